// At a probe with normal n, N directions spread as the cosine over its hemisphere, the same in every probe's frame
// (heights sqrt(1 - (q + 1/2) / N), each turned on by the golden angle):
//     D_i = integral of Y_i(d) max(0, n.d) O(d)  =  pi / N sum over rays q that meet the object of Y_i(d_q)
// A vertex v takes D from its probes p nearest along the surface, weights (1/s_p - 1/s)^2 (Franke & Little), s the
// distance of the next one: they fall to zero where a probe leaves the set. Along an edge the distance is its length,
// longer where the surface turns: s^2 = |e|^2 + (bend R |n - n'|)^2, R the object's reach, so that the two sides of a
// crease are far apart. A probe whose rays are all blocked lies inside another part of the object, where nothing is
// seen of it; vertices around, which may be outside, leave it out. Probes are drawn one by one, each the vertex
// farthest from those before.
//
// Stops being true where what is hidden changes between neighbouring probes; neighbours are those of the mesh as it was
// when the surface was made.
#include "render/shadow_surface.h"
#include "base/heap.h"
#include "base/memory.h"
#include "render/sh_rotate.h"
#include <stdlib.h>
#include <string.h>

enum { RAYS = 32, VALUES = ALB_SHADOW_VALUES, NEIGHBOURS = ALB_SHADOW_PROBE_NEIGHBOURS, LABELS = NEIGHBOURS + 1 };
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
static bool draw_probes(alb_shadow_surface *s, graph *g, size_t limit, alb_error *error)
{
    double *distances = alb_allocate(g->count, sizeof *distances, error);
    if (!distances)
        return false;
    for (size_t v = 0; v < g->count; v++)
        distances[v] = INFINITY;
    for (uint32_t v = 0; v < g->count; v++)
        if (limit >= g->count || isinf(distances[v])) {
            s->probes[s->probe_count++] = v;
            spread(distances, g, v);
        }
    while (s->probe_count < limit) {
        uint32_t farthest = 0;
        for (uint32_t v = 1; v < g->count; v++)
            farthest = distances[v] > distances[farthest] ? v : farthest;
        if (distances[farthest] == 0)
            break;
        s->probes[s->probe_count++] = farthest;
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
static bool find_labels(label (*labels)[LABELS], int *counts, const alb_shadow_surface *s, graph *g, alb_error *error)
{
    struct arrival {
        uint32_t vertex, probe;
    } *pending = alb_allocate(g->heap.capacity, sizeof *pending, error);
    uint32_t used = 0;
    if (!pending)
        return false;
    for (uint32_t p = 0; p < s->probe_count; p++) {
        pending[used] = (struct arrival){s->probes[p], p};
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

static bool connect(alb_shadow_surface *s, graph *g, alb_error *error)
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

static bool copy_mesh(alb_mesh *out, const alb_mesh *mesh, double *reach_mm, alb_error *error)
{
    bool ok = true;
    *reach_mm = 0;
    for (size_t v = 0; ok && v < mesh->vertex_count; v++) {
        ok = alb_mesh_add_vertex(out, mesh->vertices[v], error);
        *reach_mm = fmax(*reach_mm, alb_length(alb_sub(mesh->vertices[v], mesh->vertices[0])));
    }
    for (size_t f = 0; ok && f < mesh->face_count; f++)
        ok = alb_mesh_add_face(out, mesh->faces[f][0], mesh->faces[f][1], mesh->faces[f][2], 0, error);
    return ok;
}

bool alb_shadow_surface_create(alb_shadow_surface *s, const alb_mesh *mesh, const alb_vector *normals, size_t probes,
                               alb_error *error)
{
    const size_t n = mesh->vertex_count;
    graph g = {0};
    double reach_mm;
    *s = (alb_shadow_surface){0};
    bool ok = copy_mesh(&s->mesh, mesh, &reach_mm, error) && (s->probes = alb_allocate(n, sizeof *s->probes, error)) &&
              (s->neighbours = alb_allocate(n, sizeof *s->neighbours, error)) &&
              (s->weights = alb_allocate(n, sizeof *s->weights, error)) &&
              (s->hidden = alb_allocate(n, sizeof *s->hidden, error)) &&
              create_graph(&g, mesh, normals, reach_mm, error) && draw_probes(s, &g, probes, error) &&
              connect(s, &g, error);
    ok = ok && alb_tracer_create_moving(&s->tracer, &s->mesh, error) &&
         (s->seen = alb_allocate(VALUES * s->probe_count, sizeof *s->seen, error)) &&
         (s->axes = alb_allocate(3 * s->probe_count, sizeof *s->axes, error)) &&
         (s->buried = alb_allocate(s->probe_count, sizeof *s->buried, error));
    free_graph(&g);
    if (!ok)
        alb_shadow_surface_free(s);
    return ok;
}

void alb_shadow_surface_free(alb_shadow_surface *s)
{
    alb_mesh_free(&s->mesh);
    alb_tracer_free(&s->tracer);
    free(s->probes);
    free(s->neighbours);
    free(s->weights);
    free(s->hidden);
    free(s->seen);
    free(s->axes);
    free(s->buried);
    *s = (alb_shadow_surface){0};
}

typedef struct rays {
    alb_vector directions[RAYS];
    float basis[RAYS][VALUES]; // times pi / N
} rays;

static void set_rays(rays *r)
{
    double basis[VALUES];
    for (int q = 0; q < RAYS; q++) {
        const double u = (q + 0.5) / RAYS, turn = M_PI * (3 - sqrt(5)) * q;
        r->directions[q] = (alb_vector){sqrt(u) * cos(turn), sqrt(u) * sin(turn), sqrt(1 - u)};
        alb_sh_evaluate(basis, ALB_SHADOW_ORDER, r->directions[q]);
        for (int i = 0; i < VALUES; i++)
            r->basis[q][i] = (float)(M_PI / RAYS * basis[i]);
    }
}

static void look(alb_shadow_surface *s, size_t p, const rays *r, alb_vector normal, double far_mm)
{
    const alb_vector from = alb_add(s->mesh.vertices[s->probes[p]], alb_times(256 * s->tracer.slack_mm, normal));
    const size_t count = s->probe_count;
    float sum[VALUES] = {0};
    double world_from_axis[3][3];
    alb_sh_axis_rotation(world_from_axis, normal);
    int blocked = 0;
    for (int q = 0; q < RAYS; q++) {
        const alb_vector d = r->directions[q];
        double to[3];
        for (int k = 0; k < 3; k++)
            to[k] = world_from_axis[k][0] * d.x + world_from_axis[k][1] * d.y + world_from_axis[k][2] * d.z;
        const alb_vector end = alb_add(from, alb_times(far_mm, (alb_vector){to[0], to[1], to[2]}));
        if (!alb_tracer_blocked(&s->tracer, from, end))
            continue;
        blocked++;
        for (int i = 0; i < VALUES; i++)
            sum[i] += r->basis[q][i];
    }
    s->buried[p] = blocked == RAYS;
    for (size_t i = 0; i < VALUES; i++)
        s->seen[i * count + p] = sum[i];
    s->axes[p] = (float)normal.x, s->axes[count + p] = (float)normal.y, s->axes[2 * count + p] = (float)normal.z;
}

// The weights of a vertex without its buried probes; where those are all that count, the others among the four alike.
static void leave_out_buried(float out[NEIGHBOURS], const alb_shadow_surface *s, size_t vertex)
{
    float sum = 0, open = 0;
    for (int k = 0; k < NEIGHBOURS; k++) {
        const bool buried = s->buried[s->neighbours[vertex][k]];
        out[k] = s->weights[vertex][k];
        sum += buried ? 0 : out[k];
        open += buried ? 0 : 1;
    }
    for (int k = 0; k < NEIGHBOURS && open > 0; k++)
        out[k] = s->buried[s->neighbours[vertex][k]] ? 0 : sum > 0 ? out[k] / sum : 1 / open;
}

static void interpolate(alb_shadow_surface *s)
{
    const size_t count = s->probe_count;
    alb_sh_from_axis_batch(s->seen, s->seen, ALB_SHADOW_ORDER, s->axes, count, count);
#pragma omp parallel for schedule(static)
    for (size_t v = 0; v < s->mesh.vertex_count; v++) {
        float weights[NEIGHBOURS];
        leave_out_buried(weights, s, v);
        for (size_t i = 0; i < VALUES; i++) {
            float sum = 0;
            for (int k = 0; k < NEIGHBOURS; k++)
                sum += weights[k] * s->seen[i * count + s->neighbours[v][k]];
            s->hidden[v][i] = sum;
        }
    }
}

bool alb_shadow_surface_sample(alb_shadow_surface *s, const alb_vector *vertices, const alb_vector *normals,
                               alb_error *error)
{
    const size_t bytes = s->mesh.vertex_count * sizeof *vertices;
    rays r;
    if (s->sampled && !memcmp(s->mesh.vertices, vertices, bytes))
        return true;
    memcpy(s->mesh.vertices, vertices, bytes);
    s->sampled = false;
    if (!alb_tracer_move(&s->tracer, vertices, s->mesh.vertex_count, error))
        return false;
    const double far_mm = 0x1p24 / 8 * s->tracer.slack_mm; // four times the half of the longest extent
    set_rays(&r);
#pragma omp parallel for schedule(dynamic, 8)
    for (size_t p = 0; p < s->probe_count; p++)
        look(s, p, &r, normals[s->probes[p]], far_mm);
    interpolate(s);
    s->sampled = true;
    return true;
}
