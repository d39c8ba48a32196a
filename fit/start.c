// Starts: for every one, two or three decays of a logarithmic grid the amplitudes are a linear problem (variable
// projection; Golub & Pereyra 1973), G a = h with the Gram matrix G of the whitened columns, made once, and h their
// products with the readings; chi-square falls by a^T h. Kept are those whose amplitudes have the signs of the form.
// For positive forms that is non-negative least squares: where a solution without signs is not positive throughout, the
// best one with signs has a zero, and belongs to a form of fewer terms. The three decays lie two steps of the grid
// apart at least: closer columns are one to the other as e^(-b r) is to its derivative, and the solver gets there by
// itself. Stops being true where decays of the truth lie closer than a step of the grid and the readings still tell
// them apart.
#include "fit/start.h"
#include "base/memory.h"
#include <math.h>
#include <stdlib.h>

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

// The linear problem of all columns; borrowed by the searches below.
typedef struct problem {
    int count, all;       // columns of the grid, and with the tied ones behind them
    double *gram, *right; // all x all, upper half; all
    alb_start *best;
    int *kept, limit; // of best
    int apart;        // columns this close are neighbours
} problem;

static double whitened(const alb_basis *basis, const alb_weighing *weighing, int j, int i)
{
    const int n = weighing->readings->count;
    const double *column = basis->readings + (size_t)j * (size_t)n;
    return i < n ? column[i] / weighing->sd[i] : alb_energy(weighing->readings, column) / weighing->energy_sd;
}

static bool problem_create(problem *out, const alb_basis *basis, const alb_weighing *weighing, alb_error *error)
{
    const int rows = alb_weighing_rows(weighing), m = basis->count, all = 2 * m;
    double *columns = alb_allocate((size_t)all * (size_t)rows, sizeof(double), error);
    out->count = m;
    out->all = all;
    out->gram = alb_allocate((size_t)all * (size_t)all, sizeof(double), error);
    out->right = alb_allocate((size_t)all, sizeof(double), error);
    const bool ok = columns && out->gram && out->right;
    for (int j = 0; ok && j < all; j++)
        for (int i = 0; i < rows; i++) {
            columns[(size_t)j * (size_t)rows + (size_t)i] = whitened(basis, weighing, j, i);
            out->right[j] += columns[(size_t)j * (size_t)rows + (size_t)i] * alb_weighing_reading(weighing, i);
        }
    for (int i = 0; ok && i < all; i++)
        for (int j = i; j < all; j++) {
            if (j >= m && j != i && j != i + m) // the tied ones go with their own
                continue;
            const double *x = columns + (size_t)i * (size_t)rows, *y = columns + (size_t)j * (size_t)rows;
            double sum = 0;
            for (int k = 0; k < rows; k++)
                sum += x[k] * y[k];
            out->gram[i * all + j] = sum;
        }
    free(columns);
    return ok;
}

static void problem_free(problem *p)
{
    free(p->gram);
    free(p->right);
    *p = (problem){0};
}

// Amplitudes of two columns with the signs of the form; false where they do not come out so.
static bool two_amplitudes(alb_start *out, alb_form form, double g11, double g12, double g22, double h1, double h2)
{
    const double determinant = g11 * g22 - g12 * g12;
    if (!(determinant > 1e-12 * g11 * g22))
        return false;
    double a1 = (g22 * h1 - g12 * h2) / determinant, a2 = (g11 * h2 - g12 * h1) / determinant;
    if (form == ALB_FORM_SIGNED_EXPONENTIALS && a1 + a2 < 0) {
        a1 = (h1 - h2) / (g11 - 2 * g12 + g22);
        a2 = -a1;
    }
    out->amplitude[0] = a1;
    out->amplitude[1] = a2;
    out->gain = a1 * h1 + a2 * h2;
    return a1 > 0 && (form == ALB_FORM_TWO_EXPONENTIALS ? a2 > 0 : a2 < 0);
}

