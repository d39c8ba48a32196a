// Products with the links, per area, RGB (formulas: scatter_product.c, scatter_columns.c). What patches send of light
// on themselves is not in them. The same bytes with any number of threads.
#pragma once
#include "render/scatter_links.h"

// The weights of the exact pairs by the kernels' tables as they are.
void alb_product_write_pairs(const alb_links *links, const alb_scatter_kernel *kernels);
// Adds to out[patch] what the gathered forest sends by the kernels of the sides asked for (bits 1 << side),
// and to even[patch] (may be NULL) what it would send of an irradiance of one.
void alb_product_add(double (*out)[3], double (*even)[3], const alb_links *links, const alb_forest *forest,
                     const alb_scatter_kernel *kernels, unsigned sides);
// Adds to sums[patch] the columns: of source patch i, sum over exit patches j of A_j S'_ji / A_i. ALB_NO_MEMORY; sums
// stay.
bool alb_product_add_columns(double (*sums)[3], const alb_links *links, const alb_forest *forest,
                             const alb_scatter_kernel *kernels, alb_error *error);
