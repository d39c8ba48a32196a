// reading_i = mean over the ring's pixels p of integral S(|p - q|) e(q) dq,  e the spot's irradiance, integral 1.
//
// Both are averages over direction about the centre, so only distances count: a pixel at r and a spot sample at s are
// rho = sqrt(r^2 + s^2 - 2 r s cos phi) apart, phi uniform in 0..pi. The mass of each rho is split linearly between the
// two nearest points of a grid quadratic in its index (rho_k = rho_max (k / K)^2: fine where S is steep), so that S
// enters at the grid points alone: an operator built once, whatever is fitted. Splitting linearly costs (b h)^2 / 8 of
// e^(-b rho) at spacing h = 2 sqrt(rho rho_max) / K: below 1e-4 wherever b^2 rho rho_max < 2e-4 K^2 = 3200, K = 4000.
// The first point stands for the cell about 0, and takes S at a quarter of its width h: over the cell, mass spread
// evenly and split linearly then gives integral S r dr exactly for a / r, and to 1e-7 for what is finite at 0.
// The directions lie evenly in t, phi = pi t - sin(2 pi t) / 2 (Sidi 1993): dense about phi = 0, where a spot sample
// can come close to the pixel.
//
// Where it stops being true: e is taken as round about its centroid (its radial distribution is what is used); the
// camera's footprint and blur must be the same in e as in the image; the slab is taken as endless and alike everywhere.
#include "fit/operator.h"
#include "base/memory.h"
#include "base/vector_clones.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { GRID = 4001, DIRECTIONS = 48 };

typedef struct row {
    double weight[GRID];
    int first, last;
} row;

static double grid_at(int k, double end_mm) { return end_mm * ((double)k / (GRID - 1)) * ((double)k / (GRID - 1)); }

// Directions of equal shares of a turn that are dense about 0, and what splits a mass between grid points.
typedef struct quadrature {
    double cosine[DIRECTIONS], share[DIRECTIONS], per_spacing[GRID - 1]; // 1 / (2 k + 1)
    double per_mm;                                                       // distances to squares of grid indices
} quadrature;

static void add_mass(row *out, double square, int k, double mass, const quadrature *by)
{
    const double upper = fmin(fmax((square - (double)k * k) * by->per_spacing[k], 0), 1);
    out->weight[k] += mass * (1 - upper);
    out->weight[k + 1] += mass * upper;
    out->first = k < out->first ? k : out->first;
    out->last = k + 1 > out->last ? k + 1 : out->last;
}

// Squares of the grid indices of the distances between a pixel at r and a spot sample at s, and the points below them.
ALB_VECTOR_CLONES
static void distances(double square[DIRECTIONS], int below[DIRECTIONS], double r, double s, const quadrature *by)
{
    for (int k = 0; k < DIRECTIONS; k++) {
        const double squared = r * r + s * s - 2 * r * s * by->cosine[k];
        square[k] = by->per_mm * sqrt(squared > 0 ? squared : 0);
        const double index = sqrt(square[k]);
        below[k] = (int)(index < GRID - 2 ? index : GRID - 2);
    }
}

static void fill_row(row *out, const double *r_mm, const double *share, const alb_spot *spot, const quadrature *by)
{
    *out = (row){.first = GRID, .last = -1};
    for (int i = 0; i < ALB_RING_SAMPLES; i++)
        for (int j = 0; share[i] > 0 && j < spot->count; j++) {
            const double mass = share[i] * spot->share[j];
            double square[DIRECTIONS];
            int below[DIRECTIONS];
            distances(square, below, r_mm[i], spot->r_mm[j], by);
            if (spot->r_mm[j] == 0) {
                add_mass(out, square[0], below[0], mass, by);
                continue;
            }
            for (int k = 0; k < DIRECTIONS; k++)
                add_mass(out, square[k], below[k], mass * by->share[k], by);
        }
}

