// Weighted least squares of a form to the readings: min sum ((v_i - (W S)_i) / sd_i)^2.
//
// Start: for every pair of decays on a logarithmic grid the amplitudes are a linear problem of two unknowns with the
// signs the form wants (variable projection; Golub & Pereyra 1973); its Gram matrix is made once. The best few pairs
// are polished by Levenberg-Marquardt (Ceres) in parameters that cannot break the form:
//   positive: ln a1, ln b1, ln a2, ln b2        signed: ln a1, ln b1, s = -a2/a1 in 0..1, ln(b2/b1 - 1), b2/b1 >= 1.1
// Logarithms and whitening make the answer independent of the units. b1 < b2 in both.
// Covariance: (J^T J)^-1 in the form's own parameters, J whitened, scaled to unit diagonal before it is inverted. It is
// the linear approximation: too small where the decays come close (b2/b1 below about 1.5 at 1 % noise).
#include "fit/search.h"
#include "base/memory.h"
#include "fit/solve.h"
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { STARTS = 5, PARAMETERS = 4 };

int alb_candidate_parameters(alb_candidate candidate)
{
    return alb_form_parameter_count(candidate.form) - candidate.tied;
}

double alb_energy(const alb_readings *readings, const double *value)
{
    double sum = 0;
    for (int i = 0; i < readings->count; i++)
        sum += readings->area_mm2[i] * value[i];
    return sum;
}

bool alb_basis_create(alb_basis *basis, const alb_readings *readings, const alb_operator *forward, alb_error *error)
{
    double nearest = readings->outer_mm;
    for (int i = 0; i < readings->count; i++)
        if (readings->r_mm[i] > 0)
            nearest = fmin(nearest, readings->r_mm[i]);
    const double low = 0.1 / readings->outer_mm, high = fmin(10 / nearest, 1e6 * low);
    const int count = (int)fmax(ceil(4 * log(high / low)), 24);
    *basis = (alb_basis){.count = count};
    basis->decay_per_mm = alb_allocate(2 * (size_t)count, sizeof(double), error);
    basis->readings = alb_allocate(2 * (size_t)count * (size_t)readings->count, sizeof(double), error);
    const size_t rows = (size_t)readings->count, grid = (size_t)forward->grid_count;
    double(*on_grid)[ALB_OPERATOR_COLUMNS] = alb_allocate(grid, sizeof *on_grid, error);
    double(*columns)[ALB_OPERATOR_COLUMNS] = alb_allocate(rows, sizeof *columns, error);
    const bool ok = basis->decay_per_mm && basis->readings && on_grid && columns;
    for (int j = 0; ok && j < 2 * count; j++)
        basis->decay_per_mm[j] =
            low * pow(high / low, (j % count) / (double)(count - 1)) * (j < count ? 1 : ALB_TIED_RATIO);
    for (int j = 0; ok && j < 2 * count; j += ALB_OPERATOR_COLUMNS) {
        const int together = 2 * count - j < ALB_OPERATOR_COLUMNS ? 2 * count - j : ALB_OPERATOR_COLUMNS;
        for (size_t k = 0; k < grid; k++)
            for (int c = 0; c < together; c++)
                on_grid[k][c] = exp(-basis->decay_per_mm[j + c] * forward->grid_mm[k]);
        alb_operator_apply(columns, forward, (const double(*)[ALB_OPERATOR_COLUMNS])on_grid);
        for (int c = 0; c < together; c++)
            for (size_t i = 0; i < rows; i++)
                basis->readings[(size_t)(j + c) * rows + i] = columns[i][c];
    }
    free(columns);
    free(on_grid);
    if (!ok)
        alb_basis_free(basis);
    return ok;
}

void alb_basis_free(alb_basis *basis)
{
    free(basis->decay_per_mm);
    free(basis->readings);
    *basis = (alb_basis){0};
}

