// S' of materials that do not change as stored weights: a product reads them through and looks no profile up.
#pragma once
#include "render/scatter_links.h"

// A weight is a code of five bits, three of exponent and two of mantissa, shifted to its place in a float: 0, or from
// 2^-126 on. Below 4 none but zero is used, for those would be denormal. Of each row and source those of R, G and B
// stand beside each other in 16 bits, and two sources share a word.
enum { ALB_WEIGHT_GROUP = 4, ALB_WEIGHT_BITS = 5, ALB_WEIGHT_SHIFT = 21 };
enum { ALB_WEIGHT_PART = 2048 };       // leaves of a subtree, at most
enum { ALB_WEIGHT_GROUPS_AHEAD = 64 }; // what a product asks memory for before it is there

// What lights a block of exit patches: clusters of the forest, source k the one first_source + gaps[0] + ... + gaps[k].
// Where a gap is too wide, sources of no weight stand between; the last group is filled up with them.
typedef struct alb_weight_block {
    uint32_t first_leaf, row_count, group_count, first_source;
    float scales[3][ALB_BLOCK];                         // of the sums of codes
    uint32_t (*codes)[ALB_WEIGHT_GROUP / 2][ALB_BLOCK]; // of each group, as the gaps
    uint16_t (*gaps)[ALB_WEIGHT_GROUP];
} alb_weight_block;

// How the light of a cluster comes about: the means of its children, the next cluster and the one here, by the left
// one's part of the area; of a patch, below zero, that is the patch.
typedef struct alb_weight_cluster {
    uint32_t right;
    float left_share;
} alb_weight_cluster;

typedef struct alb_weights {
    size_t block_count, group_count;
    alb_weight_block *blocks;
    uint32_t (*codes)[ALB_WEIGHT_GROUP / 2][ALB_BLOCK]; // of all blocks, and ALB_WEIGHT_GROUPS_AHEAD beyond
    uint16_t (*gaps)[ALB_WEIGHT_GROUP];
    alb_weight_cluster *clusters; // of the forest
    uint32_t (*parts)[2];         // first clusters and ends of subtrees that are summed on their own,
    uint32_t *tops;               // and the clusters above them, in order
    size_t part_count, top_count;
    float (*lights)[4]; // of clusters, patches too: mean irradiance of R, G and B; workspace of a product
} alb_weights;

// From the links and kernels as they are (how: scatter_weights_make.c). row_sums[patch] and local[patch] of S';
// error_wanted: see alb_scatter_keep_weights. All is read, nothing kept. ALB_NO_MEMORY, *weights then empty.
bool alb_weights_create(alb_weights *weights, const alb_links *links, const alb_forest *forest,
                        const alb_scatter_kernel *kernels, const double (*row_sums)[3], const double (*local)[3],
                        double error_wanted, alb_error *error);
void alb_weights_free(alb_weights *weights);
size_t alb_weights_bytes(const alb_weights *weights, const alb_forest *forest);
// What irradiance sends out of the patches of the forest: local of its own, and what other patches send. Rows of out of
// patches that are in no tree stay. The same bytes with any number of threads.
void alb_weights_apply(double (*out)[3], const alb_weights *weights, const alb_forest *forest, const double (*local)[3],
                       const double (*irradiance)[3]);
// The largest error of products with the weights against those with the links, over lights around random patches, per
// cent (formula: scatter_weights_error.c). Overwrites the forest's light. ALB_NO_MEMORY.
bool alb_weights_error(double *percent, const alb_weights *weights, const alb_links *links, alb_forest *forest,
                       const alb_scatter_kernel *kernels, const double (*local)[3], size_t patch_count,
                       alb_error *error);
