// Shortest paths in a plane section of a body.
//
// The chord between two points of the body leaves it through one triangle and returns through another. The plane
// through the chord that contains the sum of their two normals, inwards, cuts the surface along a curve between them,
// which is followed from triangle to triangle (optical_section.c); a string drawn tight around it from end to end is
// the convex hull of the curve and the ends. About a straight edge between two planes, and about circles, spheres and
// cylinders across their axis, this plane holds the shortest path itself (for the edge: the chord meets the bisecting
// plane where the unfolded path meets the edge). Elsewhere the corners of the path are then moved along the edges of
// the mesh on which they lie, to where both sides meet the edge at one angle. What remains is second order in the angle
// between the plane and the true path.
//
// Between places near by most surfaces hardly bend. The curve itself, just inside, is a path that bounds the shortest
// one from above, as the chord does from below: where the two are alike the string about it needs no proof that it is
// inside.
#include "render/optical_section.h"
#include <string.h>

enum { SWEEPS = 3, FEW = 4 };
// Detours beyond which corners are moved along their edges, and other planes are tried: beside one that the surface
// speaks for, or beside a guess.
static const double worth_moving = 1.02, worth_turning = 1.07, worth_turning_guessed = 1.005;

alb_chord alb_chord_between(const alb_optical_solid *solid, alb_vector from, alb_vector to)
{
    const alb_vector way = alb_sub(to, from);
    alb_chord chord = {.from = from, .to = to, .along = alb_unit(way), .length_mm = alb_length(way)};
    chord.count = alb_voxels_crossings(chord.crossings, ALB_CROSSINGS_MAX, &solid->voxels, from, to);
    return chord;
}

static double root_of(double x) { return x > 0 ? sqrt(x) : 0; }

// Where on the edge, or on the line that holds it, a path from p to q over it is shortest: both unfolded into one
// plane.
static alb_vector on_edge(alb_vector a, alb_vector b, alb_vector p, alb_vector q, bool line)
{
    const alb_vector e = alb_sub(b, a), pa = alb_sub(p, a), qa = alb_sub(q, a);
    const double length = alb_length(e), zp = alb_dot(pa, e) / length, zq = alb_dot(qa, e) / length;
    const double rp = root_of(alb_dot(pa, pa) - zp * zp), rq = root_of(alb_dot(qa, qa) - zq * zq);
    const double z = rp + rq > 0 ? (zp * rq + zq * rp) / (rp + rq) : 0.5 * (zp + zq);
    return alb_add(a, alb_times(line ? z / length : z < 0 ? 0 : z > length ? 1 : z / length, e));
}

static double length_of(const alb_bends *bends)
{
    double length = 0;
    for (int i = 1; i < bends->count; i++)
        length += alb_length(alb_sub(bends->at[i], bends->at[i - 1]));
    return length;
}

// Legs that do not follow the surface, or all, must stay inside.
static bool legs_are_inside(const alb_bends *bends, const alb_cut *hull, int kept, const alb_optical_solid *solid,
                            bool all)
{
    for (int i = 0; i <= kept; i++) {
        if (!all && i > 0 && i < kept && hull[i].order - hull[i - 1].order == 1)
            continue;
        if (!alb_voxels_inside(&solid->voxels, bends->at[i], bends->at[i + 1]))
            return false;
    }
    return true;
}

// The mean normal of the triangles on both sides of the edge that is cut.
static alb_vector normal_at(const alb_cut *c, const alb_surface_net *net)
{
    const uint32_t across = net->neighbours[c->place / 3][c->place % 3];
    const alb_vector normal = net->normals[c->place / 3];
    return across == UINT32_MAX ? normal : alb_unit(alb_add(normal, net->normals[across / 3]));
}

// Measures the corners as they are, then moves them off the surface; false where a leg leaves the body. Legs of a path
// that is not shorter than most_mm are not looked at.
static bool finish(alb_bends *bends, const alb_cut *hull, int kept, const alb_optical_solid *solid, double most_mm,
                   bool all)
{
    bends->length_mm = length_of(bends);
    for (int i = 0; i < kept; i++)
        bends->at[i + 1] = alb_sub(bends->at[i + 1], alb_times(solid->lift_mm, normal_at(&hull[i], &solid->net)));
    return !(bends->length_mm < most_mm) || legs_are_inside(bends, hull, kept, solid, all);
}

// Moves the corners along their edges (lines: along the lines that hold these), each to where it is best, in turns.
static void move(alb_bends *bends, const alb_cut *hull, int kept, const alb_surface_net *net, bool lines)
{
    for (int sweep = 0; sweep < (lines ? 4 * SWEEPS : SWEEPS); sweep++)
        for (int i = 0; i < kept; i++) {
            const alb_vector *t = net->triangles[hull[i].place / 3];
            const uint32_t k = hull[i].place % 3;
            bends->at[i + 1] = on_edge(t[k], t[(k + 1) % 3], bends->at[i], bends->at[i + 2], lines);
        }
}

// The path over the hull's corners: moved along their edges if that stays inside, and past these where a few edges,
// each as it may be one of many in a line, are all that it turns about.
static bool string(alb_bends *bends, const alb_cut *hull, int kept, const alb_optical_solid *solid,
                   const alb_chord *chord, const alb_section_plane *p, double most_mm)
{
    if (kept + 2 > ALB_BENDS_MAX)
        return false;
    alb_vector planar[ALB_BENDS_MAX];
    bends->count = kept + 2;
    planar[0] = chord->from, planar[kept + 1] = chord->to;
    for (int i = 0; i < kept; i++)
        planar[i + 1] = alb_add(p->origin, alb_add(alb_times(hull[i].x, p->along), alb_times(hull[i].y, p->up)));
    memcpy(bends->at, planar, (size_t)bends->count * sizeof *planar);
    if (length_of(bends) >= worth_moving * chord->length_mm)
        for (int lines = kept <= FEW; lines >= 0; lines--) {
            move(bends, hull, kept, &solid->net, lines);
            if (finish(bends, hull, kept, solid, most_mm, lines))
                return true;
            memcpy(bends->at, planar, (size_t)bends->count * sizeof *planar);
        }
    return finish(bends, hull, kept, solid, most_mm, false);
}

