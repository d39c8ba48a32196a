// Shortest paths in a plane section of a body.
//
// The chord between two points of the body leaves it through one triangle and returns through another. The plane
// through the chord that contains the sum of their two normals, inwards, cuts the surface along a curve between them,
// which is followed from triangle to triangle; a string drawn tight around it from end to end is the convex hull of the
// curve and the ends. About a straight edge between two planes, and about circles, spheres and cylinders across their
// axis, this plane holds the shortest path itself (for the edge: the chord meets the bisecting plane where the unfolded
// path meets the edge). Elsewhere the corners of the path are then moved along the edges of the mesh on which they lie,
// to where both sides meet the edge at one angle. What remains is second order in the angle between the plane and the
// true path.
//
// Between places near by most surfaces hardly bend. The curve itself, just inside, is a path that bounds the shortest
// one from above, as the chord does from below: where the two are alike the string about it needs no proof that it is
// inside.
#include "render/optical_solid.h"
#include <string.h>

enum { CROSSINGS = 48, POINTS = 1024, SWEEPS = 3, STEPS = 64 };
// Detours beyond which corners are moved along their edges, and other planes are tried.
static const double worth_moving = 1.02, worth_turning = 1.07;

typedef struct plane {
    alb_vector origin, along, up, normal; // along the chord; up: the side of the path
} plane;

// Where the section crosses an edge of the mesh.
typedef struct cut {
    double x, y;    // along the chord, and up
    uint32_t place; // 3 * triangle + edge
    int order;      // along the curve; the next curve begins with a gap
} cut;

static double height(const plane *p, alb_vector v) { return alb_dot(p->normal, alb_sub(v, p->origin)); }

// Between a and b at heights of different sign above the plane.
static cut cut_at(const plane *p, alb_vector a, alb_vector b, double ha, double hb, uint32_t place)
{
    const alb_vector at = alb_sub(alb_add(a, alb_times(ha / (ha - hb), alb_sub(b, a))), p->origin);
    return (cut){.x = alb_dot(at, p->along), .y = alb_dot(at, p->up), .place = place};
}

// Into the triangle across the edge that is cut, and to where the section leaves that by one of its two other edges.
static cut step(const plane *p, const alb_surface_net *net, uint32_t across)
{
    const uint32_t next = across / 3, came = across % 3, third = (came + 2) % 3, after = (came + 1) % 3;
    const alb_vector *t = net->triangles[next], came_from = t[came], came_to = t[after];
    const double h_from = height(p, came_from), h_to = height(p, came_to), hc = height(p, t[third]);
    return (hc >= 0) == (h_from >= 0) ? cut_at(p, came_to, t[third], h_to, hc, 3 * next + after)
                                      : cut_at(p, t[third], came_from, hc, h_from, 3 * next + third);
}

static int entry_of(const alb_crossing *crossings, size_t count, uint32_t triangle)
{
    for (size_t i = 0; i < count; i++)
        if (!crossings[i].leaves && crossings[i].triangle == triangle)
            return (int)i;
    return -1;
}

// Where the section leaves the triangle, forwards (upwards: up); of no place where it does not cross it. A corner in
// the plane counts as above it.
static cut leave(const plane *p, const alb_surface_net *net, uint32_t triangle, bool upwards)
{
    const alb_vector *t = net->triangles[triangle];
    const double heights[3] = {height(p, t[0]), height(p, t[1]), height(p, t[2])};
    cut furthest = {.place = UINT32_MAX};
    for (int k = 0; k < 3; k++) {
        const double ha = heights[k], hb = heights[(k + 1) % 3];
        if ((ha >= 0) == (hb >= 0))
            continue;
        const cut found = cut_at(p, t[k], t[(k + 1) % 3], ha, hb, 3 * triangle + (uint32_t)k);
        if (furthest.place == UINT32_MAX || (upwards ? found.y > furthest.y : found.x > furthest.x))
            furthest = found;
    }
    return furthest;
}

