// Areas, centroids and normals of triangles; connected bodies by union-find over shared edges.
//
// A closed surface that is convex at every edge bounds a convex body; one component only, which is what a body is here.
#include "render/patch.h"
#include "base/memory.h"
#include <stdlib.h>
#include <string.h>

static alb_vector corner(const alb_mesh *mesh, size_t face, int k) { return mesh->vertices[mesh->faces[face][k]]; }

bool alb_patches_create(alb_patches *patches, const alb_mesh *mesh, alb_error *error)
{
    const size_t n = mesh->face_count;
    *patches = (alb_patches){.mesh = mesh, .count = n};
    if (!(patches->centroids = alb_allocate(n, sizeof *patches->centroids, error)) ||
        !(patches->normals = alb_allocate(n, sizeof *patches->normals, error)) ||
        !(patches->areas_mm2 = alb_allocate(n, sizeof *patches->areas_mm2, error))) {
        alb_patches_free(patches);
        return false;
    }
    alb_vector low = {INFINITY, INFINITY, INFINITY}, high = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < n; i++) {
        const alb_vector a = corner(mesh, i, 0), b = corner(mesh, i, 1), c = corner(mesh, i, 2);
        const alb_vector cross = alb_cross(alb_sub(b, a), alb_sub(c, a));
        patches->centroids[i] = alb_times(1.0 / 3, alb_add(a, alb_add(b, c)));
        patches->normals[i] = alb_unit(cross);
        patches->areas_mm2[i] = 0.5 * alb_length(cross);
        for (int k = 0; k < 3; k++) {
            const alb_vector at = corner(mesh, i, k);
            low = (alb_vector){fmin(low.x, at.x), fmin(low.y, at.y), fmin(low.z, at.z)};
            high = (alb_vector){fmax(high.x, at.x), fmax(high.y, at.y), fmax(high.z, at.z)};
        }
    }
    if (n)
        patches->offset_mm = 16 * 0x1p-24 * fmax(high.x - low.x, fmax(high.y - low.y, high.z - low.z));
    return true;
}

void alb_patches_free(alb_patches *patches)
{
    free(patches->centroids);
    free(patches->normals);
    free(patches->areas_mm2);
    free(patches->free_cells);
    *patches = (alb_patches){0};
}

void alb_patch_triangle(alb_vector triangle[3], const alb_patches *patches, size_t patch)
{
    for (int k = 0; k < 3; k++)
        triangle[k] = corner(patches->mesh, patch, k);
}

// Cell k lies in row r = floor(sqrt k) from corner 0, the 2 r + 1 cells of a row alternately upright and turned over.
void alb_patch_cell(alb_vector triangle[3], const alb_patches *patches, size_t patch, int cell)
{
    alb_vector whole[3];
    alb_patch_triangle(whole, patches, patch);
    const int row = (int)sqrt(cell + 0.5), across = cell - row * row, left = across / 2;
    const int upright[3][2] = {{row, left}, {row + 1, left}, {row + 1, left + 1}};
    const int over[3][2] = {{row, left}, {row + 1, left + 1}, {row, left + 1}};
    for (int k = 0; k < 3; k++) {
        const int *at = across % 2 ? over[k] : upright[k]; // row, place in it
        const double wc = at[1] / 8.0, wb = (at[0] - at[1]) / 8.0;
        triangle[k] =
            alb_add(alb_times(1 - wb - wc, whole[0]), alb_add(alb_times(wb, whole[1]), alb_times(wc, whole[2])));
    }
}

// Cell number `place` (0-based) of those that are set.
static int set_cell(uint64_t cells, int place)
{
    while (place-- > 0)
        cells &= cells - 1;
    return __builtin_ctzll(cells);
}

alb_vector alb_patch_point(const alb_patches *patches, size_t patch, double u, double v)
{
    alb_vector t[3];
    const uint64_t cells = patches->free_cells ? patches->free_cells[patch] : UINT64_MAX;
    if (cells && cells != UINT64_MAX) {
        const double along = u * __builtin_popcountll(cells);
        alb_patch_cell(t, patches, patch, set_cell(cells, (int)along));
        u = along - floor(along);
    } else
        alb_patch_triangle(t, patches, patch);
    const double root = sqrt(u), wa = 1 - root, wb = root * (1 - v), wc = root * v;
    const alb_vector point = alb_add(alb_times(wa, t[0]), alb_add(alb_times(wb, t[1]), alb_times(wc, t[2])));
    return alb_add(point, alb_times(patches->offset_mm, patches->normals[patch]));
}

// A half edge: its two ends in ascending order, so that partners sort together.
typedef struct half_edge {
    int label;
    uint32_t low, high, face, opposite;
    bool forward; // runs from low to high
} half_edge;

