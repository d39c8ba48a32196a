// Two levels, on the irradiance h that patches send each other:
//     B = M + S'(E + h),    rest = F B - h
// so that S' rest is the residual M + S'(E + F B) - B of the radiosity: an error is known after each product with F,
// and S' is never spent on finding it. With the clusters' Q, P (the same value on each of its patches), F_c and S_c:
//     start   g = (I - F_c S_c)^-1 F_c Q (M + S~ E),   h = F (M + S~ (E + P g)) =: y,   then h = y + P d,
//             d = (I - F_c S_c)^-1 F_c S_c (Q y - g)
//     step    z = rest + P (I - F_c S_c)^-1 F_c S_c Q rest,   along q = z - F S'z: the multiple with the least rest,
//             q made orthogonal to those before (GCR: Eisenstat, Elman & Schultz 1983)
// S~ scatters like S_c between clusters and keeps what varies within one where it is. The start costs F alone: S'
// blurs, and F sees little of what S~ gets wrong.
//
// The residual that is stated is a bound: |S' rest| <= s |rest| in the 2-norm weighted by area, s the largest row sum
// of S' (Schur's test; S' is symmetric by area as far as the profile is, so that columns sum to what rows do), over the
// length of Q (M + S~ E), which is about |M + S'E| or shorter.
#include "render/radiosity_two_level.h"
#include "base/memory.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { STEPS = 20 }; // before a new start from what is found

typedef struct run {
    const alb_radiosity *equations;
    const alb_rgb *irradiance, *exitance;
    alb_space space;
    alb_radiosity_report *report;
    alb_rgb *radiosity, *light, *rest; // B; E + h, later z; F B - h
    alb_rgb *even, *sent, *settled;    // of clusters: means, what they send out, and the coarse solution
    alb_rgb *along[STEPS], *sends[STEPS];
    double squares[3]; // of M + S'E of the clusters, times area
    double bound[3];   // of the residual per length of sqrt(s) rest; 0: a dark channel
    double floor;
} run;

static const double minus_one[1][3] = {{-1, -1, -1}};

static void find_bounds(run *r)
{
    const alb_scatter *scatter = r->equations->scatter;
    double rows[3] = {0};
    for (size_t p = 0; p < scatter->patch_count; p++)
        for (int c = 0; c < 3; c++)
            rows[c] = fmax(rows[c], scatter->row_sums[p][c]);
    for (int c = 0; c < 3; c++) {
        const double square = isfinite(r->squares[c]) ? r->squares[c] : (double)NAN;
        r->bound[c] = square == 0 ? 0 : sqrt(rows[c] * r->space.total_mm2 / square);
    }
}

static double worst_of(const run *r, const double length[3])
{
    return alb_rgb_largest(
        (const double[3]){r->bound[0] * length[0], r->bound[1] * length[1], r->bound[2] * length[2]});
}

// Notes the rest after a product.
static void note(run *r)
{
    double size[3], length[3];
    alb_radiosity_report *report = r->report;
    alb_space_norm(size, &r->space, (const alb_rgb *)r->radiosity);
    alb_space_weighted_norm(length, &r->space, (const alb_rgb *)r->rest,
                            (const alb_rgb *)r->equations->scatter->row_sums);
    r->floor = ALB_RESIDUAL_LEAST * fmax(1, worst_of(r, size));
    report->residual = report->history[report->iterations++] = worst_of(r, length);
}

// M + S~ (E + P g), from Q E + g in r->settled.
static void send_roughly(alb_rgb *out, const run *r)
{
    const alb_clusters *clusters = &r->equations->clusters;
    alb_clusters_move(r->sent, clusters, (const alb_rgb *)r->settled, (const alb_rgb *)r->even);
#pragma omp parallel for schedule(static)
    for (size_t p = 0; p < clusters->patch_count; p++)
        for (int c = 0; c < 3; c++)
            out[p][c] =
                (r->exitance ? r->exitance[p][c] : 0) +
                alb_clusters_sent(clusters, (const alb_rgb *)r->sent, p, c, r->irradiance ? r->irradiance[p][c] : 0);
}

