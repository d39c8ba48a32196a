// Form factors: rays per patch against error, time and bytes, lattice against random rays. Prints a table and draws the
// chart: bench.form_factor CHART.svg
//
// Scene: a room of 4 x 4 x 4 with a ball in it. Error: rms over all patches of (irradiance - reference) / rms of the
// reference, for a smooth radiosity B = 1/2 + 1/2 sin 2x cos(1.5 y + z) and a sharp one: a disc on the floor and a
// corner of the ceiling lit, 3.5 % of the area. Reference: 16 independent lattices of 1,024 rays.
#include "base/plot.h"
#include "base/progress.h"
#include "render/form_factor.h"
#include "render/shape.h"
#include <stdio.h>
#include <stdlib.h>

enum { SETTINGS = 4, REFERENCES = 16, PATTERNS = 2 };
static const int rays_of[SETTINGS] = {16, 64, 256, 1024};
static const char *const sampling_names[2] = {"lattice", "random"}, *const pattern_names[PATTERNS] = {"smooth",
                                                                                                      "sharp"};

typedef double rgb[3];

typedef struct bench {
    alb_mesh mesh;
    alb_patches patches;
    alb_tracer tracer;
    rgb *radiosity, *irradiance, *reference; // channels 0 and 1 are the two patterns
    double error_percent[2][PATTERNS][SETTINGS], seconds[2][SETTINGS], rays[SETTINGS];
} bench;

static bool build(bench *b, alb_error *error)
{
    alb_mesh ball = {0};
    const alb_box room = {
        .centre_mm = {2, 2, 2}, .size_mm = {4, 4, 4}, .cells = {16, 16, 16}, .grading = 1, .inward = true};
    const alb_sphere sphere = {.centre_mm = {1.6, 2.3, 1}, .radius_mm = 0.8, .subdivisions = 3};
    bool ok = alb_shape_box(&b->mesh, &room, error) && alb_shape_sphere(&ball, &sphere, error) &&
              alb_mesh_append(&b->mesh, &ball, 1, (alb_vector){0}, error) &&
              alb_patches_create(&b->patches, &b->mesh, error) && alb_tracer_create(&b->tracer, &b->mesh, error);
    alb_mesh_free(&ball);
    const size_t n = b->patches.count;
    b->radiosity = calloc(n, sizeof *b->radiosity);
    b->irradiance = calloc(n, sizeof *b->irradiance);
    b->reference = calloc(n, sizeof *b->reference);
    if (ok && (!b->radiosity || !b->irradiance || !b->reference))
        ok = alb_fail(error, ALB_NO_MEMORY, "out of memory for %zu patches", n);
    for (size_t p = 0; ok && p < n; p++) {
        const alb_vector c = b->patches.centroids[p];
        b->radiosity[p][0] = 0.5 + 0.5 * sin(2 * c.x) * cos(1.5 * c.y + c.z);
        b->radiosity[p][1] = (c.z == 0 && hypot(c.x - 3, c.y - 1) < 0.85) || (c.z == 4 && c.x < 1 && c.y < 1);
    }
    return ok;
}

static bool measure(bench *b, double *seconds, int rays, uint64_t seed, alb_sampling sampling, alb_error *error)
{
    alb_form_factors factors;
    const double start_s = alb_clock_s();
    if (!alb_form_factors_create(&factors, &b->patches, &b->tracer, rays, seed, sampling, error))
        return false;
    *seconds = alb_clock_s() - start_s;
    alb_form_factors_apply(b->irradiance, &factors, (const rgb *)b->radiosity);
    alb_form_factors_free(&factors);
    return true;
}

static bool make_reference(bench *b, alb_error *error)
{
    double seconds;
    for (uint64_t k = 0; k < REFERENCES; k++) {
        if (!measure(b, &seconds, 1024, 1000 + k, ALB_SAMPLING_LATTICE, error))
            return false;
        for (size_t p = 0; p < b->patches.count; p++)
            for (int c = 0; c < PATTERNS; c++)
                b->reference[p][c] += b->irradiance[p][c] / REFERENCES;
    }
    return true;
}

static double error_of(const bench *b, int pattern)
{
    double difference = 0, whole = 0;
    for (size_t p = 0; p < b->patches.count; p++) {
        difference += pow(b->irradiance[p][pattern] - b->reference[p][pattern], 2);
        whole += pow(b->reference[p][pattern], 2);
    }
    return 100 * sqrt(difference / whole);
}

static bool chart(const bench *b, const char *path, alb_error *error)
{
    alb_curve by_rays[4] = {{0}}, by_time[4] = {{0}};
    static const char *const labels[4] = {"lattice, smooth", "lattice, sharp", "random, smooth", "random, sharp"};
    for (int k = 0; k < 4; k++) {
        by_rays[k] = (alb_curve){.label = labels[k],
                                 .x = b->rays,
                                 .y = b->error_percent[k / 2][k % 2],
                                 .count = SETTINGS,
                                 .mark = ALB_MARK_LINE_AND_POINTS};
        by_time[k] = by_rays[k];
        by_time[k].x = b->seconds[k / 2];
    }
    const alb_panel panels[2] = {{.title = "Form factors: error of irradiance against rays (4 bytes each) a patch",
                                  .x_label = "rays per patch",
                                  .y_label = "rms error, %",
                                  .log_x = true,
                                  .log_y = true,
                                  .curves = by_rays,
                                  .curve_count = 4,
                                  .height = 1},
                                 {.title = "The same against time",
                                  .x_label = "seconds",
                                  .y_label = "rms error, %",
                                  .log_x = true,
                                  .log_y = true,
                                  .curves = by_time,
                                  .curve_count = 4,
                                  .height = 1}};
    return alb_plot_write(path, panels, 2, 800, 800, error);
}

int main(int argc, char **argv)
{
    bench b = {0};
    alb_error error = {0};
    bool ok = build(&b, &error) && make_reference(&b, &error);
    printf("%zu patches\n%-8s %5s  %-22s %9s %14s\n", b.patches.count, "rays", "a patch", "rms error, %", "seconds",
           "bytes a patch");
    for (int sampling = 0; ok && sampling < 2; sampling++)
        for (int k = 0; ok && k < SETTINGS; k++) {
            b.rays[k] = rays_of[k];
            ok = measure(&b, &b.seconds[sampling][k], rays_of[k], 7, (alb_sampling)sampling, &error);
            for (int c = 0; ok && c < PATTERNS; c++)
                b.error_percent[sampling][c][k] = error_of(&b, c);
            printf("%-8s %5d  %s %5.2f  %s %5.2f %11.3f %12d\n", sampling_names[sampling], rays_of[k], pattern_names[0],
                   b.error_percent[sampling][0][k], pattern_names[1], b.error_percent[sampling][1][k],
                   b.seconds[sampling][k], 4 * rays_of[k]);
        }
    if (ok && argc > 1)
        ok = chart(&b, argv[1], &error);
    if (!ok)
        fprintf(stderr, "bench.form_factor: %s\n", error.text);
    free(b.radiosity);
    free(b.irradiance);
    free(b.reference);
    alb_tracer_free(&b.tracer);
    alb_patches_free(&b.patches);
    alb_mesh_free(&b.mesh);
    return ok ? 0 : (int)error.status;
}