// Whitened model and its derivatives by the form's own parameters: values[0] the model, values[1 + p] the derivatives.
// All come from the readings of e^(-b r) and r e^(-b r) of the one or two terms: the operator's four columns.
typedef struct model {
    const alb_weighing *weighing;
    alb_candidate candidate;
    bool known; // the values are those of `at`
    double at[PARAMETERS];
    double (*on_grid)[ALB_OPERATOR_COLUMNS], (*columns)[ALB_OPERATOR_COLUMNS];
    double *values[1 + PARAMETERS];
} model;

static void model_free(model *m)
{
    free(m->on_grid);
    free(m->columns);
    free(m->values[0]);
    *m = (model){0};
}

static bool model_create(model *out, alb_candidate candidate, const alb_weighing *weighing, alb_error *error)
{
    const size_t grid = (size_t)weighing->forward->grid_count, rows = (size_t)weighing->readings->count + 1;
    *out = (model){.weighing = weighing, .candidate = candidate};
    if (!(out->on_grid = alb_allocate(grid, sizeof *out->on_grid, error)) ||
        !(out->columns = alb_allocate(rows, sizeof *out->columns, error)) ||
        !(out->values[0] = alb_allocate((1 + PARAMETERS) * rows, sizeof(double), error))) {
        model_free(out);
        return false;
    }
    for (int p = 1; p <= PARAMETERS; p++)
        out->values[p] = out->values[p - 1] + rows;
    return true;
}

static int residual_count(const alb_weighing *weighing)
{
    return weighing->readings->count + (weighing->energy_sd > 0);
}

static void model_evaluate(model *m, const alb_profile *profile)
{
    const alb_operator *forward = m->weighing->forward;
    const alb_readings *readings = m->weighing->readings;
    const int n = readings->count, parameters = alb_form_parameter_count(profile->form);
    const double *p = profile->parameters;
    for (int k = 0; k < forward->grid_count; k++)
        for (int t = 0; t < parameters; t += 2) {
            const double e = exp(-p[t + 1] * forward->grid_mm[k]);
            m->on_grid[k][t] = e;
            m->on_grid[k][t + 1] = forward->grid_mm[k] * e;
        }
    alb_operator_apply(m->columns, forward, (const double(*)[ALB_OPERATOR_COLUMNS])m->on_grid);
    for (int i = 0; i < n; i++) {
        m->values[0][i] = 0;
        for (int t = 0; t < parameters; t += 2) {
            m->values[0][i] += p[t] * m->columns[i][t];
            m->values[1 + t][i] = m->columns[i][t];
            m->values[2 + t][i] = -p[t] * m->columns[i][t + 1];
        }
    }
    for (int q = 0; q <= parameters; q++) {
        double *values = m->values[q];
        values[n] = m->weighing->energy_sd > 0 ? alb_energy(readings, values) / m->weighing->energy_sd : 0;
        for (int i = 0; i < n; i++)
            values[i] /= m->weighing->sd[i];
    }
}

static double whitened_reading(const alb_weighing *weighing, int i)
{
    return i < weighing->readings->count
               ? weighing->readings->value[i] / weighing->sd[i]
               : alb_energy(weighing->readings, weighing->readings->value) / weighing->energy_sd;
}

// The form's parameters from the solver's, and the derivatives d form[i] / d solver[j].
static alb_profile profile_of(double jacobian[PARAMETERS][PARAMETERS], alb_candidate candidate, const double *u)
{
    alb_profile profile = {.form = candidate.form};
    double *p = profile.parameters, (*j)[PARAMETERS] = jacobian;
    memset(jacobian, 0, sizeof(double[PARAMETERS][PARAMETERS]));
    p[0] = j[0][0] = exp(u[0]);
    p[1] = j[1][1] = exp(u[1]);
    if (candidate.form == ALB_FORM_TWO_EXPONENTIALS) {
        p[2] = j[2][2] = exp(u[2]);
        p[3] = j[3][3] = exp(u[3]);
    } else if (candidate.form == ALB_FORM_SIGNED_EXPONENTIALS) {
        const double excess = candidate.tied ? ALB_TIED_RATIO - 1 : exp(u[3]); // of b2 over b1
        p[2] = j[2][0] = -u[2] * p[0];
        j[2][2] = -p[0];
        p[3] = j[3][1] = p[1] * (1 + excess);
        j[3][3] = candidate.tied ? 0 : p[1] * excess;
    }
    return profile;
}

