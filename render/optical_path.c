// Which way the paths of a body are found, and all that is asked of them from outside.
#include "render/optical_path.h"
#include "base/memory.h"
#include "render/optical_solid.h"
#include <stdio.h>
#include <stdlib.h>

const char *const alb_optical_kind_names[ALB_OPTICAL_KINDS] = {"convex", "solid", "sheet"};

struct alb_optical_memory {
    alb_search search;
};

bool alb_optical_paths_create(alb_optical_paths *paths, const alb_body *body, const alb_patches *patches,
                              const alb_optical_options *options, alb_error *error)
{
    *paths = (alb_optical_paths){.reach_mm = options->reach_mm > 0 ? options->reach_mm : (double)INFINITY,
                                 .patches = patches};
    if (body->convex || body->count == 0) {
        snprintf(paths->description, sizeof paths->description, "convex: every path is straight");
        return true;
    }
    double longest = 0;
    for (size_t i = 0; i < body->count; i++)
        longest += sqrt(patches->areas_mm2[body->patches[i]]);
    paths->kind = ALB_OPTICAL_SOLID;
    paths->voxel_mm = options->voxel_mm > 0 ? options->voxel_mm : 3 * longest / (double)body->count;
    if (!(paths->solid = alb_allocate(1, sizeof *paths->solid, error)) ||
        !alb_optical_solid_create(paths->solid, body, patches, paths->voxel_mm, paths->reach_mm, error)) {
        alb_optical_paths_free(paths);
        return false;
    }
    paths->unsure_voxels = paths->solid->voxels.unsure;
    return true;
}

void alb_optical_paths_free(alb_optical_paths *paths)
{
    if (paths->solid)
        alb_optical_solid_free(paths->solid);
    free(paths->solid);
    *paths = (alb_optical_paths){0};
}

bool alb_optical_workspace_create(alb_optical_workspace *work, const alb_optical_paths *paths, alb_error *error)
{
    *work = (alb_optical_workspace){0};
    if (!(work->memory = alb_allocate(1, sizeof *work->memory, error)))
        return false;
    if (paths->solid && !alb_search_create(&work->memory->search, paths->solid->turns.count, error)) {
        alb_optical_workspace_free(work);
        return false;
    }
    return true;
}

void alb_optical_workspace_free(alb_optical_workspace *work)
{
    if (work->memory)
        alb_search_free(&work->memory->search);
    free(work->memory);
    *work = (alb_optical_workspace){0};
}

void alb_optical_paths_measure(float *distances_mm, unsigned char *opposite, alb_optical_workspace *work,
                               const alb_optical_paths *paths, uint32_t from, const alb_optical_target *targets,
                               size_t count)
{
    const alb_vector start = paths->patches->centroids[from];
    for (size_t i = 0; i < count; i++) {
        const alb_optical_target *t = &targets[i];
        const alb_vector point = {(double)t->x_mm, (double)t->y_mm, (double)t->z_mm};
        double length = alb_length(alb_sub(point, start));
        if (paths->kind == ALB_OPTICAL_SOLID && length <= paths->reach_mm) {
            const alb_surface_net *net = &paths->solid->net;
            length = alb_optical_solid_measure(&work->memory->search, paths->solid, net->local[from - net->first],
                                               net->local[t->patch - net->first], alb_sub(point, net->origin));
        }
        distances_mm[i] = length <= paths->reach_mm ? (float)length : INFINITY;
        if (opposite)
            opposite[i] = 0;
    }
}
