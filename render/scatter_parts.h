// A patch in equal parts: how it is cut, and what of its light the parts miss.
#pragma once
#include "render/scatter_forest.h"

enum { ALB_PARTS_MAX = 64 };

// A point source with its moments, in the order of alb_cluster.
typedef struct alb_source {
    float at[3], moments[6];
} alb_source;

// Likewise where the light is shared out over three distances.
float alb_parts_left_by_thirds(const alb_cluster *cluster, float b, float distance_mm);
// Cuts the patch of the cluster, with these corners, into 4, 16 or 64 parts; the result is the variance of a part over
// that of the whole.
float alb_parts_cut(alb_source parts[ALB_PARTS_MAX], const alb_cluster *cluster, const alb_vector triangle[3],
                    int count);
// The most parts that the patch may be cut into.
int alb_parts_most(const alb_cluster *cluster);
// What is left of the light of one of so many parts, relative to it, seen from a distance where |s'| / s = b.
float alb_parts_left(const alb_cluster *cluster, int parts, float b, float distance_mm);
// From p to the nearest point of the triangle.
double alb_distance_to_triangle(alb_vector p, const alb_vector triangle[3]);
