// J = Q R by Householder reflections (Golub & Van Loan, Matrix Computations, sec. 5.2), columns scaled to unit length:
// step = -R^-1 Q^T r, covariance = R^-1 R^-T. The condition of J enters once, not squared.
//
// A step is kept where the next one is shorter in units of the standard deviations, |Q^T r|: chi-square itself is flat
// at a minimum and tells its place to half the digits only. Stops being true far from a minimum and where residuals are
// so large that Gauss-Newton steps diverge; the parameters are then left as they are.
#include "fit/gauss_newton.h"
#include "base/memory.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct factors {
    int rows, columns;
    double *jacobian, *residuals; // R and the reflections; Q^T r
    double *scale, *diagonal;
} factors;

static void factors_free(factors *f)
{
    free(f->jacobian);
    *f = (factors){0};
}

static bool factors_create(factors *f, const alb_problem *problem, alb_error *error)
{
    const size_t rows = (size_t)problem->residual_count, columns = (size_t)problem->parameter_count;
    *f = (factors){.rows = problem->residual_count, .columns = problem->parameter_count};
    f->jacobian = alb_allocate(rows * columns + rows + 2 * columns, sizeof(double), error);
    if (!f->jacobian)
        return false;
    f->residuals = f->jacobian + rows * columns;
    f->scale = f->residuals + rows;
    f->diagonal = f->scale + columns;
    return true;
}

// Reflects column j into the diagonal, and with it the columns behind it and the residuals.
static void reflect(factors *f, int j)
{
    double *a = f->jacobian;
    const int n = f->columns;
    double norm = 0;
    for (int i = j; i < f->rows; i++)
        norm += a[i * n + j] * a[i * n + j];
    norm = a[j * n + j] > 0 ? -sqrt(norm) : sqrt(norm);
    f->diagonal[j] = norm;
    a[j * n + j] -= norm;
    const double half = -norm * a[j * n + j]; // v.v / 2
    for (int k = j + 1; half > 0 && k <= n; k++) {
        double product = 0;
        for (int i = j; i < f->rows; i++)
            product += a[i * n + j] * (k < n ? a[i * n + k] : f->residuals[i]);
        for (int i = j; i < f->rows; i++)
            *(k < n ? &a[i * n + k] : &f->residuals[i]) -= product / half * a[i * n + j];
    }
}

// At the parameters; false where the Jacobian is not of full rank or not finite.
static bool factor(factors *f, double *chi_square, const alb_problem *problem, const double *parameters)
{
    const int n = f->columns;
    problem->evaluate(f->residuals, f->jacobian, parameters, problem->context);
    *chi_square = 0;
    for (int i = 0; i < f->rows; i++)
        *chi_square += f->residuals[i] * f->residuals[i];
    for (int j = 0; j < n; j++) {
        double square = 0;
        for (int i = 0; i < f->rows; i++)
            square += f->jacobian[i * n + j] * f->jacobian[i * n + j];
        f->scale[j] = sqrt(square);
        // what changes nothing by a change of itself is as good as absent
        if (!(f->scale[j] * fmax(fabs(parameters[j]), 1) > 1e-13 * sqrt(*chi_square) && isfinite(f->scale[j])))
            return false;
        for (int i = 0; i < f->rows; i++)
            f->jacobian[i * n + j] /= f->scale[j];
    }
    for (int j = 0; j < n; j++) {
        reflect(f, j);
        if (!(fabs(f->diagonal[j]) > 1e-13))
            return false;
    }
    return isfinite(*chi_square);
}

// x = R^-1 x, in units of the columns' lengths.
static void back_substitute(double *x, const factors *f)
{
    for (int i = f->columns - 1; i >= 0; i--) {
        for (int k = i + 1; k < f->columns; k++)
            x[i] -= f->jacobian[i * f->columns + k] * x[k];
        x[i] /= f->diagonal[i];
    }
}

static double length(const double *x, int n)
{
    double square = 0;
    for (int i = 0; i < n; i++)
        square += x[i] * x[i];
    return sqrt(square);
}

static bool within(const double *parameters, const alb_problem *problem)
{
    for (int p = 0; p < problem->parameter_count; p++)
        if (!(parameters[p] > problem->lower[p] && parameters[p] < problem->upper[p]))
            return false;
    return true;
}

bool alb_gauss_newton(double *parameters, double *chi_square, bool *full_rank, const alb_problem *problem,
                      alb_error *error)
{
    const int n = problem->parameter_count;
    factors f;
    double *next = alb_allocate((size_t)n, sizeof *next, error), reached;
    if (!next || !factors_create(&f, problem, error)) {
        free(next);
        return false;
    }
    *full_rank = problem->residual_count >= n && factor(&f, &reached, problem, parameters);
    bool going = *full_rank && within(parameters, problem);
    for (int step = 0; going && step < 100; step++) {
        const double before = length(f.residuals, n);
        for (int p = 0; p < n; p++)
            next[p] = -f.residuals[p];
        back_substitute(next, &f);
        for (int p = 0; p < n; p++)
            next[p] = parameters[p] + next[p] / f.scale[p];
        going = within(next, problem) && factor(&f, &reached, problem, next) && length(f.residuals, n) < 0.9 * before &&
                reached <= *chi_square * (1 + 1e-9) + 1e-9 * before * before;
        if (going) {
            memcpy(parameters, next, (size_t)n * sizeof *next);
            *chi_square = reached;
        }
    }
    factors_free(&f);
    free(next);
    return true;
}

bool alb_problem_covariance(double *covariance, bool *full_rank, const double *parameters, const alb_problem *problem,
                            alb_error *error)
{
    const int n = problem->parameter_count;
    const size_t size = (size_t)n;
    factors f;
    double chi_square, *inverse = alb_allocate(size * size, sizeof *inverse, error); // row q: column q of R^-1
    memset(covariance, 0, size * size * sizeof *covariance);
    if (!inverse || !factors_create(&f, problem, error)) {
        free(inverse);
        return false;
    }
    *full_rank = problem->residual_count >= n && factor(&f, &chi_square, problem, parameters);
    for (int q = 0; *full_rank && q < n; q++) {
        inverse[q * n + q] = 1;
        back_substitute(inverse + q * n, &f);
    }
    for (int p = 0; *full_rank && p < n; p++)
        for (int q = 0; q < n; q++)
            for (int k = 0; k < n; k++)
                covariance[p * n + q] += inverse[k * n + p] * inverse[k * n + q] / f.scale[p] / f.scale[q];
    factors_free(&f);
    free(inverse);
    return true;
}
