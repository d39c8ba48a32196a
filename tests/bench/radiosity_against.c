// Ours against the recipe of Sheng et al. 2014 in the same run: form factors alone on the Cornell box, the whole recipe
// on a small one; and every solver in a closed room by its albedo.
#include "base/memory.h"
#include "base/progress.h"
#include "baseline_hemicube.h"
#include "radiosity_bench.h"
#include <stdlib.h>
#include <string.h>

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

int hemicube_side(const bench *b, int setting) { return (b->quick ? 8 : 32) << setting; }

// Pixels of the hemicube: the oracle's rows alone, time and bytes scaled to all patches. Small values kept, and
// dropped.
static bool sweep_hemicube(bench *b, const alb_solution *s, const rgb *radiosity, alb_error *error)
{
    rgb *found[2] = {alb_allocate(b->oracle_rows, sizeof(rgb), error),
                     alb_allocate(b->oracle_rows, sizeof(rgb), error)};
    const double scale = (double)s->patches.count / (double)b->oracle_rows;
    bool ok = found[0] && found[1];
    for (int k = 0; ok && k < SWEEP; k++) {
        hemicube cube;
        size_t entries = 0, large = 0;
        if (!(ok = hemicube_create(&cube, hemicube_side(b, k), 0, error)))
            break;
        const double start_s = alb_clock_s();
#pragma omp parallel for schedule(dynamic, 1) reduction(+ : entries, large)
        for (size_t r = 0; r < b->oracle_rows; r++) {
            hemicube_entry *row = malloc(cube.count * sizeof *row);
            const size_t count = row ? hemicube_row(row, &cube, &s->patches, &s->tracer, b->rows[r]) : 0;
            memset(found[0][r], 0, sizeof(rgb));
            memset(found[1][r], 0, sizeof(rgb));
            for (size_t e = 0; e < count; e++) {
                const bool is_large = row[e].value >= 1e-5f;
                for (int c = 0; c < 3; c++) {
                    found[0][r][c] += (double)row[e].value * radiosity[row[e].patch][c];
                    found[1][r][c] += is_large ? (double)row[e].value * radiosity[row[e].patch][c] : 0;
                }
                large += is_large;
            }
            entries += count;
            free(row);
        }
        for (int m = 0; m < 2; m++) {
            b->sweep_seconds[1 + m][k] = (alb_clock_s() - start_s) * scale;
            b->sweep_bytes[1 + m][k] = (double)((m ? large : entries) * sizeof(hemicube_entry)) * scale / 1e6;
            b->sweep_error[1 + m][k] = error_of(b, (const rgb *)found[m], false, false);
        }
        hemicube_free(&cube);
    }
    free(found[0]);
    free(found[1]);
    return ok;
}

bool run_sweep(bench *b, alb_error *error)
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
             sweep_hemicube(b, &s, (const rgb *)radiosity, error);
        free(radiosity);
        alb_solution_free(&s);
    }
    alb_scene_free(&scene);
    return ok;
}

// The whole recipe on a small Cornell box, beside ours on the same.
bool run_recipe(bench *b, alb_error *error)
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
bool run_albedos(bench *b, alb_error *error)
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
