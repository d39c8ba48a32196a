// Clusters are the vertices that share a cube of a lattice when the shape is made; afterwards they move with their
// vertices, so that a deforming object keeps its clusters and what is drawn does not flicker. A cluster stands at the
// mean of its vertices: on average over a smooth surface that is right to second order in the cube's side. Stops being
// true for an object that is torn apart after it was made.
#include "render/shadow_shape.h"
#include "base/memory.h"
#include <stdlib.h>
#include <string.h>

typedef struct keyed {
    int64_t cube[3];
    uint32_t vertex;
} keyed;

static int by_cube(const void *a, const void *b)
{
    const keyed *p = a, *q = b;
    for (int i = 0; i < 3; i++)
        if (p->cube[i] != q->cube[i])
            return p->cube[i] < q->cube[i] ? -1 : 1;
    return p->vertex < q->vertex ? -1 : p->vertex > q->vertex;
}

static bool find_clusters(alb_shadow_shape *shape, const alb_vector *vertices, double cell_mm, alb_error *error)
{
    keyed *keys = alb_allocate(shape->vertex_count, sizeof *keys, error);
    if (!keys)
        return false;
    for (size_t i = 0; i < shape->vertex_count; i++) {
        const double at[3] = {vertices[i].x, vertices[i].y, vertices[i].z};
        keys[i].vertex = (uint32_t)i;
        for (int k = 0; k < 3; k++)
            keys[i].cube[k] = (int64_t)floor(at[k] / cell_mm);
    }
    qsort(keys, shape->vertex_count, sizeof *keys, by_cube);
    for (size_t first = 0, end; first < shape->vertex_count; first = end, shape->cluster_count++)
        for (end = first; end < shape->vertex_count && !memcmp(keys[first].cube, keys[end].cube, sizeof keys->cube);
             end++)
            shape->cluster_of[keys[end].vertex] = (uint32_t)shape->cluster_count;
    free(keys);
    return true;
}

static void draw_between_clusters(alb_shadow_shape *shape)
{
    for (size_t f = 0; f < shape->face_count; f++) {
        uint32_t at[3];
        for (int k = 0; k < 3; k++)
            at[k] = shape->cluster_of[shape->faces[f][k]];
        if (shape->face_colours || (at[0] != at[1] && at[1] != at[2] && at[2] != at[0]))
            memcpy(shape->drawn[shape->drawn_count++], at, sizeof at);
    }
}

static int by_edge(const void *a, const void *b)
{
    const uint64_t *p = a, *q = b;
    return p[0] != q[0] ? (p[0] < q[0] ? -1 : 1) : 0;
}

static bool find_closed(alb_shadow_shape *shape, alb_error *error)
{
    const size_t count = 3 * shape->face_count;
    uint64_t(*edges)[2] = alb_allocate(count, sizeof *edges, error); // both ends, low first; whether it runs upwards
    if (!edges)
        return false;
    for (size_t e = 0; e < count; e++) {
        const uint64_t a = shape->faces[e / 3][e % 3], b = shape->faces[e / 3][(e + 1) % 3];
        edges[e][0] = a < b ? a << 32 | b : b << 32 | a;
        edges[e][1] = a < b;
    }
    qsort(edges, count, sizeof *edges, by_edge);
    shape->closed = true;
    for (size_t first = 0, end; first < count; first = end) {
        int upwards = 0;
        for (end = first; end < count && edges[end][0] == edges[first][0]; end++)
            upwards += edges[end][1] ? 1 : -1;
        shape->closed &= upwards == 0;
    }
    free(edges);
    return true;
}

