// A patch in equal parts: how it is cut, and what of its light the parts miss.
#pragma once
#include "render/scatter_forest.h"

// A source is taken whole or in equal parts; `spread`: variance of a part over that of the whole; of long patches,
// which are cut across, smaller.
enum { ALB_LEVELS = 6, ALB_PARTS_MAX = 64 };
typedef struct alb_level {
    int parts;
    float spread;
} alb_level;
extern const alb_level alb_levels[ALB_LEVELS];

// A point source with its moments, in the order of alb_cluster.
typedef struct alb_source {
    float at[3], moments[6];
} alb_source;

void alb_parts_cut(alb_source parts[ALB_PARTS_MAX], const alb_vector triangle[3], const alb_level *level);
// The level of so many parts, long ones or not.
int alb_parts_level(const alb_cluster *cluster, int parts);
// The most parts that the patch may be cut into.
int alb_parts_most(const alb_cluster *cluster);
// What is left of the light of one of so many parts, relative to it, seen from a distance where |s'| / s = b.
float alb_parts_left(const alb_cluster *cluster, int parts, float b, float distance_mm);
// From p to the nearest point of the triangle.
double alb_distance_to_triangle(alb_vector p, const alb_vector triangle[3]);
