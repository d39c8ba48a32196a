// Radiosity on the five scenes: seconds, bytes and error beside the figures of Sheng et al. 2014 (two GPUs) and the
// goals set for two CPU cores; then error against time against bytes, with the paper's recipe as baseline in the same
// run.
//     bench.radiosity [CHART.svg] [--quick] [--json FILE]
// --quick: small scenes, to see that it runs; its figures mean nothing.
//
// Irradiance error: rms over some hundred patches of (F B - F* B) / rms of F* B, all channels; F* casts 65,536 rays
// from each of those patches; B is the scene's own radiosity. Relighting: the balance solved from nothing to a residual
// of 1e-3 for lights that moved, the lights' own shadow rays apart. Animation: three frames, times sixteen.
#include "base/json.h"
#include "base/memory.h"
#include "base/plot.h"
#include "base/progress.h"
#include "base/random.h"
#include "baseline_hemicube.h"
#include "baseline_recipe.h"
#include "scenes/scenes.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { RUNS = 3, SWEEP = 4, FRAMES = 3 };

typedef double rgb[3];

typedef struct figures {
    size_t patches;
    double forms_s, scatter_s, bytes_mb, lights_s, relight_s, rewrite_s;
    double error_percent, rays_error_percent, stated_percent;
    int products, jacobi_products;
} figures;

// Sheng et al. 2014, table 1, and what is to be reached here. The paper's gallop is a frame of its animation.
static const struct {
    double precompute_s, megabytes, relight_fps, change_fps, goal_precompute_s, goal_megabytes, goal_relight_fps;
} others[TEST_SCENES] = {
    {7 * 60, 800, 14, 4, 2, 35, 40},     {22 * 60, 2700, 3, 0.25, 6, 100, 20}, {48 * 60, 8200, 0.4, 0.2, 30, 350, 4},
    {35 * 60, 2700, 3, 0.5, 6, 100, 20}, {19 * 60, 2400, 5, 0.4, 10, 100, 20},
};

typedef struct bench {
    bool quick;
    int oracle_rays;
    size_t oracle_rows;
    figures of[TEST_SCENES];
    double frame_s;
    size_t *rows;        // of the oracle, for the scene at hand
    rgb *truth, *direct; // by rays; what else falls there
    double sweep_seconds[3][SWEEP], sweep_bytes[3][SWEEP], sweep_error[3][SWEEP]; // lattice, hemicube, hemicube dropped
    recipe baseline;
    double baseline_error;
    figures beside; // ours on the baseline's scene
    double albedo_products[ALB_SOLVERS][4];
} bench;

// --- the oracle ------------------------------------------------------------------------------------------------------

// pi times the radiance of an even sky.
static void sky_of(double sky[3], const alb_scene *scene)
{
    memset(sky, 0, sizeof(rgb));
    for (size_t i = 0; i < scene->light_count; i++)
        for (int c = 0; scene->lights[i].kind == ALB_LIGHT_ENVIRONMENT && c < 3; c++)
            sky[c] += M_PI * scene->lights[i].radiance[c];
}

static void gather(double out[3], const uint32_t *hits, size_t count, const rgb *radiosity, const double sky[3],
                   size_t patches)
{
    memset(out, 0, sizeof(rgb));
    for (size_t k = 0; k < count; k++) {
        const double *from = hits[k] < patches ? radiosity[hits[k]] : sky;
        for (int c = 0; hits[k] <= patches && c < 3; c++)
            out[c] += from[c] / (double)count;
    }
}

// What some patches, drawn at random, receive.
static bool make_oracle(bench *b, const alb_scene *scene, const alb_solution *s, const rgb *radiosity, alb_error *error)
{
    const alb_ray_pattern pattern = {b->oracle_rays, 99, ALB_SAMPLING_LATTICE};
    double sky[3];
    bool ok = true;
    sky_of(sky, scene);
#pragma omp parallel for schedule(dynamic, 1) reduction(&& : ok)
    for (size_t k = 0; k < b->oracle_rows; k++) {
        alb_random random = alb_random_at(98, 0, k);
        uint32_t *hits = malloc((size_t)pattern.rays * sizeof *hits);
        const size_t patch = b->rows[k] = (size_t)(alb_random_uniform(&random) * (double)s->patches.count);
        ok = ok && hits != NULL;
        if (hits) {
            alb_rays_cast(hits, &pattern, &s->patches, &s->tracer, patch);
            gather(b->truth[k], hits, (size_t)pattern.rays, radiosity, sky, s->patches.count);
        }
        for (int c = 0; c < 3; c++)
            b->direct[k][c] = s->irradiance[patch][c] - (double)s->factors.sky_shares[patch] * sky[c];
        free(hits);
    }
    return ok || alb_fail(error, ALB_NO_MEMORY, "out of memory for the oracle's rays");
}

