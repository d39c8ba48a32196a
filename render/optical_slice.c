// Shortest paths in a plane section of a body.
//
// The chord between two points of the body leaves it through one triangle and returns through another. The plane
// through the chord that contains the sum of their two normals, inwards, cuts the surface along a curve between them,
// which is followed from triangle to triangle (optical_section.c); a string drawn tight around it from end to end is
// the convex hull of the curve and the ends. About a straight edge between two planes, and about circles, spheres and
// cylinders across their axis, this plane holds the shortest path itself (for the edge: the chord meets the bisecting
// plane where the unfolded path meets the edge). Elsewhere the corners of the path then leave the plane
// (optical_string.c). What remains is second order in the angle between the plane and the true path.
//
// Between places near by most surfaces hardly bend. The curve itself, just inside, is a path that bounds the shortest
// one from above, as the chord does from below: where the two are alike the string about it needs no proof that it is
// inside.
#include "render/optical_section.h"

// Detours beyond which other planes are tried: beside one that the surface speaks for, or beside a guess.
static const double worth_turning = 1.07, worth_turning_guessed = 1.005;

alb_chord alb_chord_between(const alb_optical_solid *solid, alb_vector from, alb_vector to)
{
    const alb_vector way = alb_sub(to, from);
    alb_chord chord = {.from = from, .to = to, .along = alb_unit(way), .length_mm = alb_length(way)};
    chord.count = alb_voxels_crossings(chord.crossings, ALB_CROSSINGS_MAX, &solid->voxels, from, to);
    return chord;
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
    return alb_string(bends, cuts, alb_section_tighten(cuts, cut_count, chord->length_mm), solid, chord, &p, most_mm);
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
