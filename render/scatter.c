// S' in density form (A_i area, c_j centroid of the exit patch, s(r) the profile, 1/mm^2):
//     B_j = sum_i S'_ji E_i,    S'_ji = (1/A_j) integral_Aj integral_Ai s  ~=  integral_Ai s(|c_j - x|) dA(x)
// The paper's form (Sheng et al. 2014, eq. 8) divides by A_i instead and is right only for patches of one area.
//     opaque patch        S'_jj = reflectance, nothing else
//     self and near       the exact integral over the source triangle (scatter_triangle.c)
//     far                 A_i s(|c_j - c_i|), s from a table of 16,384 entries over the body's diagonal D, linear:
//                         relative error (b D / 16384)^2 / 8 for exp(-b r), 1e-5 at b D = 150
// The centroid rule and how near is near: scatter_body.c.
// Distances are straight lines: exact inside a convex body, too short otherwise (closed, convex: the caller warns).
// Between the faces of a slab the transmission profile acts at the lateral distance; on one face the reflection
// profile; from and to the edge faces the reflection profile at the straight distance, for want of a measurement there.
// Stops being true where the profile's plane geometry does: within a diffusion length of edges, and for solids thinner
// than that, whose row sums then show it by exceeding the profile's total.
#include "render/scatter.h"
#include "base/memory.h"
#include "render/scatter_body.h"
#include "render/scatter_pairs.h"
#include <stdlib.h>
#include <string.h>

// Local and near terms of the sums.
static void add_near_sums(alb_scatter *scatter, const alb_patches *patches)
{
    for (size_t j = 0; j < scatter->patch_count; j++) {
        for (int c = 0; c < 3; c++) {
            scatter->row_sums[j][c] += scatter->local[j][c];
            scatter->column_sums[j][c] += scatter->local[j][c];
        }
        for (size_t k = scatter->row_starts[j]; k < scatter->row_starts[j + 1]; k++) {
            const size_t i = scatter->sources[k];
            const double ratio = patches->areas_mm2[j] / patches->areas_mm2[i];
            for (int c = 0; c < 3; c++) {
                scatter->row_sums[j][c] += (double)scatter->weights[k][c];
                scatter->column_sums[i][c] += (double)scatter->weights[k][c] * ratio;
            }
        }
    }
}

static bool fill_rows(alb_scatter *scatter, const alb_patches *patches, alb_error *error)
{
    for (size_t b = 0; b < scatter->body_count; b++)
        alb_scatter_add_far(scatter->row_sums, scatter, &scatter->bodies[b], &scatter->bodies[b].sources);
    for (size_t p = 0; p < patches->count; p++)
        scatter->row_starts[p + 1] += scatter->row_starts[p];
    const size_t pairs = scatter->row_starts[patches->count];
    if (!(scatter->sources = alb_allocate(pairs, sizeof *scatter->sources, error)) ||
        !(scatter->weights = alb_allocate(pairs, sizeof *scatter->weights, error)))
        return false;
    for (size_t b = 0; b < scatter->body_count; b++) {
        const alb_scatter_body *body = &scatter->bodies[b];
#pragma omp parallel for schedule(dynamic, 16)
        for (size_t j = 0; j < body->sources.count; j++)
            alb_scatter_fill_near(scatter, body, patches, j);
    }
    add_near_sums(scatter, patches);
    return true;
}

bool alb_scatter_create(alb_scatter *scatter, const alb_patches *patches, const uint16_t *materials,
                        const alb_surface *surfaces, alb_error *error)
{
    const size_t n = patches->count;
    bool ok = false;
    alb_bodies found = {0};
    int *labels = alb_allocate(n, sizeof *labels, error);
    *scatter = (alb_scatter){.patch_count = n};
    if (!labels || !(scatter->local = alb_allocate(n, sizeof *scatter->local, error)) ||
        !(scatter->row_sums = alb_allocate(n, sizeof *scatter->row_sums, error)) ||
        !(scatter->column_sums = alb_allocate(n, sizeof *scatter->column_sums, error)) ||
        !(scatter->row_starts = alb_allocate(n + 1, sizeof *scatter->row_starts, error)))
        goto done;
    for (size_t p = 0; p < n; p++) {
        const alb_surface *surface = &surfaces[materials[p]];
        labels[p] = surface->scatters ? materials[p] : -1;
        memcpy(scatter->local[p], surface->reflectance, sizeof scatter->local[p]);
    }
    if (!alb_bodies_find(&found, patches, labels, error) ||
        !(scatter->bodies = alb_allocate(found.count, sizeof *scatter->bodies, error)))
        goto done;
    for (; scatter->body_count < found.count; scatter->body_count++) {
        const alb_body *body = &found.bodies[scatter->body_count];
        if (!alb_scatter_body_create(&scatter->bodies[scatter->body_count], body, patches,
                                     &surfaces[materials[body->patches[0]]], error))
            goto done;
    }
    ok = fill_rows(scatter, patches, error);
    for (size_t b = 0; b < scatter->body_count; b++) // what the products need no longer
        for (int side = 0; side < ALB_SIDES; side++) {
            free(scatter->bodies[b].radials[side].discs);
            scatter->bodies[b].radials[side].discs = NULL;
            scatter->bodies[b].radials[side].profiles = NULL;
        }
done:
    free(labels);
    alb_bodies_free(&found);
    if (!ok)
        alb_scatter_free(scatter);
    return ok;
}

