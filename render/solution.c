// The order of the steps, timed. Small lamps light the scene directly (lamp.h): their light is then part of E, M is
// left out of the solution and of the balance, and is added to B at the end. Balance, H = E + F B the whole irradiance,
// kappa the column sums of S':
//     in = sum A (E + M),  absorbed = sum A (1 - kappa) H,  escaped = sum A B (share of sky rays), lost likewise for
//     backs
#include "render/solution.h"
#include "base/memory.h"
#include "base/progress.h"
#include "render/lamp.h"
#include <stdlib.h>
#include <string.h>

const char *const alb_stage_names[ALB_STAGES] = {"tracer", "form_factors", "lights", "scattering", "solve"};

static bool light_patches(alb_solution *s, const alb_scene *scene, alb_error *error)
{
    const size_t n = s->patches.count;
    if (!(s->irradiance = alb_allocate(n, sizeof *s->irradiance, error)) ||
        !(s->exitance = alb_allocate(n, sizeof *s->exitance, error)) ||
        !(s->radiosity = alb_allocate(n, sizeof *s->radiosity, error)))
        return false;
    for (size_t p = 0; p < n; p++)
        memcpy(s->exitance[p], scene->surfaces[scene->mesh.groups[p]].exitance, sizeof s->exitance[p]);
    for (size_t i = 0; i < scene->light_count; i++)
        if (!alb_light_add(s->irradiance, &scene->lights[i], &s->patches, &s->tracer, &s->factors, scene->seed,
                           UINT64_MAX - i, error))
            return false;
    s->lamps_direct = alb_lamps_are_small(&s->patches, (const double(*)[3])s->exitance);
    if (s->lamps_direct && !alb_lamps_add(s->irradiance, (const double(*)[3])s->exitance, &s->patches, &s->tracer,
                                          scene->seed, UINT64_MAX - ALB_LIGHTS_MAX, error))
        return false;
    s->bytes[ALB_STAGE_LIGHTS] = 3 * n * sizeof *s->radiosity;
    return true;
}

static bool scatter_patches(alb_solution *s, const alb_scene *scene, alb_error *error)
{
    if (!alb_scatter_create(&s->scatter, &s->patches, scene->mesh.groups, scene->surfaces, error))
        return false;
    s->bytes[ALB_STAGE_SCATTERING] = alb_scatter_bytes(&s->scatter);
    const bool closed = !s->factors.sky_rays && !s->factors.back_rays;
    return alb_radiosity_check(&s->row_sum, &s->scatter, closed, scene->mesh.groups, scene->surfaces, error);
}

static void take_balance(alb_solution *s, const double (*irradiance)[3])
{
    const double(*kept)[3] = (const double(*)[3])s->scatter.column_sums;
    for (size_t p = 0; p < s->patches.count; p++)
        for (int c = 0; c < 3; c++) {
            const double area = s->patches.areas_mm2[p];
            s->column_sum = fmax(s->column_sum, kept[p][c]);
            s->balance.in[c] += area * (s->irradiance[p][c] + (s->lamps_direct ? 0 : s->exitance[p][c]));
            s->balance.absorbed[c] += area * (1 - kept[p][c]) * irradiance[p][c];
            s->balance.escaped[c] += area * s->radiosity[p][c] * (double)s->factors.sky_shares[p];
            s->balance.lost[c] += area * s->radiosity[p][c] * (double)s->factors.back_shares[p];
        }
}

// What leaves a smooth slab on the far side leaves in other directions than what is reflected.
static bool take_across(alb_solution *s, const alb_scene *scene, const double (*irradiance)[3], alb_error *error)
{
    bool wanted = false;
    for (size_t i = 0; i < scene->surface_count; i++)
        wanted |= scene->surfaces[i].slab && scene->surfaces[i].exits[ALB_TRANSMISSION].smooth;
    return !wanted || ((s->across = alb_allocate(s->patches.count, sizeof *s->across, error)) &&
                       alb_scatter_apply_across(s->across, &s->scatter, irradiance, error));
}

// What the whole irradiance H = E + F B says.
static bool take_irradiance(alb_solution *s, const alb_scene *scene, alb_error *error)
{
    double(*irradiance)[3] = alb_allocate(s->patches.count, sizeof *irradiance, error);
    if (!irradiance)
        return false;
    alb_form_factors_apply(irradiance, &s->factors, (const double(*)[3])s->radiosity);
    for (size_t p = 0; p < s->patches.count; p++)
        for (int c = 0; c < 3; c++)
            irradiance[p][c] += s->irradiance[p][c];
    take_balance(s, (const double(*)[3])irradiance);
    const bool ok = take_across(s, scene, (const double(*)[3])irradiance, error);
    free(irradiance);
    return ok;
}

static bool solve(alb_solution *s, const alb_scene *scene, alb_error *error)
{
    const size_t n = s->patches.count;
    double(*emitted)[3] = alb_allocate(n, sizeof *emitted, error);
    s->bytes[ALB_STAGE_SOLVE] = 23 * n * sizeof *s->radiosity;
    if (emitted && !s->lamps_direct)
        memcpy(emitted, s->exitance, n * sizeof *emitted);
    const bool ok =
        emitted &&
        alb_radiosity_solve(s->radiosity, &s->report, (const double(*)[3])s->irradiance, (const double(*)[3])emitted,
                            &s->scatter, &s->factors, s->patches.areas_mm2, scene->residual, error) &&
        take_irradiance(s, scene, error);
    free(emitted);
    for (size_t p = 0; ok && s->lamps_direct && p < n; p++)
        for (int c = 0; c < 3; c++)
            s->radiosity[p][c] += s->exitance[p][c];
    return ok;
}

static bool run_stage(alb_solution *s, alb_stage stage, const alb_scene *scene, alb_error *error)
{
    switch (stage) {
    case ALB_STAGE_TRACER:
        if (!alb_patches_create(&s->patches, &scene->mesh, error) ||
            !alb_tracer_create(&s->tracer, &scene->mesh, error))
            return false;
        s->bytes[stage] = (size_t)s->tracer.bytes;
        return true;
    case ALB_STAGE_FORM_FACTORS:
        if (!alb_form_factors_create(&s->factors, &s->patches, &s->tracer, scene->rays_per_patch, scene->seed,
                                     ALB_SAMPLING_LATTICE, error))
            return false;
        s->bytes[stage] = alb_form_factors_bytes(&s->factors);
        return true;
    case ALB_STAGE_LIGHTS:
        return light_patches(s, scene, error);
    case ALB_STAGE_SCATTERING:
        return scatter_patches(s, scene, error);
    default:
        return solve(s, scene, error);
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
        solution->seconds[stage] = alb_clock_s() - start_s;
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
    alb_scatter_free(&solution->scatter);
    free(solution->irradiance);
    free(solution->exitance);
    free(solution->radiosity);
    free(solution->across);
    *solution = (alb_solution){0};
}
