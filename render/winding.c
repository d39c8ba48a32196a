// Generalised winding number (Jacobson et al. 2013): the solid angles under which the point sees the triangles, signed,
// over 4 pi. Van Oosterom & Strackee 1983, with a, b, c the corners seen from the point:
//     tan(omega / 2) = a . (b x c) / (|a||b||c| + (a . b)|c| + (b . c)|a| + (c . a)|b|)
// Clusters further away than twice their radius count as one dipole, (c . sum A n) / |c|^3 (Barill et al. 2018).
// Closed and turned outwards it is a whole number but for that; it stops deciding where a hole is as near as it is
// wide.
#include "render/winding.h"
#include "base/memory.h"
#include <math.h>
#include <stdlib.h>

enum { LEAF = 8, DEEPEST = 64 };
static const double far_radii = 2.5;

static alb_vector middle_of(const alb_vector t[3]) { return alb_times(1.0 / 3, alb_add(t[0], alb_add(t[1], t[2]))); }

static void summarise(alb_winding_node *node, const alb_winding *winding)
{
    double area = 0;
    alb_vector weighted = {0};
    for (uint32_t i = node->begin; i < node->end; i++) {
        const alb_vector *t = winding->triangles[winding->order[i]];
        const alb_vector normal = alb_times(0.5, alb_cross(alb_sub(t[1], t[0]), alb_sub(t[2], t[0])));
        node->dipole = alb_add(node->dipole, normal);
        weighted = alb_add(weighted, alb_times(alb_length(normal), middle_of(t)));
        area += alb_length(normal);
    }
    node->centre =
        area > 0 ? alb_times(1 / area, weighted) : middle_of(winding->triangles[winding->order[node->begin]]);
    for (uint32_t i = node->begin; i < node->end; i++)
        for (int k = 0; k < 3; k++)
            node->radius =
                fmax(node->radius, alb_length(alb_sub(winding->triangles[winding->order[i]][k], node->centre)));
}

// Splits the triangles of a node at the middle of their bounds; by halves where all middles fall on one side.
static uint32_t split(const alb_winding *winding, uint32_t begin, uint32_t end)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint32_t i = begin; i < end; i++) {
        const alb_vector m = middle_of(winding->triangles[winding->order[i]]);
        const double at[3] = {m.x, m.y, m.z};
        for (int k = 0; k < 3; k++)
            low[k] = fmin(low[k], at[k]), high[k] = fmax(high[k], at[k]);
    }
    int axis = high[1] - low[1] > high[0] - low[0];
    axis = high[2] - low[2] > high[axis] - low[axis] ? 2 : axis;
    const double cut = 0.5 * (low[axis] + high[axis]);
    uint32_t left = begin;
    for (uint32_t i = begin; i < end; i++) {
        const alb_vector m = middle_of(winding->triangles[winding->order[i]]);
        if ((axis == 0 ? m.x : axis == 1 ? m.y : m.z) < cut) {
            const uint32_t swapped = winding->order[i];
            winding->order[i] = winding->order[left];
            winding->order[left++] = swapped;
        }
    }
    return left == begin || left == end ? begin + (end - begin) / 2 : left;
}

static void build(alb_winding *winding, uint32_t begin, uint32_t end, int depth)
{
    alb_winding_node *node = &winding->nodes[winding->node_count++];
    *node = (alb_winding_node){.begin = begin, .end = end};
    summarise(node, winding);
    if (end - begin <= LEAF)
        return;
    const uint32_t cut = depth < DEEPEST / 2 ? split(winding, begin, end) : begin + (end - begin) / 2;
    build(winding, begin, cut, depth + 1);
    node->right = (uint32_t)winding->node_count;
    build(winding, cut, end, depth + 1);
}

bool alb_winding_create(alb_winding *winding, const alb_vector (*triangles)[3], size_t count, alb_error *error)
{
    *winding = (alb_winding){.triangles = triangles, .count = count};
    if (!(winding->order = alb_allocate(count, sizeof *winding->order, error)) ||
        !(winding->nodes = alb_allocate(2 * count, sizeof *winding->nodes, error))) {
        alb_winding_free(winding);
        return false;
    }
    for (uint32_t i = 0; i < count; i++)
        winding->order[i] = i;
    if (count)
        build(winding, 0, (uint32_t)count, 0);
    return true;
}

void alb_winding_free(alb_winding *winding)
{
    free(winding->order);
    free(winding->nodes);
    *winding = (alb_winding){0};
}

// Over 2: the half angle.
static double half_solid_angle(const alb_vector t[3], alb_vector point)
{
    const alb_vector a = alb_sub(t[0], point), b = alb_sub(t[1], point), c = alb_sub(t[2], point);
    const double la = alb_length(a), lb = alb_length(b), lc = alb_length(c);
    return atan2(alb_dot(a, alb_cross(b, c)),
                 la * lb * lc + alb_dot(a, b) * lc + alb_dot(b, c) * la + alb_dot(c, a) * lb);
}

double alb_winding_number(const alb_winding *winding, alb_vector point)
{
    uint32_t stack[DEEPEST];
    int depth = 0;
    double half = 0;
    if (winding->count)
        stack[depth++] = 0;
    while (depth > 0) {
        const uint32_t at = stack[--depth];
        const alb_winding_node *node = &winding->nodes[at];
        const alb_vector c = alb_sub(node->centre, point);
        const double distance = alb_length(c);
        if (distance > far_radii * node->radius)
            half += 0.5 * alb_dot(c, node->dipole) / (distance * distance * distance);
        else if (node->right == 0)
            for (uint32_t i = node->begin; i < node->end; i++)
                half += half_solid_angle(winding->triangles[winding->order[i]], point);
        else
            stack[depth++] = node->right, stack[depth++] = at + 1;
    }
    return half / (2 * M_PI);
}
