// What a solution may lack, and where the light goes. H = E + F B the whole irradiance, kappa the column sums of S':
//     in = sum A (E + M),  absorbed = sum A (1 - kappa) H,  escaped = sum A B (share of sky rays),  lost likewise for
//     backs
// Errors of rays and of sampled scattering are random, what is left of the equations is a bound:
//     stated = hypot(rays, scattering) + bound
#include "render/solution_account.h"
#include "base/memory.h"
#include <stdlib.h>

double alb_solution_scatter_error(const alb_scene *scene)
{
    return 0.005 * (scene->error_percent > 0 ? fmin(fmax(scene->error_percent, 0.2), 1) : 1);
}

static void take_balance(alb_solution *s, const double (*irradiance)[3])
{
    const double(*kept)[3] = (const double(*)[3])s->scatter.column_sums;
    s->balance = (alb_balance){0};
    s->column_sum = 0;
    for (size_t p = 0; p < s->patches.count; p++)
        for (int c = 0; c < 3; c++) {
            const double area = s->patches.areas_mm2[p];
            s->column_sum = fmax(s->column_sum, kept[p][c]);
            s->balance.in[c] += area * (s->irradiance[p][c] + (s->lamps_direct ? 0 : s->exitance[p][c]));
            s->balance.absorbed[c] += area * (1 - kept[p][c]) * irradiance[p][c];
            s->balance.escaped[c] += area * s->radiosity[p][c] * alb_form_factors_sky_share(&s->factors, p);
            s->balance.lost[c] += area * s->radiosity[p][c] * alb_form_factors_back_share(&s->factors, p);
        }
}

// What leaves a smooth slab on the far side leaves in other directions than what is reflected.
static bool take_across(alb_solution *s, const alb_scene *scene, const double (*irradiance)[3], alb_error *error)
{
    bool wanted = false;
    for (size_t i = 0; i < scene->surface_count; i++)
        wanted |= scene->surfaces[i].slab && scene->surfaces[i].exits[ALB_TRANSMISSION].smooth;
    free(s->across);
    s->across = NULL;
    if (wanted && !(s->across = alb_allocate(s->patches.count, sizeof *s->across, error)))
        return false;
    if (wanted)
        alb_scatter_apply_across(s->across, &s->scatter, irradiance);
    return true;
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

bool alb_solution_account(alb_solution *s, const alb_scene *scene, alb_error *error)
{
    double sky[3];
    if (!alb_scatter_sum_columns(&s->scatter, error))
        return false;
    alb_lights_sky(sky, scene->lights, scene->light_count);
    s->bound = alb_radiosity_bound(&s->equations, &s->report, (const double(*)[3])s->radiosity);
    if (!alb_form_factors_error(&s->rays_error_percent, &s->irradiance_error_percent, &s->factors,
                                (const double(*)[3])s->radiosity, (const double(*)[3])s->irradiance, sky, error))
        return false;
    const double scattered_percent = s->scatter.body_count ? 100 * alb_solution_scatter_error(scene) : 0;
    s->stated_error_percent = hypot(s->irradiance_error_percent, scattered_percent) + 100 * s->bound;
    return take_irradiance(s, scene, error);
}
