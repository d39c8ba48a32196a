// Probes are drawn one by one, each the vertex farthest from those before, along the surface. A vertex v takes from its
// probes p nearest along it by weights (1/s_p - 1/s)^2 (Franke & Little), s the distance of the next one: they fall to
// zero where a probe leaves the set. Along an edge the distance is its length, longer where the surface turns:
//     s^2 = |e|^2 + (bend R |n - n'|)^2,  R the object's reach
// so that the two sides of a crease are far apart. Neighbours are those of the mesh as it was when the surface was
// made.
#include "render/shadow_probes.h"
#include "base/heap.h"
#include "base/memory.h"
#include <stdlib.h>

enum { NEIGHBOURS = ALB_SHADOW_PROBE_NEIGHBOURS, LABELS = NEIGHBOURS + 1 };
static const double bend = 0.2;

// The mesh's edges out of each vertex: to[starts[v]] .. to[starts[v + 1]].
typedef struct graph {
    size_t count, edges;
    uint32_t *starts, *to;
    float *lengths;
    alb_heap heap;
} graph;

static void free_graph(graph *g)
{
    free(g->starts);
    free(g->to);
    free(g->lengths);
    free(g->heap.entries);
}

static bool create_graph(graph *g, const alb_mesh *mesh, const alb_vector *normals, double reach_mm, alb_error *error)
{
    const size_t n = g->count = mesh->vertex_count;
    g->edges = 6 * mesh->face_count;
    g->heap.capacity = LABELS * g->edges + n; // every label of a vertex goes along every edge once
    if (!(g->starts = alb_allocate(n + 2, sizeof *g->starts, error)) ||
        !(g->to = alb_allocate(g->edges, sizeof *g->to, error)) ||
        !(g->lengths = alb_allocate(g->edges, sizeof *g->lengths, error)) ||
        !(g->heap.entries = alb_allocate(g->heap.capacity, sizeof *g->heap.entries, error)))
        return false;
    for (size_t f = 0; f < mesh->face_count; f++)
        for (int k = 0; k < 3; k++)
            g->starts[mesh->faces[f][k] + 2] += 2;
    for (size_t v = 2; v < n + 2; v++)
        g->starts[v] += g->starts[v - 1];
    for (size_t f = 0; f < mesh->face_count; f++)
        for (int k = 0; k < 6; k++) {
            const uint32_t from = mesh->faces[f][k % 3], to = mesh->faces[f][(k % 3 + 1 + k / 3) % 3],
                           at = g->starts[from + 1]++;
            const double turn = bend * reach_mm * alb_length(alb_sub(normals[from], normals[to]));
            g->to[at] = to;
            g->lengths[at] = (float)hypot(alb_length(alb_sub(mesh->vertices[from], mesh->vertices[to])), turn);
        }
    return true;
}

// Lowers the distances to those from one more vertex.
static void spread(double *distances, graph *g, uint32_t from)
{
    distances[from] = 0;
    for (alb_heap_push(&g->heap, 0, from); g->heap.count;) {
        const alb_heap_entry at = alb_heap_pop(&g->heap);
        for (uint32_t e = g->starts[at.id]; at.key <= distances[at.id] && e < g->starts[at.id + 1]; e++) {
            const double there = at.key + (double)g->lengths[e];
            if (there >= distances[g->to[e]])
                continue;
            distances[g->to[e]] = there;
            alb_heap_push(&g->heap, there, g->to[e]);
        }
    }
}

// One in each connected part, then the farthest vertex each time.
static bool draw_probes(alb_shadow_probes *s, graph *g, size_t limit, alb_error *error)
{
    double *distances = alb_allocate(g->count, sizeof *distances, error);
    if (!distances)
        return false;
    for (size_t v = 0; v < g->count; v++)
        distances[v] = INFINITY;
    for (uint32_t v = 0; v < g->count; v++)
        if (limit >= g->count || isinf(distances[v])) {
            s->vertices[s->count++] = v;
            spread(distances, g, v);
        }
    while (s->count < limit) {
        uint32_t farthest = 0;
        for (uint32_t v = 1; v < g->count; v++)
            farthest = distances[v] > distances[farthest] ? v : farthest;
        if (distances[farthest] == 0)
            break;
        s->vertices[s->count++] = farthest;
        spread(distances, g, farthest);
    }
    free(distances);
    return true;
}

