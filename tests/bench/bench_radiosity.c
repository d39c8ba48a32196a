// Radiosity on the five scenes: seconds, bytes and error beside the figures of Sheng et al. 2014 (two GPUs) and the
// goals set for two CPU cores; then error against time against bytes, with the paper's recipe as baseline in the same
// run.
//     bench.radiosity [CHART.svg] [--quick] [--json FILE]
// --quick: small scenes, to see that it runs; its figures mean nothing.
//
// Irradiance error: rms over some hundred patches of (F B - F* B) / rms of F* B, all channels; F* casts 65,536 rays
// from each of those patches; B is the scene's own radiosity. Relighting: the balance solved from nothing to a residual
// of 1e-3 for lights that moved, the lights' own shadow rays apart; a change of translucency the same with
// tables rewritten. Animation: three frames, times sixteen.
#include "base/memory.h"
#include "base/progress.h"
#include "radiosity_bench.h"
#include "render/relight.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { RUNS = 5, FRAMES = 3, RANK = 48, RELIGHTS = 25, TURNS = 15, BOWLS = 1 };

static void move_lights(alb_scene *scene, int step)
{
    for (size_t i = 0; i < scene->light_count; i++)
        scene->lights[i].position_mm.x += step % 2 ? 7 : -5;
    for (size_t i = 0; i < scene->surface_count; i++)
        scene->surfaces[i].exitance[step % 3] *= 1.2;
}

static int ascending(const void *a, const void *b)
{
    const double *p = a, *q = b;
    return *p < *q ? -1 : *p > *q;
}

static double median(double *values, size_t count)
{
    qsort(values, count, sizeof *values, ascending);
    return values[count / 2];
}

// The balance alone, from nothing, or from what stands in *last, where it is left. A baseline may run out of products:
// it then counts ALB_PRODUCTS_MAX.
static bool solve_from(rgb **last, double *seconds, int *products, alb_solution *s, alb_solver solver, alb_error *error)
{
    rgb *radiosity = alb_allocate(s->patches.count, sizeof *radiosity, error);
    alb_radiosity_report report = {0};
    const double start_s = alb_clock_s();
    bool ok = radiosity &&
              alb_radiosity_solve(radiosity, &report, &s->equations, solver, (const rgb *)s->irradiance,
                                  s->lamps_direct ? NULL : (const rgb *)s->exitance, (const rgb *)*last, 1e-3, error);
    *seconds = alb_clock_s() - start_s;
    free(*last);
    *last = radiosity;
    if (!ok && report.iterations >= ALB_PRODUCTS_MAX) {
        *error = (alb_error){0};
        ok = true;
    }
    *products = ok ? report.iterations : 0;
    return ok;
}

bool solve_again(double *seconds, int *products, alb_solution *s, alb_solver solver, alb_error *error)
{
    rgb *radiosity = NULL;
    const bool ok = solve_from(&radiosity, seconds, products, s, solver, error);
    free(radiosity);
    return ok;
}

static bool relight(figures *out, alb_solution *s, alb_scene *scene, alb_error *error)
{
    double seconds[RUNS], lights[RUNS];
    for (int run = 0; run < RUNS; run++) {
        move_lights(scene, run);
        if (!alb_solution_relight(s, scene, error))
            return false;
        lights[run] = s->seconds[ALB_STAGE_LIGHTS];
        if (!solve_again(&seconds[run], &out->products, s, ALB_SOLVER_TWO_LEVEL, error))
            return false;
    }
    out->relight_s = median(seconds, RUNS);
    out->lights_s = median(lights, RUNS);
    double jacobi_s;
    return solve_again(&jacobi_s, &out->jacobi_products, s, ALB_SOLVER_JACOBI, error);
}

// Everything of two exponentials narrows, the total stays.
static void narrow(alb_scene *scene, double times)
{
    for (size_t i = 0; i < scene->surface_count; i++)
        for (int side = 0; side < ALB_SIDES; side++)
            for (int c = 0; c < 3; c++) {
                double *p = scene->surfaces[i].profiles[side][c].parameters;
                p[0] *= times * times, p[1] *= times, p[2] *= times * times, p[3] *= times;
            }
}

// By a quarter, back, and again: tables and the balance for them, which finds the row sums, from the radiosity before
// (alb_solution_rematerial starts there where bodies send as much as before); and, by turns, the balance from nothing
// for the same materials, as new lights take it.
static bool change_translucency(figures *out, alb_solution *s, alb_scene *scene, alb_error *error)
{
    double seconds[TURNS], times[TURNS], relit_s;
    int products;
    rgb *last = NULL;
    bool ok = solve_from(&last, &relit_s, &products, s, ALB_SOLVER_TWO_LEVEL, error);
    for (int run = 0; ok && run < TURNS; run++) {
        narrow(scene, run % 2 ? 0.8 : 1.25);
        const double start_s = alb_clock_s();
        ok = alb_scatter_rewrite_tables(&s->scatter, scene->surfaces, error);
        alb_radiosity_refresh(&s->equations);
        const double rewritten_s = alb_clock_s() - start_s;
        ok = ok && solve_from(&last, &seconds[run], &products, s, ALB_SOLVER_TWO_LEVEL, error);
        seconds[run] += rewritten_s;
        alb_radiosity_refresh(&s->equations);
        ok = ok && solve_again(&relit_s, &products, s, ALB_SOLVER_TWO_LEVEL, error);
        times[run] = seconds[run] / relit_s;
    }
    free(last);
    out->change_s = ok ? median(seconds, TURNS) : 0;
    out->change_times = ok ? median(times, TURNS) : 0;
    return ok;
}