// Follows the curve (its number for the order) from where the chord leaves, upwards, until it is back at the chord. The
// crossing by which it returns, or -1.
static int follow(cut *cuts, int *cut_count, int curve, const alb_surface_net *net, const plane *p,
                  const alb_crossing *crossings, size_t crossing_count, uint32_t triangle)
{
    cut best = leave(p, net, triangle, true);
    if (best.place == UINT32_MAX)
        return -1;
    while (*cut_count < POINTS) {
        best.order = *cut_count + curve;
        cuts[(*cut_count)++] = best;
        const uint32_t across = net->neighbours[best.place / 3][best.place % 3];
        if (across == UINT32_MAX)
            return -1;
        const int entry = entry_of(crossings, crossing_count, across / 3);
        if (entry >= 0)
            return entry;
        best = step(p, net, across);
    }
    return -1;
}

// By falling angle seen from the start of the chord; at one angle the nearer first.
static bool before(const cut *a, const cut *b)
{
    const double cross = a->x * b->y - a->y * b->x;
    return cross < 0 || (cross == 0 && a->x * a->x + a->y * a->y < b->x * b->x + b->y * b->y);
}

static void sort(cut *cuts, int count)
{
    for (int gap = count > 64 ? count / 3 : 1;; gap = gap > 3 ? gap / 3 : 1) {
        for (int i = gap; i < count; i++) {
            const cut moved = cuts[i];
            int j = i;
            for (; j >= gap && before(&moved, &cuts[j - gap]); j -= gap)
                cuts[j] = cuts[j - gap];
            cuts[j] = moved;
        }
        if (gap == 1)
            break;
    }
}

// The hull from (0, 0) over the cuts to (length, 0), in place.
static int tighten(cut *cuts, int count, double length)
{
    int kept = 0, above = 0;
    for (int i = 0; i < count; i++)
        if (cuts[i].y > 0)
            cuts[above++] = cuts[i];
    sort(cuts, above);
    for (int i = 0; i <= above; i++) {
        const double x = i < above ? cuts[i].x : length, y = i < above ? cuts[i].y : 0;
        while (kept > 0) {
            const cut *top = &cuts[kept - 1];
            const double bx = kept > 1 ? cuts[kept - 2].x : 0, by = kept > 1 ? cuts[kept - 2].y : 0;
            if ((top->x - bx) * (y - by) - (top->y - by) * (x - bx) < 0)
                break;
            kept--;
        }
        if (i < above)
            cuts[kept++] = cuts[i];
    }
    return kept;
}

static double norm(double x, double y) { return sqrt(x * x + y * y); }

static double taut_length(const cut *hull, int kept, double length)
{
    double x = 0, y = 0, sum = 0;
    for (int i = 0; i < kept; i++) {
        sum += norm(hull[i].x - x, hull[i].y - y);
        x = hull[i].x, y = hull[i].y;
    }
    return sum + norm(length - x, y);
}

bool alb_slice_along(double *length_mm, const alb_surface_net *net, uint32_t from, uint32_t to, double most_mm)
{
    const alb_vector start = net->middles[from], chord = alb_sub(net->middles[to], start),
                     inwards = alb_times(-1, alb_add(net->normals[from], net->normals[to]));
    const double whole = alb_length(chord);
    plane p = {.origin = start, .along = alb_unit(chord)};
    p.up = alb_unit(alb_sub(inwards, alb_times(alb_dot(inwards, p.along), p.along)));
    p.normal = alb_cross(p.along, p.up);
    cut cuts[STEPS], at = leave(&p, net, from, false);
    double x = 0, y = 0, length = 0;
    for (int count = 0; count < STEPS && at.place != UINT32_MAX; count++) {
        length += norm(at.x - x, at.y - y);
        const uint32_t across = net->neighbours[at.place / 3][at.place % 3];
        if (across == UINT32_MAX || !(length + norm(whole - at.x, at.y) <= most_mm))
            return false;
        x = at.x, y = at.y;
        cuts[count] = at;
        if (across / 3 == to) {
            *length_mm = taut_length(cuts, tighten(cuts, count + 1, whole), whole);
            return true;
        }
        at = step(&p, net, across);
    }
    return false;
}

static double root_of(double x) { return x > 0 ? sqrt(x) : 0; }

