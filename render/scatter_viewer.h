// A block of exit patches that looks for what lights it: what the choice of links, their distances and their paths
// share.
#pragma once
#include "render/scatter_block.h"

enum { ALB_LINK_EXACT = -1 }; // the kind of a wish for an exact pair

// A link before its distances are known; left_out: bits of the rows that are the source itself or take it exactly.
typedef struct alb_wish {
    uint32_t cluster, source; // source: node or leaf
    uint8_t side, left_out;
    int8_t kind;
} alb_wish;

// How much longer paths are than straight at a distance and beyond; nearer, in proportion.
typedef struct alb_detour {
    float length, at;
} alb_detour;

// What one thread works with.
typedef struct alb_link_workspace {
    alb_wish *wishes;
    alb_detour (*detours)[ALB_BLOCK]; // of each wish and row
    alb_optical_target *targets;      // of the wishes
    float *distances;
    unsigned char *opposite;
    size_t wish_count, wish_capacity, detour_capacity, target_capacity, distance_capacity, opposite_capacity;
    alb_optical_workspace paths;
    const alb_optical_paths *paths_of; // whom it serves
    alb_found_links found;
} alb_link_workspace;

// The block; its places relative to the middle of the body.
typedef struct alb_viewer {
    const alb_forest *forest;
    const alb_patches *patches;
    const alb_scatter_kernel *kernels[ALB_SIDES];
    const alb_scatter_kernel_needs *needs[ALB_SIDES];
    const uint16_t *index; // of the kernels
    const alb_tree *tree;
    const alb_optical_paths *paths;
    double error_wanted;
    uint32_t first_leaf, row_count, middle_row;
    float at[3][ALB_BLOCK]; // centroids, rows that are missing stand where the last one does
    float centre[3], radius;
    float axes[3][ALB_BLOCK]; // slab: its normal, of a sheet the rows' own; else zero
    alb_link_workspace *work;
} alb_viewer;

static inline bool alb_viewer_in_sheet(const alb_viewer *v) { return v->paths->kind == ALB_OPTICAL_SHEET; }

// Takes from v what lies along a direction of length one, or nothing.
void alb_project(float v[3], float x, float y, float z);
// Lateral to the row's axis.
void alb_viewer_project(float to[3], const alb_viewer *v, uint32_t row);
// Mean distances from the rows to the source, mm, and its variances along the lines of sight; across: lateral to the
// axis (formulas of distances: scatter_distance.c).
void alb_viewer_measure(float distances[ALB_BLOCK], float along_mm2[ALB_BLOCK], const alb_viewer *v,
                        const alb_source *from, bool across);
// Distances from the rows to the source, as many as the kind has codes; straight.
void alb_viewer_distances(float distances[ALB_SHARES_MAX][ALB_BLOCK], const alb_viewer *v, const alb_wish *wished,
                          int kind);
// The patch as the row sees it: through a slab, moved along the axis into the plane of the row.
void alb_viewer_triangle(alb_vector t[3], const alb_viewer *v, const alb_cluster *cluster, int side, uint32_t row);
// How much longer the paths inside the body are than straight, of each wish and row, in the workspace; in a sheet also
// which face is lit. Both this and the next note in the workspace where memory ran out.
void alb_viewer_find_detours(const alb_viewer *v);
// Links and exact pairs from the wishes, in the workspace.
void alb_viewer_grant(const alb_viewer *v);