static int by_edge(const void *a, const void *b)
{
    const half_edge *p = a, *q = b;
    if (p->label != q->label)
        return p->label < q->label ? -1 : 1;
    if (p->low != q->low)
        return p->low < q->low ? -1 : 1;
    if (p->high != q->high)
        return p->high < q->high ? -1 : 1;
    return p->face < q->face ? -1 : p->face > q->face;
}

static uint32_t root_of(uint32_t *parent, uint32_t i)
{
    while (parent[i] != i)
        i = parent[i] = parent[parent[i]];
    return i;
}

static size_t collect_edges(half_edge *edges, const alb_patches *patches, const int *labels)
{
    size_t count = 0;
    for (size_t f = 0; f < patches->count; f++)
        for (int k = 0; k < 3 && labels[f] >= 0; k++) {
            const uint32_t *face = patches->mesh->faces[f], a = face[k], b = face[(k + 1) % 3];
            edges[count++] =
                (half_edge){labels[f], a < b ? a : b, a < b ? b : a, (uint32_t)f, face[(k + 2) % 3], a < b};
        }
    qsort(edges, count, sizeof *edges, by_edge);
    return count;
}

// Whether the neighbour's far corner rises above this face's plane by more than half a degree.
static bool bends_out(const alb_patches *patches, const half_edge *p, const half_edge *q)
{
    const alb_vector rise = alb_sub(patches->mesh->vertices[q->opposite], patches->mesh->vertices[p->low]);
    return alb_dot(rise, patches->normals[p->face]) > 0.0087 * alb_length(rise);
}

typedef struct flags {
    bool open, concave;
} flags;

static void join(uint32_t *parent, flags *of_face, const alb_patches *patches, const half_edge *edges, size_t count)
{
    for (size_t i = 0, next; i < count; i = next) {
        for (next = i + 1; next < count && edges[next].label == edges[i].label && edges[next].low == edges[i].low &&
                           edges[next].high == edges[i].high;
             next++) {
            const uint32_t a = root_of(parent, edges[i].face), b = root_of(parent, edges[next].face);
            parent[a < b ? b : a] = a < b ? a : b;
        }
        if (next - i != 2 || edges[i].forward == edges[i + 1].forward)
            of_face[edges[i].face].open = true;
        else if (bends_out(patches, &edges[i], &edges[i + 1]))
            of_face[edges[i].face].concave = true;
    }
}

// Groups the labelled faces by their root: bodies in the order of their first face.
static bool gather(alb_bodies *bodies, uint32_t *parent, const flags *of_face, const int *labels, size_t n,
                   alb_error *error)
{
    bool ok = false;
    size_t placed = 0;
    uint32_t *body_of = alb_allocate(n, sizeof *body_of, error);
    bodies->patches = alb_allocate(n, sizeof *bodies->patches, error);
    bodies->bodies = NULL;
    if (!body_of || !bodies->patches)
        goto done;
    for (size_t f = 0; f < n; f++)
        if (labels[f] >= 0 && root_of(parent, (uint32_t)f) == f)
            body_of[f] = (uint32_t)bodies->count++;
    if (!(bodies->bodies = alb_allocate(bodies->count, sizeof *bodies->bodies, error)))
        goto done;
    for (size_t f = 0; f < n; f++)
        if (labels[f] >= 0)
            bodies->bodies[body_of[root_of(parent, (uint32_t)f)]].count++;
    for (size_t b = 0; b < bodies->count; b++) {
        alb_body *body = &bodies->bodies[b];
        body->patches = bodies->patches + placed;
        placed += body->count;
        body->count = 0;
        body->closed = body->convex = true;
    }
    for (size_t f = 0; f < n; f++) {
        if (labels[f] < 0)
            continue;
        alb_body *body = &bodies->bodies[body_of[root_of(parent, (uint32_t)f)]];
        body->patches[body->count++] = (uint32_t)f;
        body->closed &= !of_face[f].open;
        body->convex &= !of_face[f].open && !of_face[f].concave;
    }
    ok = true;
done:
    free(body_of);
    return ok;
}

bool alb_bodies_find(alb_bodies *bodies, const alb_patches *patches, const int *labels, alb_error *error)
{
    bool ok = false;
    const size_t n = patches->count;
    half_edge *edges = alb_allocate(3 * n, sizeof *edges, error);
    uint32_t *parent = alb_allocate(n, sizeof *parent, error);
    flags *of_face = alb_allocate(n, sizeof *of_face, error);
    *bodies = (alb_bodies){0};
    if (!edges || !parent || !of_face)
        goto done;
    for (size_t f = 0; f < n; f++)
        parent[f] = (uint32_t)f;
    join(parent, of_face, patches, edges, collect_edges(edges, patches, labels));
    ok = gather(bodies, parent, of_face, labels, n, error);
done:
    free(edges);
    free(parent);
    free(of_face);
    if (!ok)
        alb_bodies_free(bodies);
    return ok;
}

void alb_bodies_free(alb_bodies *bodies)
{
    free(bodies->bodies);
    free(bodies->patches);
    *bodies = (alb_bodies){0};
}
