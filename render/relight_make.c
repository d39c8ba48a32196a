// The receivers and the columns of relighting and the error it is stated with (relight.c): a solution for each light
// that receivers are chosen by, one a column for its range, one for its adjoint, one for each test.
#include "base/memory.h"
#include "base/random.h"
#include "render/relight.h"
#include <stdlib.h>
#include <string.h>

enum { COLUMNS_STEP = 8, CHOOSING = 16, TESTS = 16 };
enum { FOR_RANGE, FOR_TESTS, FOR_RECEIVERS }; // streams of random numbers
static const double choosing_residual = 1e-2, range_residual = 1e-3, adjoint_residual = 3e-4, test_residual = 1e-4;
static const double missed_by_receivers = 0.005; // of the radiosity
static const double minus_one[1][3] = {{-1, -1, -1}};

typedef struct maker {
    alb_relight *out;
    const alb_patches *patches;
    alb_space space;
    alb_rgb **basis; // irradiances that receivers are chosen by, then columns of Q
    alb_rgb *light, *solution;
    double *shares; // of the area, of each cluster
    uint64_t seed;
} maker;

enum { LIGHT_KINDS = 4 };

// A light at random, by turns one that shines on what lies about a random patch and faces its way, within a tenth to a
// third of the scene; a point of light in front of it, without shadows; the sky, brighter from one side; and what a
// lamp there, of the size of the spot, lights through the form factors, with shadows.
static void random_light(maker *m, uint64_t stream, int index)
{
    const alb_patches *patches = m->patches;
    const alb_form_factors *factors = m->out->equations->factors;
    alb_random random = alb_random_at(m->seed, stream, (uint64_t)index);
    const size_t n = patches->count, at = (size_t)(alb_random_uniform(&random) * (double)n);
    const double size_mm = sqrt(m->space.total_mm2) * 0.03 * pow(10, alb_random_uniform(&random));
    const int kind = index % LIGHT_KINDS == 2 && !factors->sky_rays ? 0 : index % LIGHT_KINDS;
    alb_rgb *out = kind == 3 ? m->solution : m->light;
    double colour[3];
    for (int c = 0; c < 3; c++)
        colour[c] = 0.2 + 0.8 * alb_random_uniform(&random);
    const alb_vector from = alb_add(patches->centroids[at], alb_times(size_mm, patches->normals[at]));
    for (size_t p = 0; p < n; p++) {
        const alb_vector aside = alb_sub(patches->centroids[p], patches->centroids[at]),
                         to = alb_sub(from, patches->centroids[p]);
        const double facing = alb_dot(patches->normals[p], patches->normals[at]),
                     spot = fmax(0, facing) * exp(-alb_dot(aside, aside) / (size_mm * size_mm)),
                     point = fmax(0, alb_dot(alb_unit(to), patches->normals[p])) /
                             fmax(alb_dot(to, to), 0.01 * size_mm * size_mm),
                     sky = alb_form_factors_sky_share(factors, p) * (1 + 0.6 * facing);
        for (int c = 0; c < 3; c++)
            out[p][c] = colour[c] * (kind == 1 ? point : kind == 2 ? sky : spot);
    }
    if (kind == 3)
        alb_form_factors_apply(m->light, m->out->equations->factors, (const alb_rgb *)m->solution);
}

static bool solve(maker *m, const alb_rgb *light, const alb_rgb *exitance, double residual, alb_error *error)
{
    alb_radiosity_report report;
    return alb_radiosity_solve(m->solution, &report, m->out->equations, ALB_SOLVER_TWO_LEVEL, light, exitance, NULL,
                               residual, error);
}