static void quadrature_create(quadrature *by, double end_mm)
{
    by->per_mm = (double)(GRID - 1) * (GRID - 1) / end_mm;
    for (int k = 0; k < DIRECTIONS; k++) {
        const double t = (k + 0.5) / DIRECTIONS;
        by->cosine[k] = cos(M_PI * t - sin(2 * M_PI * t) / 2);
        by->share[k] = (1 - cos(2 * M_PI * t)) / DIRECTIONS;
    }
    for (int k = 0; k < GRID - 1; k++)
        by->per_spacing[k] = 1.0 / (2 * k + 1);
}

static bool allocate(alb_operator *forward, int rows, int grid, alb_error *error)
{
    *forward = (alb_operator){.row_count = rows, .grid_count = grid};
    const size_t n = (size_t)rows;
    return (forward->grid_mm = alb_allocate((size_t)grid, sizeof(double), error)) &&
           (forward->first = alb_allocate(n, sizeof(int), error)) &&
           (forward->last = alb_allocate(n, sizeof(int), error)) &&
           (forward->offset = alb_allocate(n + 1, sizeof(size_t), error));
}

bool alb_operator_create(alb_operator *forward, const alb_readings *readings, const alb_spot *spot, alb_error *error)
{
    bool ok = false;
    row *rows = NULL;
    if (!allocate(forward, readings->count, GRID, error))
        goto done;
    rows = alb_allocate((size_t)readings->count, sizeof *rows, error);
    if (!rows)
        goto done;
    double end_mm = 0, spot_mm = 0;
    quadrature by;
    for (int i = 0; i < readings->count; i++)
        for (int k = 0; k < ALB_RING_SAMPLES; k++)
            end_mm = fmax(end_mm, readings->sample_r_mm[i][k]);
    for (int j = 0; j < spot->count; j++)
        spot_mm = fmax(spot_mm, spot->r_mm[j]);
    end_mm = (end_mm + spot_mm) * (1 + 1e-9);
    quadrature_create(&by, end_mm);
    for (int k = 0; k < GRID; k++)
        forward->grid_mm[k] = grid_at(k, end_mm);
    forward->grid_mm[0] = forward->grid_mm[1] / 4;
#pragma omp parallel for schedule(dynamic)
    for (int i = 0; i < readings->count; i++)
        fill_row(&rows[i], readings->sample_r_mm[i], readings->sample_share[i], spot, &by);
    for (int i = 0; i < readings->count; i++) {
        forward->first[i] = rows[i].first;
        forward->last[i] = rows[i].last;
        forward->offset[i + 1] = forward->offset[i] + (size_t)(rows[i].last - rows[i].first + 1);
    }
    forward->weight = alb_allocate(forward->offset[readings->count], sizeof(double), error);
    if (!forward->weight)
        goto done;
    for (int i = 0; i < readings->count; i++)
        memcpy(forward->weight + forward->offset[i], rows[i].weight + rows[i].first,
               (forward->offset[i + 1] - forward->offset[i]) * sizeof(double));
    ok = true;
done:
    free(rows);
    if (!ok)
        alb_operator_free(forward);
    return ok;
}

bool alb_operator_identity(alb_operator *forward, const alb_readings *readings, alb_error *error)
{
    const int n = readings->count;
    if (!allocate(forward, n, n, error) || !(forward->weight = alb_allocate((size_t)n, sizeof(double), error))) {
        alb_operator_free(forward);
        return false;
    }
    for (int i = 0; i < n; i++) {
        forward->grid_mm[i] = readings->r_mm[i];
        forward->first[i] = forward->last[i] = i;
        forward->offset[i + 1] = (size_t)i + 1;
        forward->weight[i] = 1;
    }
    return true;
}

