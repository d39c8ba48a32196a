// Winding number of a triangle surface about a point: 1 inside a closed surface, 0 outside, in between near holes.
#pragma once
#include "base/error.h"
#include "base/vector.h"
#include <stddef.h>
#include <stdint.h>

typedef struct alb_winding_node {
    alb_vector centre, dipole;  // area-weighted middle; sum of area times normal
    double radius;              // of a ball about the centre that holds the triangles
    uint32_t begin, end, right; // triangles in `order`; the left child follows its parent, 0: a leaf
} alb_winding_node;

typedef struct alb_winding {
    const alb_vector (*triangles)[3]; // borrowed
    uint32_t *order;
    alb_winding_node *nodes;
    size_t count, node_count;
} alb_winding;

// Fails for want of memory alone.
bool alb_winding_create(alb_winding *winding, const alb_vector (*triangles)[3], size_t count, alb_error *error);
void alb_winding_free(alb_winding *winding);
// To about 0.01 beyond the triangles next to the point, which are exact.
double alb_winding_number(const alb_winding *winding, alb_vector point);
