// Patches in clusters, and what light does between clusters: the coarse level of the two-level solver.
#pragma once
#include "render/form_factor.h"
#include "render/radiosity_vectors.h"
#include "render/scatter.h"

typedef struct alb_clusters {
    size_t patch_count, count;
    uint16_t *cluster;             // of each patch
    double *areas_mm2;             // of each cluster
    uint16_t *hits;                // [cluster * ALB_CLUSTER_RAYS + q]: cluster; `count` for the sky and backs
    alb_rgb *kept;                 // area mean of the row sums of S'
    const alb_rgb *sums;           // row sums of S'; borrowed
    const double *patch_areas_mm2; // borrowed
    float (*values)[4];            // scratch of a coarse product; the last is zero
    alb_rgb *right, *found;        // scratch of a coarse solution
} alb_clusters;

enum { ALB_CLUSTER_RAYS = 256 };

// About 16 patches each, fewer in narrow gaps, of one material and one main direction. row: scratch for the longest row
// of the factors.
bool alb_clusters_create(alb_clusters *clusters, const alb_patches *patches, const alb_form_factors *factors,
                         const alb_scatter *scatter, uint32_t *row, alb_error *error);
void alb_clusters_free(alb_clusters *clusters);
// After the scattering was rewritten.
void alb_clusters_refresh(alb_clusters *clusters, const alb_scatter *scatter);
size_t alb_clusters_bytes(const alb_clusters *clusters);
// x = about (I - S'F)^-1 right.
void alb_clusters_solve(alb_rgb *x, const alb_clusters *clusters, const alb_rgb *right);