static bool find_receivers(maker *m, alb_error *error)
{
    double lengths[CHOOSING][3];
    for (int k = 0; k < CHOOSING; k++) {
        random_light(m, FOR_RECEIVERS, k);
        if (!solve(m, (const alb_rgb *)m->light, NULL, choosing_residual, error))
            return false;
        alb_space_norm(lengths[k], &m->space, (const alb_rgb *)m->solution);
        alb_form_factors_apply(m->basis[k], m->out->equations->factors, (const alb_rgb *)m->solution);
    }
    return alb_receivers_create(&m->out->receivers, m->out->equations, m->basis, (const double(*)[3])lengths, CHOOSING,
                                missed_by_receivers, error);
}

// Means over the clusters as a column of whole numbers of its step, times weights (NULL: ones).
static void pack(maker *m, int16_t *to, float *steps, int column, const alb_rgb *values, const double *weights)
{
    const alb_clusters *clusters = &m->out->equations->clusters;
    alb_rgb *even = m->out->even;
    alb_clusters_average(even, clusters, values);
    for (size_t c = 0; c < 3; c++) {
        const size_t at = 3 * (size_t)column + c;
        double largest = 0;
        for (size_t k = 0; k < clusters->count; k++) {
            even[k][c] *= weights ? weights[k] : 1;
            largest = fmax(largest, fabs(even[k][c]));
        }
        steps[at] = (float)(largest / INT16_MAX);
        for (size_t k = 0; k < clusters->count && largest > 0; k++)
            to[k * alb_relight_numbers(m->out) + at] = (int16_t)lround(even[k][c] / largest * INT16_MAX);
    }
}

// Q: T2 of random light.
static bool find_range(maker *m, alb_error *error)
{
    alb_relight *out = m->out;
    for (int k = 0; k < out->rank; k++) {
        random_light(m, FOR_RANGE, k);
        if (!solve(m, (const alb_rgb *)m->light, NULL, range_residual, error))
            return false;
        alb_scatter_apply(m->basis[k], out->equations->scatter, (const alb_rgb *)m->light);
        alb_space_add(NULL, &m->space, m->solution, minus_one, &m->basis[k], 1);
        alb_form_factors_apply(m->basis[k], out->equations->factors, (const alb_rgb *)m->solution);
        alb_space_orthonormalise(&m->space, m->basis, NULL, k, 1e-8);
        pack(m, out->u, out->u_step, k, (const alb_rgb *)m->basis[k], NULL);
    }
    return true;
}

// V: T2* of the columns of Q.
static bool find_adjoint(maker *m, alb_error *error)
{
    alb_relight *out = m->out;
    const alb_bounce bounce = alb_radiosity_bounce(out->equations);
    for (int k = 0; k < out->rank; k++) {
        if (!solve(m, NULL, (const alb_rgb *)m->basis[k], adjoint_residual, error))
            return false;
        bounce.apply(m->light, bounce.data, (const alb_rgb *)m->basis[k]);
        alb_space_add(NULL, &m->space, m->solution, minus_one, &m->basis[k], 1);
        alb_space_add(NULL, &m->space, m->solution, minus_one, &m->light, 1);
        pack(m, out->v, out->v_step, k, (const alb_rgb *)m->solution, m->shares);
    }
    return true;
}

static bool state_error(maker *m, alb_error *error)
{
    alb_relight *out = m->out;
    double squares[LIGHT_KINDS] = {0};
    for (int test = 0; test < TESTS; test++) {
        double whole[3], off[3], shares[3];
        alb_rgb *found = m->basis[0]; // its columns are packed
        random_light(m, FOR_TESTS, test);
        alb_scatter_use_links(out->equations->scatter, true);
        const bool solved = solve(m, (const alb_rgb *)m->light, NULL, test_residual, error);
        alb_scatter_use_links(out->equations->scatter, false);
        if (!solved)
            return false;
        alb_relight_apply(found, out, (const alb_rgb *)m->light);
        alb_space_norm(whole, &m->space, (const alb_rgb *)m->solution);
        alb_space_add(off, &m->space, found, minus_one, &m->solution, 1);
        for (int c = 0; c < 3; c++)
            shares[c] = whole[c] == 0 ? 0 : 100 * off[c] / whole[c];
        const double worst = alb_rgb_largest(shares);
        if (isnan(worst))
            return alb_fail(error, ALB_INTERNAL, "relighting: what comes of test light %d is no number", test);
        squares[test % LIGHT_KINDS] += worst * worst * LIGHT_KINDS / TESTS;
        out->worst_percent = fmax(out->worst_percent, worst);
    }
    for (int kind = 0; kind < LIGHT_KINDS; kind++)
        out->error_percent = fmax(out->error_percent, sqrt(squares[kind]));
    out->tests = TESTS;
    return true;
}