typedef struct label {
    double distance;
    uint32_t probe;
} label;

static bool is_known(const label *labels, int count, uint32_t probe)
{
    for (int k = 0; k < count; k++)
        if (labels[k].probe == probe)
            return true;
    return false;
}

// The nearest probes of every vertex: all probes set out at once, a vertex passes on the first LABELS that reach it.
// Entries of the heap are vertices of probes, id = place in `pending`.
static bool find_labels(label (*labels)[LABELS], int *counts, const alb_shadow_probes *s, graph *g, alb_error *error)
{
    struct arrival {
        uint32_t vertex, probe;
    } *pending = alb_allocate(g->heap.capacity, sizeof *pending, error);
    uint32_t used = 0;
    if (!pending)
        return false;
    for (uint32_t p = 0; p < s->count; p++) {
        pending[used] = (struct arrival){s->vertices[p], p};
        alb_heap_push(&g->heap, 0, used++);
    }
    while (g->heap.count) {
        const alb_heap_entry at = alb_heap_pop(&g->heap);
        const uint32_t v = pending[at.id].vertex, probe = pending[at.id].probe;
        if (counts[v] == LABELS || is_known(labels[v], counts[v], probe))
            continue;
        labels[v][counts[v]++] = (label){at.key, probe};
        for (uint32_t e = g->starts[v]; e < g->starts[v + 1]; e++) {
            const uint32_t to = g->to[e];
            if (counts[to] == LABELS || is_known(labels[to], counts[to], probe))
                continue;
            pending[used] = (struct arrival){to, probe};
            alb_heap_push(&g->heap, at.key + (double)g->lengths[e], used++);
        }
    }
    free(pending);
    return true;
}

static void weigh(uint32_t *neighbours, float *weights, const label *labels, int count)
{
    const double last = count == LABELS ? labels[LABELS - 1].distance : 2 * labels[count - 1].distance;
    double share[NEIGHBOURS] = {1}, sum = 0;
    for (int k = 0; k < NEIGHBOURS; k++)
        neighbours[k] = labels[k < count ? k : 0].probe;
    for (int k = 0; k < NEIGHBOURS && k < count; k++) {
        if (labels[0].distance > 0 && last > labels[0].distance)
            share[k] = pow(1 / labels[k].distance - 1 / last, 2);
        sum += share[k];
    }
    for (int k = 0; k < NEIGHBOURS && k < count; k++)
        weights[k] = (float)(share[k] / sum);
}

static bool connect(alb_shadow_probes *s, graph *g, alb_error *error)
{
    label(*labels)[LABELS] = alb_allocate(g->count, sizeof *labels, error);
    int *counts = alb_allocate(g->count, sizeof *counts, error);
    const bool ok = labels && counts && find_labels(labels, counts, s, g, error);
    for (size_t v = 0; ok && v < g->count; v++)
        weigh(s->neighbours[v], s->weights[v], labels[v], counts[v]);
    free(labels);
    free(counts);
    return ok;
}

// The distance of the farthest vertex from the first one.
static double reach_of(const alb_mesh *mesh)
{
    double reach_mm = 0;
    for (size_t v = 0; v < mesh->vertex_count; v++)
        reach_mm = fmax(reach_mm, alb_length(alb_sub(mesh->vertices[v], mesh->vertices[0])));
    return reach_mm;
}

bool alb_shadow_probes_create(alb_shadow_probes *probes, const alb_mesh *mesh, const alb_vector *normals, size_t limit,
                              alb_error *error)
{
    const size_t n = mesh->vertex_count;
    graph g = {0};
    *probes = (alb_shadow_probes){0};
    const bool ok = (probes->vertices = alb_allocate(n, sizeof *probes->vertices, error)) &&
                    (probes->neighbours = alb_allocate(n, sizeof *probes->neighbours, error)) &&
                    (probes->weights = alb_allocate(n, sizeof *probes->weights, error)) &&
                    create_graph(&g, mesh, normals, reach_of(mesh), error) && draw_probes(probes, &g, limit, error) &&
                    connect(probes, &g, error);
    free_graph(&g);
    return ok;
}

void alb_shadow_probes_free(alb_shadow_probes *probes)
{
    free(probes->vertices);
    free(probes->neighbours);
    free(probes->weights);
    *probes = (alb_shadow_probes){0};
}