static void solver_of(double *u, const alb_profile *profile)
{
    const double *p = profile->parameters;
    u[0] = log(p[0]);
    u[1] = log(p[1]);
    u[2] = profile->form == ALB_FORM_TWO_EXPONENTIALS ? log(p[2]) : -p[2] / p[0];
    u[3] = profile->form == ALB_FORM_TWO_EXPONENTIALS ? log(p[3]) : log(p[3] / p[1] - 1);
}

static void evaluate(double *residuals, double *jacobian, const double *u, const void *context)
{
    model *m = (model *)context;
    double chain[PARAMETERS][PARAMETERS];
    const alb_profile profile = profile_of(chain, m->candidate, u);
    const int all = alb_form_parameter_count(m->candidate.form), rows = residual_count(m->weighing);
    const int free_parameters = alb_candidate_parameters(m->candidate);
    const size_t size = (size_t)free_parameters * sizeof *u;
    if (!m->known ||
        memcmp(m->at, u, size) != 0) // the solver asks for the residuals first, then for the Jacobian there
        model_evaluate(m, &profile);
    m->known = true;
    memcpy(m->at, u, size);
    for (int i = 0; i < rows; i++) {
        residuals[i] = m->values[0][i] - whitened_reading(m->weighing, i);
        for (int q = 0; jacobian && q < free_parameters; q++) {
            double sum = 0;
            for (int p = 0; p < all; p++)
                sum += m->values[1 + p][i] * chain[p][q];
            jacobian[i * free_parameters + q] = sum;
        }
    }
}

static void order_terms(alb_profile *profile)
{
    double *p = profile->parameters;
    if (profile->form != ALB_FORM_TWO_EXPONENTIALS || p[1] <= p[3])
        return;
    const double a = p[0], b = p[1];
    p[0] = p[2], p[1] = p[3], p[2] = a, p[3] = b;
}

bool alb_search_polish(alb_profile *profile, double *chi_square, alb_candidate candidate, const alb_weighing *weighing,
                       alb_error *error)
{
    model m;
    if (!model_create(&m, candidate, weighing, error))
        return false;
    double top = 0, u[PARAMETERS], lower[PARAMETERS], upper[PARAMETERS], chain[PARAMETERS][PARAMETERS];
    for (int i = 0; i < weighing->readings->count; i++)
        top = fmax(top, fabs(weighing->readings->value[i]));
    solver_of(u, profile);
    const double outer = weighing->readings->outer_mm;
    for (int p = 0; p < PARAMETERS; p++) {
        const bool amplitude = p % 2 == 0;
        lower[p] = amplitude ? log(top) - 40 : log(0.01 / outer);
        upper[p] = amplitude ? log(top) + 40 : log(1e7 / outer);
    }
    if (profile->form == ALB_FORM_SIGNED_EXPONENTIALS) {
        lower[2] = 0, upper[2] = 1;
        lower[3] = log(ALB_TIED_RATIO - 1), upper[3] = log(1e7);
    }
    const int parameters = alb_candidate_parameters(candidate);
    for (int p = 0; p < parameters; p++)
        u[p] = fmin(fmax(u[p], lower[p]), upper[p]);
    const alb_problem problem = {parameters, residual_count(weighing), evaluate, &m, lower, upper};
    const bool ok = alb_solve(u, chi_square, &problem, error);
    *profile = profile_of(chain, candidate, u);
    order_terms(profile);
    model_free(&m);
    return ok;
}

