// Where paths through a body may turn: the nodes of the voxel graph.
//
// A path turns on the surface alone, where that bulges into the body. So each piece of surface (one voxel, one of six
// directions, joined) is a node, placed on its sharpest inward edge, a twentieth of a voxel in; pieces of two walls in
// one voxel stay two nodes. Voxels inside are nodes too, for the search to pass through.
#include "base/memory.h"
#include "render/optical_solid.h"
#include <stdlib.h>

typedef struct piece_key {
    uint64_t key;
    uint32_t triangle;
} piece_key;

static int by_key(const void *a, const void *b)
{
    const piece_key *p = a, *q = b;
    if (p->key != q->key)
        return p->key < q->key ? -1 : 1;
    return p->triangle < q->triangle ? -1 : p->triangle > q->triangle;
}

static void voxel_at(int place[3], const alb_turns *turns, alb_vector p)
{
    const double at[3] = {p.x - turns->low.x, p.y - turns->low.y, p.z - turns->low.z};
    for (int a = 0; a < 3; a++) {
        const double x = floor(at[a] / turns->size_mm);
        place[a] = x < 0 ? 0 : x > turns->n[a] - 1 ? turns->n[a] - 1 : (int)x;
    }
}

static size_t voxel_index(const alb_turns *t, const int place[3])
{
    return ((size_t)place[2] * (size_t)t->n[1] + (size_t)place[1]) * (size_t)t->n[0] + (size_t)place[0];
}

static unsigned direction_of(alb_vector n)
{
    const double x = fabs(n.x), y = fabs(n.y), z = fabs(n.z);
    if (x >= y && x >= z)
        return n.x < 0;
    return y >= z ? 2 + (n.y < 0) : 4 + (n.z < 0);
}

// Numbers the pieces: triangles of one voxel and direction joined over edges.
static bool find_pieces(alb_turns *turns, const alb_surface_net *net, alb_error *error)
{
    piece_key *keys = alb_allocate(net->count, sizeof *keys, error);
    uint32_t *stack = alb_allocate(net->count, sizeof *stack, error);
    uint64_t *key_of = alb_allocate(net->count, sizeof *key_of, error);
    const bool ok = keys && stack && key_of;
    for (uint32_t i = 0; ok && i < net->count; i++) {
        int place[3];
        voxel_at(place, turns, net->middles[i]);
        key_of[i] = voxel_index(turns, place) * 6 + direction_of(net->normals[i]);
        keys[i] = (piece_key){key_of[i], i};
        turns->of_triangle[i] = UINT32_MAX;
    }
    if (ok)
        qsort(keys, net->count, sizeof *keys, by_key);
    for (size_t i = 0; ok && i < net->count; i++) {
        size_t depth = 0;
        if (turns->of_triangle[keys[i].triangle] != UINT32_MAX)
            continue;
        const uint32_t piece = (uint32_t)turns->surface_count++;
        turns->of_triangle[keys[i].triangle] = piece;
        stack[depth++] = keys[i].triangle;
        while (depth > 0) {
            const uint32_t at = stack[--depth];
            for (int k = 0; k < 3; k++) {
                const uint32_t across = net->neighbours[at][k];
                if (across == UINT32_MAX || turns->of_triangle[across / 3] != UINT32_MAX ||
                    key_of[across / 3] != key_of[at])
                    continue;
                turns->of_triangle[across / 3] = piece;
                stack[depth++] = across / 3;
            }
        }
    }
    free(keys);
    free(stack);
    free(key_of);
    return ok;
}

typedef struct candidate {
    double sharpness; // sine of the angle by which the edge bends into the body, 0 for a triangle's middle
    alb_vector at, inwards;
} candidate;

