// A string over the corners of a plane section, drawn tight in space.
//
// The shortest path over given edges meets each at one angle from both sides. Corners first move along the lines that
// hold their edges, for an edge may be one of many in a line: the length L = sum l_i is convex in the places t_i of
// corners a_i + t_i e_i on the lines, and l <= l^2 / (2 l') + l' / 2 bounds it from above and touches it at the path so
// far (l'), so each least of sum l^2 / l' (a tridiagonal system) is a shorter path (Weiszfeld 1937). Corners on edges
// that do not bend would hold it back, where two lines meet, and are left out. A path that leaves the body is tried
// once more with corners that stay on their edges, moved in turns, and then as the section has it.
#include "render/optical_section.h"

enum { SWEEPS = 3, STEPS = 8 };
static const double worth_moving = 1.02; // times the chord
static const double little = 1e-4;       // of the length: steps that gain less are the last
static const double flat_edge = 1e-4;    // radians: by as much of an edge's length corners are kept off the surface

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

// Moves the corners along their edges, each to where it is best, in turns.
static void move(alb_bends *bends, const alb_cut *hull, int kept, const alb_surface_net *net)
{
    for (int sweep = 0; sweep < SWEEPS; sweep++)
        for (int i = 0; i < kept; i++) {
            const alb_vector *t = net->triangles[hull[i].place / 3];
            const uint32_t k = hull[i].place % 3;
            bends->at[i + 1] = on_edge(t[k], t[(k + 1) % 3], bends->at[i], bends->at[i + 2]);
        }
}

// To where the sum of l^2 / l' is least, l' the lengths of the legs as they are.
static void step_on_lines(alb_bends *bends, const alb_vector *lines, int kept)
{
    double diagonal[ALB_BENDS_MAX], above[ALB_BENDS_MAX], step[ALB_BENDS_MAX];
    const double whole = length_of(bends), least = 1e-9 * whole;
    for (int i = 0; i < kept; i++)
        diagonal[i] = 1e-3 / whole, step[i] = above[i] = 0; // not zero where legs lie along a line
    for (int leg = 0; leg <= kept; leg++) {                 // from corner leg - 1 to corner leg
        const alb_vector way = alb_sub(bends->at[leg + 1], bends->at[leg]);
        const double length = fmax(alb_length(way), least);
        const alb_vector u = alb_times(1 / length, way);
        const double before = leg > 0 ? alb_dot(lines[leg - 1], u) : 0, after = leg < kept ? alb_dot(lines[leg], u) : 0;
        if (leg > 0)
            step[leg - 1] += before, diagonal[leg - 1] += 1 / length;
        if (leg < kept)
            step[leg] -= after, diagonal[leg] += 1 / length;
        if (leg > 0 && leg < kept)
            above[leg - 1] = -alb_dot(lines[leg - 1], lines[leg]) / length;
    }
    for (int i = 1; i < kept; i++) {
        const double factor = above[i - 1] / diagonal[i - 1];
        diagonal[i] -= factor * above[i - 1], step[i] -= factor * step[i - 1];
    }
    for (int i = kept - 1; i >= 0; i--) {
        step[i] = (step[i] - (i + 1 < kept ? above[i] * step[i + 1] : 0)) / diagonal[i];
        bends->at[i + 1] = alb_add(bends->at[i + 1], alb_times(step[i], lines[i]));
    }
}

// Until it gains no more.
static void move_on_lines(alb_bends *bends, const alb_cut *hull, int kept, const alb_surface_net *net)
{
    alb_vector lines[ALB_BENDS_MAX];
    for (int i = 0; i < kept; i++) {
        const alb_vector *t = net->triangles[hull[i].place / 3];
        lines[i] = alb_unit(alb_sub(t[(hull[i].place + 1) % 3], t[hull[i].place % 3]));
    }
    for (int step = 0; step < STEPS; step++) {
        const alb_bends before = *bends;
        const double length = length_of(bends);
        step_on_lines(bends, lines, kept);
        const double gained = length - length_of(bends);
        if (!(gained > 0))
            *bends = before;
        if (!(gained > little * length))
            break;
    }
}

// Leaves out corners on edges that do not bend: diagonals of flat quadrangles.
static int leave_out_flat(alb_bends *bends, alb_cut *bending, const alb_cut *hull, int kept, const alb_surface_net *net)
{
    int count = 0;
    for (int i = 0; i < kept; i++) {
        const uint32_t triangle = hull[i].place / 3, across = net->neighbours[triangle][hull[i].place % 3];
        if (across != UINT32_MAX && alb_length(alb_cross(net->normals[triangle], net->normals[across / 3])) < flat_edge)
            continue;
        bending[count++] = hull[i];
        bends->at[count] = bends->at[i + 1];
    }
    bends->at[count + 1] = bends->at[kept + 1];
    bends->count = count + 2;
    return count;
}

// The corners in the plane.
static void place_planar(alb_bends *bends, const alb_cut *hull, int kept, const alb_chord *chord,
                         const alb_section_plane *p)
{
    bends->count = kept + 2;
    bends->at[0] = chord->from, bends->at[kept + 1] = chord->to;
    for (int i = 0; i < kept; i++)
        bends->at[i + 1] = alb_add(p->origin, alb_add(alb_times(hull[i].x, p->along), alb_times(hull[i].y, p->up)));
}

bool alb_string(alb_bends *bends, const alb_cut *hull, int kept, const alb_optical_solid *solid, const alb_chord *chord,
                const alb_section_plane *p, double most_mm)
{
    if (kept + 2 > ALB_BENDS_MAX)
        return false;
    place_planar(bends, hull, kept, chord, p);
    if (length_of(bends) >= worth_moving * chord->length_mm) {
        alb_cut bending[ALB_BENDS_MAX];
        const int count = leave_out_flat(bends, bending, hull, kept, &solid->net);
        move_on_lines(bends, bending, count, &solid->net);
        if (finish(bends, bending, count, solid, most_mm, true))
            return true;
        place_planar(bends, hull, kept, chord, p);
        move(bends, hull, kept, &solid->net);
        if (finish(bends, hull, kept, solid, most_mm, false))
            return true;
        place_planar(bends, hull, kept, chord, p);
    }
    return finish(bends, hull, kept, solid, most_mm, false);
}