typedef struct start {
    double gain; // how much it lowers chi-square from that of nothing
    int i, j;    // decays
    double a1, a2;
} start;

// Amplitudes of two columns with the signs of the form; false where they do not come out so.
static bool amplitudes(start *out, alb_form form, double g11, double g12, double g22, double h1, double h2)
{
    const double determinant = g11 * g22 - g12 * g12;
    if (form == ALB_FORM_EXPONENTIAL) {
        out->a1 = g11 > 0 ? h1 / g11 : 0;
        out->gain = out->a1 * h1;
        return out->a1 > 0;
    }
    if (!(determinant > 1e-12 * g11 * g22))
        return false;
    out->a1 = (g22 * h1 - g12 * h2) / determinant;
    out->a2 = (g11 * h2 - g12 * h1) / determinant;
    if (form == ALB_FORM_SIGNED_EXPONENTIALS && out->a1 + out->a2 < 0) {
        const double difference = g11 - 2 * g12 + g22;
        out->a1 = (h1 - h2) / difference;
        out->a2 = -out->a1;
    }
    out->gain = out->a1 * h1 + out->a2 * h2;
    return out->a1 > 0 && (form == ALB_FORM_TWO_EXPONENTIALS ? out->a2 > 0 : out->a2 < 0);
}

// Keeps the best few that are not neighbours of a better one.
static void keep(start *best, int *count, start candidate)
{
    for (int k = 0; k < *count; k++)
        if (abs(best[k].i - candidate.i) <= 1 && abs(best[k].j - candidate.j) <= 1) {
            if (candidate.gain > best[k].gain)
                best[k] = candidate;
            return;
        }
    if (*count < STARTS) {
        best[(*count)++] = candidate;
        return;
    }
    int worst = 0;
    for (int k = 1; k < STARTS; k++)
        if (best[k].gain < best[worst].gain)
            worst = k;
    if (candidate.gain > best[worst].gain)
        best[worst] = candidate;
}

static double whitened_basis(const alb_basis *basis, const alb_weighing *weighing, int j, int i)
{
    const int n = weighing->readings->count;
    const double *column = basis->readings + (size_t)j * (size_t)n;
    return i < n ? column[i] / weighing->sd[i] : alb_energy(weighing->readings, column) / weighing->energy_sd;
}

static bool find_starts(start *best, int *count, alb_candidate candidate, const alb_basis *basis,
                        const alb_weighing *weighing, alb_error *error)
{
    const int rows = residual_count(weighing), m = basis->count, all = 2 * m;
    double *columns = alb_allocate((size_t)all * (size_t)rows, sizeof(double), error);
    double *right = alb_allocate((size_t)all, sizeof(double), error);
    *count = 0;
    if (!columns || !right) {
        free(columns);
        free(right);
        return false;
    }
    for (int j = 0; j < all; j++)
        for (int i = 0; i < rows; i++) {
            columns[j * rows + i] = whitened_basis(basis, weighing, j, i);
            right[j] += columns[j * rows + i] * whitened_reading(weighing, i);
        }
    for (int i = 0; i < m; i++)
        for (int j = i; j < all; j++) {
            const bool single = candidate.form == ALB_FORM_EXPONENTIAL;
            if (candidate.tied ? j != i + m : j >= m || single != (i == j))
                continue;
            double g11 = 0, g12 = 0, g22 = 0;
            for (int k = 0; k < rows; k++) {
                const double x = columns[i * rows + k], y = columns[j * rows + k];
                g11 += x * x, g12 += x * y, g22 += y * y;
            }
            start pair = {.i = i, .j = j};
            if (amplitudes(&pair, candidate.form, g11, g12, g22, right[i], right[j]))
                keep(best, count, pair);
        }
    free(columns);
    free(right);
    return true;
}

