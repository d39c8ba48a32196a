// Error of irradiance by rays against rays, time and bytes: a 4 x 4 x 4 room of 72,752 patches with a ball in it, a
// smooth radiosity and two of two bright spots (3.1 % of the room): a corner of the ceiling and a disc of the floor,
// under the ball or away from all. Truth: 65,536 rays of other random numbers on 500
// rows. Lattice rays beside random ones (the baseline), and rays refined for a stated error. One draw of the rays is
// luck: the rays that 500 bytes a patch hold, of eight seeds, by their median and range. Then view factors of polygons
// against Howell's C-11 for gaps of 1e-3 to 1e3 of the size.
//     bench.form_factor [CHART.svg]
#include "base/plot.h"
#include "base/progress.h"
#include "render/form_factor.h"
#include "render/form_factor_exact.h"
#include "render/shape.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    SETTINGS = 4,
    PATTERNS = 3,
    SAMPLED = 500,
    TRUTH_RAYS = 65536,
    PRODUCTS = 9,
    REFINED = 3,
    SEEDS = 8,
    FITTING = 227
};

static const int rays_of[SETTINGS] = {16, 64, 256, 1024};
static const double asked_of[REFINED] = {10, 5, 2.5};
static const char *const sampling_names[2] = {"lattice", "random"}, *const pattern_names[PATTERNS] = {
                                                                        "smooth", "spot under the ball", "spot away"};

typedef double rgb[3];

typedef struct row {
    double rays, bytes, seconds, product_ms, error_percent[PATTERNS];
} row;

typedef struct bench {
    alb_mesh mesh;
    alb_patches patches;
    alb_tracer tracer;
    rgb *radiosity, *irradiance; // a channel a pattern
    rgb truth[SAMPLED];          // of the patches sample_of
    row rows[2][SETTINGS], refined[REFINED];
} bench;

static size_t sample_of(const bench *b, size_t k) { return k * (b->patches.count / SAMPLED); }

static bool build(bench *b, alb_error *error)
{
    alb_mesh ball = {0};
    const alb_box room = {
        .centre_mm = {2, 2, 2}, .size_mm = {4, 4, 4}, .cells = {66, 66, 66}, .grading = 1, .inward = true};
    const alb_sphere sphere = {.centre_mm = {1.6, 2.3, 1}, .radius_mm = 0.8, .subdivisions = 5};
    bool ok = alb_shape_box(&b->mesh, &room, error) && alb_shape_sphere(&ball, &sphere, error) &&
              alb_mesh_append(&b->mesh, &ball, 1, (alb_vector){0}, error) &&
              alb_patches_create(&b->patches, &b->mesh, error) && alb_tracer_create(&b->tracer, &b->mesh, error);
    alb_mesh_free(&ball);
    const size_t n = b->patches.count;
    b->radiosity = calloc(n, sizeof *b->radiosity);
    b->irradiance = calloc(n, sizeof *b->irradiance);
    if (ok && (!b->radiosity || !b->irradiance))
        ok = alb_fail(error, ALB_NO_MEMORY, "out of memory for %zu patches", n);
    for (size_t p = 0; ok && p < n; p++) {
        const alb_vector c = b->patches.centroids[p];
        b->radiosity[p][0] = 0.5 + 0.5 * sin(2 * c.x) * cos(1.5 * c.y + c.z);
        const bool corner = c.z == 4 && c.x < 1 && c.y < 1;
        b->radiosity[p][1] = corner || (c.z == 0 && hypot(c.x - 1.6, c.y - 2.3) < 0.85);
        b->radiosity[p][2] = corner || (c.z == 0 && hypot(c.x - 3, c.y - 1) < 0.85);
    }
    return ok;
}

