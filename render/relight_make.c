// The columns of narrow relighting and the error they are stated with (relight.c): one solution a column for its range,
// one for the adjoint.
#include "base/memory.h"
#include "base/random.h"
#include "render/relight.h"
#include <stdlib.h>
#include <string.h>

enum { COLUMNS_STEP = 8, TESTS = 16 };
static const double range_residual = 1e-3, adjoint_residual = 3e-4, test_residual = 1e-4;
static const double minus_one[1][3] = {{-1, -1, -1}};

typedef struct maker {
    alb_relight *out;
    const alb_patches *patches;
    alb_space space;
    alb_rgb **basis;      // rank columns of Q
    double (*lengths)[3]; // of their adjoints
    alb_rgb *light, *solution;
    uint64_t seed;
} maker;

enum { LIGHT_KINDS = 4 };

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
    }
    return true;
}

// A column of V as whole numbers of its step.
static void pack(maker *m, int column, const alb_rgb *means)
{
    alb_relight *out = m->out;
    const alb_clusters *clusters = &out->equations->clusters;
    for (size_t c = 0; c < 3; c++) {
        const size_t at = 3 * (size_t)column + c;
        double largest = 0;
        for (size_t k = 0; k < clusters->count; k++)
            largest = fmax(largest, fabs(means[k][c]) * clusters->areas_mm2[k]);
        out->v_step[at] = (float)(largest / m->space.total_mm2 / INT16_MAX);
        for (size_t k = 0; k < clusters->count && largest > 0; k++)
            out->v[k * alb_relight_numbers(out) + at] =
                (int16_t)lround(means[k][c] * clusters->areas_mm2[k] / largest * INT16_MAX);
    }
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
        pack(m, k, (const alb_rgb *)out->even);
        alb_space_norm(m->lengths[k], &m->space, (const alb_rgb *)m->solution);
    }
    return true;
}

static bool state_error(maker *m, alb_error *error)
{
    alb_relight *out = m->out;
    alb_radiosity_report report;
    double squares[LIGHT_KINDS] = {0};
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
        squares[test % LIGHT_KINDS] += worst * worst * LIGHT_KINDS / TESTS;
        out->worst_percent = fmax(out->worst_percent, worst);
    }
    for (int kind = 0; kind < LIGHT_KINDS; kind++)
        out->error_percent = fmax(out->error_percent, sqrt(squares[kind]));
    out->tests = TESTS;
    return true;
}

static bool allocate(maker *m, alb_error *error)
{
    alb_relight *out = m->out;
    const size_t n = out->count, count = alb_relight_numbers(out);
    if (!alb_space_create(&m->space, m->patches->areas_mm2, n, error) ||
        !(m->basis = alb_allocate((size_t)out->rank, sizeof *m->basis, error)) ||
        !(m->light = alb_allocate(n, sizeof *m->light, error)) ||
        !(m->solution = alb_allocate(n, sizeof *m->solution, error)) ||
        !(m->lengths = alb_allocate((size_t)out->rank, sizeof *m->lengths, error)) ||
        !(out->v = alb_allocate(out->equations->clusters.count * count, sizeof *out->v, error)) ||
        !(out->u_step = alb_allocate(count, sizeof *out->u_step, error)) ||
        !(out->v_step = alb_allocate(count, sizeof *out->v_step, error)) ||
        !(out->partial = alb_allocate(alb_relight_blocks(out) * count, sizeof *out->partial, error)) ||
        !(out->even = alb_allocate(out->equations->clusters.count, sizeof *out->even, error)) ||
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
    const bool ok = allocate(&m, error) && find_range(&m, error) && find_adjoint(&m, error) &&
                    alb_relight_find_modes(relight, m.basis, (const double(*)[3])m.lengths, error) &&
                    state_error(&m, error);
    for (int k = 0; m.basis && k < relight->rank; k++)
        free(m.basis[k]);
    free(m.basis);
    free(m.lengths);
    free(m.light);
    free(m.solution);
    alb_space_free(&m.space);
    if (!ok)
        alb_relight_free(relight);
    return ok;
}