// h from nothing, in r->light.
static void start_with_clusters(run *r)
{
    const alb_clusters *clusters = &r->equations->clusters;
    const size_t count = clusters->count;
    alb_rgb *even = r->even, *sent = r->sent, *settled = r->settled;
    for (size_t k = 0; k < count; k++) // E + g
        for (int c = 0; c < 3; c++)
            settled[k][c] += even[k][c];
    send_roughly(r->rest, r);
    alb_form_factors_apply(r->light, r->equations->factors, (const alb_rgb *)r->rest);
    alb_clusters_average(sent, clusters, (const alb_rgb *)r->light);
    for (size_t k = 0; k < count; k++)
        for (int c = 0; c < 3; c++)
            even[k][c] += sent[k][c] - settled[k][c]; // Q y - g
}

// light += P of what the irradiance r->even on clusters comes to once it bounces between them.
static void add_settled(run *r, alb_rgb *light)
{
    const alb_clusters *clusters = &r->equations->clusters;
    alb_clusters_scatter(r->sent, clusters, (const alb_rgb *)r->even);
    alb_clusters_settle(r->settled, clusters, (const alb_rgb *)r->sent);
#pragma omp parallel for schedule(static)
    for (size_t p = 0; p < clusters->patch_count; p++)
        for (int c = 0; c < 3; c++)
            light[p][c] += r->settled[clusters->cluster[p]][c];
}

static void swap(alb_rgb **a, alb_rgb **b)
{
    alb_rgb *const kept = *a;
    *a = *b;
    *b = kept;
}

static void add(alb_rgb *to, const alb_rgb *from, size_t n)
{
#pragma omp parallel for schedule(static)
    for (size_t p = 0; p < (from ? n : 0); p++)
        for (int c = 0; c < 3; c++)
            to[p][c] += from[p][c];
}

// B and the rest of h, which is in r->light.
static void settle(run *r)
{
    const size_t n = r->space.count;
    memcpy(r->rest, r->light, n * sizeof *r->rest);
    add(r->light, r->irradiance, n);
    const bool known = alb_scatter_rows_known(r->equations->scatter);
    alb_scatter_apply(r->radiosity, r->equations->scatter, (const alb_rgb *)r->light);
    if (!known)
        find_bounds(r);
    add(r->radiosity, r->exitance, n);
    alb_form_factors_apply(r->light, r->equations->factors, (const alb_rgb *)r->radiosity);
    alb_space_add(NULL, &r->space, r->light, minus_one, &r->rest, 1);
    swap(&r->light, &r->rest);
    note(r);
}

static bool step(run *r, int k, alb_error *error)
{
    double factors[1][3];
    const size_t n = r->space.count;
    if (!r->along[k] && (!(r->along[k] = alb_allocate(n, sizeof(alb_rgb), error)) ||
                         !(r->sends[k] = alb_allocate(n, sizeof(alb_rgb), error))))
        return false;
    memcpy(r->light, r->rest, n * sizeof *r->light);
    alb_clusters_average(r->even, &r->equations->clusters, (const alb_rgb *)r->rest);
    add_settled(r, r->light);
    alb_scatter_apply(r->sends[k], r->equations->scatter, (const alb_rgb *)r->light);
    alb_form_factors_apply(r->along[k], r->equations->factors, (const alb_rgb *)r->sends[k]);
    alb_space_add(NULL, &r->space, r->light, minus_one, &r->along[k], 1);
    swap(&r->light, &r->along[k]);
    alb_space_orthonormalise(&r->space, r->along, r->sends, k, 0);
    alb_space_dots(factors, &r->space, (const alb_rgb *)r->rest, &r->along[k], 1);
    alb_space_add(NULL, &r->space, r->radiosity, (const double(*)[3])factors, &r->sends[k], 1);
    for (int c = 0; c < 3; c++)
        factors[0][c] = -factors[0][c];
    alb_space_add(NULL, &r->space, r->rest, (const double(*)[3])factors, &r->along[k], 1);
    note(r);
    return true;
}