static bool find_truth(bench *b, alb_error *error)
{
    const alb_ray_pattern pattern = {TRUTH_RAYS, 1000, ALB_SAMPLING_LATTICE, NULL};
    uint32_t *hits = calloc(TRUTH_RAYS, sizeof *hits);
    if (!hits)
        return alb_fail(error, ALB_NO_MEMORY, "out of memory for %d rays", TRUTH_RAYS);
    for (size_t k = 0; k < SAMPLED; k++) {
        alb_rays_cast(hits, &pattern, &b->patches, &b->tracer, sample_of(b, k));
        for (size_t q = 0; q < TRUTH_RAYS; q++)
            for (int c = 0; c < PATTERNS && hits[q] < b->patches.count; c++)
                b->truth[k][c] += b->radiosity[hits[q]][c] / TRUTH_RAYS;
    }
    free(hits);
    return true;
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// Fills what the factors say: median time of a product, bytes, error.
static void measure(row *out, bench *b, const alb_form_factors *factors)
{
    double seconds[PRODUCTS];
    for (int k = 0; k < PRODUCTS; k++) {
        const double start_s = alb_clock_s();
        alb_form_factors_apply(b->irradiance, factors, (const rgb *)b->radiosity);
        seconds[k] = alb_clock_s() - start_s;
    }
    qsort(seconds, PRODUCTS, sizeof *seconds, by_value);
    out->product_ms = 1e3 * seconds[PRODUCTS / 2];
    out->rays = (double)alb_hit_rows_rays(&factors->rows) / (double)b->patches.count;
    out->bytes = (double)alb_form_factors_bytes(factors) / (double)b->patches.count;
    for (int c = 0; c < PATTERNS; c++) {
        double difference = 0, whole = 0;
        for (size_t k = 0; k < SAMPLED; k++) {
            difference += pow(b->irradiance[sample_of(b, k)][c] - b->truth[k][c], 2);
            whole += pow(b->truth[k][c], 2);
        }
        out->error_percent[c] = 100 * sqrt(difference / whole);
    }
}

static void print_row(const char *name, const row *r)
{
    printf("%-18s %6.0f", name, r->rays);
    for (int c = 0; c < PATTERNS; c++)
        printf("  %s %.2f", pattern_names[c], r->error_percent[c]);
    printf(" %9.2f %11.2f %13.0f\n", r->seconds, r->product_ms, r->bytes);
}

static bool measure_even(bench *b, int sampling, int setting, alb_error *error)
{
    alb_form_factors factors;
    row *out = &b->rows[sampling][setting];
    const double start_s = alb_clock_s();
    if (!alb_form_factors_create(&factors, &b->patches, &b->tracer, rays_of[setting], 7, (alb_sampling)sampling, error))
        return false;
    out->seconds = alb_clock_s() - start_s;
    measure(out, b, &factors);
    print_row(sampling_names[sampling], out);
    alb_form_factors_free(&factors);
    return true;
}

static bool measure_refined(bench *b, int setting, alb_error *error)
{
    alb_form_factors factors;
    double stated;
    char name[64];
    row *out = &b->refined[setting];
    const double start_s = alb_clock_s();
    if (!alb_form_factors_create(&factors, &b->patches, &b->tracer, 64, 7, ALB_SAMPLING_LATTICE, error) ||
        !alb_form_factors_refine(&stated, &factors, &b->patches, &b->tracer, (const rgb *)b->radiosity, NULL,
                                 asked_of[setting], 4096, error))
        return false;
    out->seconds = alb_clock_s() - start_s;
    measure(out, b, &factors);
    snprintf(name, sizeof name, "%g %%, states %.2f", asked_of[setting], stated);
    print_row(name, out);
    alb_form_factors_free(&factors);
    return true;
}

static bool measure_seeds(bench *b, alb_error *error)
{
    double errors[PATTERNS][SEEDS];
    row r = {0};
    for (int seed = 0; seed < SEEDS; seed++) {
        alb_form_factors factors;
        if (!alb_form_factors_create(&factors, &b->patches, &b->tracer, FITTING, 7 + (uint64_t)seed,
                                     ALB_SAMPLING_LATTICE, error))
            return false;
        measure(&r, b, &factors);
        for (int c = 0; c < PATTERNS; c++)
            errors[c][seed] = r.error_percent[c];
        alb_form_factors_free(&factors);
    }
    printf("lattice, %d seeds: %.0f rays, %.0f bytes a patch; median [least, most]", SEEDS, r.rays, r.bytes);
    for (int c = 0; c < PATTERNS; c++) {
        qsort(errors[c], SEEDS, sizeof *errors[c], by_value);
        printf("  %s %.2f [%.2f, %.2f]", pattern_names[c], 0.5 * (errors[c][SEEDS / 2 - 1] + errors[c][SEEDS / 2]),
               errors[c][0], errors[c][SEEDS - 1]);
    }
    printf("\n");
    return true;
}

static void take_curve(alb_curve *curve, double x[SETTINGS], double y[SETTINGS], const row *rows, int count,
                       int pattern, int against, const char *label)
{
    for (int k = 0; k < count; k++) {
        x[k] = against == 0 ? rows[k].bytes : against == 1 ? rows[k].seconds : rows[k].product_ms;
        y[k] = rows[k].error_percent[pattern];
    }
    *curve = (alb_curve){.label = label, .x = x, .y = y, .count = (size_t)count, .mark = ALB_MARK_LINE_AND_POINTS};
}

static bool chart(const bench *b, const char *path, alb_error *error)
{
    static const char *const titles[3] = {"Form factors: error of irradiance against bytes a patch (72,752 patches)",
                                          "The same against seconds to cast", "The same against a product's time"},
                             *const axes[3] = {"bytes a patch", "seconds", "milliseconds"};
    static const char *const labels[3][PATTERNS] = {
        {"lattice, smooth", "lattice, spot under the ball", "lattice, spot away"},
        {"random, smooth", "random, spot under the ball", "random, spot away"},
        {NULL, NULL, "for a stated error, spot away"}};
    double x[3][7][SETTINGS], y[3][7][SETTINGS];
    alb_curve curves[3][7];
    alb_panel panels[3];
    for (int panel = 0; panel < 3; panel++) {
        size_t count = 0;
        for (int kind = 0; kind < 3; kind++)
            for (int c = 0; c < PATTERNS; c++)
                if (labels[kind][c]) {
                    take_curve(&curves[panel][count], x[panel][count], y[panel][count],
                               kind < 2 ? b->rows[kind] : b->refined, kind < 2 ? SETTINGS : REFINED, c, panel,
                               labels[kind][c]);
                    count++;
                }
        panels[panel] = (alb_panel){.title = titles[panel],
                                    .x_label = axes[panel],
                                    .y_label = "rms error, %",
                                    .log_x = true,
                                    .log_y = true,
                                    .curves = curves[panel],
                                    .curve_count = count,
                                    .height = 1};
    }
    return alb_plot_write(path, panels, 3, 800, 1100, error);
}

// Opposed unit squares (C-11), evaluated with log1p so that it holds far away.
static bool measure_exact(alb_error *error)
{
    printf("\nview factor of opposed unit squares\n%8s %18s %14s %12s\n", "gap", "factor", "relative error",
           "us a pair");
    for (int k = -3; k <= 3; k++) {
        const long double gap = powl(10, k), x2 = 1 / (gap * gap), root = sqrtl(1 + x2);
        const long double closed = 2 / (acosl(-1) * x2) *
                                   (0.5L * log1pl(x2 * x2 / (1 + 2 * x2)) + 2 / gap * root * atanl(1 / (gap * root)) -
                                    2 / gap * atanl(1 / gap));
        const double z = (double)gap;
        const alb_vector p[4] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
        const alb_vector q[4] = {{0, 0, z}, {0, 1, z}, {1, 1, z}, {1, 0, z}};
        double found = 0;
        const double start_s = alb_clock_s();
        for (int time = 0; time < 100; time++)
            if (!alb_form_factor_exact(&found, p, 4, q, 4, error))
                return false;
        printf("%8g %18.12g %14.1e %12.1f\n", z, found, fabs((double)((long double)found / closed - 1)),
               1e4 * (alb_clock_s() - start_s));
    }
    return true;
}

int main(int argc, char **argv)
{
    alb_error error = {0};
    bench *b = calloc(1, sizeof *b);
    if (!b)
        return ALB_NO_MEMORY;
    bool ok = build(b, &error) && find_truth(b, &error);
    printf("%zu patches\n%-18s %6s  %-54s %9s %11s %13s\n", b->patches.count, "rays", "a patch", "rms error, %",
           "seconds", "product, ms", "bytes a patch");
    for (int sampling = 0; ok && sampling < 2; sampling++)
        for (int k = 0; ok && k < SETTINGS; k++)
            ok = measure_even(b, sampling, k, &error);
    for (int k = 0; ok && k < REFINED; k++)
        ok = measure_refined(b, k, &error);
    ok = ok && measure_seeds(b, &error) && measure_exact(&error) && (argc < 2 || chart(b, argv[1], &error));
    if (!ok)
        fprintf(stderr, "bench.form_factor: %s\n", error.text);
    free(b->radiosity);
    free(b->irradiance);
    alb_tracer_free(&b->tracer);
    alb_patches_free(&b->patches);
    alb_mesh_free(&b->mesh);
    free(b);
    return ok ? 0 : (int)error.status;
}
