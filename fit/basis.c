// The effective distance of every reading, tabulated over the decays.
//
// A reading averages e^(-b r) over the distances that the operator gives it, so it is share_i e^(-b rho_i(x)), x = ln
// b, with an effective distance rho_i = -ln((W e^(-b r))_i / share_i) / b: bounded, falling from the mean distance for
// b -> 0 to the smallest for b -> infinity, and smooth on the scale of 1 in x. rho + rho' is the mean distance under
// the weights W e^(-b r), so that both are known at the nodes of a table and cubic Hermite interpolation serves between
// them. At step h it costs b h^4 / 384 |rho''''| of the column: 1e-7 b P for a spot of size P at h = 0.11. Readings
// that are values of S have rho = r, and no table. Stops being true outside the range of ln b (set_range).
#include "fit/basis.h"
#include "base/memory.h"
#include "base/vector_clones.h"
#include "fit/columns.h"
#include "fit/search.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

ALB_VECTOR_CLONES
void alb_basis_distances(double *work, const alb_basis *basis, double x)
{
    const int rows = basis->rows, last = basis->fine_nodes - 2;
    const double at = (x - basis->lowest) / basis->fine_step, h = basis->fine_step;
    const int k = at < 0 ? 0 : at > last ? last : (int)at;
    const double u = at - k, v = 1 - u;
    const double *p0 = basis->distance + (size_t)k * (size_t)rows, *p1 = p0 + rows;
    const double *s0 = basis->slope + (size_t)k * (size_t)rows, *s1 = s0 + rows;
    for (int i = 0; i < rows; i++) {
        const double step = p1[i] - p0[i], m0 = s0[i] * h, m1 = s1[i] * h;
        const double value = p0[i] + u * u * (3 - 2 * u) * step + u * v * (v * m0 - u * m1);
        const double slope = (6 * u * v * step + v * (1 - 3 * u) * m0 - u * (2 - 3 * u) * m1) / h;
        const double bend = ((6 - 12 * u) * step + (6 * u - 4) * m0 + (6 * u - 2) * m1) / (h * h);
        work[i] = value;
        work[rows + i] = value + slope;
        work[2 * rows + i] = value + 2 * slope + bend;
    }
}

// Effective distances of one row at all fine nodes; `work` has room for the row.
static void tabulate(alb_basis *basis, const alb_operator *forward, int row, double *work)
{
    const int n = forward->last[row] - forward->first[row] + 1;
    const double *weight = forward->weight + forward->offset[row], *r = forward->grid_mm + forward->first[row];
    for (int k = 0; k < basis->fine_nodes; k++) {
        const double b = exp(basis->lowest + k * basis->fine_step);
        for (int i = 0; i < n; i++)
            work[i] = -b * (r[i] - r[0]);
        alb_columns_exp(work, n);
        double sum = 0, moment = 0;
        for (int i = 0; i < n; i++) {
            sum += weight[i] * work[i];
            moment += weight[i] * work[i] * (r[i] - r[0]);
        }
        const size_t at = (size_t)k * (size_t)basis->rows + (size_t)row;
        const double rho = -log(sum / basis->share[row]) / b;
        basis->distance[at] = r[0] + rho;
        basis->slope[at] = moment / sum - rho;
    }
}

static bool fill_distances(alb_basis *basis, const alb_operator *forward, bool plain, alb_error *error)
{
    for (int i = 0; i < basis->count; i++) {
        for (size_t k = forward->offset[i]; k <= forward->offset[i] + (size_t)(forward->last[i] - forward->first[i]);
             k++)
            basis->share[i] += forward->weight[k];
        if (plain)
            basis->distance[i] = forward->grid_mm[forward->first[i]];
    }
    if (plain)
        return true;
    double *work = alb_allocate((size_t)forward->grid_count, sizeof *work, error);
    if (!work)
        return false;
    for (int i = 0; i < basis->count; i++)
        tabulate(basis, forward, i, work);
    free(work);
    return true;
}

static void fill_nodes(double *columns, const alb_basis *basis, double shift, double *work)
{
    for (int j = 0; j < basis->nodes; j++) {
        const double x = basis->first + j * basis->step + shift, b = exp(x);
        double *column = columns + (size_t)j * (size_t)basis->rows;
        const double *distance = basis->distance;
        if (basis->slope) {
            alb_basis_distances(work, basis, x);
            distance = work;
        }
        for (int i = 0; i < basis->rows; i++)
            column[i] = -b * distance[i];
        alb_columns_exp(column, basis->rows);
        for (int i = 0; i < basis->rows; i++)
            column[i] *= basis->share[i];
    }
}

// Bounds of ln b: the slowest term falls by 1 % over the readings, the fastest by e^40 before the first of them.
static void set_range(alb_basis *basis, const alb_readings *readings)
{
    const double node_step = 0.46, fine_step = 0.11;
    double nearest = readings->outer_mm;
    for (int i = 0; i < readings->count; i++)
        if (readings->r_mm[i] > 0)
            nearest = fmin(nearest, readings->r_mm[i]);
    nearest = fmax(nearest, 1e-6 * readings->outer_mm);
    basis->lowest = log(0.01 / readings->outer_mm);
    basis->highest = log(40 / nearest);
    basis->first = basis->lowest;
    const double range = log(10 / nearest) - basis->first;
    basis->nodes = (int)fmax(ceil(range / node_step), 12);
    basis->step = range / (basis->nodes - 1);
    basis->fine_nodes = (int)ceil((basis->highest - basis->lowest) / fine_step) + 1;
    basis->fine_step = (basis->highest - basis->lowest) / (basis->fine_nodes - 1);
}

