// How much longer light goes inside a body than the straight lines of a block: along paths (optical_path.h), searched
// from one row and taken for its neighbours as well.
#include "render/scatter_viewer.h"
#include <string.h>

// Paths from a row to the wishes' clusters, and then to the other rows.
static void measure_paths(const alb_viewer *v, uint32_t from)
{
    alb_link_workspace *work = v->work;
    const size_t n = work->wish_count, all = n + v->row_count;
    const alb_vector middle = v->tree->middle_mm;
    work->targets = alb_grow(&work->found.failed, work->targets, &work->target_capacity, 0, all, sizeof *work->targets);
    work->distances =
        alb_grow(&work->found.failed, work->distances, &work->distance_capacity, 0, all, sizeof *work->distances);
    work->opposite = alb_grow(&work->found.failed, work->opposite, &work->opposite_capacity, 0, all, 1);
    if (work->paths_of != v->paths && !work->found.failed) {
        alb_optical_workspace_free(&work->paths);
        work->found.failed = !alb_optical_workspace_create(&work->paths, v->paths, NULL);
        work->paths_of = v->paths;
    }
    if (work->found.failed)
        return;
    for (size_t k = 0; k < all; k++) {
        const alb_cluster *cluster = k < n ? &v->forest->clusters[work->wishes[k].cluster] : NULL;
        const uint32_t row = (uint32_t)(k - n), leaf = cluster ? cluster->leaf : v->first_leaf + row;
        float at[3];
        for (int i = 0; i < 3; i++)
            at[i] = cluster ? cluster->centre_mm[i] : v->at[i][row];
        work->targets[k] = (alb_optical_target){v->forest->patches[leaf], (float)(middle.x + (double)at[0]),
                                                (float)(middle.y + (double)at[1]), (float)(middle.z + (double)at[2])};
    }
    alb_optical_paths_measure(work->distances, work->opposite, &work->paths, v->paths,
                              v->forest->patches[v->first_leaf + from], work->targets, all);
}

static float chord_to(float to[3], const alb_viewer *v, uint32_t from, const float at[3])
{
    for (int i = 0; i < 3; i++)
        to[i] = at[i] - v->at[i][from];
    return sqrtf(to[0] * to[0] + to[1] * to[1] + to[2] * to[2]);
}

// How much longer the paths inside the body are than what `measure` says: of this row, for those in the mask that it
// may stand for, which is told. In a sheet they also say which face is lit, but about the rim. Beyond the reach a path
// is taken as long as that: of light so far away it matters only that it is not lost.
static unsigned find_detours(const alb_viewer *v, uint32_t from, unsigned rows)
{
    alb_link_workspace *work = v->work;
    const size_t n = work->wish_count;
    unsigned served = 1U << from;
    float to[3];
    measure_paths(v, from);
    if (work->found.failed)
        return rows;
    for (uint32_t row = 0; row < v->row_count; row++) {
        const float chord = chord_to(to, v, from, (const float[3]){v->at[0][row], v->at[1][row], v->at[2][row]});
        if (work->distances[n + row] <= 1.2F * chord) // else one patch beyond a fold of the other
            served |= rows & 1U << row;
    }
    for (size_t k = 0; k < n; k++) {
        alb_wish *wished = &work->wishes[k];
        const alb_cluster *cluster = &v->forest->clusters[wished->cluster];
        if (alb_viewer_in_sheet(v) && v->tree->face != ALB_FACE_EDGE &&
            alb_optical_paths_face(v->paths, v->forest->patches[cluster->leaf]) != ALB_RIM)
            wished->side = work->opposite[k] ? ALB_TRANSMISSION : ALB_REFLECTION;
        const float chord = chord_to(to, v, from, cluster->centre_mm);
        if (wished->side == ALB_TRANSMISSION)
            alb_viewer_project(to, v, from);
        const float straight = sqrtf(to[0] * to[0] + to[1] * to[1] + to[2] * to[2]),
                    path = fminf(work->distances[k], fmaxf((float)v->paths->reach_mm, chord)),
                    more = fabsf(path - straight) > 1e-4F * straight ? path - straight : 0;
        for (uint32_t row = 0; row < ALB_BLOCK; row++)
            if (served >> row & 1)
                work->detours[k][row] = (alb_detour){more, fmaxf(straight, cluster->radius_mm)};
    }
    return served;
}

void alb_viewer_find_detours(const alb_viewer *v)
{
    alb_link_workspace *work = v->work;
    const size_t n = work->wish_count;
    work->detours = alb_grow(&work->found.failed, work->detours, &work->detour_capacity, 0, n, sizeof *work->detours);
    if (work->found.failed || !n)
        return;
    memset(work->detours, 0, n * sizeof *work->detours);
    unsigned left = v->paths->kind == ALB_OPTICAL_CONVEX ? 0 : (1U << v->row_count) - 1;
    for (uint32_t row = v->middle_row; left; row = (row + 1) % v->row_count)
        if (left >> row & 1)
            left &= ~find_detours(v, row, left);
}
