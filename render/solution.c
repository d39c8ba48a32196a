// The order of the steps, timed. Small lamps light the scene directly (lamp.h): their light is then part of E, M is
// left out of the solution and of the balance, and is added to B at the end.
// What changed and what stays: rays know the meshes alone, scattering the meshes and materials, the solve everything.
// A solution that is already there is the start of the next where the direct light has changed by so little that
// clusters would come no nearer.
#include "render/solution.h"
#include "base/memory.h"
#include "base/progress.h"
#include "render/lamp.h"
#include "render/patch_cull.h"
#include "render/solution_account.h"
#include <stdlib.h>
#include <string.h>

const char *const alb_stage_names[ALB_STAGES] = {"tracer", "form_factors", "lights", "scattering", "solve"};

// Changes of the direct light, |E - E'| / |E|, and of what materials send of even light in all, below which the last
// solution is the better start. How wide materials scatter matters little: what patches send each other knows it less.
static const double small_change = 0.005, small_change_of_materials = 0.01;

static const alb_solver default_solver = ALB_SOLVER_TWO_LEVEL;

static bool light_patches(alb_solution *s, const alb_scene *scene, alb_error *error)
{
    const size_t n = s->patches.count;
    memset(s->irradiance, 0, n * sizeof *s->irradiance);
    for (size_t p = 0; p < n; p++)
        memcpy(s->exitance[p], scene->surfaces[scene->mesh.groups[p]].exitance, sizeof s->exitance[p]);
    alb_progress progress;
    bool ok = true;
    alb_progress_begin(&progress, "lights", (long)scene->light_count);
    for (size_t i = 0; ok && i < scene->light_count; i++) {
        ok = alb_light_add(s->irradiance, &scene->lights[i], &s->patches, &s->tracer, &s->factors, scene->seed,
                           UINT64_MAX - i, error);
        alb_progress_at(&progress, (long)i + 1);
    }
    alb_progress_end(&progress);
    if (!ok)
        return false;
    s->lamps_direct = alb_lamps_are_small(&s->patches, (const double(*)[3])s->exitance);
    return !s->lamps_direct || alb_lamps_add(s->irradiance, (const double(*)[3])s->exitance, &s->patches, &s->tracer,
                                             scene->seed, UINT64_MAX - ALB_LIGHTS_MAX, error);
}

static bool first_light(alb_solution *s, const alb_scene *scene, alb_error *error)
{
    const size_t n = s->patches.count;
    if (!(s->irradiance = alb_allocate(n, sizeof *s->irradiance, error)) ||
        !(s->exitance = alb_allocate(n, sizeof *s->exitance, error)) ||
        !(s->radiosity = alb_allocate(n, sizeof *s->radiosity, error)))
        return false;
    s->bytes[ALB_STAGE_LIGHTS] = 3 * n * sizeof *s->radiosity;
    return light_patches(s, scene, error);
}

static bool check_scattering(alb_solution *s, const alb_scene *scene, alb_error *error)
{
    const bool closed = !s->factors.sky_rays && !s->factors.back_rays;
    return alb_radiosity_check(&s->row_sum, &s->scatter, closed, scene->mesh.groups, scene->surfaces, error);
}

static bool scatter_patches(alb_solution *s, const alb_scene *scene, alb_error *error)
{
    if (!alb_scatter_create(&s->scatter, &s->patches, scene->mesh.groups, scene->surfaces,
                            alb_solution_scatter_error(scene), error))
        return false;
    s->bytes[ALB_STAGE_SCATTERING] = alb_scatter_bytes(&s->scatter);
    return check_scattering(s, scene, error);
}

// From the radiosity as it stands where it is a start; small lamps are added to it at the end.
static bool solve(alb_solution *s, const alb_scene *scene, bool start, alb_error *error)
{
    const size_t n = s->patches.count;
    const double(*exitance)[3] = (const double(*)[3])s->exitance;
    double(*guess)[3] = start ? alb_allocate(n, sizeof *guess, error) : NULL;
    if (start && !guess)
        return false;
    if (start)
        memcpy(guess, s->radiosity, n * sizeof *guess);
    const bool ok =
        alb_radiosity_solve(s->radiosity, &s->report, &s->equations, default_solver, (const double(*)[3])s->irradiance,
                            s->lamps_direct ? NULL : exitance, (const double(*)[3])guess, scene->residual, error);
    free(guess);
    return ok;
}

static void add_lamps(alb_solution *s, double sign)
{
    for (size_t p = 0; s->lamps_direct && p < s->patches.count; p++)
        for (int c = 0; c < 3; c++)
            s->radiosity[p][c] += sign * s->exitance[p][c];
}

// Casts more rays where the first solution asks for them, and solves again from it. The time counts as that of the
// rays.
static bool refine_rays(alb_solution *s, const alb_scene *scene, alb_error *error)
{
    double sky[3];
    const double start_s = alb_clock_s();
    const size_t rays = alb_hit_rows_rays(&s->factors.rows);
    alb_lights_sky(sky, scene->lights, scene->light_count);
    const bool ok =
        alb_form_factors_refine(NULL, &s->factors, &s->patches, &s->tracer, (const double(*)[3])s->radiosity, sky,
                                scene->error_percent, ALB_RAYS_REFINED_MAX, error);
    s->bytes[ALB_STAGE_FORM_FACTORS] = ok ? alb_form_factors_bytes(&s->factors) : 0;
    s->seconds[ALB_STAGE_FORM_FACTORS] += alb_clock_s() - start_s;
    s->seconds[ALB_STAGE_SOLVE] -= alb_clock_s() - start_s;
    if (!ok || alb_hit_rows_rays(&s->factors.rows) == rays)
        return ok;
    alb_radiosity_free(&s->equations);
    return (!s->factors.sky_rays || light_patches(s, scene, error)) &&
           alb_radiosity_create(&s->equations, &s->patches, &s->scatter, &s->factors, error) &&
           solve(s, scene, true, error);
}

