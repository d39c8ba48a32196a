// A section is followed from triangle to triangle across the edges that it cuts. A corner's coordinates are found once,
// when its triangle is entered, and by both triangles of an edge alike, so that the curve cannot get lost between them.
// A corner in the plane counts as above it. The string about a curve is the upper convex hull of its cuts (Graham
// 1972).
#include "render/optical_section.h"

enum { STEPS = 64, LOOKS = 4 };

typedef struct corner {
    double x, y, height; // above the plane
} corner;

// An edge that is cut, with its corners as the triangle on this side has them, and where it leads.
typedef struct gate {
    uint32_t across; // 3 * triangle + edge there
    corner ends[2];
} gate;

alb_section_plane alb_section_through(alb_vector origin, alb_vector along, alb_vector towards)
{
    alb_section_plane p = {.origin = origin, .along = along};
    p.up = alb_unit(alb_sub(towards, alb_times(alb_dot(towards, along), along)));
    p.normal = alb_cross(along, p.up);
    return p;
}

static corner corner_at(const alb_section_plane *p, alb_vector v)
{
    const alb_vector at = alb_sub(v, p->origin);
    return (corner){alb_dot(at, p->along), alb_dot(at, p->up), alb_dot(at, p->normal)};
}

static alb_cut cut_at(const gate *g)
{
    const corner *a = &g->ends[0], *b = &g->ends[1];
    const double share = a->height / (a->height - b->height);
    return (alb_cut){.x = a->x + share * (b->x - a->x), .y = a->y + share * (b->y - a->y), .place = g->across};
}

// Through the gate, and to the one of the next triangle's two other edges by which the section leaves it. Which is a
// toss-up: no branch.
static void step(gate *g, const alb_section_plane *p, const alb_surface_net *net)
{
    const alb_door *door = &net->doors[g->across];
    const corner third = corner_at(p, door->third);
    const int side = (third.height >= 0) == (g->ends[1].height >= 0);
    g->ends[side] = third;
    g->across = door->across[side];
}

// Where the section leaves the triangle, forwards (upwards: up); false where it does not cross it.
static bool leave(gate *out, const alb_section_plane *p, const alb_surface_net *net, uint32_t triangle, bool upwards)
{
    corner corners[3];
    double most = -(double)INFINITY;
    for (int k = 0; k < 3; k++)
        corners[k] = corner_at(p, net->triangles[triangle][k]);
    for (int k = 0; k < 3; k++) {
        const gate g = {net->neighbours[triangle][k], {corners[k], corners[(k + 1) % 3]}};
        if ((g.ends[0].height >= 0) == (g.ends[1].height >= 0))
            continue;
        const alb_cut cut = cut_at(&g);
        if ((upwards ? cut.y : cut.x) > most)
            most = upwards ? cut.y : cut.x, *out = g;
    }
    return most > -(double)INFINITY;
}

static int entry_of(const alb_chord *chord, uint32_t triangle)
{
    for (size_t i = 0; i < chord->count; i++)
        if (!chord->crossings[i].leaves && chord->crossings[i].triangle == triangle)
            return (int)i;
    return -1;
}

static double norm(double x, double y) { return sqrt(x * x + y * y); }

int alb_section_follow(alb_cut *cuts, int *cut_count, int curve, const alb_surface_net *net,
                       const alb_section_plane *plane, const alb_chord *chord, size_t first, double most_mm)
{
    const double near = 1e-6 * net->edge_mm; // cuts above are not beside the chord
    gate g;
    if (!leave(&g, plane, net, chord->crossings[first].triangle, true))
        return -1;
    for (alb_cut cut = cut_at(&g); *cut_count < ALB_CUTS_MAX;) {
        cut.order = *cut_count + curve;
        cuts[(*cut_count)++] = cut;
        if (g.across == UINT32_MAX ||
            (*cut_count % LOOKS == 0 && norm(cut.x, cut.y) + norm(chord->length_mm - cut.x, cut.y) > most_mm))
            return -1;
        const uint32_t triangle = g.across / 3;
        step(&g, plane, net);
        const alb_cut next = cut_at(&g);
        if (cut.y < near || next.y < near) {
            const int entry = entry_of(chord, triangle);
            if (entry >= 0)
                return entry;
        }
        cut = next;
    }
    return -1;
}

// By falling angle seen from the start of the chord; at one angle the nearer first.
static bool before(const alb_cut *a, const alb_cut *b)
{
    const double cross = a->x * b->y - a->y * b->x;
    return cross < 0 || (cross == 0 && a->x * a->x + a->y * a->y < b->x * b->x + b->y * b->y);
}

static void sort(alb_cut *cuts, int count)
{
    for (int gap = count > 64 ? count / 3 : 1;; gap = gap > 3 ? gap / 3 : 1) {
        for (int i = gap; i < count; i++) {
            const alb_cut moved = cuts[i];
            int j = i;
            for (; j >= gap && before(&moved, &cuts[j - gap]); j -= gap)
                cuts[j] = cuts[j - gap];
            cuts[j] = moved;
        }
        if (gap == 1)
            break;
    }
}

int alb_section_tighten(alb_cut *cuts, int count, double length)
{
    int kept = 0, above = 0;
    for (int i = 0; i < count; i++)
        if (cuts[i].y > 0)
            cuts[above++] = cuts[i];
    sort(cuts, above);
    for (int i = 0; i <= above; i++) {
        const double x = i < above ? cuts[i].x : length, y = i < above ? cuts[i].y : 0;
        while (kept > 0) {
            const alb_cut *top = &cuts[kept - 1];
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

static double taut_length(const alb_cut *hull, int kept, double length)
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
    const alb_section_plane p = alb_section_through(start, alb_unit(chord), inwards);
    alb_cut cuts[STEPS];
    gate g;
    double x = 0, y = 0, length = 0;
    if (!leave(&g, &p, net, from, false))
        return false;
    for (int count = 0; count < STEPS; count++) {
        cuts[count] = cut_at(&g);
        length += norm(cuts[count].x - x, cuts[count].y - y);
        x = cuts[count].x, y = cuts[count].y;
        if (g.across == UINT32_MAX || !(length + norm(whole - x, y) <= most_mm))
            return false;
        if (g.across / 3 == to) {
            *length_mm = taut_length(cuts, alb_section_tighten(cuts, count + 1, whole), whole);
            return true;
        }
        step(&g, &p, net);
    }
    return false;
}
