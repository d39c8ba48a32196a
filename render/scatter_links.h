// Links: from which clusters, patches and parts of patches each exit patch is lit, and how far they are.
#pragma once
#include "render/optical_path.h"
#include "render/scatter_forest.h"
#include "render/scatter_kernel.h"
#include "render/scatter_parts.h"
#include "render/scatter_rule.h"

// What a link lights a block by: a node of the forest or a patch, at one distance that all rows see alike or one that
// they do not; or a patch with its light shared out over three or eight distances.
typedef enum alb_link_kind {
    ALB_LINK_NODE,
    ALB_LINK_NEAR_NODE,
    ALB_LINK_PATCH,
    ALB_LINK_NEAR_PATCH,
    ALB_LINK_THIRDS,
    ALB_LINK_EIGHTHS,
    ALB_LINK_KINDS
} alb_link_kind;

enum { ALB_SHARES_MAX = 8 };

// Codes of a row, and what share of the light each stands for.
static inline int alb_link_codes(int kind)
{
    return kind == ALB_LINK_EIGHTHS ? ALB_SHARES_MAX : kind == ALB_LINK_THIRDS ? 3 : 1;
}
static inline float alb_link_share(int kind, int code)
{
    return kind == ALB_LINK_EIGHTHS  ? 1.0F / ALB_SHARES_MAX
           : kind != ALB_LINK_THIRDS ? 1
                                     : (code == 1 ? 14.0F : 5.0F) / 24;
}

// Bytes of codes: those of each of ALB_BLOCK rows, row after row for the first, then for the second; before them, where
// all rows share the bend of the profile, the code at which it is taken.
static inline size_t alb_link_bend_bytes(int kind) { return kind <= ALB_LINK_PATCH ? 1 : 0; }
static inline size_t alb_link_code_bytes(int kind)
{
    return alb_link_bend_bytes(kind) + (size_t)(alb_link_codes(kind) * ALB_BLOCK);
}

// Links of one block of exit patches by one octave of one kernel and one kind. Source k of the run, a node or a leaf,
// is first + deltas[0] + ... + deltas[k]. Rows that are missing repeat the last one.
typedef struct alb_link_run {
    uint32_t first, count;
    uint16_t kernel;
    uint8_t octave, kind;
} alb_link_run;

// A pair so close, for its profile, that eight distances do not do.
typedef struct alb_exact_pair {
    uint32_t leaf;
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
    int8_t (*directions)[4];  // of nodes: from the block, 127 long; variance along it over the spread, 64 for one
    size_t bytes, link_count; // link_count: of rows
} alb_link_block;

typedef struct alb_links {
    size_t block_count;
    alb_link_block *blocks;
} alb_links;

// The kernels of a body, by side; of a solid only that of reflection counts.
typedef struct alb_body_kernels {
    uint16_t index[ALB_SIDES];
} alb_body_kernels;

// Links of all blocks of the forest (how they are chosen: scatter_links.c). of_bodies[body] index kernels,
// needs[kernel]; paths[body], all zero where segments stay inside; error_wanted, relative: of a row's sum, for the
// parts of near patches. Exact pairs have no weights yet (alb_product_write_pairs). All is read, nothing kept.
// ALB_NO_MEMORY, *links then empty. The same bytes with any number of threads.
bool alb_links_create(alb_links *links, const alb_forest *forest, const alb_patches *patches,
                      const alb_body_kernels *of_bodies, const alb_scatter_kernel *kernels,
                      const alb_scatter_kernel_needs *needs, const alb_optical_paths *paths, double error_wanted,
                      alb_error *error);
void alb_links_free(alb_links *links);
