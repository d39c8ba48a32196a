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
static const double worth_pulling = 1.15; // of the section; what pulling gains at most, commonly
enum { FINE_VOXELS = 6000000, ROUNDS = 3, CHAIN = 64, TOUCHES = 16 };

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
                              alb_error *error)
{
    *solid = (alb_optical_solid){0};
    if (!alb_surface_net_create(&solid->net, body, patches, error))
        return false;
    solid->lift_mm = 1e-4 * solid->net.edge_mm;
    if (alb_voxels_create(&solid->voxels, (const alb_vector(*)[3])solid->net.triangles, solid->net.count,
                          0.8 * solid->net.edge_mm, FINE_VOXELS, body->closed, error) &&
        fill_starts(solid, error))
        return true;
    alb_optical_solid_free(solid);
    return false;
}

bool alb_optical_solid_prepare(alb_optical_solid *solid, double voxel_mm, double reach_mm, alb_error *error)
{
    solid->reach_mm = reach_mm;
    return alb_turns_create(&solid->turns, solid, voxel_mm, error);
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

static double between(const alb_bends *path, int first, int last)
{
    double length = 0;
    for (int i = first; i < last; i++)
        length += alb_length(alb_sub(path->at[i + 1], path->at[i]));
    return length;
}

// Replaces what lies between two corners by the section through them and the mean of the corners, or the best one
// turned from it, where that is shorter.
static bool pull(alb_bends *path, const alb_optical_solid *solid, int first, int last, bool turn)
{
    alb_bends section;
    const alb_vector from = path->at[first], to = path->at[last], along = alb_unit(alb_sub(to, from));
    alb_vector towards = {0};
    for (int i = first + 1; i < last; i++) {
        const alb_vector at = alb_sub(path->at[i], from);
        towards = alb_add(towards, alb_sub(at, alb_times(alb_dot(at, along), along)));
    }
    if (!(turn ? alb_slice_best : alb_slice)(&section, solid, from, to, towards) ||
        !(section.length_mm < between(path, first, last)))
        return false;
    const int more = section.count - (last - first + 1); // corners
    if (path->count + more > ALB_BENDS_MAX)
        return false;
    memmove(&path->at[last + more], &path->at[last], (size_t)(path->count - last) * sizeof *path->at);
    memcpy(&path->at[first + 1], &section.at[1], (size_t)(section.count - 2) * sizeof *path->at);
    path->count += more;
    return true;
}

// All of it, then halves that overlap, then quarters, until corner by corner; less where the whole could be replaced
// and parts gain nothing.
static void tighten(alb_bends *path, const alb_optical_solid *solid)
{
    const bool whole = pull(path, solid, 0, path->count - 1, true);
    for (int span = path->count / 2; span > 1; span = span > 3 ? span / 2 : span - 1) {
        const double before = between(path, 0, path->count - 1);
        for (int first = 0; first + 2 < path->count; first += (span + 1) / 2)
            pull(path, solid, first, first + span < path->count - 1 ? first + span : path->count - 1, false);
        if (whole && between(path, 0, path->count - 1) > (1 - 3e-4) * before)
            break;
    }
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

// The graph's path: its corners, backwards, with the pieces of surface at both ends. False where there is none.
static bool graph_path(alb_bends *path, alb_search *search, const alb_optical_solid *solid, uint32_t from, uint32_t to)
{
    const alb_turns *turns = &solid->turns;
    const uint32_t source = turns->of_triangle[from], target = turns->of_triangle[to];
    if (search->source != source)
        alb_search_run(search, solid, source);
    if (!alb_search_found(search, target))
        return false;
    path->count = 0;
    put(path, solid->starts[to]);
    for (uint32_t node = target;; node = search->parents[node]) {
        put(path, (alb_vector){(double)turns->at[node][0], (double)turns->at[node][1], (double)turns->at[node][2]});
        if (node == source || path->count >= CHAIN)
            break;
    }
    put(path, solid->starts[from]);
    return true;
}

// Pulls it tight and measures it; *last is its last corner before the end.
static double pulled(alb_vector *last, alb_bends *path, const alb_optical_solid *solid)
{
    shorten(path, solid);
    double length = length_of(path, solid);
    for (int round = 0; round < ROUNDS; round++) {
        tighten(path, solid);
        shorten(path, solid);
        const double before = length;
        length = fmin(length, length_of(path, solid));
        if (length > (1 - 1e-4) * before)
            break;
    }
    *last = path->at[1];
    return length;
}

// Its length to first order: from end to end without the pieces of surface there.
static double estimate(const alb_bends *path)
{
    double length = 0;
    for (int i = 1; i < path->count; i++) {
        const bool end = path->count > 4 && (i == 1 || i == path->count - 1);
        if (!end && path->count > 4 && (i == 2 || i == path->count - 2))
            length += alb_length(alb_sub(path->at[i == 2 ? 0 : i + 1], path->at[i == 2 ? 2 : i - 1]));
        else if (!end)
            length += alb_length(alb_sub(path->at[i], path->at[i - 1]));
    }
    return length;
}

// Whether the chord is outside for no longer than rounding: through an edge or a corner.
static bool only_touches(const alb_optical_solid *solid, alb_vector start, alb_vector end)
{
    alb_crossing crossings[TOUCHES];
    const size_t count = alb_voxels_crossings(crossings, TOUCHES, &solid->voxels, start, end);
    int inside = 1;
    double out = 0;
    if (count < 2 || count > TOUCHES)
        return false;
    for (size_t i = 0; i < count; i++) {
        if (inside <= 0)
            out += crossings[i].at - crossings[i - 1].at;
        inside += crossings[i].leaves ? -1 : 1;
    }
    return inside > 0 && out * alb_length(alb_sub(end, start)) < 4 * solid->lift_mm;
}

double alb_optical_solid_measure(alb_search *search, const alb_optical_solid *solid, uint32_t from, uint32_t to,
                                 alb_vector point)
{
    const alb_vector start = solid->starts[from], end = solid->starts[to], middle = solid->net.middles[to];
    const double chord = alb_length(alb_sub(middle, solid->net.middles[from]));
    if (from == to || alb_voxels_inside(&solid->voxels, start, end) || only_touches(solid, start, end))
        return alb_length(alb_sub(point, solid->net.middles[from]));
    alb_bends path;
    alb_vector towards, last = start;
    double best = (double)INFINITY;
    if ((alb_slice_direction(&towards, solid, start, end) && alb_slice_best(&path, solid, start, end, towards)) ||
        alb_slice_any(&path, solid, start, end)) {
        best = path.length_mm;
        last = path.at[path.count - 2];
    }
    if (best > trusted_detour * chord && graph_path(&path, search, solid, from, to) &&
        estimate(&path) < worth_pulling * best) {
        alb_vector corner = {0};
        const double other = pulled(&corner, &path, solid);
        if (other < best)
            best = other, last = corner;
    }
    return best - alb_length(alb_sub(middle, last)) + alb_length(alb_sub(point, last));
}