static int held_columns(const maker *m) { return m->out->rank > CHOOSING ? m->out->rank : CHOOSING; }

static bool allocate(maker *m, alb_error *error)
{
    alb_relight *out = m->out;
    const size_t n = out->count, clusters = out->equations->clusters.count;
    if (!alb_space_create(&m->space, m->patches->areas_mm2, n, error) ||
        !(m->basis = alb_allocate((size_t)held_columns(m), sizeof *m->basis, error)) ||
        !(m->light = alb_allocate(n, sizeof *m->light, error)) ||
        !(m->solution = alb_allocate(n, sizeof *m->solution, error)) ||
        !(m->shares = alb_allocate(clusters, sizeof *m->shares, error)) ||
        !(out->even = alb_allocate(clusters, sizeof *out->even, error)) ||
        !(out->bounced = alb_allocate(clusters, sizeof *out->bounced, error)) ||
        !(out->sent = alb_allocate(clusters, sizeof *out->sent, error)) ||
        !(out->irradiance = alb_allocate(n, sizeof *out->irradiance, error)))
        return false;
    for (size_t k = 0; k < clusters; k++)
        m->shares[k] = out->equations->clusters.areas_mm2[k] / m->space.total_mm2;
    for (int k = 0; k < held_columns(m); k++)
        if (!(m->basis[k] = alb_allocate(n, sizeof(alb_rgb), error)))
            return false;
    return true;
}

static bool allocate_columns(alb_relight *out, alb_error *error)
{
    const size_t count = alb_relight_numbers(out);
    return (out->u = alb_allocate(out->equations->clusters.count * count, sizeof *out->u, error)) &&
           (out->v = alb_allocate(out->equations->clusters.count * count, sizeof *out->v, error)) &&
           (out->u_step = alb_allocate(count, sizeof *out->u_step, error)) &&
           (out->v_step = alb_allocate(count, sizeof *out->v_step, error)) &&
           (out->partial = alb_allocate(alb_relight_blocks(out) * count, sizeof *out->partial, error));
}

bool alb_relight_create(alb_relight *relight, alb_radiosity *equations, const alb_patches *patches, int rank,
                        uint64_t seed, alb_error *error)
{
    *relight = (alb_relight){0};
    if (rank < 0 || rank > ALB_RELIGHT_RANK_MAX || (size_t)rank > patches->count || !patches->count)
        return alb_fail(error, ALB_BAD_DATA, "relighting by %d columns: 0 to %d and at most the %zu patches", rank,
                        ALB_RELIGHT_RANK_MAX, patches->count);
    relight->count = patches->count;
    relight->equations = equations;
    relight->rank = (rank + COLUMNS_STEP - 1) / COLUMNS_STEP * COLUMNS_STEP; // rows of whole vector registers
    maker m = {.out = relight, .patches = patches, .seed = seed};
    const bool ok = allocate(&m, error) && find_receivers(&m, error) && allocate_columns(relight, error) &&
                    find_range(&m, error) && find_adjoint(&m, error) && state_error(&m, error);
    for (int k = 0; m.basis && k < held_columns(&m); k++)
        free(m.basis[k]);
    free(m.basis);
    free(m.shares);
    free(m.light);
    free(m.solution);
    alb_space_free(&m.space);
    if (!ok)
        alb_relight_free(relight);
    return ok;
}
