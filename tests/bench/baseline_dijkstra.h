// The paper's recipe for optical paths: Dijkstra over the voxels inside, each joined to its 26 neighbours.
#pragma once
#include "render/voxels.h"

typedef struct baseline_dijkstra {
    const alb_voxels *voxels;
    double *lengths; // of each voxel, from the source
    size_t *heap, *places, heap_count;
} baseline_dijkstra;

bool baseline_dijkstra_create(baseline_dijkstra *d, const alb_voxels *voxels, alb_error *error);
void baseline_dijkstra_free(baseline_dijkstra *d);
// Lengths from the voxel of the point to all voxels that are inside or hold the surface.
void baseline_dijkstra_run(baseline_dijkstra *d, alb_vector from);
// INFINITY where no path leads. The ends are taken to the middles of their voxels, as the paper does.
double baseline_dijkstra_length(const baseline_dijkstra *d, alb_vector to);
