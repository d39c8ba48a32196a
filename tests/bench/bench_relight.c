// Relighting of fixed meshes and materials: error against time and bytes, for solutions to a residual and for a bounce
// at receivers and narrow matrices. Prints a table and draws the chart: bench.relight CHART.svg [patches, 73870]
//
// Scene: three bowls and an animal on a table. Error: |B - B'| / |B'|, area-weighted 2-norm, worst channel, B' solved
// to 1e-6 with the same rays, rms over four lights that the columns were not made for: the scene's own (a sky and a
// lamp), the lamp alone, a spot of 10 degrees on a bowl's wall, and a point of light inside a bowl. Matrices
// state their error as well, over lights at random. "S' alone": one product with it, which every kind needs, by links
// or by stored weights, which say their error over lights with sharp edges. B' is found by links.
#include "base/memory.h"
#include "base/plot.h"
#include "base/progress.h"
#include "render/relight.h"
#include "render/solution.h"
#include "scenes/scenes.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { RUNS = 15, RESIDUALS = 4, RANKS = 4, KINDS = 3, POINTS = 4, LIGHTS = 4 };
static const double residuals[RESIDUALS] = {1e-1, 1e-2, 1e-3, 1e-4};
static const int ranks[RANKS] = {0, 16, 32, 48};
static const char *const kinds[KINDS] = {"solution by links", "solution by weights", "receivers, columns"};
static const double weights_error = 0.006;

typedef struct bench {
    alb_scene scene;
    alb_solution s;
    alb_rgb *light[LIGHTS], *exact[LIGHTS], *found;
    double error_percent[KINDS][POINTS], worst_percent[KINDS][POINTS], seconds[KINDS][POINTS];
} bench;

// A way of relighting: B from E, with a setting.
typedef bool (*way)(bench *b, alb_rgb *out, const alb_rgb *light, const void *setting, alb_error *error);

static double difference(const bench *b, const alb_rgb *exact)
{
    double worst = 0;
    for (int c = 0; c < 3; c++) {
        double off = 0, all = 0;
        for (size_t p = 0; p < b->s.patches.count; p++) {
            off += b->s.patches.areas_mm2[p] * pow(b->found[p][c] - exact[p][c], 2);
            all += b->s.patches.areas_mm2[p] * pow(exact[p][c], 2);
        }
        worst = fmax(worst, 100 * sqrt(off / all));
    }
    return worst;
}

static bool make_lights(bench *b, alb_error *error)
{
    const alb_light extra[2] = {{.kind = ALB_LIGHT_SPOT,
                                 .position_mm = {-60, -180, 160},
                                 .direction = {0.38, 0.8, -0.46},
                                 .half_angle_deg = 10,
                                 .flux = {1, 1, 1}},
                                {.kind = ALB_LIGHT_POINT, .position_mm = {10, 100, 40}, .flux = {1, 1, 1}}};
    const alb_light *const lights[LIGHTS] = {NULL, &b->scene.lights[1], &extra[0], &extra[1]};
    const size_t n = b->s.patches.count;
    bool ok = (b->found = alb_allocate(n, sizeof *b->found, error));
    for (int k = 0; ok && k < LIGHTS; k++) {
        ok = (b->light[k] = alb_allocate(n, sizeof *b->found, error)) &&
             (b->exact[k] = alb_allocate(n, sizeof *b->found, error));
        if (ok && !lights[k])
            memcpy(b->light[k], b->s.irradiance, n * sizeof *b->found);
        else if (ok)
            ok = alb_light_add(b->light[k], lights[k], &b->s.patches, &b->s.tracer, &b->s.factors, 1, 50, error);
    }
    return ok;
}

static bool by_solution(bench *b, alb_rgb *out, const alb_rgb *light, const void *setting, alb_error *error)
{
    alb_radiosity_report report;
    return alb_radiosity_solve(out, &report, &b->s.equations, ALB_SOLVER_TWO_LEVEL, light, NULL, NULL,
                               *(const double *)setting, error);
}

static bool by_columns(bench *b, alb_rgb *out, const alb_rgb *light, const void *setting, alb_error *error)
{
    (void)b;
    (void)error;
    alb_relight_apply(out, *(alb_relight *const *)setting, light);
    return true;
}

// Error over the lights, seconds of the fastest run.
static bool measure(bench *b, int kind, int point, way relight, const void *setting, alb_error *error)
{
    double squares = 0, worst = 0, best = INFINITY;
    for (int run = 0; run < RUNS; run++)
        for (int k = 0; k < LIGHTS; k++) {
            const double start_s = alb_clock_s();
            if (!relight(b, b->found, (const alb_rgb *)b->light[k], setting, error))
                return false;
            best = fmin(best, alb_clock_s() - start_s);
            const double off = run ? 0 : difference(b, (const alb_rgb *)b->exact[k]);
            squares += off * off / LIGHTS;
            worst = fmax(worst, off);
        }
    b->seconds[kind][point] = best;
    b->error_percent[kind][point] = sqrt(squares);
    b->worst_percent[kind][point] = worst;
    return true;
}