bool alb_operator_coarsen(alb_operator *coarse, const alb_operator *forward, int factor, alb_error *error)
{
    const int f = forward->grid_count > 64 * factor && (forward->grid_count - 1) % factor == 0 ? factor : 1;
    if (!allocate(coarse, forward->row_count, (forward->grid_count - 1) / f + 1, error))
        goto failed;
    for (int i = 0; i < forward->row_count; i++) {
        coarse->first[i] = forward->first[i] / f;
        coarse->last[i] = (forward->last[i] + f - 1) / f;
        coarse->offset[i + 1] = coarse->offset[i] + (size_t)(coarse->last[i] - coarse->first[i] + 1);
    }
    if (!(coarse->weight = alb_allocate(coarse->offset[forward->row_count], sizeof(double), error)))
        goto failed;
    for (int k = 0; k < coarse->grid_count; k++)
        coarse->grid_mm[k] = forward->grid_mm[k * f];
    if (f > 1) // as the fine grid's: a quarter of the first spacing
        coarse->grid_mm[0] = coarse->grid_mm[1] / 4;
    for (int i = 0; i < forward->row_count; i++) {
        double *out = coarse->weight + coarse->offset[i];
        for (int k = forward->first[i]; k <= forward->last[i]; k++) {
            const int low = k / f, place = low - coarse->first[i];
            const double weight = forward->weight[forward->offset[i] + (size_t)(k - forward->first[i])];
            const double from = low ? forward->grid_mm[low * f] : 0, at = k ? forward->grid_mm[k] : 0;
            const double upper = k % f ? (at - from) / (forward->grid_mm[(low + 1) * f] - from) : 0;
            out[place] += weight * (1 - upper);
            if (upper > 0)
                out[place + 1] += weight * upper;
        }
    }
    return true;
failed:
    alb_operator_free(coarse);
    return false;
}

void alb_operator_free(alb_operator *forward)
{
    free(forward->grid_mm);
    free(forward->first);
    free(forward->last);
    free(forward->offset);
    free(forward->weight);
    *forward = (alb_operator){0};
}

// Even and odd grid points are summed apart: two chains of additions in a fixed order.
ALB_VECTOR_CLONES
void alb_operator_apply(double (*out)[ALB_OPERATOR_COLUMNS], const alb_operator *forward,
                        const double (*on_grid)[ALB_OPERATOR_COLUMNS])
{
    for (int i = 0; i < forward->row_count; i++) {
        const double *weight = forward->weight + forward->offset[i];
        const double(*value)[ALB_OPERATOR_COLUMNS] = on_grid + forward->first[i];
        const int n = forward->last[i] - forward->first[i] + 1;
        double even[ALB_OPERATOR_COLUMNS] = {0}, odd[ALB_OPERATOR_COLUMNS] = {0};
        for (int k = 0; k < n - 1; k += 2)
            for (int c = 0; c < ALB_OPERATOR_COLUMNS; c++) {
                even[c] += weight[k] * value[k][c];
                odd[c] += weight[k + 1] * value[k + 1][c];
            }
        for (int c = 0; c < ALB_OPERATOR_COLUMNS; c++)
            out[i][c] = even[c] + odd[c] + (n % 2 ? weight[n - 1] * value[n - 1][c] : 0);
    }
}

double *alb_operator_readings(const alb_operator *forward, const alb_profile *profile, alb_error *error)
{
    const size_t rows = (size_t)forward->row_count, grid = (size_t)forward->grid_count;
    double *out = alb_allocate(rows, sizeof(double), error);
    double(*columns)[ALB_OPERATOR_COLUMNS] = alb_allocate(rows, sizeof *columns, error);
    double(*on_grid)[ALB_OPERATOR_COLUMNS] = alb_allocate(grid, sizeof *on_grid, error);
    if (out && columns && on_grid) {
        for (size_t k = 0; k < grid; k++)
            on_grid[k][0] = alb_profile_value(profile, forward->grid_mm[k]);
        alb_operator_apply(columns, forward, (const double(*)[ALB_OPERATOR_COLUMNS])on_grid);
        for (size_t i = 0; i < rows; i++)
            out[i] = columns[i][0];
    } else {
        free(out);
        out = NULL;
    }
    free(columns);
    free(on_grid);
    return out;
}