static bool allocate(alb_shadow_shape *shape, const alb_mesh *mesh, bool shines, alb_error *error)
{
    const size_t n = shape->vertex_count;
    return (shape->faces = alb_allocate(mesh->face_count, sizeof *shape->faces, error)) &&
           (shape->drawn = alb_allocate(mesh->face_count, sizeof *shape->drawn, error)) &&
           (shape->cluster_of = alb_allocate(n, sizeof *shape->cluster_of, error)) &&
           (shape->share = alb_allocate(n, sizeof *shape->share, error)) &&
           (shape->x = alb_allocate(n, sizeof *shape->x, error)) &&
           (shape->y = alb_allocate(n, sizeof *shape->y, error)) &&
           (shape->z = alb_allocate(n, sizeof *shape->z, error)) &&
           (!shines || ((shape->face_colours = alb_allocate(mesh->face_count, sizeof *shape->face_colours, error)) &&
                        (shape->colours = alb_allocate(mesh->face_count + 1, sizeof *shape->colours, error))));
}

// Neighbours mostly have one colour: the one before is tried first.
static void find_colours(alb_shadow_shape *shape, const float (*face_radiance)[3])
{
    shape->colour_count = 1;
    for (size_t f = 0; f < shape->face_count; f++) {
        size_t c = f ? shape->face_colours[f - 1] : 0;
        if (memcmp(shape->colours[c], face_radiance[f], sizeof *shape->colours) != 0)
            for (c = 0; c < shape->colour_count; c++)
                if (!memcmp(shape->colours[c], face_radiance[f], sizeof *shape->colours))
                    break;
        if (c == shape->colour_count)
            memcpy(shape->colours[shape->colour_count++], face_radiance[f], sizeof *shape->colours);
        shape->face_colours[f] = (uint32_t)c;
    }
}

bool alb_shadow_shape_create(alb_shadow_shape *shape, const alb_mesh *mesh, const float (*face_radiance)[3],
                             double cell_mm, const char *name, alb_error *error)
{
    *shape = (alb_shadow_shape){.name = name, .face_count = mesh->face_count, .vertex_count = mesh->vertex_count};
    if (!mesh->face_count)
        return alb_fail(error, ALB_BAD_DATA, "%s: a shadow field of an object without faces", name);
    if (!allocate(shape, mesh, face_radiance, error))
        return false;
    memcpy(shape->faces, mesh->faces, mesh->face_count * sizeof *shape->faces);
    if (face_radiance)
        find_colours(shape, face_radiance);
    if (cell_mm > 0 && !face_radiance) {
        if (!find_clusters(shape, mesh->vertices, cell_mm, error))
            return false;
    } else
        for (size_t i = 0; i < mesh->vertex_count; i++)
            shape->cluster_of[i] = (uint32_t)shape->cluster_count++;
    for (size_t i = 0; i < mesh->vertex_count; i++)
        shape->x[shape->cluster_of[i]] += 1;
    for (size_t i = 0; i < mesh->vertex_count; i++)
        shape->share[i] = 1 / shape->x[shape->cluster_of[i]];
    draw_between_clusters(shape);
    return find_closed(shape, error);
}

void alb_shadow_shape_free(alb_shadow_shape *shape)
{
    free(shape->faces);
    free(shape->drawn);
    free(shape->cluster_of);
    free(shape->share);
    free(shape->x);
    free(shape->y);
    free(shape->z);
    free(shape->face_colours);
    free(shape->colours);
    *shape = (alb_shadow_shape){0};
}

void alb_shadow_shape_place(alb_shadow_shape *shape, const alb_vector *vertices, const alb_shadow_sphere *sphere)
{
    const double scale = 1 / sphere->radius_mm;
    for (size_t c = 0; c < shape->cluster_count; c++)
        shape->x[c] = shape->y[c] = shape->z[c] = 0;
    for (size_t i = 0; i < shape->vertex_count; i++) {
        const alb_vector at = alb_times(scale, alb_sub(vertices[i], sphere->centre_mm));
        const uint32_t c = shape->cluster_of[i];
        shape->x[c] += shape->share[i] * (float)at.x;
        shape->y[c] += shape->share[i] * (float)at.y;
        shape->z[c] += shape->share[i] * (float)at.z;
    }
}