static void print(const bench *b, int kind, int point, double setting, const alb_relight *narrow, double made_s)
{
    printf("%-22s %8g %8.3f %8.3f %8.2f %8.1f", kinds[kind], setting, b->error_percent[kind][point],
           b->worst_percent[kind][point], 1e3 * b->seconds[kind][point], 1 / b->seconds[kind][point]);
    if (narrow)
        printf(" %8.3f %8.1f %8.1f", narrow->error_percent, made_s, 1e-6 * (double)alb_relight_bytes(narrow));
    printf("\n");
    fflush(stdout);
}

static bool measure_solutions(bench *b, int kind, alb_error *error)
{
    for (int k = 0; k < RESIDUALS; k++) {
        if (!measure(b, kind, k, by_solution, &residuals[k], error))
            return false;
        print(b, kind, k, residuals[k], NULL, 0);
    }
    return true;
}

static bool measure_narrow(bench *b, int kind, alb_error *error)
{
    for (int k = 0; k < RANKS; k++) {
        alb_relight narrow, *const setting = &narrow;
        const double start_s = alb_clock_s();
        if (!alb_relight_create(&narrow, &b->s.equations, &b->s.patches, ranks[k], 1, error))
            return false;
        const double made_s = alb_clock_s() - start_s;
        const bool ok = measure(b, kind, k, by_columns, &setting, error);
        print(b, kind, k, narrow.rank, &narrow, made_s);
        alb_relight_free(&narrow);
        if (!ok)
            return false;
    }
    return true;
}

static void print_scattering(bench *b)
{
    double best = INFINITY;
    for (int run = 0; run < RUNS; run++) {
        const double start_s = alb_clock_s();
        alb_scatter_apply(b->found, &b->s.scatter, (const alb_rgb *)b->light[0]);
        best = fmin(best, alb_clock_s() - start_s);
    }
    printf("%-22s %8s %8s %8s %8.2f %8.1f\n", "S' alone", "", "", "", 1e3 * best, 1 / best);
}

static bool make_weights(bench *b, alb_error *error)
{
    double percent;
    const double start_s = alb_clock_s(), links_mb = 1e-6 * (double)alb_scatter_bytes(&b->s.scatter);
    if (!alb_scatter_keep_weights(&b->s.scatter, weights_error, &percent, error))
        return false;
    printf("%-22s %8g %53.3f %8.1f %8.1f\n", "weights beside links", weights_error, percent, alb_clock_s() - start_s,
           1e-6 * (double)alb_scatter_bytes(&b->s.scatter) - links_mb);
    print_scattering(b);
    return true;
}

static bool chart(const bench *b, const char *path, alb_error *error)
{
    alb_curve curves[KINDS] = {{0}};
    for (int k = 0; k < KINDS; k++)
        curves[k] = (alb_curve){.label = kinds[k],
                                .x = b->seconds[k],
                                .y = b->error_percent[k],
                                .count = k > 1 ? RANKS : RESIDUALS,
                                .mark = ALB_MARK_LINE_AND_POINTS};
    const alb_panel panel = {.title = "Relighting fixed materials: error of the radiosity against time",
                             .x_label = "seconds a relight",
                             .y_label = "error, %, rms over four lights",
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
    static const double exactly = 1e-6;
    alb_error error = {0};
    const size_t patches = argc > 2 ? (size_t)atol(argv[2]) : test_scenes[1].patches;
    bool ok = scene_bowls(&b.scene, test_scene_detail(&test_scenes[1], patches), 0, &error) &&
              alb_solution_create(&b.s, &b.scene, &error) && make_lights(&b, &error);
    for (int k = 0; ok && k < LIGHTS; k++)
        ok = by_solution(&b, b.exact[k], (const alb_rgb *)b.light[k], &exactly, &error);
    if (ok) {
        printf("%zu patches\n%-22s %8s %8s %8s %8s %8s %8s %8s %8s\n", b.s.patches.count, "", "setting", "error, %",
               "worst, %", "ms", "fps", "stated", "made, s", "MB");
        print_scattering(&b);
    }
    ok = ok && measure_solutions(&b, 0, &error) && make_weights(&b, &error) && measure_solutions(&b, 1, &error) &&
         measure_narrow(&b, 2, &error);
    if (ok && argc > 1)
        ok = chart(&b, argv[1], &error);
    if (!ok)
        fprintf(stderr, "bench.relight: %s\n", error.text);
    for (int k = 0; k < LIGHTS; k++) {
        free(b.light[k]);
        free(b.exact[k]);
    }
    free(b.found);
    alb_solution_free(&b.s);
    alb_scene_free(&b.scene);
    return ok ? 0 : (int)error.status;
}
