// Segments through a body in voxels.
//
// A segment walks from voxel to voxel (Amanatides & Woo 1987), leaps where all around has one state, and tests the
// triangles of the voxels that it enters. Those whose plane its piece within the voxel clearly does not meet are passed
// over in single precision; of the others, two triangles evaluate the edge that they share with the same operations, so
// a segment cannot slip between them: crossings are exactly odd and even but for one that runs in a triangle's plane.
// About a corner rounding could deny all triangles that meet there: what is zero but for it is zero, and counts to all.
#include "render/voxels.h"
#include <math.h>

static size_t index_of(const alb_voxels *v, int i, int j, int k)
{
    return ((size_t)k * (size_t)v->n[1] + (size_t)j) * (size_t)v->n[0] + (size_t)i;
}

static int clamped(double x, int n) { return x < 0 ? 0 : x > n - 1 ? n - 1 : (int)x; }

int alb_voxels_state(const alb_voxels *voxels, alb_vector point)
{
    const alb_vector p = alb_times(1 / voxels->size_mm, alb_sub(point, voxels->low));
    if (!(p.x >= 0 && p.x < voxels->n[0] && p.y >= 0 && p.y < voxels->n[1] && p.z >= 0 && p.z < voxels->n[2]))
        return ALB_VOXEL_OUTSIDE;
    return voxels->state[index_of(voxels, (int)p.x, (int)p.y, (int)p.z)];
}

// A walk along a segment, in voxels; t runs from 0 to 1.
typedef struct walk {
    const alb_voxels *voxels;
    double start[3], way[3], inverse[3], longest, t, until, rounding;
    int cell[3], axis;          // where it leaves the cell, at `until`
    float enters[3], leaves[3]; // of a surface voxel: the piece of the segment within
} walk;

static void walk_begin(walk *w, const alb_voxels *v, alb_vector from, alb_vector to)
{
    const alb_vector p = alb_times(1 / v->size_mm, alb_sub(from, v->low)),
                     d = alb_times(1 / v->size_mm, alb_sub(to, from));
    *w = (walk){.voxels = v, .start = {p.x, p.y, p.z}, .way = {d.x, d.y, d.z}};
    for (int a = 0; a < 3; a++) {
        w->inverse[a] = w->way[a] != 0 ? 1 / w->way[a] : (double)INFINITY;
        w->longest = fabs(w->way[a]) > w->longest ? fabs(w->way[a]) : w->longest;
        w->cell[a] = clamped(floor(w->start[a]), v->n[a]);
    }
    const double box_mm = v->size_mm * (v->n[0] + v->n[1] + v->n[2]);
    w->rounding = 1e-15 * box_mm * box_mm * v->size_mm * w->longest; // of a triple product
}

static void find_exit(walk *w)
{
    w->until = (double)INFINITY;
    for (int a = 0; a < 3; a++) {
        const double t =
            w->way[a] != 0 ? (w->cell[a] + (w->way[a] > 0) - w->start[a]) * w->inverse[a] : (double)INFINITY;
        if (t < w->until)
            w->until = t, w->axis = a;
    }
}

// The triangles of the voxel that the walk is in, from first to end; none but in surface voxels.
static uint32_t look_around(walk *w, uint32_t *end, size_t voxel)
{
    const alb_voxels *v = w->voxels;
    const uint32_t first = v->starts[voxel];
    *end = v->starts[voxel + 1];
    if (first == *end)
        return first;
    find_exit(w);
    const double until = w->until < 1 ? w->until : 1;
    for (int a = 0; a < 3; a++) {
        w->enters[a] = (float)(w->start[a] + w->t * w->way[a]);
        w->leaves[a] = (float)(w->start[a] + until * w->way[a]);
    }
    return first;
}

// Whether the piece of the segment lies clearly on one side of the triangle's plane.
static bool passes_by(const walk *w, uint32_t entry)
{
    const float *p = w->voxels->planes[entry], margin = w->voxels->margin;
    const float a = p[0] * w->enters[0] + p[1] * w->enters[1] + p[2] * w->enters[2] - p[3];
    const float b = p[0] * w->leaves[0] + p[1] * w->leaves[1] + p[2] * w->leaves[2] - p[3];
    return (a > margin && b > margin) || (a < -margin && b < -margin);
}

