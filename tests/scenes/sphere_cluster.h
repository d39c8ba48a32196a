// Clusters of spheres with their visibility known exactly: objects to judge shadows by.
#pragma once
#include <stdint.h>

enum { SPHERE_CLUSTER_MAX = 5 };

// Centred at the origin; the farthest point of a sphere is at distance 1.
typedef struct sphere_cluster {
    int count;
    double centre[SPHERE_CLUSTER_MAX][3], radius[SPHERE_CLUSTER_MAX];
} sphere_cluster;

// One to five spheres, the same for the same seed and index.
sphere_cluster sphere_cluster_random(uint64_t seed, uint64_t index);
// Coefficients (render/sh.h, order^2 of them, order to 8) of occlusion, 1 where a sphere is seen, at distance > 1 from
// the origin in direction -z: the cluster lies ahead, around +z. Relative error some 1e-5.
void sphere_cluster_occlusion(double *coefficients, int order, const sphere_cluster *cluster, double distance);