static bool allocate(alb_basis *basis, bool plain, alb_error *error)
{
    const size_t rows = (size_t)basis->rows, grid = (size_t)basis->nodes * rows;
    const size_t table = plain ? rows : (size_t)basis->fine_nodes * rows;
    return (basis->column = alb_allocate(grid, sizeof(double), error)) &&
           (basis->tied = alb_allocate(grid, sizeof(double), error)) &&
           (basis->distance = alb_allocate(table, sizeof(double), error)) &&
           (plain || (basis->slope = alb_allocate(table, sizeof(double), error))) &&
           (basis->share = alb_allocate(rows, sizeof(double), error)) &&
           (basis->area_mm2 = alb_allocate(rows, sizeof(double), error));
}

static bool fill_columns(alb_basis *basis, alb_error *error)
{
    double *work = alb_allocate(3 * (size_t)basis->rows, sizeof *work, error);
    if (work) {
        fill_nodes(basis->column, basis, 0, work);
        fill_nodes(basis->tied, basis, log(ALB_TIED_RATIO), work);
    }
    free(work);
    return work != NULL;
}

// Groups of neighbours that lie within a fifth of their distance; how many.
static int group(int *first, const alb_readings *readings)
{
    int count = 0;
    for (int i = 0; i < readings->count; i++) {
        const double from = count ? readings->r_mm[first[count - 1]] : 0, span = readings->r_mm[i] - from;
        if (count == 0 || !(span >= 0 && span <= 0.2 * from))
            first[count++] = i;
    }
    first[count] = readings->count;
    return count;
}

// Effective distance of the mean of a group of readings, at fine node k.
static void merge_distance(alb_basis *merged, const alb_basis *basis, int g, int k)
{
    const double x = basis->lowest + k * merged->fine_step, b = exp(x);
    const int from = basis->group[g], to = basis->group[g + 1];
    double nearest = (double)INFINITY, sum = 0, moment = 0;
    for (int pass = 0; pass < 2; pass++)
        for (int i = from; i < to; i++) {
            double rho = basis->distance[i], slope = 0;
            if (basis->slope) {
                rho = basis->distance[k * basis->rows + i];
                slope = basis->slope[k * basis->rows + i];
            }
            if (pass == 0) {
                nearest = fmin(nearest, rho);
            } else {
                const double column = basis->share[i] * exp(-b * (rho - nearest));
                sum += column;
                moment += column * (rho - nearest + slope);
            }
        }
    const double rho = -log(sum / (to - from) / merged->share[g]) / b;
    merged->distance[k * merged->rows + g] = nearest + rho;
    merged->slope[k * merged->rows + g] = moment / sum - rho;
}

// The same for the plain means of neighbouring readings.
static bool merge(alb_basis *basis, const alb_readings *readings, alb_error *error)
{
    if (!(basis->group = alb_allocate((size_t)basis->count + 1, sizeof *basis->group, error)) ||
        !(basis->merged = alb_allocate(1, sizeof *basis->merged, error)))
        return false;
    alb_basis *merged = basis->merged;
    *merged = (alb_basis){.count = group(basis->group, readings),
                          .lowest = basis->lowest,
                          .highest = basis->highest,
                          .nodes = basis->nodes,
                          .first = basis->first,
                          .step = basis->step,
                          .fine_nodes = basis->fine_nodes,
                          .fine_step = basis->fine_step};
    merged->rows = (merged->count + 1 + ALB_LANES - 1) / ALB_LANES * ALB_LANES;
    if (!allocate(merged, false, error))
        return false;
    for (int g = 0; g < merged->count; g++) {
        for (int i = basis->group[g]; i < basis->group[g + 1]; i++) {
            merged->share[g] += basis->share[i] / (basis->group[g + 1] - basis->group[g]);
            merged->area_mm2[g] += basis->area_mm2[i];
        }
        for (int k = 0; k < merged->fine_nodes; k++)
            merge_distance(merged, basis, g, k);
    }
    return fill_columns(merged, error);
}

bool alb_basis_create(alb_basis *basis, const alb_readings *readings, const alb_operator *forward, alb_error *error)
{
    const int n = readings->count;
    *basis = (alb_basis){.count = n, .rows = (n + 1 + ALB_LANES - 1) / ALB_LANES * ALB_LANES};
    set_range(basis, readings);
    bool plain = true;
    for (int i = 0; i < n; i++)
        plain &= forward->first[i] == forward->last[i];
    bool ok = allocate(basis, plain, error) && fill_distances(basis, forward, plain, error);
    if (ok)
        memcpy(basis->area_mm2, readings->area_mm2, (size_t)n * sizeof(double));
    ok = ok && fill_columns(basis, error) && merge(basis, readings, error);
    if (!ok)
        alb_basis_free(basis);
    return ok;
}

void alb_basis_free(alb_basis *basis)
{
    if (basis->merged)
        alb_basis_free(basis->merged);
    free(basis->merged);
    free(basis->group);
    free(basis->column);
    free(basis->tied);
    free(basis->distance);
    free(basis->slope);
    free(basis->share);
    free(basis->area_mm2);
    *basis = (alb_basis){0};
}
