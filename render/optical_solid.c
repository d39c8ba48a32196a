// Optical paths through the volume of one body.
//
// From patch to patch: the chord where it stays inside; else the tight string in a plane section (optical_slice.c)
// where the surface says which; else, or where that turns far, the path of the voxel graph (optical_search.c) pulled
// tight: corners are left out where the next but one is seen, and replaced by the plane section through their
// neighbours.
#include "render/optical_solid.h"
#include "base/memory.h"
#include <stdlib.h>
#include <string.h>

// A section that is longer than this times its chord is compared with the graph's path.
static const double trusted_detour = 1.2;
enum { FINE_VOXELS = 6000000, ROUNDS = 3, CHAIN = 64 };

static bool fill_starts(alb_optical_solid *solid, alb_error *error)
{
    const alb_surface_net *net = &solid->net;
    if (!(solid->starts = alb_allocate(net->count, sizeof *solid->starts, error)))
        return false;
    for (size_t i = 0; i < net->count; i++) {
        const alb_vector *t = net->triangles[i];
        double longest = 0;
        for (int k = 0; k < 3; k++)
            longest = fmax(longest, alb_length(alb_sub(t[(k + 1) % 3], t[k])));
        const double height = alb_length(alb_cross(alb_sub(t[1], t[0]), alb_sub(t[2], t[0]))) / longest;
        solid->starts[i] = alb_sub(net->middles[i], alb_times(fmin(1e-3 * height, solid->lift_mm), net->normals[i]));
    }
    return true;
}

bool alb_optical_solid_create(alb_optical_solid *solid, const alb_body *body, const alb_patches *patches,
                              double voxel_mm, double reach_mm, alb_error *error)
{
    *solid = (alb_optical_solid){.reach_mm = reach_mm};
    if (!alb_surface_net_create(&solid->net, body, patches, error))
        return false;
    solid->lift_mm = 1e-4 * solid->net.edge_mm;
    if (alb_voxels_create(&solid->voxels, (const alb_vector(*)[3])solid->net.triangles, solid->net.count,
                          0.8 * solid->net.edge_mm, FINE_VOXELS, body->closed, error) &&
        fill_starts(solid, error) && alb_turns_create(&solid->turns, solid, voxel_mm, error))
        return true;
    alb_optical_solid_free(solid);
    return false;
}

void alb_optical_solid_free(alb_optical_solid *solid)
{
    alb_surface_net_free(&solid->net);
    alb_voxels_free(&solid->voxels);
    alb_turns_free(&solid->turns);
    free(solid->starts);
    *solid = (alb_optical_solid){0};
}

static void put(alb_bends *path, alb_vector at)
{
    if (path->count < ALB_BENDS_MAX)
        path->at[path->count++] = at;
}

// Leaves out corners whose neighbours see each other.
static bool shorten(alb_bends *path, const alb_optical_solid *solid)
{
    int kept = 1;
    for (int i = 1; i + 1 < path->count; i++)
        if (!alb_voxels_inside(&solid->voxels, path->at[kept - 1], path->at[i + 1]))
            path->at[kept++] = path->at[i];
    path->at[kept++] = path->at[path->count - 1];
    const bool fewer = kept < path->count;
    path->count = kept;
    return fewer;
}

// Replaces corner i by the section through its neighbours and itself, where that is shorter.
static int pull(alb_bends *path, const alb_optical_solid *solid, int i)
{
    alb_bends section;
    const alb_vector before = path->at[i - 1], after = path->at[i + 1];
    const double now = alb_length(alb_sub(path->at[i], before)) + alb_length(alb_sub(path->at[i], after));
    if (!alb_slice(&section, solid, before, after, alb_sub(path->at[i], before)) || !(section.length_mm < now))
        return 1;
    const int more = section.count - 3; // corners beyond the one replaced
    if (path->count + more > ALB_BENDS_MAX)
        return 1;
    memmove(&path->at[i + 1 + more], &path->at[i + 1], (size_t)(path->count - i - 1) * sizeof *path->at);
    memcpy(&path->at[i], &section.at[1], (size_t)(section.count - 2) * sizeof *path->at);
    path->count += more;
    return section.count - 2 > 0 ? section.count - 2 : 0;
}

// Length; a leg that is blocked (within a piece of surface, or between joined ones) is measured along its section.
static double length_of(const alb_bends *path, const alb_optical_solid *solid)
{
    double length = 0;
    for (int i = 1; i < path->count; i++) {
        const alb_vector a = path->at[i - 1], b = path->at[i];
        alb_bends section;
        alb_vector towards;
        section.length_mm = alb_length(alb_sub(b, a));
        if (!alb_voxels_inside(&solid->voxels, a, b) && alb_slice_direction(&towards, solid, a, b) &&
            !alb_slice(&section, solid, a, b, towards))
            section.length_mm = alb_length(alb_sub(b, a));
        length += section.length_mm;
    }
    return length;
}

// The graph's path, pulled tight; *last is its last corner before the end. INFINITY where there is none.
static double graph_path(alb_vector *last, alb_search *search, const alb_optical_solid *solid, uint32_t from,
                         uint32_t to)
{
    const alb_turns *turns = &solid->turns;
    const uint32_t source = turns->of_triangle[from], target = turns->of_triangle[to];
    if (search->source != source)
        alb_search_run(search, solid, source);
    if (search->stamps[target] != search->stamp || !(search->states[target] & 4))
        return (double)INFINITY;
    alb_bends path = {.count = 0};
    put(&path, solid->starts[to]);
    for (uint32_t node = target;; node = search->parents[node]) {
        put(&path, (alb_vector){(double)turns->at[node][0], (double)turns->at[node][1], (double)turns->at[node][2]});
        if (node == source || path.count >= CHAIN)
            break;
    }
    put(&path, solid->starts[from]); // the path runs backwards
    shorten(&path, solid);
    for (int round = 0; round < ROUNDS; round++) {
        for (int i = 1; i + 1 < path.count;)
            i += pull(&path, solid, i);
        if (!shorten(&path, solid))
            break;
    }
    *last = path.at[1];
    return length_of(&path, solid);
}

double alb_optical_solid_measure(alb_search *search, const alb_optical_solid *solid, uint32_t from, uint32_t to,
                                 alb_vector point)
{
    const alb_vector start = solid->starts[from], end = solid->starts[to], middle = solid->net.middles[to];
    const double chord = alb_length(alb_sub(middle, solid->net.middles[from]));
    if (from == to || alb_voxels_inside(&solid->voxels, start, end))
        return alb_length(alb_sub(point, solid->net.middles[from]));
    alb_bends section;
    alb_vector towards, last = start;
    double best = (double)INFINITY;
    if (alb_slice_direction(&towards, solid, start, end) && alb_slice(&section, solid, start, end, towards)) {
        best = section.length_mm;
        last = section.at[section.count - 2];
    }
    if (best > trusted_detour * chord) {
        alb_vector corner = {0};
        const double other = graph_path(&corner, search, solid, from, to);
        if (other < best)
            best = other, last = corner;
    }
    return best - alb_length(alb_sub(middle, last)) + alb_length(alb_sub(point, last));
}