// Steps until the rest is small enough or they lead nowhere; then from what is found, where rounding has added up.
static bool iterate(run *r, double residual, alb_error *error)
{
    alb_radiosity_report *report = r->report;
    for (;;) {
        const double first = report->residual;
        double before = INFINITY;
        for (int k = 0; k < STEPS && report->residual > residual && report->residual < 0.99 * before &&
                        report->iterations < ALB_PRODUCTS_MAX - 1;
             k++) {
            before = report->residual;
            if (!step(r, k, error))
                return false;
        }
        if (report->residual <= residual && residual > 10 * r->floor)
            return true;
        alb_form_factors_apply(r->light, r->equations->factors, (const alb_rgb *)r->radiosity);
        settle(r);
        if (!(report->residual > residual) || report->iterations >= ALB_PRODUCTS_MAX ||
            (report->residual <= r->floor && report->residual > 0.5 * first))
            return true;
    }
}

static bool allocate(run *r, alb_error *error)
{
    const size_t n = r->equations->factors->patch_count, count = r->equations->clusters.count;
    return alb_space_create(&r->space, r->equations->areas_mm2, n, error) &&
           (r->light = alb_allocate(n, sizeof *r->light, error)) &&
           (r->rest = alb_allocate(n, sizeof *r->rest, error)) &&
           (r->even = alb_allocate(count, sizeof *r->even, error)) &&
           (r->sent = alb_allocate(count, sizeof *r->sent, error)) &&
           (r->settled = alb_allocate(count, sizeof *r->settled, error));
}

// The means of E in r->even, of M + S'E in r->sent.
static void average_light(run *r)
{
    const alb_clusters *clusters = &r->equations->clusters;
    if (r->irradiance)
        alb_clusters_average(r->even, clusters, r->irradiance);
    alb_clusters_scatter(r->sent, clusters, (const alb_rgb *)r->even);
    if (r->exitance)
        alb_clusters_average(r->settled, clusters, r->exitance);
    for (size_t k = 0; k < clusters->count; k++)
        for (int c = 0; c < 3; c++)
            r->sent[k][c] += r->settled[k][c];
    for (size_t k = 0; k < clusters->count; k++)
        for (int c = 0; c < 3; c++)
            r->squares[c] += clusters->areas_mm2[k] * r->sent[k][c] * r->sent[k][c];
}

static bool solve(run *r, const alb_rgb *start, double residual, alb_error *error)
{
    const size_t n = r->space.count;
    average_light(r);
    find_bounds(r);
    if (r->bound[0] + r->bound[1] + r->bound[2] == 0) { // nothing is sent on
        memset(r->radiosity, 0, n * sizeof *r->radiosity);
        if (r->exitance)
            memcpy(r->radiosity, r->exitance, n * sizeof *r->radiosity);
        return true;
    }
    if (start) {
        alb_form_factors_apply(r->light, r->equations->factors, start);
    } else {
        alb_clusters_settle(r->settled, &r->equations->clusters, (const alb_rgb *)r->sent);
        start_with_clusters(r);
        add_settled(r, r->light);
    }
    settle(r);
    if (!iterate(r, residual, error))
        return false;
    alb_space_mean(r->report->residual_flux, &r->space, (const alb_rgb *)r->rest);
    return alb_solver_check(r->report, ALB_SOLVER_TWO_LEVEL, residual, r->floor, r->irradiance, n, error);
}

bool alb_two_level_run(alb_rgb *radiosity, alb_radiosity_report *report, const alb_radiosity *equations,
                       const alb_rgb *irradiance, const alb_rgb *exitance, const alb_rgb *start, double residual,
                       alb_error *error)
{
    run r = {.equations = equations,
             .irradiance = irradiance,
             .exitance = exitance,
             .report = report,
             .radiosity = radiosity};
    *report = (alb_radiosity_report){0};
    const bool ok = allocate(&r, error) && solve(&r, start, residual, error);
    for (int k = 0; k < STEPS; k++) {
        free(r.along[k]);
        free(r.sends[k]);
    }
    free(r.light);
    free(r.rest);
    free(r.even);
    free(r.sent);
    free(r.settled);
    alb_space_free(&r.space);
    return ok;
}
