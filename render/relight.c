// With B = S'E + S'F B, the irradiance that patches send each other is G = F B = T E, T = (I - F S')^-1 F S', and
//     B = S'(E + T E),    T ~= Q (T* Q)*        randomised range finder (Halko, Martinsson & Tropp 2011, alg. 4.1)
// Q: an orthonormal basis, in the inner product weighted by area, of T applied to random lights, one solution each.
// Lights and not white noise: that would find the sampling noise of F, which is most of T's rank and of which smooth
// light sees little.
// T*, the adjoint in that product, is S'F (I - S'F)^-1 by reciprocity, T* q = x - q with x = q + S'F x: another
// solution. S'E stays exact, so that only light that has left one patch for another is narrowed down. (Sheng et al.
// 2014 precompute the whole inverse for this, n^2 numbers.) With an exact bounce,
//     B = S'(E + F S'E + T2 E),    T2 = F S' T
// and T2 is narrower still: the light of a small spot has spread before the columns see it. It costs F and S' once
// more.
//
// T* q is as smooth as scattered light is: V is kept as its means over the clusters of the equations, V^T E ~= V^T Q E.
// Columns are kept as 16-bit whole numbers of a step of their own, 1/32767 of the largest, rows side by side: a product
// reads U and V once.
//
// Where it stops being true: light that a few large columns do not span, such as the bounce of a small spot in a
// corner, falls outside Q; reciprocity holds for rays and for sampled scattering only statistically. Both are in the
// stated error, which is measured.
#include "render/relight.h"
#include "base/memory.h"
#include "base/random.h"
#include "base/vector_clones.h"
#include <stdlib.h>
#include <string.h>

enum { ROWS = 256, LANES = 24, COLUMNS_STEP = 8, TESTS = 12 };
static const double range_residual = 1e-3, adjoint_residual = 3e-4, test_residual = 1e-4;
static const double minus_one[1][3] = {{-1, -1, -1}};

static size_t numbers(const alb_relight *r) { return 3 * (size_t)r->rank; }

static size_t cluster_count(const alb_relight *r) { return r->equations->clusters.count; }

static size_t blocks_of(const alb_relight *r) { return (cluster_count(r) + ROWS - 1) / ROWS; }

// out += values of one row times light[l % 3].
ALB_VECTOR_CLONES
static void add_row(float *restrict out, const int16_t *restrict values, const float light[LANES], size_t count)
{
    for (size_t k = 0; k < count; k += LANES)
        for (int l = 0; l < LANES; l++)
            out[k + (size_t)l] += light[l] * (float)values[k + (size_t)l];
}

ALB_VECTOR_CLONES
static void dot_row(double out[3], const int16_t *restrict values, const float *restrict factors, size_t count)
{
    float sums[LANES] = {0};
    for (size_t k = 0; k < count; k += LANES)
        for (int l = 0; l < LANES; l++)
            sums[l] += factors[k + (size_t)l] * (float)values[k + (size_t)l];
    for (int c = 0; c < 3; c++) {
        out[c] = 0;
        for (int l = c; l < LANES; l += 3)
            out[c] += (double)sums[l];
    }
}

// factors = V^T Q E, with the steps of V and U.
static void project(float *factors, const alb_relight *r, const alb_rgb *irradiance)
{
    const size_t count = numbers(r), clusters = cluster_count(r);
    alb_clusters_average(r->even, &r->equations->clusters, irradiance);
#pragma omp parallel for schedule(static)
    for (size_t block = 0; block < blocks_of(r); block++) {
        float sums[3 * ALB_RELIGHT_RANK_MAX] = {0}, light[LANES];
        for (size_t k = block * ROWS; k < clusters && k < (block + 1) * ROWS; k++) {
            const double *e = r->even[k];
            for (int l = 0; l < LANES; l++)
                light[l] = (float)e[l % 3];
            if (e[0] != 0 || e[1] != 0 || e[2] != 0)
                add_row(sums, r->v + k * count, light, count);
        }
        for (size_t k = 0; k < count; k++)
            r->partial[block * count + k] = (double)sums[k];
    }
    for (size_t k = 0; k < count; k++) {
        double sum = 0;
        for (size_t block = 0; block < blocks_of(r); block++)
            sum += r->partial[block * count + k];
        factors[k] = (float)(sum * (double)r->v_step[k] * (double)r->u_step[k]);
    }
}