// Where on the edge a path from p to q over it is shortest: both unfolded into one plane.
static alb_vector on_edge(alb_vector a, alb_vector b, alb_vector p, alb_vector q)
{
    const alb_vector e = alb_sub(b, a), pa = alb_sub(p, a), qa = alb_sub(q, a);
    const double length = alb_length(e), zp = alb_dot(pa, e) / length, zq = alb_dot(qa, e) / length;
    const double rp = root_of(alb_dot(pa, pa) - zp * zp), rq = root_of(alb_dot(qa, qa) - zq * zq);
    const double z = rp + rq > 0 ? (zp * rq + zq * rp) / (rp + rq) : 0.5 * (zp + zq);
    return alb_add(a, alb_times(z < 0 ? 0 : z > length ? 1 : z / length, e));
}

static double length_of(const alb_bends *bends)
{
    double length = 0;
    for (int i = 1; i < bends->count; i++)
        length += alb_length(alb_sub(bends->at[i], bends->at[i - 1]));
    return length;
}

// Legs that do not follow the surface must stay inside.
static bool legs_are_inside(const alb_bends *bends, const cut *hull, int kept, const alb_optical_solid *solid)
{
    for (int i = 0; i <= kept; i++) {
        if (i > 0 && i < kept && hull[i].order - hull[i - 1].order == 1)
            continue;
        if (!alb_voxels_inside(&solid->voxels, bends->at[i], bends->at[i + 1]))
            return false;
    }
    return true;
}

// The mean normal of the triangles on both sides of the edge that is cut.
static alb_vector normal_at(const cut *c, const alb_surface_net *net)
{
    const uint32_t across = net->neighbours[c->place / 3][c->place % 3];
    const alb_vector normal = net->normals[c->place / 3];
    return across == UINT32_MAX ? normal : alb_unit(alb_add(normal, net->normals[across / 3]));
}

// Measures the corners as they are, then moves them off the surface; false where a leg leaves the body.
static bool finish(alb_bends *bends, const cut *hull, int kept, const alb_optical_solid *solid)
{
    bends->length_mm = length_of(bends);
    for (int i = 0; i < kept; i++)
        bends->at[i + 1] = alb_sub(bends->at[i + 1], alb_times(solid->lift_mm, normal_at(&hull[i], &solid->net)));
    return legs_are_inside(bends, hull, kept, solid);
}

// The path over the hull's corners, moved along their edges if that stays inside.
static bool string(alb_bends *bends, const cut *hull, int kept, const alb_optical_solid *solid, alb_vector from,
                   alb_vector to, const plane *p)
{
    if (kept + 2 > ALB_BENDS_MAX)
        return false;
    bends->count = kept + 2;
    bends->at[0] = from, bends->at[kept + 1] = to;
    for (int i = 0; i < kept; i++)
        bends->at[i + 1] = alb_add(p->origin, alb_add(alb_times(hull[i].x, p->along), alb_times(hull[i].y, p->up)));
    if (length_of(bends) < worth_moving * alb_length(alb_sub(to, from)))
        return finish(bends, hull, kept, solid);
    alb_vector planar[ALB_BENDS_MAX];
    memcpy(planar, bends->at, (size_t)bends->count * sizeof *planar);
    for (int sweep = 0; sweep < SWEEPS; sweep++)
        for (int i = 0; i < kept; i++) {
            const alb_vector *t = solid->net.triangles[hull[i].place / 3];
            const uint32_t k = hull[i].place % 3;
            bends->at[i + 1] = on_edge(t[k], t[(k + 1) % 3], bends->at[i], bends->at[i + 2]);
        }
    if (finish(bends, hull, kept, solid))
        return true;
    memcpy(bends->at, planar, (size_t)bends->count * sizeof *planar);
    return finish(bends, hull, kept, solid);
}

