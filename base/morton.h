// Points in the order of a Morton curve (Morton 1966): near by along it is near by in space, mostly.
#pragma once
#include "base/vector.h"
#include <stddef.h>
#include <stdint.h>

typedef struct alb_morton {
    alb_vector low;
    double per_mm; // one over the longest side of the points' box; 0: they are one
} alb_morton;

// The curve through the box of the points.
alb_morton alb_morton_of(const alb_vector *points, size_t count);
// How far along the curve, `bits` (1..21) an axis: three times as many in all, x highest.
uint64_t alb_morton_place(const alb_morton *curve, alb_vector point, int bits);
