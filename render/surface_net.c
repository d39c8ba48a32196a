// The triangles of one body, side by side, and what lies across their edges.
#include "base/memory.h"
#include "render/mesh_edges.h"
#include "render/optical_solid.h"
#include <stdlib.h>

static bool join(alb_surface_net *net, const alb_body *body, const alb_mesh *mesh, alb_error *error)
{
    const size_t count = 3 * net->count;
    alb_half_edge *edges = alb_half_edges_sorted((const uint32_t(*)[3])mesh->faces, body->patches, net->count, error);
    if (!edges)
        return false;
    for (size_t i = 0; i < count; i++)
        net->neighbours[i / 3][i % 3] = UINT32_MAX;
    for (size_t i = 0, next; i < count; i = next) {
        next = alb_half_edges_end(edges, count, i);
        if (next - i != 2 || edges[i].up == edges[i + 1].up)
            continue;
        const uint32_t a = edges[i].place, b = edges[i + 1].place;
        net->neighbours[a / 3][a % 3] = b, net->neighbours[b / 3][b % 3] = a;
    }
    free(edges);
    return true;
}

static void hang_doors(alb_surface_net *net)
{
    for (size_t i = 0; i < 3 * net->count; i++)
        net->doors[i] = (alb_door){net->triangles[i / 3][(i + 2) % 3],
                                   {net->neighbours[i / 3][(i + 2) % 3], net->neighbours[i / 3][(i + 1) % 3]}};
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return x < y ? -1 : x > y;
}

static bool fill(alb_surface_net *net, const alb_body *body, const alb_patches *patches, alb_error *error)
{
    double *longest = alb_allocate(net->count, sizeof *longest, error);
    if (!longest)
        return false;
    alb_vector low = patches->centroids[body->patches[0]], high = low;
    for (size_t i = 0; i < net->count; i++) {
        const alb_vector c = patches->centroids[body->patches[i]];
        low = (alb_vector){fmin(low.x, c.x), fmin(low.y, c.y), fmin(low.z, c.z)};
        high = (alb_vector){fmax(high.x, c.x), fmax(high.y, c.y), fmax(high.z, c.z)};
    }
    net->origin = alb_times(0.5, alb_add(low, high));
    for (size_t i = 0; i < net->count; i++) {
        const uint32_t patch = body->patches[i];
        alb_patch_triangle(net->triangles[i], patches, patch);
        for (int k = 0; k < 3; k++)
            net->triangles[i][k] = alb_sub(net->triangles[i][k], net->origin);
        for (int k = 0; k < 3; k++)
            longest[i] = fmax(longest[i], alb_length(alb_sub(net->triangles[i][(k + 1) % 3], net->triangles[i][k])));
        net->middles[i] = alb_sub(patches->centroids[patch], net->origin);
        net->normals[i] = patches->normals[patch];
        net->local[patch - net->first] = (uint32_t)i;
    }
    qsort(longest, net->count, sizeof *longest, by_value);
    net->edge_mm = longest[net->count / 2];
    free(longest);
    return true;
}

bool alb_surface_net_create(alb_surface_net *net, const alb_body *body, const alb_patches *patches, alb_error *error)
{
    const size_t n = body->count;
    *net = (alb_surface_net){.count = n};
    if (n == 0)
        return true;
    net->first = body->patches[0], net->last = body->patches[n - 1];
    if ((net->triangles = alb_allocate(n, sizeof *net->triangles, error)) &&
        (net->normals = alb_allocate(n, sizeof *net->normals, error)) &&
        (net->middles = alb_allocate(n, sizeof *net->middles, error)) &&
        (net->neighbours = alb_allocate(n, sizeof *net->neighbours, error)) &&
        (net->doors = alb_allocate(3 * n, sizeof *net->doors, error)) &&
        (net->local = alb_allocate((size_t)(net->last - net->first) + 1, sizeof *net->local, error)) &&
        fill(net, body, patches, error) && join(net, body, patches->mesh, error)) {
        hang_doors(net);
        return true;
    }
    alb_surface_net_free(net);
    return false;
}

void alb_surface_net_free(alb_surface_net *net)
{
    free(net->triangles);
    free(net->normals);
    free(net->middles);
    free(net->neighbours);
    free(net->doors);
    free(net->local);
    *net = (alb_surface_net){0};
}