// To the next voxel of another state or, from a surface voxel, to the next; false at the end.
static bool walk_step(walk *w)
{
    const alb_voxels *v = w->voxels;
    const size_t voxel = index_of(v, w->cell[0], w->cell[1], w->cell[2]);
    const int clear = v->clear[voxel];
    if (clear > 0) {
        w->t += clear / w->longest;
        if (!(w->t < 1))
            return false;
        for (int a = 0; a < 3; a++)
            w->cell[a] = clamped(floor(w->start[a] + w->t * w->way[a]), v->n[a]);
        return true;
    }
    if (v->starts[voxel] == v->starts[voxel + 1])
        find_exit(w);
    w->t = w->until > w->t ? w->until : w->t;
    w->cell[w->axis] += w->way[w->axis] > 0 ? 1 : -1;
    return w->until < 1 && w->cell[w->axis] >= 0 && w->cell[w->axis] < v->n[w->axis];
}

static double rounded(double x, double rounding) { return fabs(x) > rounding ? x : 0; }

// Whether the segment meets the triangle; edges and corners count to all triangles that share them.
static bool meets(alb_crossing *crossing, const walk *w, uint32_t triangle, alb_vector from, alb_vector way)
{
    const alb_vector *t = w->voxels->triangles[triangle];
    const alb_vector a = alb_sub(t[0], from), b = alb_sub(t[1], from), c = alb_sub(t[2], from);
    const double ab = rounded(alb_dot(way, alb_cross(a, b)), w->rounding),
                 bc = rounded(alb_dot(way, alb_cross(b, c)), w->rounding);
    if ((ab > 0 && bc < 0) || (ab < 0 && bc > 0))
        return false;
    const double ca = rounded(alb_dot(way, alb_cross(c, a)), w->rounding);
    if ((ca > 0 && (ab < 0 || bc < 0)) || (ca < 0 && (ab > 0 || bc > 0)) || (ab == 0 && bc == 0 && ca == 0))
        return false;
    const alb_vector normal = alb_cross(alb_sub(b, a), alb_sub(c, a));
    const double speed = alb_dot(way, normal), at = alb_dot(a, normal) / speed;
    *crossing = (alb_crossing){at, triangle, speed > 0};
    return at > 0 && at < 1;
}

bool alb_voxels_inside(const alb_voxels *voxels, alb_vector from, alb_vector to)
{
    const alb_vector way = alb_sub(to, from);
    walk w;
    walk_begin(&w, voxels, from, to);
    do {
        const size_t voxel = index_of(voxels, w.cell[0], w.cell[1], w.cell[2]);
        if (voxels->state[voxel] == ALB_VOXEL_OUTSIDE)
            return false;
        uint32_t end;
        for (uint32_t i = look_around(&w, &end, voxel); i < end; i++) {
            alb_crossing crossing;
            if (!passes_by(&w, i) && meets(&crossing, &w, voxels->lists[i], from, way))
                return false;
        }
    } while (walk_step(&w));
    return true;
}

// Enters the crossing in its place unless its triangle is there already.
static size_t insert(alb_crossing *crossings, size_t count, alb_crossing crossing)
{
    for (size_t i = 0; i < count; i++)
        if (crossings[i].triangle == crossing.triangle)
            return count;
    size_t i = count;
    for (; i > 0 && (crossings[i - 1].at > crossing.at ||
                     (crossings[i - 1].at == crossing.at && crossings[i - 1].triangle > crossing.triangle));
         i--)
        crossings[i] = crossings[i - 1];
    crossings[i] = crossing;
    return count + 1;
}

size_t alb_voxels_crossings(alb_crossing *crossings, size_t most, const alb_voxels *voxels, alb_vector from,
                            alb_vector to)
{
    const alb_vector way = alb_sub(to, from);
    size_t count = 0;
    walk w;
    walk_begin(&w, voxels, from, to);
    do {
        const size_t voxel = index_of(voxels, w.cell[0], w.cell[1], w.cell[2]);
        uint32_t end;
        for (uint32_t i = look_around(&w, &end, voxel); i < end; i++) {
            alb_crossing crossing;
            if (passes_by(&w, i) || !meets(&crossing, &w, voxels->lists[i], from, way))
                continue;
            if (count == most)
                return most + 1;
            count = insert(crossings, count, crossing);
        }
    } while (walk_step(&w));
    return count;
}
