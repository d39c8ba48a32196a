// Gauss-Newton by QR of the Jacobian (qr.h): step = -R^-1 Q^T r, covariance = R^-1 R^-T.
//
// A step is kept where the next one is shorter in units of the standard deviations, |Q^T r|: chi-square itself is flat
// at a minimum and tells its place to half the digits only. Stops being true far from a minimum and where residuals are
// so large that Gauss-Newton steps diverge; the parameters are then left as they are.
#include "fit/gauss_newton.h"
#include "base/memory.h"
#include "fit/qr.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct factors {
    alb_qr qr; // its right side: residuals, then Q^T r
    double **column, *jacobian;
} factors;

static void factors_free(factors *f)
{
    free(f->column);
    free(f->jacobian);
    *f = (factors){0};
}

static bool factors_create(factors *f, const alb_problem *problem, alb_error *error)
{
    const size_t rows = (size_t)problem->residual_count, columns = (size_t)problem->parameter_count;
    *f = (factors){.column = alb_allocate(columns, sizeof *f->column, error),
                   .jacobian = alb_allocate(2 * rows * columns + rows + 2 * columns, sizeof(double), error)};
    if (!f->column || !f->jacobian) {
        factors_free(f);
        return false;
    }
    for (size_t j = 0; j < columns; j++)
        f->column[j] = f->jacobian + (columns + j) * rows;
    double *rest = f->jacobian + 2 * rows * columns;
    f->qr = (alb_qr){problem->residual_count, problem->parameter_count, f->column, rest, rest + rows,
                     rest + rows + columns};
    return true;
}

// At the parameters; false where the Jacobian is not of full rank or not finite.
static bool factor(const factors *f, double *chi_square, const alb_problem *problem, const double *parameters)
{
    const alb_qr *qr = &f->qr;
    problem->evaluate(qr->right, f->jacobian, parameters, problem->context);
    *chi_square = 0;
    for (int i = 0; i < qr->rows; i++) {
        *chi_square += qr->right[i] * qr->right[i];
        for (int j = 0; j < qr->columns; j++)
            f->column[j][i] = f->jacobian[i * qr->columns + j];
    }
    if (!isfinite(*chi_square) || !alb_qr_factor(qr, 1e-13))
        return false;
    for (int j = 0; j < qr->columns; j++) // what changes nothing by a change of itself is as good as absent
        if (!(qr->scale[j] * fmax(fabs(parameters[j]), 1) > 1e-13 * sqrt(*chi_square)))
            return false;
    return true;
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
        const double before = length(f.qr.right, n);
        for (int p = 0; p < n; p++)
            next[p] = -f.qr.right[p];
        alb_qr_back_substitute(next, &f.qr);
        for (int p = 0; p < n; p++)
            next[p] = parameters[p] + next[p] / f.qr.scale[p];
        going = within(next, problem) && factor(&f, &reached, problem, next) && length(f.qr.right, n) < 0.9 * before &&
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
    const size_t size = (size_t)n * (size_t)n;
    factors f;
    double chi_square, *work = alb_allocate(size, sizeof *work, error);
    memset(covariance, 0, size * sizeof *covariance);
    if (!work || !factors_create(&f, problem, error)) {
        free(work);
        return false;
    }
    *full_rank = problem->residual_count >= n && factor(&f, &chi_square, problem, parameters);
    if (*full_rank)
        alb_qr_covariance(covariance, n, &f.qr, work);
    factors_free(&f);
    free(work);
    return true;
}