// F B and the sky by the form factors, of all patches.
static void gather_all(rgb *out, const alb_scene *scene, const alb_solution *s, const alb_form_factors *factors,
                       const rgb *radiosity)
{
    double sky[3];
    sky_of(sky, scene);
    alb_form_factors_apply(out, factors, radiosity);
    for (size_t p = 0; p < s->patches.count; p++)
        for (int c = 0; c < 3; c++)
            out[p][c] += (double)factors->sky_shares[p] * sky[c];
}

// rms of what was found on the oracle's rows against it, relative to all that falls there or to what comes by rays.
// found[row] or, by patch, found[rows[row]].
static double error_of(const bench *b, const rgb *found, bool by_patch, bool whole)
{
    double difference = 0, all = 0;
    for (size_t k = 0; k < b->oracle_rows; k++)
        for (int c = 0; c < 3; c++) {
            difference += pow(found[by_patch ? b->rows[k] : k][c] - b->truth[k][c], 2);
            all += pow(b->truth[k][c] + (whole ? b->direct[k][c] : 0), 2);
        }
    return 100 * sqrt(difference / all);
}

// B without what small lamps send directly, which is in E.
static rgb *bounced(const alb_solution *s, alb_error *error)
{
    rgb *out = alb_allocate(s->patches.count, sizeof *out, error);
    for (size_t p = 0; out && p < s->patches.count; p++)
        for (int c = 0; c < 3; c++)
            out[p][c] = s->radiosity[p][c] - (s->lamps_direct ? s->exitance[p][c] : 0);
    return out;
}

// --- a scene ---------------------------------------------------------------------------------------------------------

static void move_lights(alb_scene *scene, int step)
{
    for (size_t i = 0; i < scene->light_count; i++)
        scene->lights[i].position_mm.x += step % 2 ? 7 : -5;
    for (size_t i = 0; i < scene->surface_count; i++)
        scene->surfaces[i].exitance[step % 3] *= 1.2;
}

static double median(double values[RUNS])
{
    return fmax(fmin(values[0], values[1]), fmin(fmax(values[0], values[1]), values[2]));
}

// The balance alone, from nothing. A baseline may run out of products: it then counts ALB_PRODUCTS_MAX.
static bool solve_again(double *seconds, int *products, alb_solution *s, alb_solver solver, alb_error *error)
{
    rgb *radiosity = alb_allocate(s->patches.count, sizeof *radiosity, error);
    alb_radiosity_report report = {0};
    const double start_s = alb_clock_s();
    bool ok = radiosity && alb_radiosity_solve(radiosity, &report, &s->equations, solver, (const rgb *)s->irradiance,
                                               s->lamps_direct ? NULL : (const rgb *)s->exitance, NULL, 1e-3, error);
    *seconds = alb_clock_s() - start_s;
    free(radiosity);
    if (!ok && report.iterations >= ALB_PRODUCTS_MAX) {
        *error = (alb_error){0};
        ok = true;
    }
    *products = ok ? report.iterations : 0;
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
    out->relight_s = median(seconds);
    out->lights_s = median(lights);
    double jacobi_s;
    return solve_again(&jacobi_s, &out->jacobi_products, s, ALB_SOLVER_JACOBI, error);
}

// Everything of two exponentials shrinks by a quarter, the total stays.
static bool change_translucency(figures *out, alb_solution *s, alb_scene *scene, alb_error *error)
{
    for (size_t i = 0; i < scene->surface_count; i++)
        for (int side = 0; side < ALB_SIDES; side++)
            for (int c = 0; c < 3; c++) {
                double *p = scene->surfaces[i].profiles[side][c].parameters;
                p[0] *= 1.5625, p[1] *= 1.25, p[2] *= 1.5625, p[3] *= 1.25;
            }
    if (!alb_solution_rematerial(s, scene, error))
        return false;
    out->rewrite_s = s->seconds[ALB_STAGE_SCATTERING];
    return true;
}

static bool measure_error(bench *b, figures *out, const alb_scene *scene, const alb_solution *s, alb_error *error)
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

