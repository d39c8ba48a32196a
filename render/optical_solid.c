// Optical paths through the volume of one body.
//
// From patch to patch: the chord where it stays inside; else the tight string in a plane section (optical_slice.c)
// where the surface says which; else, or where that turns far, the path of the voxel graph (optical_search.c) pulled
// tight: corners are left out where the next but one is seen, and replaced by the plane section through their
// neighbours.
#include "render/optical_solid.h"
#include "base/memory.h"
#include <stdlib.h>

// A section that is longer than this times its chord is compared with the graph's path; and how much longer than the
// section that may be before it is pulled, for pulling to gain so much is rare.
static const double trusted_detour = 1.2, worth_pulling = 1.15;
// Surfaces that bend by less, with curves that are longer than the chord by less, are followed and not looked into.
static const double flat_cosine = 0.85, flat_detour = 1.02;
static const double true_corner = 0.3; // radians
enum { VOXELS_MOST = 6000000, VOXELS_LEAST = 20000, VOXELS_A_PATCH = 100, TOUCHES = 16 };

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
    const size_t most = VOXELS_LEAST + VOXELS_A_PATCH * body->count;
    if (alb_voxels_create(&solid->voxels, (const alb_vector(*)[3])solid->net.triangles, solid->net.count,
                          0.8 * solid->net.edge_mm, most < VOXELS_MOST ? most : VOXELS_MOST, body->closed, error) &&
        fill_starts(solid, error))
        return true;
    alb_optical_solid_free(solid);
    return false;
}

bool alb_optical_solid_prepare(alb_optical_solid *solid, double voxel_mm, double reach_mm, alb_error *error)
{
    // Slivers have next to no area for their length: never finer than the voxels, whose number is bounded.
    solid->reach_mm = reach_mm;
    return alb_turns_create(&solid->turns, solid, fmax(voxel_mm, solid->voxels.size_mm), error);
}

void alb_optical_solid_free(alb_optical_solid *solid)
{
    alb_surface_net_free(&solid->net);
    alb_voxels_free(&solid->voxels);
    alb_turns_free(&solid->turns);
    free(solid->starts);
    *solid = (alb_optical_solid){0};
}

static alb_vector node_at(const alb_turns *turns, uint32_t node)
{
    return (alb_vector){(double)turns->at[node][0], (double)turns->at[node][1], (double)turns->at[node][2]};
}

// The graph's path between two pieces of surface, with ends of its own where given; false where there is none.
static bool graph_path(alb_bends *path, alb_search *search, const alb_optical_solid *solid, uint32_t source,
                       uint32_t target, alb_vector start, alb_vector end)
{
    alb_vector chain[ALB_BENDS_MAX / 2];
    int count = 0;
    if (search->source != source)
        alb_search_run(search, solid, source);
    if (!alb_search_found(search, target))
        return false;
    for (uint32_t node = target; count < ALB_BENDS_MAX / 2; node = search->parents[node]) {
        chain[count++] = node_at(&solid->turns, node);
        if (node == source)
            break;
    }
    path->count = 0;
    path->at[path->count++] = start;
    while (count > 0)
        path->at[path->count++] = chain[--count];
    path->at[path->count++] = end;
    return true;
}

// The path around what is in the way of a chord; its length INFINITY where none was found. Its ends lie on, or
// are, the two pieces of surface.
static void go_around(alb_bends *path, alb_search *search, const alb_optical_solid *solid, uint32_t source,
                      uint32_t target, const alb_chord *chord)
{
    alb_bends other;
    alb_vector towards;
    path->count = 2, path->at[0] = chord->from, path->at[1] = chord->to;
    if (!(alb_slice_direction(&towards, solid, chord) && alb_slice_best(path, solid, chord, towards, false)) &&
        !alb_slice_any(path, solid, chord))
        path->length_mm = (double)INFINITY;
    if (path->length_mm <= trusted_detour * chord->length_mm ||
        !graph_path(&other, search, solid, source, target, chord->from, chord->to) ||
        (double)search->lengths[target] > worth_pulling * path->length_mm)
        return;
    alb_bends_pull(&other, solid);
    if (other.length_mm < path->length_mm)
        *path = other;
}

// Whether the chord is outside for no longer than rounding: through an edge or a corner.
static bool only_touches(const alb_optical_solid *solid, const alb_chord *chord)
{
    int inside = 1;
    double out = 0;
    if (chord->count < 2 || chord->count > TOUCHES)
        return false;
    for (size_t i = 0; i < chord->count; i++) {
        if (inside <= 0)
            out += chord->crossings[i].at - chord->crossings[i - 1].at;
        inside += chord->crossings[i].leaves ? -1 : 1;
    }
    return inside > 0 && out * chord->length_mm < 4 * solid->lift_mm;
}

// Whether the surface leads from one triangle to the other almost straight, and how far.
static bool is_near_flat(double *length_mm, const alb_surface_net *net, uint32_t from, uint32_t to)
{
    const double chord = alb_length(alb_sub(net->middles[to], net->middles[from]));
    return alb_dot(net->normals[from], net->normals[to]) >= flat_cosine &&
           alb_slice_along(length_mm, net, from, to, flat_detour * chord);
}

static alb_vector leg(const alb_bends *path, int i) { return alb_sub(path->at[i + 1], path->at[i]); }

// The length of the path with another end, near by: the path swings about its last true corner, unfolded from there on
// into a straight line. Bends as over a round edge, slight one by one and together, are none.
static double swing(const alb_bends *path, alb_vector end, alb_vector point)
{
    int i = path->count - 2;
    double after = alb_length(leg(path, i)), turned = 0;
    const alb_vector last = alb_unit(leg(path, i));
    for (; i > 0; i--) {
        const alb_vector before = leg(path, i - 1), next = leg(path, i);
        turned += atan2(alb_length(alb_cross(before, next)), alb_dot(before, next));
        if (!(turned < true_corner))
            break;
        after += alb_length(leg(path, i - 1));
    }
    return fmax(path->length_mm - after, 0) + alb_length(alb_add(alb_times(after, last), alb_sub(point, end)));
}

double alb_optical_solid_measure(alb_search *search, const alb_optical_solid *solid, uint32_t from, uint32_t to,
                                 alb_vector point)
{
    const alb_vector start = solid->starts[from], end = solid->starts[to], source = solid->net.middles[from],
                     middle = solid->net.middles[to];
    alb_bends path;
    double length;
    if (from != to && is_near_flat(&length, &solid->net, from, to))
        return alb_length(alb_add(alb_times(length, alb_unit(alb_sub(middle, source))), alb_sub(point, middle)));
    if (from == to || alb_voxels_inside(&solid->voxels, start, end))
        return alb_length(alb_sub(point, source));
    const alb_chord chord = alb_chord_between(solid, start, end);
    if (only_touches(solid, &chord))
        return alb_length(alb_sub(point, source));
    go_around(&path, search, solid, solid->turns.of_triangle[from], solid->turns.of_triangle[to], &chord);
    return swing(&path, middle, point);
}
