// The equations of radiosity as a bounce x -> S'F x, and what is checked before they are solved:
//     b = S (e + G b) in flux form,  ||S||_1 = largest column sum of S = s,  ||G||_1 = largest row sum of F <= 1
// so that bounce N carries at most s^N of the light that arrives. The rows of F hold exactly for ray-cast factors, and
// row sums of S' are its column sums as far as the profile is symmetric: rows below 1 are what a solution needs.
#include "render/radiosity.h"
#include "base/memory.h"
#include "render/radiosity_two_level.h"
#include <stdlib.h>
#include <string.h>

bool alb_radiosity_create(alb_radiosity *equations, const alb_patches *patches, const alb_scatter *scatter,
                          const alb_form_factors *factors, alb_error *error)
{
    *equations = (alb_radiosity){.scatter = scatter, .factors = factors, .areas_mm2 = patches->areas_mm2};
    size_t longest = 1;
    for (size_t p = 0; p < patches->count; p++)
        longest = (size_t)fmax((double)longest, alb_form_factors_rays(factors, p));
    const bool ok = (equations->row = alb_allocate(longest, sizeof *equations->row, error)) &&
                    (equations->gathered = alb_allocate(patches->count, sizeof *equations->gathered, error)) &&
                    (equations->scattered = alb_allocate(patches->count, sizeof *equations->scattered, error)) &&
                    alb_clusters_create(&equations->clusters, patches, factors, scatter, equations->row, error);
    if (!ok)
        alb_radiosity_free(equations);
    return ok;
}

void alb_radiosity_free(alb_radiosity *equations)
{
    alb_clusters_free(&equations->clusters);
    free(equations->row);
    free(equations->gathered);
    free(equations->scattered);
    *equations = (alb_radiosity){0};
}

void alb_radiosity_refresh(alb_radiosity *equations) { alb_clusters_refresh(&equations->clusters, equations->scatter); }

size_t alb_radiosity_bytes(const alb_radiosity *equations)
{
    return alb_clusters_bytes(&equations->clusters) + 2 * equations->factors->patch_count * sizeof *equations->gathered;
}

static void apply(alb_rgb *out, const void *data, const alb_rgb *x)
{
    const alb_radiosity *equations = data;
    alb_form_factors_apply(equations->gathered, equations->factors, x);
    alb_scatter_apply(out, equations->scatter, (const alb_rgb *)equations->gathered);
}

static bool is_opaque(const alb_scatter *scatter, size_t p)
{
    return !memcmp(scatter->local[p], scatter->row_sums[p], sizeof scatter->local[p]);
}

// What neighbours' rays add to a patch's own: lags by a sweep.
static void gather_shared(alb_rgb *out, const alb_form_factors *factors, const alb_rgb *x, alb_rgb *room)
{
    alb_form_factors_apply(out, factors, x);
    alb_form_factors_apply_rows(room, factors, x);
    for (size_t p = 0; p < factors->patch_count; p++)
        for (int c = 0; c < 3; c++)
            out[p][c] -= room[p][c];
}

// An opaque patch sends out at once what it gathers; bodies scatter at the end of the sweep.
static void sweep(alb_rgb *x, const void *data, const alb_rgb *right)
{
    const alb_radiosity *equations = data;
    const alb_scatter *scatter = equations->scatter;
    const size_t n = scatter->patch_count;
    gather_shared(equations->gathered, equations->factors, (const alb_rgb *)x, equations->scattered);
    for (size_t p = 0; p < n; p++) {
        const int rays = alb_form_factors_rays(equations->factors, p);
        double sum[3] = {0};
        alb_form_factors_row(equations->row, equations->factors, p);
        for (int q = 0; q < rays; q++)
            for (int c = 0; c < 3 && equations->row[q] < n; c++)
                sum[c] += x[equations->row[q]][c];
        for (int c = 0; c < 3; c++) {
            equations->gathered[p][c] += sum[c] / rays;
            if (is_opaque(scatter, p))
                x[p][c] = right[p][c] + scatter->local[p][c] * equations->gathered[p][c];
        }
    }
    alb_scatter_apply(equations->scattered, scatter, (const alb_rgb *)equations->gathered);
    for (size_t p = 0; p < n; p++)
        for (int c = 0; c < 3 && !is_opaque(scatter, p); c++)
            x[p][c] = right[p][c] + equations->scattered[p][c];
}

