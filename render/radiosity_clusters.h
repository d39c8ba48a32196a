// Patches in clusters, and what light does between clusters: the coarse level of the two-level solver.
#pragma once
#include "render/form_factor.h"
#include "render/radiosity_vectors.h"
#include "render/scatter.h"

typedef struct alb_clusters {
    size_t patch_count, count;
    uint16_t *cluster;             // of each patch
    uint32_t *members, *first;     // patches of cluster k: members[first[k] .. first[k + 1])
    double *areas_mm2;             // of each cluster
    uint32_t *first_hit;           // what the rays of cluster k hit: clusters hits[first_hit[k] .. first_hit[k + 1]);
    uint16_t *hits;                // of ALB_CLUSTER_RAYS the others see the sky and backs
    uint16_t *sources[3];          // [channel][cluster * ALB_CLUSTER_SOURCES + q]: whose light leaves from here
    bool *spreads;                 // of each cluster: light from others leaves from here
    alb_rgb *kept;                 // area mean of the row sums of S'
    const alb_rgb *sums;           // row sums of S'; borrowed
    const double *patch_areas_mm2; // borrowed
    float (*values)[4];            // scratch of a product
    alb_rgb *bounced, *right;      // scratch of a solution
} alb_clusters;

enum { ALB_CLUSTER_RAYS = 256, ALB_CLUSTER_SOURCES = 32 };

// About 16 patches each, fewer in narrow gaps, of one material and one main direction. factors are read, not kept;
// patches lend their areas, the scattering its row sums. row: scratch for the longest row of the factors.
// ALB_NO_MEMORY, *clusters then empty.
bool alb_clusters_create(alb_clusters *clusters, const alb_patches *patches, const alb_form_factors *factors,
                         const alb_scatter *scatter, uint32_t *row, alb_error *error);
void alb_clusters_free(alb_clusters *clusters);
// After the scattering was rewritten: its sums, which share comes from where stays.
void alb_clusters_refresh(alb_clusters *clusters, const alb_scatter *scatter);
size_t alb_clusters_bytes(const alb_clusters *clusters);
// out = Q values: the mean over area of each cluster's patches.
void alb_clusters_average(alb_rgb *out, const alb_clusters *clusters, const alb_rgb *values);
// out = S_c light: what clusters send out of irradiance even on each.
void alb_clusters_scatter(alb_rgb *out, const alb_clusters *clusters, const alb_rgb *light);
// Roughly what patches send out, S~, of irradiance e with the means `even` once it is `light` on the clusters: S_c
// between clusters, and what varies within one stays where it is. moved: of clusters, the even light that, added to
// what is there, sends it; then patch by patch.
void alb_clusters_move(alb_rgb *moved, const alb_clusters *clusters, const alb_rgb *light, const alb_rgb *even);
static inline double alb_clusters_sent(const alb_clusters *clusters, const alb_rgb *moved, size_t patch, int channel,
                                       double irradiance)
{
    return clusters->sums[patch][channel] * (moved[clusters->cluster[patch]][channel] + irradiance);
}
// out = F_c radiosity: irradiance of the clusters by each other, by one in `stride` of their rays.
void alb_clusters_gather(alb_rgb *out, const alb_clusters *clusters, const alb_rgb *radiosity, int stride);
// out = (I - F_c S_c)^-1 F_c radiosity: irradiance of the clusters by each other, for what they send out by themselves.
void alb_clusters_settle(alb_rgb *out, const alb_clusters *clusters, const alb_rgb *radiosity);