bool measure_error(bench *b, figures *out, const alb_scene *scene, const alb_solution *s, alb_error *error)
{
    rgb *radiosity = bounced(s, error), *found = alb_allocate(s->patches.count, sizeof *found, error);
    const bool ok = radiosity && found && make_oracle(b, scene, s, (const rgb *)radiosity, error);
    if (ok) {
        gather_all(found, scene, s, &s->factors, (const rgb *)radiosity);
        out->error_percent = error_of(b, (const rgb *)found, true, true);
        out->rays_error_percent = error_of(b, (const rgb *)found, true, false);
        out->stated_percent = s->rays_error_percent;
    }
    free(radiosity);
    free(found);
    return ok;
}

void note_creation(figures *out, const alb_solution *s)
{
    out->patches = s->patches.count;
    out->forms_s = s->seconds[ALB_STAGE_TRACER] + s->seconds[ALB_STAGE_FORM_FACTORS];
    out->scatter_s = s->seconds[ALB_STAGE_SCATTERING];
    out->bytes_mb = (double)(s->bytes[ALB_STAGE_FORM_FACTORS] + s->bytes[ALB_STAGE_SCATTERING]) / 1e6;
}

// Stored weights and narrow matrices for the materials as they are: made once, applied to the lights.
static bool relight_narrowly(bench *b, alb_solution *s, alb_error *error)
{
    alb_relight narrow;
    double seconds[RELIGHTS];
    rgb *radiosity = alb_allocate(s->patches.count, sizeof *radiosity, error);
    const double start_s = alb_clock_s(), links_mb = (double)alb_scatter_bytes(&s->scatter) / 1e6;
    const bool ok = radiosity && alb_scatter_keep_weights(&s->scatter, 0.006, NULL, error) &&
                    alb_relight_create(&narrow, &s->equations, &s->patches, RANK, 3, error);
    if (ok) {
        b->narrow_made_s = alb_clock_s() - start_s;
        b->narrow_mb = (double)(alb_relight_bytes(&narrow) + alb_scatter_bytes(&s->scatter)) / 1e6 - links_mb;
        b->narrow_error_percent = narrow.error_percent;
        for (int run = 0; run < RELIGHTS; run++) {
            const double from_s = alb_clock_s();
            alb_relight_apply(radiosity, &narrow, (const rgb *)s->irradiance);
            seconds[run] = alb_clock_s() - from_s;
        }
        b->narrow_s = median(seconds, RELIGHTS);
        alb_relight_free(&narrow);
    }
    free(radiosity);
    return ok;
}

static bool run_scene(bench *b, int i, alb_error *error)
{
    alb_scene scene;
    alb_solution s;
    figures *out = &b->of[i];
    if (!test_scenes[i].create(&scene, b->quick ? test_scene_detail(&test_scenes[i], 1500) : 1, 0, error))
        return false;
    bool ok = alb_solution_create(&s, &scene, error);
    if (ok) {
        note_creation(out, &s);
        ok = relight(out, &s, &scene, error) && measure_error(b, out, &scene, &s, error) &&
             (i != BOWLS || relight_narrowly(b, &s, error)) && change_translucency(out, &s, &scene, error);
        alb_solution_free(&s);
    }
    alb_scene_free(&scene);
    return ok;
}

// Precomputation of single frames.
static bool run_animation(bench *b, alb_error *error)
{
    const test_scene *gallop = &test_scenes[TEST_SCENES - 1];
    bool ok = true;
    for (int frame = 0; ok && frame < gallop->frames; frame += gallop->frames / FRAMES) {
        alb_scene scene;
        alb_solution s;
        ok = gallop->create(&scene, b->quick ? test_scene_detail(gallop, 1500) : 1, frame, error);
        if (!ok)
            return false;
        if ((ok = alb_solution_create(&s, &scene, error))) {
            figures of;
            note_creation(&of, &s);
            b->frame_s += (of.forms_s + of.scatter_s) / FRAMES;
            alb_solution_free(&s);
        }
        alb_scene_free(&scene);
    }
    return ok;
}

int main(int argc, char **argv)
{
    const char *svg = NULL, *json = NULL;
    bench b = {0};
    alb_error error = {0};
    for (int i = 1; i < argc; i++) {
        if (!strcmp(argv[i], "--quick"))
            b.quick = true;
        else if (!strcmp(argv[i], "--json") && i + 1 < argc)
            json = argv[++i];
        else
            svg = argv[i];
    }
    b.oracle_rays = b.quick ? 4096 : 65536;
    b.oracle_rows = b.quick ? 50 : 500;
    b.rows = alb_allocate(b.oracle_rows, sizeof *b.rows, &error);
    b.truth = alb_allocate(b.oracle_rows, sizeof *b.truth, &error);
    b.direct = alb_allocate(b.oracle_rows, sizeof *b.direct, &error);
    bool ok = b.rows && b.truth && b.direct;
    for (int i = 0; ok && i < TEST_SCENES; i++) {
        ok = run_scene(&b, i, &error);
        if (ok)
            print_scene(&b, i);
    }
    ok = ok && run_animation(&b, &error) && run_sweep(&b, &error) && run_recipe(&b, &error) && run_albedos(&b, &error);
    if (ok)
        print_rest(&b);
    ok = ok && (!svg || draw_chart(&b, svg, &error)) && (!json || write_json(&b, json, &error));
    if (!ok)
        fprintf(stderr, "bench.radiosity: %s\n", error.text);
    recipe_free(&b.baseline);
    free(b.rows);
    free(b.truth);
    free(b.direct);
    return ok ? 0 : (int)error.status;
}