// The sharpest inward edge of the triangle beyond 0.1 (6 degrees), or its middle.
static candidate best_of(const alb_surface_net *net, uint32_t triangle)
{
    candidate best = {0, net->middles[triangle], alb_times(-1, net->normals[triangle])};
    for (int k = 0; k < 3; k++) {
        const uint32_t across = net->neighbours[triangle][k];
        if (across == UINT32_MAX)
            continue;
        const alb_vector a = net->triangles[triangle][k], b = net->triangles[triangle][(k + 1) % 3];
        const alb_vector n = net->normals[triangle], m = net->normals[across / 3];
        const double inwards = alb_dot(alb_unit(alb_sub(b, a)), alb_cross(m, n)); // > 0: a reflex edge
        if (inwards > fmax(best.sharpness, 0.1))
            best = (candidate){inwards, alb_times(0.5, alb_add(a, b)), alb_times(-1, alb_unit(alb_add(n, m)))};
    }
    return best;
}

// As far in as the body lets, at most `depth`.
static alb_vector lifted(const alb_optical_solid *solid, candidate from, double depth)
{
    const alb_vector start = alb_add(from.at, alb_times(solid->lift_mm, from.inwards));
    for (; depth > solid->lift_mm; depth /= 2)
        if (alb_voxels_inside(&solid->voxels, start, alb_add(from.at, alb_times(2 * depth, from.inwards))))
            return alb_add(from.at, alb_times(depth, from.inwards));
    return start;
}

static bool place_pieces(alb_turns *turns, const alb_optical_solid *solid, alb_error *error)
{
    const alb_surface_net *net = &solid->net;
    candidate *best = alb_allocate(turns->surface_count, sizeof *best, error);
    if (!best)
        return false;
    for (size_t i = 0; i < turns->surface_count; i++)
        best[i].sharpness = -1;
    for (uint32_t i = 0; i < net->count; i++) {
        const candidate c = best_of(net, i);
        if (c.sharpness > best[turns->of_triangle[i]].sharpness + 1e-6)
            best[turns->of_triangle[i]] = c;
    }
    for (size_t i = 0; i < turns->surface_count; i++) {
        const alb_vector at = lifted(solid, best[i], 0.05 * turns->size_mm);
        turns->at[i][0] = (float)at.x, turns->at[i][1] = (float)at.y, turns->at[i][2] = (float)at.z;
    }
    free(best);
    return true;
}

static size_t voxels_of(const alb_turns *turns)
{
    return (size_t)turns->n[0] * (size_t)turns->n[1] * (size_t)turns->n[2];
}

static alb_vector voxel_middle(const alb_turns *turns, size_t voxel)
{
    const size_t x = (size_t)turns->n[0], y = (size_t)turns->n[1];
    return alb_add(turns->low,
                   alb_times(turns->size_mm, (alb_vector){(double)(voxel % x) + 0.5, (double)(voxel / x % y) + 0.5,
                                                          (double)(voxel / (x * y)) + 0.5}));
}

// The nodes of each voxel: its pieces of surface, then its middle where that is inside.
static bool fill_voxels(alb_turns *turns, const alb_surface_net *net, alb_error *error)
{
    const size_t voxels = voxels_of(turns);
    if (!(turns->voxel_starts = alb_allocate(voxels + 1, sizeof *turns->voxel_starts, error)) ||
        !(turns->voxel_nodes = alb_allocate(turns->count, sizeof *turns->voxel_nodes, error)))
        return false;
    uint32_t *voxel_of = alb_allocate(turns->count, sizeof *voxel_of, error);
    if (!voxel_of)
        return false;
    for (size_t i = 0; i < net->count; i++) { // all triangles of a piece lie in its voxel
        int place[3];
        voxel_at(place, turns, net->middles[i]);
        voxel_of[turns->of_triangle[i]] = (uint32_t)voxel_index(turns, place);
    }
    for (size_t i = turns->surface_count; i < turns->count; i++) {
        int place[3];
        voxel_at(place, turns, (alb_vector){(double)turns->at[i][0], (double)turns->at[i][1], (double)turns->at[i][2]});
        voxel_of[i] = (uint32_t)voxel_index(turns, place);
    }
    for (size_t i = 0; i < turns->count; i++)
        turns->voxel_starts[voxel_of[i] + 1]++;
    for (size_t v = 0; v < voxels; v++)
        turns->voxel_starts[v + 1] += turns->voxel_starts[v];
    for (size_t i = turns->count; i-- > 0;) // leaves starts[v + 1] where v begins: moved back below
        turns->voxel_nodes[--turns->voxel_starts[voxel_of[i] + 1]] = (uint32_t)i;
    for (size_t v = 0; v < voxels; v++)
        turns->voxel_starts[v] = turns->voxel_starts[v + 1];
    turns->voxel_starts[voxels] = (uint32_t)turns->count;
    free(voxel_of);
    return true;
}

