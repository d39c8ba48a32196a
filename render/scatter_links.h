// Links: from which clusters, patches and parts of patches each exit patch is lit, and how far they are.
#pragma once
#include "render/scatter_forest.h"
#include "render/scatter_kernel.h"
#include "render/scatter_rule.h"

// A source is taken whole or in equal parts; `spread`: variance of a part over that of the
// whole; of long patches, which are cut across, smaller.
enum { ALB_LEVELS = 6 };
typedef struct alb_level {
    int parts;
    float spread;
} alb_level;
extern const alb_level alb_levels[ALB_LEVELS];

// Links of one block of exit patches by one octave of one kernel and one level. Node k of the run is
// first + deltas[0] + ... + deltas[k]; each has ALB_BLOCK codes a part, one a row.
typedef struct alb_link_run {
    uint32_t first, count;
    uint16_t kernel;
    uint8_t octave, level;
} alb_link_run;

// A pair so close, for its profile, that parts do not do.
typedef struct alb_exact_pair {
    uint32_t node; // a leaf
    uint16_t kernel;
    uint8_t row;
    float per_area;   // one over the source's
    float weights[3]; // of area times irradiance
    alb_rule rule;
} alb_exact_pair;

// One allocation holds the pairs, then the runs, the deltas, the codes and the directions.
typedef struct alb_link_block {
    uint32_t first_leaf, row_count, run_count, pair_count;
    alb_exact_pair *pairs;
    alb_link_run *runs;
    uint16_t *deltas;
    uint8_t *codes;
    int8_t (*directions)[4];  // from the block to the clusters, 127 long
    size_t bytes, link_count; // link_count: codes that are links, and pairs
} alb_link_block;

typedef struct alb_links {
    size_t block_count;
    alb_link_block *blocks;
} alb_links;

// The kernels of a body, by side; of a solid only that of reflection counts.
typedef struct alb_body_kernels {
    uint16_t index[ALB_SIDES];
} alb_body_kernels;

// needs: of each kernel. error: of a row's sum, for the parts of near patches.
bool alb_links_create(alb_links *links, const alb_forest *forest, const alb_patches *patches,
                      const alb_body_kernels *of_bodies, const alb_scatter_kernel *kernels,
                      const alb_scatter_kernel_needs *needs, double error_wanted, alb_error *error);
void alb_links_free(alb_links *links);
