// Exact shortest paths along a triangle surface, from a point to points, up to a reach.
#pragma once
#include "base/error.h"
#include "base/heap.h"
#include "base/vector.h"
#include <stddef.h>
#include <stdint.h>

// What is borrowed of the surface: corners, and 3 * triangle + edge across each edge (UINT32_MAX: none).
typedef struct alb_geodesic_surface {
    size_t count, vertex_count;
    const alb_vector (*triangles)[3];
    const uint32_t (*neighbours)[3];
    uint32_t (*corners)[3];           // vertex of each corner
    uint32_t *around_starts, *around; // triangles of each vertex: 3 * triangle + corner
    unsigned char *turns;             // of each vertex: 1 where paths may turn, at a boundary or a saddle
} alb_geodesic_surface;

// Corners are told apart by their place. Fails for want of memory alone.
bool alb_geodesic_surface_create(alb_geodesic_surface *surface, const alb_vector (*triangles)[3],
                                 const uint32_t (*neighbours)[3], size_t count, alb_error *error);
void alb_geodesic_surface_free(alb_geodesic_surface *surface);
size_t alb_geodesic_surface_bytes(const alb_geodesic_surface *surface);

// A point to go to: seen along the path that leads to `at`, a point of the triangle, and measured to `end`, beside it.
typedef struct alb_geodesic_target {
    uint32_t triangle;
    alb_vector at, end;
    double distance_mm; // the answer; INFINITY beyond the reach
    double to_at_mm;    // the same to `at`
    uint32_t next;      // workspace
} alb_geodesic_target;

// Workspace of one thread.
typedef struct alb_geodesic_memory {
    struct alb_window *windows;
    alb_heap heap;
    uint32_t *free, *heads, *stamps, *vertex_stamps, stamp, used;
    double *distances;
    size_t free_count, dropped; // dropped: windows there was no room for; answers stay lengths of paths, perhaps not
                                // the shortest
} alb_geodesic_memory;
bool alb_geodesic_memory_create(alb_geodesic_memory *memory, const alb_geodesic_surface *surface, alb_error *error);
void alb_geodesic_memory_free(alb_geodesic_memory *memory);

// The targets stand in groups of `alternatives` (1: each for itself), count is a multiple of it; of a group only the
// nearest is sure to be shortest, the others are at least so far. dropped tells windows there was no room for.
void alb_geodesic_run(alb_geodesic_target *targets, size_t count, size_t alternatives, alb_geodesic_memory *memory,
                      const alb_geodesic_surface *surface, uint32_t triangle, alb_vector from, double reach_mm);