void alb_relight_apply(alb_rgb *radiosity, alb_relight *r, const alb_rgb *irradiance)
{
    float factors[3 * ALB_RELIGHT_RANK_MAX];
    project(factors, r, irradiance);
#pragma omp parallel for schedule(static)
    for (size_t p = 0; p < r->count; p++) {
        double bounced[3];
        dot_row(bounced, r->u + p * numbers(r), factors, numbers(r));
        for (int c = 0; c < 3; c++)
            r->irradiance[p][c] = irradiance[p][c] + bounced[c];
    }
    if (r->exact_bounce) {
        alb_scatter_apply(radiosity, r->equations->scatter, irradiance);
        alb_form_factors_apply(r->bounced, r->equations->factors, (const alb_rgb *)radiosity);
#pragma omp parallel for schedule(static)
        for (size_t p = 0; p < r->count; p++)
            for (int c = 0; c < 3; c++)
                r->irradiance[p][c] += r->bounced[p][c];
    }
    alb_scatter_apply(radiosity, r->equations->scatter, (const alb_rgb *)r->irradiance);
}

// A column of so many rows as whole numbers of its step; `weights` (NULL: ones) times it.
static void pack(int16_t *to, float *steps, const alb_relight *r, int column, const alb_rgb *from, size_t count,
                 const double *weights, double total)
{
    const size_t at = 3 * (size_t)column;
    double largest[3] = {0};
    for (size_t p = 0; p < count; p++)
        for (int c = 0; c < 3; c++)
            largest[c] = fmax(largest[c], fabs(from[p][c]) * (weights ? weights[p] / total : 1));
    for (int c = 0; c < 3; c++)
        steps[at + (size_t)c] = (float)(largest[c] / INT16_MAX);
    for (size_t p = 0; p < count; p++)
        for (int c = 0; c < 3; c++) {
            const double value = from[p][c] * (weights ? weights[p] / total : 1);
            to[p * numbers(r) + at + (size_t)c] =
                (int16_t)(largest[c] > 0 ? lround(value / largest[c] * INT16_MAX) : 0);
        }
}

typedef struct maker {
    alb_relight *out;
    const alb_patches *patches;
    alb_space space;
    alb_rgb **basis; // rank columns of Q
    alb_rgb *light, *solution;
    uint64_t seed;
} maker;

// Takes from column k what the columns before it span, twice (Gram-Schmidt), and makes it one long; a channel that
// died out becomes zero.
static void orthonormalise(const maker *m, int k)
{
    alb_rgb *column = m->basis[k];
    double before[3], length[3], factor[3];
    alb_space_norm(before, &m->space, (const alb_rgb *)column);
    for (int round = 0; round < 2; round++)
        for (int first = 0; first < k; first += ALB_SPACE_VECTORS) {
            double dots[ALB_SPACE_VECTORS][3];
            const int count = k - first < ALB_SPACE_VECTORS ? k - first : ALB_SPACE_VECTORS;
            alb_space_dots(dots, &m->space, (const alb_rgb *)column, m->basis + first, count);
            for (int i = 0; i < count; i++)
                for (int c = 0; c < 3; c++)
                    dots[i][c] = -dots[i][c];
            alb_space_add(NULL, &m->space, column, (const double(*)[3])dots, m->basis + first, count);
        }
    alb_space_norm(length, &m->space, (const alb_rgb *)column);
    for (int c = 0; c < 3; c++)
        factor[c] = length[c] > 1e-8 * before[c] ? 1 / length[c] : 0;
    alb_space_scale(&m->space, column, factor);
}

