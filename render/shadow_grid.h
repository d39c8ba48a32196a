// The nodes of a shadow field: directions in which it is sampled, and how to interpolate between them.
#pragma once
#include "base/vector.h"
#include <stdint.h>

// The lattice corners of cells x cells cells on each face of a cube, 6 cells^2 + 2 in all (386 for the paper's 6 x 8 x
// 8). Faces share the nodes on their seams, so that interpolation is continuous across seams and corners.
typedef struct alb_shadow_grid {
    int cells; // 1 to ALB_SHADOW_CELLS_MAX
} alb_shadow_grid;
enum { ALB_SHADOW_CELLS_MAX = 64 };

static inline int alb_shadow_grid_count(alb_shadow_grid grid) { return 6 * grid.cells * grid.cells + 2; }
// Unit direction of node 0 .. count - 1.
alb_vector alb_shadow_grid_direction(alb_shadow_grid grid, int node);

// Four nodes and their bilinear weights (>= 0, sum 1).
typedef struct alb_shadow_place {
    int nodes[4];
    float weights[4];
} alb_shadow_place;
// The place of a direction of any length but zero. The weights are continuous functions of the direction.
alb_shadow_place alb_shadow_grid_place(alb_shadow_grid grid, alb_vector direction);