bool alb_slice(alb_bends *bends, const alb_optical_solid *solid, const alb_chord *chord, alb_vector towards,
               double most_mm)
{
    alb_cut cuts[ALB_CUTS_MAX];
    int cut_count = 0;
    const double far_mm = fmin(2 * most_mm, 1.2 * solid->reach_mm);
    const alb_section_plane p = alb_section_through(chord->from, chord->along, towards);
    if (chord->count > ALB_CROSSINGS_MAX || !(alb_dot(p.up, p.up) > 0.5))
        return false;
    for (size_t i = 0; i < chord->count; i++) {
        if (!chord->crossings[i].leaves)
            continue;
        const int before = cut_count,
                  back = alb_section_follow(cuts, &cut_count, (int)i, &solid->net, &p, chord, i, far_mm);
        if (back < 0 && i + 1 < chord->count && chord->crossings[i + 1].leaves &&
            chord->crossings[i + 1].at - chord->crossings[i].at < 1e-9) { // through an edge or a corner
            cut_count = before;
            continue;
        }
        if (back < 0)
            return false;
        if ((size_t)back > i)
            i = (size_t)back;
    }
    return string(bends, cuts, alb_section_tighten(cuts, cut_count, chord->length_mm), solid, chord, &p, most_mm);
}

static alb_vector turned(alb_vector up, alb_vector along, double angle)
{
    return alb_add(alb_times(cos(angle), up), alb_times(sin(angle), alb_cross(along, up)));
}

// The first of the planes turned from `up` by more and more that leads there.
static bool slice_beside(alb_bends *bends, alb_vector *up, const alb_optical_solid *solid, const alb_chord *chord)
{
    for (int k = 0; k < 6; k++) {
        const alb_vector to = turned(*up, chord->along, (k & 1 ? -0.15 : 0.15) * (k / 2 + 1));
        if (alb_slice(bends, solid, chord, to, (double)INFINITY)) {
            *up = to;
            return true;
        }
    }
    return false;
}

// Three planes, then where a parabola through their lengths is lowest; then the same closer by.
static bool turn(alb_bends *bends, const alb_optical_solid *solid, const alb_chord *chord, alb_vector towards,
                 double worth, bool beside)
{
    alb_vector up = alb_section_through(chord->from, chord->along, towards).up;
    if (!alb_slice(bends, solid, chord, up, (double)INFINITY) && !(beside && slice_beside(bends, &up, solid, chord)))
        return false;
    double step = 0.3;
    for (int round = 0; round < 3 && bends->length_mm > worth * chord->length_mm; round++, step /= 3) {
        const double before = bends->length_mm;
        const alb_vector middle = up;
        double length[2];
        alb_bends other;
        for (int k = 0; k < 2; k++) {
            const alb_vector to = turned(middle, chord->along, k ? step : -step);
            const bool ok = alb_slice(&other, solid, chord, to, bends->length_mm);
            length[k] = ok ? other.length_mm : 2 * before;
            if (length[k] < bends->length_mm)
                *bends = other, up = to;
        }
        const double bend = length[0] + length[1] - 2 * before;
        const double angle = bend > 0 ? 0.5 * step * (length[0] - length[1]) / bend : 0;
        const alb_vector to = turned(middle, chord->along, fmin(fmax(angle, -2 * step), 2 * step));
        if (alb_slice(&other, solid, chord, to, bends->length_mm) && other.length_mm < bends->length_mm)
            *bends = other, up = to;
        if (bends->length_mm > (1 - 2e-3) * before)
            break;
    }
    return true;
}

bool alb_slice_best(alb_bends *bends, const alb_optical_solid *solid, const alb_chord *chord, alb_vector towards,
                    bool beside)
{
    return turn(bends, solid, chord, towards, worth_turning, beside);
}

bool alb_slice_any(alb_bends *bends, const alb_optical_solid *solid, const alb_chord *chord)
{
    enum { PLANES = 8 };
    alb_vector up, other, best = {0};
    double least = (double)INFINITY;
    alb_tangents(&up, &other, chord->along);
    for (int k = 0; k < PLANES; k++) {
        const alb_vector towards = turned(up, chord->along, 2 * M_PI * k / PLANES);
        if (alb_slice(bends, solid, chord, towards, least) && bends->length_mm < least)
            least = bends->length_mm, best = towards;
    }
    return least < (double)INFINITY && turn(bends, solid, chord, best, worth_turning_guessed, false);
}

bool alb_slice_direction(alb_vector *towards, const alb_optical_solid *solid, const alb_chord *chord)
{
    const alb_crossing *first = chord->crossings, *last = first + chord->count - 1;
    if (chord->count < 2 || chord->count > ALB_CROSSINGS_MAX || !first->leaves || last->leaves)
        return false;
    const alb_vector sum = alb_add(solid->net.normals[first->triangle], solid->net.normals[last->triangle]);
    *towards = alb_sub(alb_times(alb_dot(sum, chord->along), chord->along), sum);
    return alb_dot(*towards, *towards) > 1e-6;
}
