#include "baseline_recipe.h"
#include "base/memory.h"
#include "base/progress.h"
#include "baseline_hemicube.h"
#include <stdlib.h>
#include <string.h>

typedef double rgb[3];

// Sparse rows.
typedef struct form_row {
    hemicube_entry *entries;
    size_t count;
} form_row;
typedef struct scatter_entry {
    uint32_t patch;
    float values[3];
} scatter_entry;
typedef struct scatter_row {
    scatter_entry *entries;
    size_t count;
} scatter_row;

static bool fill_forms(form_row *rows, recipe *out, const alb_solution *s, int side, double threshold, alb_error *error)
{
    hemicube cube;
    bool ok = hemicube_create(&cube, side, threshold, error);
    if (!ok)
        return false;
#pragma omp parallel
    {
        hemicube_entry *row = malloc(cube.count * sizeof *row);
#pragma omp for schedule(dynamic, 16)
        for (size_t p = 0; p < out->patches; p++) {
            const size_t count = row ? hemicube_row(row, &cube, &s->patches, &s->tracer, p) : 0;
            if ((rows[p].entries = malloc((count + 1) * sizeof *row))) {
                memcpy(rows[p].entries, row, count * sizeof *row);
                rows[p].count = count;
            }
        }
        free(row);
    }
    for (size_t p = 0; p < out->patches; p++) {
        ok &= rows[p].entries != NULL;
        out->form_entries += rows[p].count;
    }
    hemicube_free(&cube);
    return ok || alb_fail(error, ALB_NO_MEMORY, "out of memory for the baseline's form factors");
}

// A_i s(|c_j - c_i|), with 100 points where the patch lights itself (section 5.2).
static void weight(float out[3], const alb_scene *scene, const alb_patches *patches, size_t exit, size_t source)
{
    const alb_surface *surface = &scene->surfaces[scene->mesh.groups[exit]];
    const int points = exit == source ? 10 : 1;
    double sum[3] = {0};
    for (int k = 0; k < points * points; k++) {
        const double u = (k / points + 0.5) / points, v = (k % points + 0.5) / points;
        const alb_vector at = points > 1 ? alb_patch_point(patches, source, u, v) : patches->centroids[source];
        const double r = alb_length(alb_sub(at, patches->centroids[exit]));
        for (int c = 0; c < 3; c++)
            sum[c] += alb_profile_value(&surface->profiles[ALB_REFLECTION][c], r);
    }
    for (int c = 0; c < 3; c++)
        out[c] = (float)(patches->areas_mm2[source] * sum[c] / (points * points));
}

static bool fill_scatter(scatter_row *rows, recipe *out, const alb_scene *scene, const alb_patches *patches,
                         double threshold, alb_error *error)
{
    bool ok = true;
    const uint16_t *groups = scene->mesh.groups;
#pragma omp parallel
    {
        scatter_entry *row = malloc(out->patches * sizeof *row);
#pragma omp for schedule(dynamic, 16)
        for (size_t j = 0; j < out->patches; j++) {
            const alb_surface *surface = &scene->surfaces[groups[j]];
            size_t count = 0;
            for (size_t i = 0; row && i < out->patches; i++) {
                scatter_entry entry = {.patch = (uint32_t)i};
                if (surface->scatters ? groups[i] != groups[j] : i != j)
                    continue;
                for (int c = 0; c < 3; c++)
                    entry.values[c] = (float)surface->reflectance[c];
                if (surface->scatters)
                    weight(entry.values, scene, patches, j, i);
                if (fmaxf(entry.values[0], fmaxf(entry.values[1], entry.values[2])) >= (float)threshold)
                    row[count++] = entry;
            }
            if ((rows[j].entries = malloc((count + 1) * sizeof *row))) {
                memcpy(rows[j].entries, row, count * sizeof *row);
                rows[j].count = count;
            }
        }
        free(row);
    }
    for (size_t p = 0; p < out->patches; p++) {
        ok &= rows[p].entries != NULL;
        out->scatter_entries += rows[p].count;
    }
    return ok || alb_fail(error, ALB_NO_MEMORY, "out of memory for the baseline's scattering");
}

