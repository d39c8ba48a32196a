// The vertices of a surface for geodesics: which triangles meet at them, and whether paths may turn there.
#include "base/memory.h"
#include "render/geodesic.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

// Corners reached from one another around a common vertex are one vertex: union over shared edges.
static uint32_t root_of(uint32_t *parent, uint32_t i)
{
    while (parent[i] != i)
        i = parent[i] = parent[parent[i]];
    return i;
}

static void unite(uint32_t *parent, uint32_t a, uint32_t b)
{
    a = root_of(parent, a), b = root_of(parent, b);
    parent[a < b ? b : a] = a < b ? a : b;
}

static void number_corners(alb_geodesic_surface *s, uint32_t *parent)
{
    for (uint32_t i = 0; i < 3 * s->count; i++)
        parent[i] = i;
    for (uint32_t i = 0; i < 3 * s->count; i++) {
        const uint32_t across = s->neighbours[i / 3][i % 3];
        if (across == UINT32_MAX)
            continue;
        // Edge k runs from corner k to k + 1; the neighbour's runs the other way, if it is turned as this one is.
        const uint32_t here[2] = {i, i / 3 * 3 + (i + 1) % 3}, t = across / 3 * 3,
                       there[2] = {t + (across + 1) % 3, across};
        const alb_vector a = s->triangles[i / 3][i % 3], b = s->triangles[across / 3][(across + 1) % 3];
        const bool same_turn = a.x == b.x && a.y == b.y && a.z == b.z;
        unite(parent, here[0], there[same_turn ? 0 : 1]);
        unite(parent, here[1], there[same_turn ? 1 : 0]);
    }
    for (uint32_t i = 0; i < 3 * s->count; i++)
        if (root_of(parent, i) == i)
            s->corners[i / 3][i % 3] = (uint32_t)s->vertex_count++;
    for (uint32_t i = 0; i < 3 * s->count; i++) {
        const uint32_t root = root_of(parent, i);
        s->corners[i / 3][i % 3] = s->corners[root / 3][root % 3];
    }
}

static double angle_at(const alb_vector t[3], int k)
{
    const alb_vector a = alb_sub(t[(k + 1) % 3], t[k]), b = alb_sub(t[(k + 2) % 3], t[k]);
    return atan2(alb_length(alb_cross(a, b)), alb_dot(a, b));
}

static bool fill_vertices(alb_geodesic_surface *s, alb_error *error)
{
    const size_t n = s->vertex_count;
    double *angles = alb_allocate(n, sizeof *angles, error);
    if (!angles || !(s->around_starts = alb_allocate(n + 1, sizeof *s->around_starts, error)) ||
        !(s->around = alb_allocate(3 * s->count, sizeof *s->around, error)) ||
        !(s->turns = alb_allocate(n, 1, error))) {
        free(angles);
        return false;
    }
    for (uint32_t i = 0; i < 3 * s->count; i++) {
        const uint32_t v = s->corners[i / 3][i % 3];
        s->around_starts[v]++;
        angles[v] += angle_at(s->triangles[i / 3], (int)(i % 3));
        if (s->neighbours[i / 3][i % 3] == UINT32_MAX) // both ends of a boundary edge
            s->turns[v] = s->turns[s->corners[i / 3][(i + 1) % 3]] = 1;
    }
    for (size_t v = 0, total = 0; v <= n; v++) {
        total += v < n ? s->around_starts[v] : 0;
        s->around_starts[v] = (uint32_t)total;
        if (v < n && angles[v] > 2 * M_PI + 1e-7)
            s->turns[v] = 1;
    }
    for (uint32_t i = (uint32_t)(3 * s->count); i-- > 0;)
        s->around[--s->around_starts[s->corners[i / 3][i % 3]]] = i;
    free(angles);
    return true;
}

bool alb_geodesic_surface_create(alb_geodesic_surface *surface, const alb_vector (*triangles)[3],
                                 const uint32_t (*neighbours)[3], size_t count, alb_error *error)
{
    *surface = (alb_geodesic_surface){.count = count, .triangles = triangles, .neighbours = neighbours};
    uint32_t *parent = alb_allocate(3 * count, sizeof *parent, error);
    bool ok = parent && (surface->corners = alb_allocate(count, sizeof *surface->corners, error));
    if (ok) {
        number_corners(surface, parent);
        ok = fill_vertices(surface, error);
    }
    free(parent);
    if (!ok)
        alb_geodesic_surface_free(surface);
    return ok;
}

void alb_geodesic_surface_free(alb_geodesic_surface *surface)
{
    free(surface->corners);
    free(surface->around_starts);
    free(surface->around);
    free(surface->turns);
    *surface = (alb_geodesic_surface){0};
}

size_t alb_geodesic_surface_bytes(const alb_geodesic_surface *surface)
{
    return surface->count * (3 + 3) * sizeof(uint32_t) + surface->vertex_count * (sizeof(uint32_t) + 1);
}