bool alb_slice(alb_bends *bends, const alb_optical_solid *solid, alb_vector from, alb_vector to, alb_vector towards)
{
    alb_crossing crossings[CROSSINGS];
    cut cuts[POINTS];
    int cut_count = 0;
    const alb_vector chord = alb_sub(to, from);
    const double length = alb_length(chord);
    plane p = {.origin = from, .along = alb_unit(chord)};
    p.up = alb_unit(alb_sub(towards, alb_times(alb_dot(towards, p.along), p.along)));
    p.normal = alb_cross(p.along, p.up);
    const size_t count = alb_voxels_crossings(crossings, CROSSINGS, &solid->voxels, from, to);
    if (count > CROSSINGS || !(alb_dot(p.up, p.up) > 0.5))
        return false;
    for (size_t i = 0; i < count; i++) {
        if (!crossings[i].leaves)
            continue;
        const int back = follow(cuts, &cut_count, (int)i, &solid->net, &p, crossings, count, crossings[i].triangle);
        if (back < 0)
            return false;
        if ((size_t)back > i)
            i = (size_t)back;
    }
    const int kept = tighten(cuts, cut_count, length);
    return string(bends, cuts, kept, solid, from, to, &p);
}

static alb_vector turned(alb_vector up, alb_vector along, double angle)
{
    return alb_add(alb_times(cos(angle), up), alb_times(sin(angle), alb_cross(along, up)));
}

// Three planes, then where a parabola through their lengths is lowest; then the same closer by.
bool alb_slice_best(alb_bends *bends, const alb_optical_solid *solid, alb_vector from, alb_vector to,
                    alb_vector towards)
{
    const alb_vector chord = alb_sub(to, from), along = alb_unit(chord);
    alb_vector up = alb_unit(alb_sub(towards, alb_times(alb_dot(towards, along), along)));
    if (!alb_slice(bends, solid, from, to, up))
        return false;
    double step = 0.3;
    for (int round = 0; round < 3 && bends->length_mm > worth_turning * alb_length(chord); round++, step /= 3) {
        alb_bends other[2];
        double length[2];
        for (int k = 0; k < 2; k++) {
            const bool ok = alb_slice(&other[k], solid, from, to, turned(up, along, k ? step : -step));
            length[k] = ok ? other[k].length_mm : 2 * bends->length_mm;
        }
        const double bend = length[0] + length[1] - 2 * bends->length_mm;
        double angle = bend > 0 ? 0.5 * step * (length[0] - length[1]) / bend : 0;
        angle = fmin(fmax(angle, -2 * step), 2 * step);
        alb_bends lowest;
        const bool ok = alb_slice(&lowest, solid, from, to, turned(up, along, angle));
        const double before = bends->length_mm;
        alb_vector best = up;
        for (int k = 0; k < 2; k++)
            if (length[k] < bends->length_mm)
                *bends = other[k], best = turned(up, along, k ? step : -step);
        if (ok && lowest.length_mm < bends->length_mm)
            *bends = lowest, best = turned(up, along, angle);
        up = best;
        if (bends->length_mm > (1 - 2e-3) * before)
            break;
    }
    return true;
}

bool alb_slice_any(alb_bends *bends, const alb_optical_solid *solid, alb_vector from, alb_vector to)
{
    enum { PLANES = 8 };
    const alb_vector along = alb_unit(alb_sub(to, from));
    alb_vector up, other, best = {0};
    double least = (double)INFINITY;
    alb_tangents(&up, &other, along);
    for (int k = 0; k < PLANES; k++) {
        const alb_vector towards = turned(up, along, 2 * M_PI * k / PLANES);
        if (alb_slice(bends, solid, from, to, towards) && bends->length_mm < least)
            least = bends->length_mm, best = towards;
    }
    return least < (double)INFINITY && alb_slice_best(bends, solid, from, to, best);
}

bool alb_slice_direction(alb_vector *towards, const alb_optical_solid *solid, alb_vector from, alb_vector to)
{
    alb_crossing crossings[CROSSINGS];
    const size_t count = alb_voxels_crossings(crossings, CROSSINGS, &solid->voxels, from, to);
    if (count < 2 || count > CROSSINGS || !crossings[0].leaves || crossings[count - 1].leaves)
        return false;
    const alb_vector sum =
        alb_add(solid->net.normals[crossings[0].triangle], solid->net.normals[crossings[count - 1].triangle]);
    const alb_vector along = alb_unit(alb_sub(to, from));
    *towards = alb_sub(alb_times(alb_dot(sum, along), along), sum);
    return alb_dot(*towards, *towards) > 1e-6;
}