static void apply_forms(rgb *to, const form_row *rows, const rgb *from, size_t n)
{
#pragma omp parallel for schedule(static)
    for (size_t p = 0; p < n; p++) {
        double sum[3] = {0};
        for (size_t k = 0; k < rows[p].count; k++)
            for (int c = 0; c < 3; c++)
                sum[c] += (double)rows[p].entries[k].value * from[rows[p].entries[k].patch][c];
        memcpy(to[p], sum, sizeof sum);
    }
}

static void apply_scatter(rgb *to, const scatter_row *rows, const rgb *from, size_t n)
{
#pragma omp parallel for schedule(static)
    for (size_t p = 0; p < n; p++) {
        double sum[3] = {0};
        for (size_t k = 0; k < rows[p].count; k++)
            for (int c = 0; c < 3; c++)
                sum[c] += (double)rows[p].entries[k].values[c] * from[rows[p].entries[k].patch][c];
        memcpy(to[p], sum, sizeof sum);
    }
}

// B <- S'(E + F B) until the change is 1e-3 of S'E.
static void iterate(recipe *out, const form_row *forms, const scatter_row *scatter, const alb_solution *s, rgb *next)
{
    const size_t n = out->patches;
    const double start_s = alb_clock_s();
    double change = 1, first = 1;
    for (out->products = 0; out->products < 500 && change > 1e-3 * first; out->products++) {
        apply_forms(out->irradiance, forms, (const rgb *)out->radiosity, n);
        for (size_t p = 0; p < n; p++)
            for (int c = 0; c < 3; c++)
                out->irradiance[p][c] += s->irradiance[p][c];
        apply_scatter(next, scatter, (const rgb *)out->irradiance, n);
        change = 0;
        for (size_t p = 0; p < n; p++)
            for (int c = 0; c < 3; c++) {
                next[p][c] += s->lamps_direct ? 0 : s->exitance[p][c];
                change += s->patches.areas_mm2[p] * pow(next[p][c] - out->radiosity[p][c], 2);
                out->radiosity[p][c] = next[p][c];
            }
        change = sqrt(change);
        first = out->products ? first : change;
    }
    out->solve_seconds = alb_clock_s() - start_s;
    apply_forms(out->irradiance, forms, (const rgb *)out->radiosity, n);
}

bool recipe_run(recipe *out, const alb_scene *scene, const alb_solution *solution, int hemicube_side, double threshold,
                alb_error *error)
{
    const size_t n = solution->patches.count;
    *out = (recipe){.patches = n};
    form_row *forms = alb_allocate(n, sizeof *forms, error);
    scatter_row *scatter = alb_allocate(n, sizeof *scatter, error);
    rgb *next = alb_allocate(n, sizeof *next, error);
    out->irradiance = alb_allocate(n, sizeof *out->irradiance, error);
    out->radiosity = alb_allocate(n, sizeof *out->radiosity, error);
    double start_s = alb_clock_s();
    bool ok = forms && scatter && next && out->irradiance && out->radiosity &&
              fill_forms(forms, out, solution, hemicube_side, threshold, error);
    out->form_seconds = alb_clock_s() - start_s;
    start_s = alb_clock_s();
    ok = ok && fill_scatter(scatter, out, scene, &solution->patches, threshold, error);
    out->scatter_seconds = alb_clock_s() - start_s;
    out->bytes = 8 * out->form_entries + 3 * 8 * out->scatter_entries;
    if (ok)
        iterate(out, forms, scatter, solution, next);
    for (size_t p = 0; p < n; p++) {
        free(forms ? forms[p].entries : NULL);
        free(scatter ? scatter[p].entries : NULL);
    }
    free(forms);
    free(scatter);
    free(next);
    if (!ok)
        recipe_free(out);
    return ok;
}

void recipe_free(recipe *out)
{
    free(out->irradiance);
    free(out->radiosity);
    *out = (recipe){0};
}
