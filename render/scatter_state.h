// What a scattering is made of: laid by scatter_make.c, its tables written by scatter_rewrite.c, read by the products
// of scatter.c.
#pragma once
#include "render/scatter_rule.h"
#include "render/scatter_weights.h"

// Owned, unless it says otherwise; all zero is empty.
struct alb_scatter_parts {
    alb_forest forest;           // sources in clusters, and what light they hold while a product runs
    alb_links links;             // who lights whom from how far: geometry, and the weights of exact pairs
    alb_scatter_kernel *kernels; // profiles by distance: one of each material and side that scatters
    size_t kernel_count;         // at most ALB_SIDES a body
    alb_body_kernels *of_bodies; // [body]: which kernels are its own
    alb_rule *self;              // [leaf]: the integral over the patch itself, geometry alone
    const uint16_t *materials;   // [patch], borrowed
    size_t opaque_count;
    uint32_t *opaque;         // patches that are in no tree, ascending
    double (*totals)[3];      // [kernel]: of its profiles as they are, RGB
    bool rows_known;          // the row sums are those of the profiles as they are, no estimate
    alb_weights weights;      // empty: products look the profiles up
    bool by_links;            // they do so although there are weights
    alb_bodies found;         // while links are made
    alb_optical_paths *paths; // [body], likewise
};
