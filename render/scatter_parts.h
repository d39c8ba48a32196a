// A patch in equal parts: how it is cut, and what of its light the parts miss.
#pragma once
#include "render/scatter_forest.h"

enum { ALB_PARTS_MAX = 64 };

// A point source with its moments, as in alb_cluster.
typedef struct alb_source {
    float at[3];      // mm, relative to the body's middle
    float moments[6]; // mm^2
} alb_source;

// Cuts the patch of the cluster, with these corners, into `count` equal parts, 1, 4, 16 or 64; the result is the
// variance of a part over that of the whole.
float alb_parts_cut(alb_source parts[ALB_PARTS_MAX], const alb_cluster *cluster, const alb_vector triangle[3],
                    int count);
// The most parts that the patch may be cut into.
int alb_parts_most(const alb_cluster *cluster);
// What is missing of the light of one of so many parts, relative to it, seen from a distance where |s'| / s = b, 1/mm,
// and each part stands at one distance (formula: scatter_parts.c).
float alb_parts_left(const alb_cluster *cluster, int parts, float b, float distance_mm);
// Likewise of the whole patch where its light is shared out over three distances.
float alb_parts_left_by_thirds(const alb_cluster *cluster, float b, float distance_mm);
// From p to the nearest point of the triangle, mm.
double alb_distance_to_triangle(alb_vector p, const alb_vector triangle[3]);