void alb_scatter_free(alb_scatter *scatter)
{
    for (size_t b = 0; b < scatter->body_count; b++)
        alb_scatter_body_free(&scatter->bodies[b]);
    free(scatter->bodies);
    free(scatter->local);
    free(scatter->row_sums);
    free(scatter->column_sums);
    free(scatter->row_starts);
    free(scatter->sources);
    free(scatter->weights);
    *scatter = (alb_scatter){0};
}

// The sources that light falls on, in their runs.
static void take_lit(alb_sources *lit, const alb_scatter_body *body, const double (*irradiance)[3])
{
    const alb_sources *all = &body->sources;
    lit->count = 0;
    for (int run = 0; run < 3; run++) {
        lit->starts[run] = lit->count;
        for (size_t i = all->starts[run]; i < all->starts[run + 1]; i++) {
            const double *light = irradiance[body->patches[i]];
            if (light[0] == 0 && light[1] == 0 && light[2] == 0)
                continue;
            const size_t to = lit->count++;
            lit->x_mm[to] = all->x_mm[i], lit->y_mm[to] = all->y_mm[i], lit->z_mm[to] = all->z_mm[i];
            for (int side = 0; side < ALB_SIDES; side++)
                lit->near2_mm2[side][to] = all->near2_mm2[side][i];
            for (int c = 0; c < 3; c++)
                lit->amounts[to][c] = all->amounts[i][c] * light[c];
        }
    }
    lit->starts[3] = lit->count;
}

void alb_scatter_apply(double (*out)[3], const alb_scatter *scatter, const double (*irradiance)[3])
{
#pragma omp parallel for schedule(static)
    for (size_t j = 0; j < scatter->patch_count; j++) {
        double sum[3];
        for (int c = 0; c < 3; c++)
            sum[c] = scatter->local[j][c] * irradiance[j][c];
        for (size_t k = scatter->row_starts[j]; k < scatter->row_starts[j + 1]; k++)
            for (int c = 0; c < 3; c++)
                sum[c] += (double)scatter->weights[k][c] * irradiance[scatter->sources[k]][c];
        memcpy(out[j], sum, sizeof sum);
    }
    for (size_t b = 0; b < scatter->body_count; b++) {
        alb_scatter_body *body = &scatter->bodies[b];
        take_lit(&body->lit, body, irradiance);
        alb_scatter_add_far(out, NULL, body, &body->lit);
    }
}

// Light on one face, seen from the other.
bool alb_scatter_apply_across(double (*out)[3], const alb_scatter *scatter, const double (*irradiance)[3],
                              alb_error *error)
{
    const size_t n = scatter->patch_count;
    double(*lit)[3] = alb_allocate(n, sizeof *lit, error), (*sent)[3] = alb_allocate(n, sizeof *sent, error);
    memset(out, 0, n * sizeof *out);
    for (int run = 0; lit && sent && run < 3; run += 2) {
        memset(lit, 0, n * sizeof *lit);
        for (size_t b = 0; b < scatter->body_count; b++) {
            const alb_scatter_body *body = &scatter->bodies[b];
            for (size_t i = body->sources.starts[run]; i < body->sources.starts[run + 1]; i++)
                memcpy(lit[body->patches[i]], irradiance[body->patches[i]], sizeof *lit);
        }
        alb_scatter_apply(sent, scatter, (const double(*)[3])lit);
        for (size_t b = 0; b < scatter->body_count; b++) {
            const alb_scatter_body *body = &scatter->bodies[b];
            for (size_t i = body->sources.starts[2 - run]; i < body->sources.starts[3 - run]; i++)
                memcpy(out[body->patches[i]], sent[body->patches[i]], sizeof *out);
        }
    }
    const bool ok = lit && sent;
    free(lit);
    free(sent);
    return ok;
}

static size_t sources_bytes(const alb_sources *sources)
{
    return sources->starts[3] * (5 * sizeof(float) + sizeof *sources->amounts);
}

size_t alb_scatter_bytes(const alb_scatter *scatter)
{
    const size_t n = scatter->patch_count, pairs = n ? scatter->row_starts[n] : 0;
    size_t bytes = n * (3 * sizeof *scatter->local + sizeof *scatter->row_starts) +
                   pairs * (sizeof *scatter->sources + sizeof *scatter->weights);
    for (size_t b = 0; b < scatter->body_count; b++) {
        const alb_scatter_body *body = &scatter->bodies[b];
        bytes += body->sources.count * sizeof *body->patches + 2 * sources_bytes(&body->sources);
        for (int side = 0; side < ALB_SIDES; side++)
            bytes += body->radials[side].values ? (ALB_SCATTER_TABLE + 2) * sizeof *body->radials[side].values : 0;
    }
    return bytes;
}