static void note_creation(figures *out, const alb_solution *s)
{
    out->patches = s->patches.count;
    out->forms_s = s->seconds[ALB_STAGE_TRACER] + s->seconds[ALB_STAGE_FORM_FACTORS];
    out->scatter_s = s->seconds[ALB_STAGE_SCATTERING];
    out->bytes_mb = (double)(s->bytes[ALB_STAGE_FORM_FACTORS] + s->bytes[ALB_STAGE_SCATTERING]) / 1e6;
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
             change_translucency(out, &s, &scene, error);
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

// --- against the paper's recipe --------------------------------------------------------------------------------------

// Rays a patch, on the Cornell box: whole creations.
static bool sweep_lattice(bench *b, const alb_scene *scene, const alb_solution *s, const rgb *radiosity,
                          alb_error *error)
{
    rgb *found = alb_allocate(s->patches.count, sizeof *found, error);
    bool ok = found != NULL;
    for (int k = 0; ok && k < SWEEP; k++) {
        alb_form_factors factors;
        const double start_s = alb_clock_s();
        ok = alb_form_factors_create(&factors, &s->patches, &s->tracer, 16 << (2 * k), 5, ALB_SAMPLING_LATTICE, error);
        if (!ok)
            break;
        b->sweep_seconds[0][k] = alb_clock_s() - start_s;
        b->sweep_bytes[0][k] = (double)alb_form_factors_bytes(&factors) / 1e6;
        gather_all(found, scene, s, &factors, radiosity);
        b->sweep_error[0][k] = error_of(b, (const rgb *)found, true, false);
        alb_form_factors_free(&factors);
    }
    free(found);
    return ok;
}

static int hemicube_side(const bench *b, int setting) { return (b->quick ? 8 : 32) << setting; }

// Pixels of the hemicube: the oracle's rows alone, time and bytes scaled to all patches.
static bool sweep_hemicube(bench *b, int curve, double threshold, const alb_solution *s, const rgb *radiosity,
                           alb_error *error)
{
    rgb *found = alb_allocate(b->oracle_rows, sizeof *found, error);
    const double scale = (double)s->patches.count / (double)b->oracle_rows;
    bool ok = found != NULL;
    for (int k = 0; ok && k < SWEEP; k++) {
        hemicube cube;
        size_t entries = 0;
        if (!(ok = hemicube_create(&cube, hemicube_side(b, k), threshold, error)))
            break;
        const double start_s = alb_clock_s();
#pragma omp parallel for schedule(dynamic, 1) reduction(+ : entries)
        for (size_t r = 0; r < b->oracle_rows; r++) {
            hemicube_entry *row = malloc(cube.count * sizeof *row);
            const size_t count = row ? hemicube_row(row, &cube, &s->patches, &s->tracer, b->rows[r]) : 0;
            memset(found[r], 0, sizeof *found);
            for (size_t e = 0; e < count; e++)
                for (int c = 0; c < 3; c++)
                    found[r][c] += (double)row[e].value * radiosity[row[e].patch][c];
            entries += count;
            free(row);
        }
        b->sweep_seconds[curve][k] = (alb_clock_s() - start_s) * scale;
        b->sweep_bytes[curve][k] = (double)(entries * sizeof(hemicube_entry)) * scale / 1e6;
        b->sweep_error[curve][k] = error_of(b, (const rgb *)found, false, false);
        hemicube_free(&cube);
    }
    free(found);
    return ok;
}

static bool run_sweep(bench *b, alb_error *error)
{
    alb_scene scene;
    alb_solution s;
    if (!scene_cornell(&scene, b->quick ? 0.25 : 1, 0, error))
        return false;
    bool ok = alb_solution_create(&s, &scene, error);
    if (ok) {
        rgb *radiosity = bounced(&s, error);
        ok = radiosity && make_oracle(b, &scene, &s, (const rgb *)radiosity, error) &&
             sweep_lattice(b, &scene, &s, (const rgb *)radiosity, error) &&
             sweep_hemicube(b, 1, 0, &s, (const rgb *)radiosity, error) &&
             sweep_hemicube(b, 2, 1e-5, &s, (const rgb *)radiosity, error);
        free(radiosity);
        alb_solution_free(&s);
    }
    alb_scene_free(&scene);
    return ok;
}

// The whole recipe on a small Cornell box, beside ours on the same.
static bool run_recipe(bench *b, alb_error *error)
{
    alb_scene scene;
    alb_solution s;
    if (!scene_cornell(&scene, b->quick ? 0.2 : 0.5, 0, error))
        return false;
    bool ok = alb_solution_create(&s, &scene, error);
    if (ok) {
        note_creation(&b->beside, &s);
        ok = solve_again(&b->beside.relight_s, &b->beside.products, &s, ALB_SOLVER_TWO_LEVEL, error) &&
             measure_error(b, &b->beside, &scene, &s, error) &&
             recipe_run(&b->baseline, &scene, &s, b->quick ? 32 : 64, 1e-5, error);
        b->baseline_error = ok ? error_of(b, (const rgb *)b->baseline.irradiance, true, true) : 0;
        alb_solution_free(&s);
    }
    alb_scene_free(&scene);
    return ok;
}

// Products to 1e-3 in a closed room of one albedo.
static bool run_albedos(bench *b, alb_error *error)
{
    static const double albedos[4] = {0.5, 0.8, 0.95, 0.99};
    for (int k = 0; k < 4; k++) {
        alb_scene scene;
        alb_solution s;
        if (!scene_chess(&scene, test_scene_detail(&test_scenes[2], b->quick ? 2000 : 8000), 0, error))
            return false;
        for (size_t i = 0; i < scene.surface_count; i++) {
            scene.surfaces[i].scatters = false;
            for (int c = 0; c < 3; c++)
                scene.surfaces[i].reflectance[c] = albedos[k];
        }
        bool ok = alb_solution_create(&s, &scene, error);
        for (int solver = 0; ok && solver < ALB_SOLVERS; solver++) {
            double seconds;
            int products;
            ok = solve_again(&seconds, &products, &s, (alb_solver)solver, error);
            b->albedo_products[solver][k] = products;
        }
        if (ok)
            alb_solution_free(&s);
        alb_scene_free(&scene);
        if (!ok)
            return false;
    }
    return true;
}

// --- what is printed and drawn ---------------------------------------------------------------------------------------

static void print_scene(const bench *b, int i)
{
    const figures *f = &b->of[i];
    const double precompute_s = f->forms_s + f->scatter_s;
    if (i == 0)
        printf("%-8s %8s  %-24s %-24s %-24s %-18s %s\n", "scene", "patches", "precompute F + S, s", "memory F + S, MB",
               "relight to 1e-3, fps", "products (Jacobi)", "irradiance error, %: all, by rays (stated)");
    printf("%-8s %8zu  %5.2f + %5.2f %5.0f %5.0f %7.0f %8.0f %5.0f  %9.1f %7.1f %5.0f  %9d (%d) %14.2f %.2f (%.2f)\n",
           test_scenes[i].name, f->patches, f->forms_s, f->scatter_s, others[i].precompute_s,
           others[i].goal_precompute_s, f->bytes_mb, others[i].megabytes, others[i].goal_megabytes, 1 / f->relight_s,
           others[i].relight_fps, others[i].goal_relight_fps, f->products, f->jacobi_products, f->error_percent,
           f->rays_error_percent, f->stated_percent);
    printf("%17s  total %.1f s; a change of translucency rewrites S in %.3f s, %.2f fps (paper %.2f); lights %.3f s\n",
           "", precompute_s, f->rewrite_s, 1 / (f->rewrite_s + f->relight_s), others[i].change_fps, f->lights_s);
    fflush(stdout);
}

static void print_rest(const bench *b)
{
    static const char *const names[3] = {"lattice rays", "hemicube", "hemicube > 1e-5"};
    printf("three figures side by side: measured, paper, goal\n\nanimation of 48 frames: %.1f s of precomputation a "
           "frame, "
           "%.1f min in all (paper 912, goal 8)\n\nform factors of the Cornell box\n%-16s %7s %10s %10s %8s\n",
           b->frame_s, 48 * b->frame_s / 60, "", "setting", "seconds", "MB", "error, %");
    for (int m = 0; m < 3; m++)
        for (int k = 0; k < SWEEP; k++)
            printf("%-16s %7d %10.2f %10.1f %8.2f\n", names[m], m ? hemicube_side(b, k) : 16 << (2 * k),
                   b->sweep_seconds[m][k], b->sweep_bytes[m][k], b->sweep_error[m][k]);
    const recipe *r = &b->baseline;
    printf("\n%zu patches         precompute s       MB  relight s  products  error, %%\n", r->patches);
    printf("here          %6.2f + %6.2f %8.1f %10.4f %9d %9.2f\n", b->beside.forms_s, b->beside.scatter_s,
           b->beside.bytes_mb, b->beside.relight_s, b->beside.products, b->beside.error_percent);
    printf("the recipe    %6.2f + %6.2f %8.1f %10.4f %9d %9.2f\n", r->form_seconds, r->scatter_seconds,
           (double)r->bytes / 1e6, r->solve_seconds, r->products, b->baseline_error);
    printf("\nproducts to 1e-3 in a closed room of albedo 0.5, 0.8, 0.95, 0.99\n");
    for (int k = 0; k < ALB_SOLVERS; k++)
        printf("%-18s %4.0f %4.0f %4.0f %4.0f\n", alb_solver_names[k], b->albedo_products[k][0],
               b->albedo_products[k][1], b->albedo_products[k][2], b->albedo_products[k][3]);
}

static bool write_json(const bench *b, const char *path, alb_error *error)
{
    alb_json json;
    alb_json_begin(&json, NULL);
    alb_json_list(&json, "scenes");
    for (int i = 0; i < TEST_SCENES; i++) {
        const figures *f = &b->of[i];
        alb_json_object(&json, NULL);
        alb_json_string(&json, "name", test_scenes[i].name);
        alb_json_integer(&json, "patches", (long)f->patches);
        alb_json_number(&json, "form_factors_s", f->forms_s);
        alb_json_number(&json, "scattering_s", f->scatter_s);
        alb_json_number(&json, "megabytes", f->bytes_mb);
        alb_json_number(&json, "lights_s", f->lights_s);
        alb_json_number(&json, "relight_s", f->relight_s);
        alb_json_number(&json, "rewrite_s", f->rewrite_s);
        alb_json_integer(&json, "products", f->products);
        alb_json_integer(&json, "jacobi_products", f->jacobi_products);
        alb_json_number(&json, "irradiance_error_percent", f->error_percent);
        alb_json_number(&json, "rays_error_percent", f->rays_error_percent);
        alb_json_number(&json, "stated_error_percent", f->stated_percent);
        alb_json_end_object(&json);
    }
    alb_json_end_list(&json);
    alb_json_number(&json, "frame_s", b->frame_s);
    alb_json_object(&json, "products_by_albedo");
    for (int k = 0; k < ALB_SOLVERS; k++)
        alb_json_numbers(&json, alb_solver_names[k], b->albedo_products[k], 4);
    alb_json_end_object(&json);
    return alb_json_write(&json, path, error);
}

static bool chart(const bench *b, const char *path, alb_error *error)
{
    static const char *const labels[3] = {"rays over the patch", "hemicube at the centroid",
                                          "the same, values below 1e-5 dropped"};
    alb_curve time[3], bytes[3], fps[3];
    double patches[TEST_SCENES], ours[TEST_SCENES], papers[TEST_SCENES], goals[TEST_SCENES];
    for (int m = 0; m < 3; m++) {
        time[m] = (alb_curve){.label = labels[m],
                              .x = b->sweep_seconds[m],
                              .y = b->sweep_error[m],
                              .count = SWEEP,
                              .mark = ALB_MARK_LINE_AND_POINTS};
        bytes[m] = time[m];
        bytes[m].x = b->sweep_bytes[m];
    }
    for (int i = 0; i < TEST_SCENES; i++) {
        patches[i] = (double)b->of[i].patches;
        ours[i] = 1 / b->of[i].relight_s, papers[i] = others[i].relight_fps, goals[i] = others[i].goal_relight_fps;
    }
    const double *const rates[3] = {ours, goals, papers};
    static const char *const who[3] = {"here, two CPU cores", "goal", "Sheng et al. 2014, two GPUs"};
    for (int m = 0; m < 3; m++)
        fps[m] =
            (alb_curve){.label = who[m], .x = patches, .y = rates[m], .count = TEST_SCENES, .mark = ALB_MARK_POINTS};
    const alb_panel panels[3] = {
        {"Cornell box: error of irradiance against seconds for the form factors", "seconds", "rms error, %", true, true,
         0, 0, time, 3, 1},
        {"The same against memory", "MB", "rms error, %", true, true, 0, 0, bytes, 3, 1},
        {"Relighting to a residual of 1e-3, five scenes", "patches", "frames a second", true, true, 0, 0, fps, 3, 1}};
    return alb_plot_write(path, panels, 3, 800, 1100, error);
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
    ok = ok && (!svg || chart(&b, svg, &error)) && (!json || write_json(&b, json, &error));
    if (!ok)
        fprintf(stderr, "bench.radiosity: %s\n", error.text);
    recipe_free(&b.baseline);
    free(b.rows);
    free(b.truth);
    free(b.direct);
    return ok ? 0 : (int)error.status;
}
