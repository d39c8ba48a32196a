// Which way the paths of a body are found, and all that is asked of them from outside.
//
// A body is convex, a sheet or a solid. A sheet: four fifths of its area have an opposing face within ten transport
// mean free paths (there a slab reflects 1.5 % less than a half space and lets a tenth through, by the multipole's
// closed form), or it has no inside at all. Everything else is solid, walls thinner than a voxel included: their faces
// are nodes of the graph, and what is seen is decided by the triangles, not by the voxels.
#include "render/optical_path.h"
#include "base/memory.h"
#include "render/optical_solid.h"
#include <stdio.h>
#include <stdlib.h>

const char *const alb_optical_kind_names[ALB_OPTICAL_KINDS] = {"convex", "solid", "sheet"};

static const double sheet_mean_free_paths = 10, sheet_share = 0.8;

struct alb_optical_memory {
    alb_search search;
    alb_sheet_memory sheet;
};

static bool has_inside(const alb_voxels *voxels)
{
    const size_t n = (size_t)voxels->n[0] * (size_t)voxels->n[1] * (size_t)voxels->n[2];
    for (size_t i = 0; i < n; i++)
        if (voxels->state[i] == ALB_VOXEL_INSIDE)
            return true;
    return false;
}

// Three times the patches' size, or what leaves some two thousand nodes: a search takes a few milliseconds then. How
// coarse the graph is decides which way a path goes, not its length: that is pulled tight about the triangles.
static double default_voxel_mm(const alb_body *body, const alb_patches *patches)
{
    double size = 0;
    for (size_t i = 0; i < body->count; i++)
        size += sqrt(patches->areas_mm2[body->patches[i]]);
    return fmax(3, sqrt((double)body->count / 1000)) * size / (double)body->count;
}

static void describe(alb_optical_paths *paths, const alb_body *body, double share, double limit_mm)
{
    char *text = paths->description;
    const size_t size = sizeof paths->description;
    int used = 0;
    if (paths->kind == ALB_OPTICAL_SHEET)
        used = snprintf(text, size,
                        "sheet, median thickness %.3g mm: %.0f %% of its area within %.3g mm of an opposing face",
                        paths->thickness_mm, 100 * share, limit_mm);
    else if (limit_mm > 0)
        used = snprintf(text, size,
                        "solid, median thickness %.3g mm: %.0f %% of its area within %.3g mm of an opposing face; "
                        "voxels of %.3g mm",
                        paths->thickness_mm, 100 * share, limit_mm, paths->voxel_mm);
    else
        used = snprintf(text, size, "solid, voxels of %.3g mm", paths->voxel_mm);
    if (!body->closed && used > 0 && (size_t)used < size)
        snprintf(text + used, size - (size_t)used, "; the surface is open, %zu voxels are not clearly in or out",
                 paths->unsure_voxels);
}

// Takes the thickness and makes it a sheet where that says so.
static bool try_sheet(alb_optical_paths *paths, double *share, double limit_mm, alb_error *error)
{
    alb_optical_solid *solid = paths->solid;
    double longest = 0;
    for (int a = 0; a < 3; a++)
        longest = fmax(longest, solid->voxels.n[a] * solid->voxels.size_mm);
    if (!(paths->sheet = alb_allocate(1, sizeof *paths->sheet, error)) ||
        !alb_optical_sheet_create(paths->sheet, solid, longest, error))
        return false;
    paths->thickness_mm = paths->sheet->median_mm;
    *share = alb_optical_sheet_share(paths->sheet, &solid->net, limit_mm);
    if (*share >= sheet_share || !has_inside(&solid->voxels)) {
        paths->kind = ALB_OPTICAL_SHEET;
        alb_voxels_free(&solid->voxels);
        return alb_optical_sheet_prepare(paths->sheet, &solid->net, limit_mm, error);
    }
    alb_optical_sheet_free(paths->sheet);
    free(paths->sheet);
    paths->sheet = NULL;
    return true;
}

static size_t bytes_of(const alb_optical_paths *paths)
{
    const alb_surface_net *net = &paths->solid->net;
    size_t bytes = net->count * (5 * sizeof(alb_vector) + 4 * sizeof(uint32_t) + 3 * sizeof(alb_door)) +
                   alb_voxels_bytes(&paths->solid->voxels);
    if (paths->sheet)
        bytes += net->count * (2 * sizeof(uint32_t) + 1 + sizeof(alb_vector) + sizeof(double)) +
                 alb_geodesic_surface_bytes(&paths->sheet->surface);
    return bytes + paths->solid->turns.count * 20 + net->count * (sizeof(uint32_t) + sizeof(alb_vector));
}