static bool first_solve(alb_solution *s, const alb_scene *scene, alb_error *error)
{
    if (!alb_radiosity_create(&s->equations, &s->patches, &s->scatter, &s->factors, error) ||
        !solve(s, scene, false, error) || (scene->error_percent > 0 && !refine_rays(s, scene, error)) ||
        !alb_solution_account(s, scene, error))
        return false;
    s->bytes[ALB_STAGE_SOLVE] = alb_radiosity_bytes(&s->equations) + 24 * s->patches.count * sizeof *s->radiosity;
    add_lamps(s, 1);
    return true;
}

// |E - E'|^2 / |E|^2 over all channels.
static double change_of(const alb_solution *s, const double (*before)[3])
{
    double change = 0, all = 0;
    for (size_t p = 0; p < s->patches.count; p++)
        for (int c = 0; c < 3; c++) {
            change += s->patches.areas_mm2[p] * pow(s->irradiance[p][c] - before[p][c], 2);
            all += s->patches.areas_mm2[p] * pow(s->irradiance[p][c], 2);
        }
    return all > 0 ? change / all : 0;
}

// same: the materials send as much as those of the solution as it stands.
static bool relight(alb_solution *s, const alb_scene *scene, bool same, alb_error *error)
{
    const size_t n = s->patches.count;
    double(*before)[3] = alb_allocate(n, sizeof *before, error);
    const double start_s = alb_clock_s();
    if (!before)
        return false;
    memcpy(before, s->irradiance, n * sizeof *before);
    add_lamps(s, -1);
    bool ok = light_patches(s, scene, error);
    const double lit_s = alb_clock_s();
    const bool near = same && change_of(s, (const double(*)[3])before) < small_change * small_change;
    ok = ok && solve(s, scene, near, error) && alb_solution_account(s, scene, error);
    add_lamps(s, ok ? 1 : 0);
    s->seconds[ALB_STAGE_LIGHTS] = lit_s - start_s;
    s->seconds[ALB_STAGE_SOLVE] = alb_clock_s() - lit_s;
    free(before);
    return ok;
}

bool alb_solution_relight(alb_solution *s, const alb_scene *scene, alb_error *error)
{
    return relight(s, scene, true, error);
}

// Row sums come out of the first product of the solution: what creates light is refused after it, by its name, and the
// radiosity is then what it was.
bool alb_solution_rematerial(alb_solution *s, const alb_scene *scene, alb_error *error)
{
    const size_t n = s->patches.count;
    const double start_s = alb_clock_s();
    double(*before)[3] = alb_allocate(n, sizeof *before, error);
    bool ok = before && alb_scatter_rewrite_tables(&s->scatter, scene->surfaces, error);
    s->seconds[ALB_STAGE_SCATTERING] = alb_clock_s() - start_s;
    if (ok) {
        alb_error solving = {0};
        memcpy(before, s->radiosity, n * sizeof *before);
        alb_radiosity_refresh(&s->equations);
        ok = relight(s, scene, s->scatter.change < small_change_of_materials, &solving);
        alb_scatter_sum_rows(&s->scatter);
        alb_radiosity_refresh(&s->equations);
        if (!check_scattering(s, scene, error))
            ok = false;
        else if (!ok)
            *error = solving;
        if (!ok)
            memcpy(s->radiosity, before, n * sizeof *before);
    }
    free(before);
    return ok;
}

static bool run_stage(alb_solution *s, alb_stage stage, const alb_scene *scene, alb_error *error)
{
    switch (stage) {
    case ALB_STAGE_TRACER:
        if (!alb_patches_create(&s->patches, &scene->mesh, error) ||
            !alb_tracer_create(&s->tracer, &scene->mesh, error) || !alb_patches_cull(&s->patches, &s->tracer, error))
            return false;
        s->bytes[stage] = (size_t)s->tracer.bytes;
        return true;
    case ALB_STAGE_FORM_FACTORS:
        if (!alb_form_factors_create_within(&s->factors, &s->patches, &s->tracer, scene->rays_per_patch, scene->seed,
                                            ALB_SAMPLING_LATTICE, scene->memory_bytes, error))
            return false;
        s->bytes[stage] = alb_form_factors_bytes(&s->factors);
        return true;
    case ALB_STAGE_LIGHTS:
        return first_light(s, scene, error);
    case ALB_STAGE_SCATTERING:
        return scatter_patches(s, scene, error);
    default:
        return first_solve(s, scene, error);
    }
}

bool alb_solution_create(alb_solution *solution, const alb_scene *scene, alb_error *error)
{
    *solution = (alb_solution){0};
    alb_progress progress;
    alb_progress_begin(&progress, "render", ALB_STAGES);
    bool ok = true;
    for (int stage = 0; ok && stage < ALB_STAGES; stage++) {
        const double start_s = alb_clock_s();
        ok = run_stage(solution, (alb_stage)stage, scene, error);
        solution->seconds[stage] += alb_clock_s() - start_s; // refining rays hands time back
        alb_progress_at(&progress, stage + 1);
    }
    alb_progress_end(&progress);
    if (!ok)
        alb_solution_free(solution);
    return ok;
}

void alb_solution_free(alb_solution *solution)
{
    alb_patches_free(&solution->patches);
    alb_tracer_free(&solution->tracer);
    alb_form_factors_free(&solution->factors);
    alb_radiosity_free(&solution->equations);
    alb_scatter_free(&solution->scatter);
    free(solution->irradiance);
    free(solution->exitance);
    free(solution->radiosity);
    free(solution->across);
    *solution = (alb_solution){0};
}