// Pieces of surface that share an edge.
static bool fill_adjacent(alb_turns *turns, const alb_surface_net *net, alb_error *error)
{
    if (!(turns->adjacent_starts = alb_allocate(turns->surface_count + 1, sizeof *turns->adjacent_starts, error)))
        return false;
    for (int pass = 0; pass < 2; pass++) {
        for (size_t i = 0; i < net->count; i++)
            for (int k = 0; k < 3; k++) {
                const uint32_t across = net->neighbours[i][k], piece = turns->of_triangle[i];
                if (across == UINT32_MAX || turns->of_triangle[across / 3] == piece)
                    continue;
                if (pass == 0)
                    turns->adjacent_starts[piece]++;
                else
                    turns->adjacent[--turns->adjacent_starts[piece]] = turns->of_triangle[across / 3];
            }
        if (pass == 0) {
            uint32_t total = 0;
            for (size_t i = 0; i < turns->surface_count; i++)
                turns->adjacent_starts[i] = total += turns->adjacent_starts[i];
            turns->adjacent_starts[turns->surface_count] = total;
            if (!(turns->adjacent = alb_allocate(total, sizeof *turns->adjacent, error)))
                return false;
        }
    }
    return true;
}

bool alb_turns_create(alb_turns *turns, const alb_optical_solid *solid, double size_mm, alb_error *error)
{
    const alb_voxels *fine = &solid->voxels;
    *turns = (alb_turns){.size_mm = size_mm, .low = fine->low};
    for (int a = 0; a < 3; a++)
        turns->n[a] = (int)ceil(fine->n[a] * fine->size_mm / size_mm);
    if (!(turns->of_triangle = alb_allocate(solid->net.count, sizeof *turns->of_triangle, error)) ||
        !find_pieces(turns, &solid->net, error))
        goto failed;
    turns->count = turns->surface_count;
    for (size_t v = 0; v < voxels_of(turns); v++)
        turns->count += alb_voxels_state(fine, voxel_middle(turns, v)) == ALB_VOXEL_INSIDE;
    if (!(turns->at = alb_allocate(turns->count, sizeof *turns->at, error)) || !place_pieces(turns, solid, error))
        goto failed;
    for (size_t v = 0, i = turns->surface_count; v < voxels_of(turns); v++) {
        const alb_vector m = voxel_middle(turns, v);
        if (alb_voxels_state(fine, m) != ALB_VOXEL_INSIDE)
            continue;
        turns->at[i][0] = (float)m.x, turns->at[i][1] = (float)m.y, turns->at[i][2] = (float)m.z;
        i++;
    }
    if (fill_voxels(turns, &solid->net, error) && fill_adjacent(turns, &solid->net, error))
        return true;
failed:
    alb_turns_free(turns);
    return false;
}

void alb_turns_free(alb_turns *turns)
{
    free(turns->at);
    free(turns->voxel_starts);
    free(turns->voxel_nodes);
    free(turns->adjacent_starts);
    free(turns->adjacent);
    free(turns->of_triangle);
    *turns = (alb_turns){0};
}