// A light at random: even ones shine on what lies about a random patch and faces its way, within a tenth to a third of
// the scene; odd ones are points of light in front of it, without shadows.
static void random_light(maker *m, uint64_t stream, int index)
{
    const alb_patches *patches = m->patches;
    alb_random random = alb_random_at(m->seed, stream, (uint64_t)index);
    const size_t n = patches->count, at = (size_t)(alb_random_uniform(&random) * (double)n);
    const double size_mm = sqrt(m->space.total_mm2) * 0.03 * pow(10, alb_random_uniform(&random));
    double colour[3];
    for (int c = 0; c < 3; c++)
        colour[c] = 0.2 + 0.8 * alb_random_uniform(&random);
    const alb_vector from = alb_add(patches->centroids[at], alb_times(size_mm, patches->normals[at]));
    for (size_t p = 0; p < n; p++) {
        const alb_vector aside = alb_sub(patches->centroids[p], patches->centroids[at]),
                         to = alb_sub(from, patches->centroids[p]);
        const double facing = fmax(0, alb_dot(patches->normals[p], patches->normals[at])),
                     spot = facing * exp(-alb_dot(aside, aside) / (size_mm * size_mm)),
                     point = fmax(0, alb_dot(alb_unit(to), patches->normals[p])) /
                             fmax(alb_dot(to, to), 0.01 * size_mm * size_mm);
        for (int c = 0; c < 3; c++)
            m->light[p][c] = colour[c] * (index % 2 ? point : spot);
    }
}

// Q: T of random light.
static bool find_range(maker *m, alb_error *error)
{
    alb_relight *out = m->out;
    alb_radiosity_report report;
    for (int k = 0; k < out->rank; k++) {
        random_light(m, 0, k);
        if (!alb_radiosity_solve(m->solution, &report, out->equations, ALB_SOLVER_TWO_LEVEL, (const alb_rgb *)m->light,
                                 NULL, NULL, range_residual, error))
            return false;
        if (out->exact_bounce) { // S'E and its bounce are not for the columns
            alb_scatter_apply(m->basis[k], out->equations->scatter, (const alb_rgb *)m->light);
            alb_space_add(NULL, &m->space, m->solution, minus_one, &m->basis[k], 1);
        }
        alb_form_factors_apply(m->basis[k], out->equations->factors, (const alb_rgb *)m->solution);
        orthonormalise(m, k);
        pack(out->u, out->u_step, out, k, (const alb_rgb *)m->basis[k], out->count, NULL, 1);
    }
    return true;
}

// V: means over clusters of T* of the columns of Q.
static bool find_adjoint(maker *m, alb_error *error)
{
    alb_relight *out = m->out;
    const alb_clusters *clusters = &out->equations->clusters;
    alb_radiosity_report report;
    for (int k = 0; k < out->rank; k++) {
        if (!alb_radiosity_solve(m->solution, &report, out->equations, ALB_SOLVER_TWO_LEVEL, NULL,
                                 (const alb_rgb *)m->basis[k], NULL, adjoint_residual, error))
            return false;
        alb_space_add(NULL, &m->space, m->solution, minus_one, &m->basis[k], 1);
        if (out->exact_bounce) {
            const alb_bounce bounce = alb_radiosity_bounce(out->equations);
            bounce.apply(m->light, bounce.data, (const alb_rgb *)m->basis[k]);
            alb_space_add(NULL, &m->space, m->solution, minus_one, &m->light, 1);
        }
        alb_clusters_average(out->even, clusters, (const alb_rgb *)m->solution);
        pack(out->v, out->v_step, out, k, (const alb_rgb *)out->even, clusters->count, clusters->areas_mm2,
             m->space.total_mm2);
    }
    return true;
}

