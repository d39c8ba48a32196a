// What lights a block of exit patches, as few clusters as an error allows: the step from links to stored weights.
#pragma once
#include "render/scatter_weights.h"

// Leaves of a cluster.
typedef struct alb_weight_extent {
    uint32_t first_leaf, count;
    float area_mm2;
} alb_weight_extent;

typedef struct alb_weight_source {
    alb_weight_extent of;
    uint32_t cluster;
    float weights[3][ALB_BLOCK]; // for even irradiance of one
    float slopes[3][3];          // [channel][axis]: relative change of the weights, per mm
} alb_weight_source;

typedef struct alb_weight_sources {
    alb_weight_source *items;
    size_t count, capacity;
} alb_weight_sources;

// One thread's work, block after block.
typedef struct alb_weight_maker {
    const alb_forest *forest;
    const alb_scatter_kernel *kernels;
    const alb_weight_extent *clusters;
    const uint32_t *of_leaves, *of_nodes; // which clusters these are
    float allowed[3][ALB_BLOCK];          // of the block under way: what a source may miss
    alb_weight_sources found, kept;
    bool failed; // no memory
} alb_weight_maker;

// The sources of a block in maker->kept, in the order of clusters.
void alb_weight_sources_find(alb_weight_maker *maker, const alb_link_block *block);
// Room for one more source; NULL where there is none.
alb_weight_source *alb_weight_sources_add(alb_weight_maker *maker, alb_weight_sources *to);
static inline alb_weight_source alb_weight_source_of(const alb_weight_maker *maker, uint32_t cluster)
{
    return (alb_weight_source){.of = maker->clusters[cluster], .cluster = cluster};
}