alb_bounce alb_radiosity_bounce(alb_radiosity *equations)
{
    return (alb_bounce){.count = equations->factors->patch_count,
                        .areas_mm2 = equations->areas_mm2,
                        .data = equations,
                        .apply = apply,
                        .sweep = sweep,
                        .even = (const alb_rgb *)equations->scatter->row_sums};
}

bool alb_radiosity_solve(alb_rgb *radiosity, alb_radiosity_report *report, alb_radiosity *equations, alb_solver solver,
                         const alb_rgb *irradiance, const alb_rgb *exitance, const alb_rgb *start, double residual,
                         alb_error *error)
{
    const size_t n = equations->factors->patch_count;
    const alb_bounce bounce = alb_radiosity_bounce(equations);
    if (solver == ALB_SOLVER_TWO_LEVEL)
        return alb_two_level_run(radiosity, report, equations, irradiance, exitance, start, residual, error);
    alb_rgb *right = alb_allocate(n, sizeof *right, error);
    if (!right)
        return false;
    if (irradiance)
        alb_scatter_apply(right, equations->scatter, irradiance);
    for (size_t i = 0; exitance && i < n; i++)
        for (int c = 0; c < 3; c++)
            right[i][c] += exitance[i][c];
    const bool ok = alb_solver_run(radiosity, report, solver, &bounce, (const alb_rgb *)right, start, residual, error);
    free(right);
    return ok;
}

double alb_radiosity_bound(const alb_radiosity *equations, const alb_radiosity_report *report, const alb_rgb *radiosity)
{
    const alb_scatter *scatter = equations->scatter;
    double kept[3] = {0}, power[3] = {0}, area = 0, worst = 0;
    for (size_t i = 0; i < scatter->patch_count; i++) {
        area += equations->areas_mm2[i];
        for (int c = 0; c < 3; c++) {
            kept[c] = fmax(kept[c], scatter->column_sums[i][c]);
            power[c] += equations->areas_mm2[i] * radiosity[i][c];
        }
    }
    for (int c = 0; c < 3; c++)
        if (report->residual_flux[c] > 0)
            worst = fmax(worst,
                         kept[c] < 1 ? kept[c] / (1 - kept[c]) * report->residual_flux[c] * area / power[c] : HUGE_VAL);
    return worst;
}

bool alb_radiosity_check(double *largest, const alb_scatter *scatter, bool closed_scene, const uint16_t *materials,
                         const alb_surface *surfaces, alb_error *error)
{
    static const char *const channels[3] = {"R", "G", "B"};
    const size_t n = scatter->patch_count;
    const alb_rgb *sums = (const alb_rgb *)scatter->row_sums;
    bool ok = true;
    size_t patch = 0;
    int channel = 0;
    for (size_t i = 0; i < n; i++)
        for (int c = 0; c < 3; c++)
            if (!(sums[i][c] <= sums[patch][channel]) && !isnan(sums[patch][channel]))
                patch = i, channel = c;
    if (n) {
        const double sum = sums[patch][channel], rounding = 1e-6; // weights are floats
        if (largest)
            *largest = sum;
        if (!(closed_scene ? sum < 1 - rounding : sum <= 1 + rounding))
            ok = alb_fail(
                error, ALB_BAD_DATA,
                "material '%s' creates light: patch %zu, channel %s sends out %.7g of what falls on it evenly (%s); "
                "the profile is too bright, or the body too thin for it",
                surfaces[materials[patch]].name, patch, channels[channel], sum,
                closed_scene ? "a closed scene needs less than 1" : "at most 1");
    }
    return ok;
}