static bool state_error(maker *m, alb_error *error)
{
    alb_relight *out = m->out;
    alb_radiosity_report report;
    double squares = 0;
    for (int test = 0; test < TESTS; test++) {
        double whole[3], off[3], worst = 0;
        alb_rgb *found = m->basis[0]; // its columns are packed
        random_light(m, 1, test);
        if (!alb_radiosity_solve(m->solution, &report, out->equations, ALB_SOLVER_TWO_LEVEL, (const alb_rgb *)m->light,
                                 NULL, NULL, test_residual, error))
            return false;
        alb_relight_apply(found, out, (const alb_rgb *)m->light);
        alb_space_norm(whole, &m->space, (const alb_rgb *)m->solution);
        alb_space_add(off, &m->space, found, minus_one, &m->solution, 1);
        for (int c = 0; c < 3; c++)
            worst = whole[c] > 0 ? fmax(worst, 100 * off[c] / whole[c]) : worst;
        squares += worst * worst / TESTS;
        out->worst_percent = fmax(out->worst_percent, worst);
    }
    out->error_percent = sqrt(squares);
    out->tests = TESTS;
    return true;
}

static bool allocate(maker *m, alb_error *error)
{
    alb_relight *out = m->out;
    const size_t n = out->count, count = numbers(out);
    if (!alb_space_create(&m->space, m->patches->areas_mm2, n, error) ||
        !(m->basis = alb_allocate((size_t)out->rank, sizeof *m->basis, error)) ||
        !(m->light = alb_allocate(n, sizeof *m->light, error)) ||
        !(m->solution = alb_allocate(n, sizeof *m->solution, error)) ||
        !(out->u = alb_allocate(n * count, sizeof *out->u, error)) ||
        !(out->v = alb_allocate(cluster_count(out) * count, sizeof *out->v, error)) ||
        !(out->u_step = alb_allocate(count, sizeof *out->u_step, error)) ||
        !(out->v_step = alb_allocate(count, sizeof *out->v_step, error)) ||
        !(out->partial = alb_allocate(blocks_of(out) * count, sizeof *out->partial, error)) ||
        !(out->even = alb_allocate(cluster_count(out), sizeof *out->even, error)) ||
        !(out->bounced = alb_allocate(n, sizeof *out->bounced, error)) ||
        !(out->irradiance = alb_allocate(n, sizeof *out->irradiance, error)))
        return false;
    for (int k = 0; k < out->rank; k++)
        if (!(m->basis[k] = alb_allocate(n, sizeof(alb_rgb), error)))
            return false;
    return true;
}

bool alb_relight_create(alb_relight *relight, alb_radiosity *equations, const alb_patches *patches, int rank,
                        bool exact_bounce, uint64_t seed, alb_error *error)
{
    *relight = (alb_relight){.count = patches->count, .equations = equations, .exact_bounce = exact_bounce};
    if (rank < 1 || rank > ALB_RELIGHT_RANK_MAX || (size_t)rank > patches->count)
        return alb_fail(error, ALB_BAD_DATA, "relighting by %d columns: 1 to %d and at most the %zu patches", rank,
                        ALB_RELIGHT_RANK_MAX, patches->count);
    relight->rank = (rank + COLUMNS_STEP - 1) / COLUMNS_STEP * COLUMNS_STEP; // rows of whole vector registers
    maker m = {.out = relight, .patches = patches, .seed = seed};
    const bool ok = allocate(&m, error) && find_range(&m, error) && find_adjoint(&m, error) && state_error(&m, error);
    for (int k = 0; m.basis && k < relight->rank; k++)
        free(m.basis[k]);
    free(m.basis);
    free(m.light);
    free(m.solution);
    alb_space_free(&m.space);
    if (!ok)
        alb_relight_free(relight);
    return ok;
}

void alb_relight_free(alb_relight *relight)
{
    free(relight->u);
    free(relight->v);
    free(relight->u_step);
    free(relight->v_step);
    free(relight->partial);
    free(relight->irradiance);
    free(relight->bounced);
    free(relight->even);
    *relight = (alb_relight){0};
}

size_t alb_relight_bytes(const alb_relight *relight)
{
    return relight->rank ? (relight->count + cluster_count(relight)) * numbers(relight) * sizeof *relight->u : 0;
}