// Amplitudes of the three columns i[0] < i[1] < i[2] by Cholesky of the matrix scaled to unit diagonal; false where one
// is not positive.
static bool three_amplitudes(alb_start *out, const problem *p, const int i[3])
{
    double scale[3], h[3];
    for (int k = 0; k < 3; k++) {
        scale[k] = sqrt(p->gram[i[k] * p->all + i[k]]);
        h[k] = p->right[i[k]] / scale[k];
    }
    const double r01 = p->gram[i[0] * p->all + i[1]] / scale[0] / scale[1],
                 r02 = p->gram[i[0] * p->all + i[2]] / scale[0] / scale[2],
                 r12 = p->gram[i[1] * p->all + i[2]] / scale[1] / scale[2];
    const double p11 = 1 - r01 * r01, p21 = r12 - r01 * r02; // what is left of columns 1 and 2 beside column 0
    const double p22 = 1 - r02 * r02 - p21 * p21 / p11;
    if (!(p11 > 1e-12 && p22 > 1e-12))
        return false;
    const double v1 = h[1] - r01 * h[0], v2 = h[2] - r02 * h[0] - p21 / p11 * v1;
    const double a2 = v2 / p22, a1 = (v1 - p21 * a2) / p11, a0 = h[0] - r01 * a1 - r02 * a2;
    out->amplitude[0] = a0 / scale[0];
    out->amplitude[1] = a1 / scale[1];
    out->amplitude[2] = a2 / scale[2];
    out->gain = a0 * h[0] + a1 * h[1] + a2 * h[2];
    return a0 > 0 && a1 > 0 && a2 > 0;
}

static bool neighbours(const problem *p, const alb_start *x, const alb_start *y)
{
    for (int k = 0; k < ALB_TERMS_MAX; k++)
        if (abs(x->column[k] - y->column[k]) > p->apart)
            return false;
    return true;
}

static void keep(const problem *p, const alb_start *candidate)
{
    alb_start *best = p->best;
    for (int k = 0; k < *p->kept; k++)
        if (neighbours(p, &best[k], candidate)) {
            if (candidate->gain > best[k].gain)
                best[k] = *candidate;
            return;
        }
    if (*p->kept < p->limit) {
        best[(*p->kept)++] = *candidate;
        return;
    }
    int worst = 0;
    for (int k = 1; k < p->limit; k++)
        if (best[k].gain < best[worst].gain)
            worst = k;
    if (candidate->gain > best[worst].gain)
        best[worst] = *candidate;
}

static void search_one(const problem *p)
{
    for (int i = 0; i < p->count; i++) {
        const double a = p->right[i] / p->gram[i * p->all + i];
        if (a > 0)
            keep(p, &(alb_start){a * p->right[i], {i, -1, -1}, {a, 0, 0}});
    }
}

static void search_two(const problem *p, alb_candidate candidate)
{
    for (int i = 0; i < p->count; i++)
        for (int j = candidate.tied ? i + p->count : i + 1; j < (candidate.tied ? i + p->count + 1 : p->count); j++) {
            alb_start pair = {.column = {i, j, -1}};
            if (two_amplitudes(&pair, candidate.form, p->gram[i * p->all + i], p->gram[i * p->all + j],
                               p->gram[j * p->all + j], p->right[i], p->right[j]))
                keep(p, &pair);
        }
}

static void search_three(const problem *p)
{
    for (int i = 0; i < p->count; i++)
        for (int j = i + 2; j < p->count; j++)
            for (int k = j + 2; k < p->count; k++) {
                alb_start triple = {.column = {i, j, k}};
                if (three_amplitudes(&triple, p, triple.column))
                    keep(p, &triple);
            }
}

bool alb_starts_find(alb_start best[ALB_STARTS_MAX], int *count, alb_candidate candidate, const alb_basis *basis,
                     const alb_weighing *weighing, alb_error *error)
{
    const int terms = alb_form_term_count(candidate.form);
    problem p = {.best = best, .kept = count, .limit = terms == 3 ? 8 : 5, .apart = terms == 3 ? 2 : 1};
    *count = 0;
    const bool ok = problem_create(&p, basis, weighing, error);
    if (ok) {
        if (terms == 1)
            search_one(&p);
        else if (terms == 2)
            search_two(&p, candidate);
        else
            search_three(&p);
    }
    problem_free(&p);
    return ok;
}
