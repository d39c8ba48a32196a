// Relighting of fixed meshes and materials: error against time and bytes, for solutions to a residual, for narrow
// matrices, and for the same after an exact bounce. Prints a table and draws the chart: bench.relight CHART.svg
// [patches, 12000]
//
// Scene: three bowls and an animal on a table. Error: |B - B'| / |B'|, area-weighted 2-norm, worst channel, B' solved
// to 1e-6 with the same rays, of a light that the columns were not made for. Narrow matrices state their error as well:
// rms over lights at random.
#include "base/plot.h"
#include "base/progress.h"
#include "render/relight.h"
#include "render/solution.h"
#include "scenes/scenes.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { RUNS = 5, RESIDUALS = 4, RANKS = 4, KINDS = 3, POINTS = 4 };
static const double residuals[RESIDUALS] = {1e-1, 1e-2, 1e-3, 1e-4};
static const int ranks[RANKS] = {16, 32, 64, 96};
static const char *const kinds[KINDS] = {"solution", "narrow", "narrow, exact bounce"};

typedef struct bench {
    alb_scene scene;
    alb_solution s;
    alb_rgb *exact, *found;
    double error_percent[KINDS][POINTS], seconds[KINDS][POINTS];
} bench;

static double difference(const bench *b)
{
    double worst = 0;
    for (int c = 0; c < 3; c++) {
        double off = 0, all = 0;
        for (size_t p = 0; p < b->s.patches.count; p++) {
            off += b->s.patches.areas_mm2[p] * pow(b->found[p][c] - b->exact[p][c], 2);
            all += b->s.patches.areas_mm2[p] * pow(b->exact[p][c], 2);
        }
        worst = fmax(worst, 100 * sqrt(off / all));
    }
    return worst;
}

static bool solve(bench *b, alb_rgb *out, double residual, alb_error *error)
{
    alb_radiosity_report report;
    return alb_radiosity_solve(out, &report, &b->s.equations, ALB_SOLVER_TWO_LEVEL, (const alb_rgb *)b->s.irradiance,
                               NULL, NULL, residual, error);
}

static bool measure_solutions(bench *b, alb_error *error)
{
    for (int k = 0; k < RESIDUALS; k++) {
        double best = INFINITY;
        for (int run = 0; run < RUNS; run++) {
            const double start_s = alb_clock_s();
            if (!solve(b, b->found, residuals[k], error))
                return false;
            best = fmin(best, alb_clock_s() - start_s);
        }
        b->seconds[0][k] = best;
        b->error_percent[0][k] = difference(b);
        printf("%-22s %8.0e %10s %10s %10.3f %10s %10.2f\n", kinds[0], residuals[k], "", "", b->error_percent[0][k], "",
               1e3 * best);
    }
    return true;
}

static bool measure_narrow(bench *b, int kind, alb_error *error)
{
    for (int k = 0; k < RANKS; k++) {
        alb_relight narrow;
        double start_s = alb_clock_s(), best = INFINITY;
        if (!alb_relight_create(&narrow, &b->s.equations, &b->s.patches, ranks[k], kind == 2, 1, error))
            return false;
        const double made_s = alb_clock_s() - start_s;
        for (int run = 0; run < RUNS; run++) {
            start_s = alb_clock_s();
            alb_relight_apply(b->found, &narrow, (const alb_rgb *)b->s.irradiance);
            best = fmin(best, alb_clock_s() - start_s);
        }
        b->seconds[kind][k] = best;
        b->error_percent[kind][k] = difference(b);
        printf("%-22s %8d %10.1f %10.1f %10.3f %10.3f %10.2f\n", kinds[kind], narrow.rank, made_s,
               1e-6 * (double)alb_relight_bytes(&narrow), b->error_percent[kind][k], narrow.error_percent, 1e3 * best);
        alb_relight_free(&narrow);
    }
    return true;
}

static bool chart(const bench *b, const char *path, alb_error *error)
{
    alb_curve curves[KINDS] = {{0}};
    for (int k = 0; k < KINDS; k++)
        curves[k] = (alb_curve){.label = kinds[k],
                                .x = b->seconds[k],
                                .y = b->error_percent[k],
                                .count = POINTS,
                                .mark = ALB_MARK_LINE_AND_POINTS};
    const alb_panel panel = {.title = "Relighting fixed materials: error of radiosity against time "
                                      "(residuals 1e-1 to 1e-4; 16 to 96 columns)",
                             .x_label = "seconds a relight",
                             .y_label = "error, %",
                             .log_x = true,
                             .log_y = true,
                             .curves = curves,
                             .curve_count = KINDS,
                             .height = 1};
    return alb_plot_write(path, &panel, 1, 800, 500, error);
}

int main(int argc, char **argv)
{
    static bench b;
    alb_error error = {0};
    const size_t patches = argc > 2 ? (size_t)atol(argv[2]) : 12000;
    bool ok = scene_bowls(&b.scene, test_scene_detail(&test_scenes[1], patches), 0, &error) &&
              alb_solution_create(&b.s, &b.scene, &error);
    b.exact = calloc(b.s.patches.count, sizeof *b.exact);
    b.found = calloc(b.s.patches.count, sizeof *b.found);
    ok = ok && b.exact && b.found && solve(&b, b.exact, 1e-6, &error);
    printf("%zu patches\n%-22s %8s %10s %10s %10s %10s %10s\n", b.s.patches.count, "", "setting", "made in, s", "MB",
           "error, %", "stated, %", "ms");
    ok = ok && measure_solutions(&b, &error) && measure_narrow(&b, 1, &error) && measure_narrow(&b, 2, &error);
    if (ok && argc > 1)
        ok = chart(&b, argv[1], &error);
    if (!ok)
        fprintf(stderr, "bench.relight: %s\n", error.text);
    free(b.exact);
    free(b.found);
    alb_solution_free(&b.s);
    alb_scene_free(&b.scene);
    return ok ? 0 : 1;
}