bool alb_optical_paths_create(alb_optical_paths *paths, const alb_body *body, const alb_patches *patches,
                              const alb_optical_options *options, alb_error *error)
{
    const double limit_mm = sheet_mean_free_paths * options->mean_free_path_mm;
    double share = 0;
    *paths = (alb_optical_paths){.reach_mm = options->reach_mm > 0 ? options->reach_mm : (double)INFINITY,
                                 .patches = patches};
    if (body->count == 0 || (body->convex && !(limit_mm > 0))) {
        snprintf(paths->description, sizeof paths->description, "convex: every path is straight");
        return true;
    }
    if (!(paths->solid = alb_allocate(1, sizeof *paths->solid, error)) ||
        !alb_optical_solid_create(paths->solid, body, patches, error))
        goto failed;
    paths->kind = ALB_OPTICAL_SOLID;
    paths->unsure_voxels = paths->solid->voxels.unsure;
    if (limit_mm > 0 && !try_sheet(paths, &share, limit_mm, error))
        goto failed;
    if (paths->kind == ALB_OPTICAL_SOLID && body->convex) {
        paths->kind = ALB_OPTICAL_CONVEX;
        alb_optical_solid_free(paths->solid);
        free(paths->solid);
        paths->solid = NULL;
        snprintf(paths->description, sizeof paths->description,
                 "convex, median thickness %.3g mm: every path is straight", paths->thickness_mm);
        return true;
    }
    if (paths->kind == ALB_OPTICAL_SOLID) {
        paths->voxel_mm = options->voxel_mm > 0 ? options->voxel_mm : default_voxel_mm(body, patches);
        if (!alb_optical_solid_prepare(paths->solid, paths->voxel_mm, paths->reach_mm, error))
            goto failed;
        paths->voxel_mm = paths->solid->turns.size_mm;
    }
    describe(paths, body, share, limit_mm);
    paths->bytes = bytes_of(paths);
    return true;
failed:
    alb_optical_paths_free(paths);
    return false;
}

void alb_optical_paths_free(alb_optical_paths *paths)
{
    if (paths->solid)
        alb_optical_solid_free(paths->solid);
    if (paths->sheet)
        alb_optical_sheet_free(paths->sheet);
    free(paths->solid);
    free(paths->sheet);
    *paths = (alb_optical_paths){0};
}

alb_sheet_face alb_optical_paths_face(const alb_optical_paths *paths, uint32_t patch)
{
    if (paths->kind != ALB_OPTICAL_SHEET)
        return ALB_RIM;
    const alb_surface_net *net = &paths->solid->net;
    return (alb_sheet_face)paths->sheet->sides[net->local[patch - net->first]];
}

bool alb_optical_workspace_create(alb_optical_workspace *work, const alb_optical_paths *paths, alb_error *error)
{
    *work = (alb_optical_workspace){0};
    if (!(work->memory = alb_allocate(1, sizeof *work->memory, error)))
        return false;
    if ((paths->kind == ALB_OPTICAL_SOLID &&
         !alb_search_create(&work->memory->search, paths->solid->turns.count, error)) ||
        (paths->kind == ALB_OPTICAL_SHEET &&
         !alb_geodesic_memory_create(&work->memory->sheet.geodesic, &paths->sheet->surface, error))) {
        alb_optical_workspace_free(work);
        return false;
    }
    return true;
}

void alb_optical_workspace_free(alb_optical_workspace *work)
{
    if (work->memory) {
        alb_search_free(&work->memory->search);
        alb_geodesic_memory_free(&work->memory->sheet.geodesic);
    }
    free(work->memory);
    *work = (alb_optical_workspace){0};
}

static alb_vector point_of(const alb_optical_target *t)
{
    return (alb_vector){(double)t->x_mm, (double)t->y_mm, (double)t->z_mm};
}

static void measure_solid(float *distances_mm, alb_search *search, const alb_optical_paths *paths, uint32_t from,
                          const alb_optical_target *targets, size_t count)
{
    const alb_surface_net *net = &paths->solid->net;
    const alb_vector start = paths->patches->centroids[from];
    for (size_t i = 0; i < count; i++) {
        const alb_vector point = point_of(&targets[i]);
        distances_mm[i] = INFINITY;
        if (alb_length(alb_sub(point, start)) <= paths->reach_mm)
            distances_mm[i] = (float)alb_optical_solid_measure(search, paths->solid, net->local[from - net->first],
                                                               net->local[targets[i].patch - net->first],
                                                               alb_sub(point, net->origin));
    }
}

static void measure_sheet(float *distances_mm, unsigned char *opposite, alb_sheet_memory *memory,
                          const alb_optical_paths *paths, uint32_t from, const alb_optical_target *targets,
                          size_t count)
{
    const alb_surface_net *net = &paths->solid->net;
    uint32_t to[ALB_SHEET_TARGETS];
    alb_vector points[ALB_SHEET_TARGETS];
    for (size_t done = 0, batch; done < count; done += batch) {
        batch = count - done < ALB_SHEET_TARGETS ? count - done : ALB_SHEET_TARGETS;
        for (size_t i = 0; i < batch; i++) {
            to[i] = net->local[targets[done + i].patch - net->first];
            points[i] = alb_sub(point_of(&targets[done + i]), net->origin);
        }
        alb_optical_sheet_measure(distances_mm + done, opposite ? opposite + done : NULL, memory, paths->sheet, net,
                                  net->local[from - net->first], to, points, batch, paths->reach_mm);
    }
}

void alb_optical_paths_measure(float *distances_mm, unsigned char *opposite, alb_optical_workspace *work,
                               const alb_optical_paths *paths, uint32_t from, const alb_optical_target *targets,
                               size_t count)
{
    for (size_t i = 0; opposite && i < count; i++)
        opposite[i] = 0;
    if (paths->kind == ALB_OPTICAL_SHEET)
        measure_sheet(distances_mm, opposite, &work->memory->sheet, paths, from, targets, count);
    else if (paths->kind == ALB_OPTICAL_SOLID)
        measure_solid(distances_mm, &work->memory->search, paths, from, targets, count);
    else
        for (size_t i = 0; i < count; i++)
            distances_mm[i] = (float)alb_length(alb_sub(point_of(&targets[i]), paths->patches->centroids[from]));
    for (size_t i = 0; i < count; i++)
        if (!((double)distances_mm[i] <= paths->reach_mm))
            distances_mm[i] = INFINITY;
}