bool alb_search(alb_profile *profile, double *chi_square, bool *found, alb_candidate candidate, const alb_basis *basis,
                const alb_weighing *weighing, alb_error *error)
{
    start best[STARTS];
    int count;
    *found = false;
    *chi_square = INFINITY;
    if (!find_starts(best, &count, candidate, basis, weighing, error))
        return false;
    for (int k = 0; k < count; k++) {
        alb_profile tried = {candidate.form,
                             {best[k].a1, basis->decay_per_mm[best[k].i], best[k].a2, basis->decay_per_mm[best[k].j]}};
        double reached;
        if (!alb_search_polish(&tried, &reached, candidate, weighing, error))
            return false;
        if (reached < *chi_square) {
            *profile = tried;
            *chi_square = reached;
            *found = true;
        }
    }
    return true;
}

// Inverts a symmetric positive definite matrix of unit diagonal in place by Cholesky; false where a pivot, which is
// 1 - R^2 of a parameter on those before it, is below 1e-11.
static bool invert(double matrix[PARAMETERS][PARAMETERS], int n)
{
    double l[PARAMETERS][PARAMETERS] = {{0}}, inverse[PARAMETERS][PARAMETERS] = {{0}};
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            double sum = matrix[i][j];
            for (int k = 0; k < j; k++)
                sum -= l[i][k] * l[j][k];
            if (i == j && !(sum > 1e-11))
                return false;
            l[i][j] = i == j ? sqrt(sum) : sum / l[j][j];
        }
    for (int column = 0; column < n; column++)
        for (int i = column; i < n; i++) {
            double sum = i == column ? 1 : 0;
            for (int k = column; k < i; k++)
                sum -= l[i][k] * inverse[k][column];
            inverse[i][column] = sum / l[i][i];
        }
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            matrix[i][j] = 0;
            for (int k = 0; k < n; k++)
                matrix[i][j] += inverse[k][i] * inverse[k][j];
        }
    return true;
}

bool alb_search_covariance(double covariance[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX], bool *full_rank,
                           const alb_profile *profile, alb_candidate candidate, const alb_weighing *weighing,
                           alb_error *error)
{
    model m;
    if (!model_create(&m, candidate, weighing, error))
        return false;
    model_evaluate(&m, profile);
    const int all = alb_form_parameter_count(profile->form), n = alb_candidate_parameters(candidate);
    const int rows = residual_count(weighing);
    // own[p][q]: derivative of the form's parameter p by the free parameter q (a1, b1, a2, and b2 where it is free)
    double own[PARAMETERS][PARAMETERS] = {{0}}, matrix[PARAMETERS][PARAMETERS] = {{0}}, scale[PARAMETERS] = {0};
    for (int p = 0; p < all; p++)
        own[p][p] = p < n;
    if (candidate.tied)
        own[3][1] = ALB_TIED_RATIO;
    for (int i = 0; i < rows; i++) {
        double row[PARAMETERS] = {0};
        for (int q = 0; q < n; q++)
            for (int p = 0; p < all; p++)
                row[q] += m.values[1 + p][i] * own[p][q];
        for (int p = 0; p < n; p++)
            for (int q = 0; q < n; q++)
                matrix[p][q] += row[p] * row[q];
    }
    model_free(&m);
    *full_rank = true;
    for (int p = 0; p < n; p++) {
        scale[p] = sqrt(matrix[p][p]);
        *full_rank &= scale[p] > 0 && isfinite(scale[p]);
    }
    for (int p = 0; *full_rank && p < n; p++)
        for (int q = 0; q < n; q++)
            matrix[p][q] = matrix[p][q] / scale[p] / scale[q];
    *full_rank = *full_rank && invert(matrix, n);
    memset(covariance, 0, sizeof(double[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX]));
    for (int p = 0; *full_rank && p < all; p++)
        for (int q = 0; q < all; q++)
            for (int k = 0; k < n; k++)
                for (int l = 0; l < n; l++)
                    covariance[p][q] += own[p][k] * own[q][l] * matrix[k][l] / scale[k] / scale[l];
    return true;
}
