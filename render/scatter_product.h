// Products with the links.
#pragma once
#include "render/scatter_links.h"

// The weights of the exact pairs, anew.
void alb_product_write_pairs(const alb_links *links, const alb_scatter_kernel *kernels);
// Adds to the rows of out what the gathered forest sends by the kernels of the sides asked for (bits 1 << side),
// and to those of even (may be NULL) what it would send of an irradiance of one.
void alb_product_add(double (*out)[3], double (*even)[3], const alb_links *links, const alb_forest *forest,
                     const alb_scatter_kernel *kernels, unsigned sides);
// Adds to the rows of `sums` the columns: of source patch i, sum over exit patches j of A_j S'_ji / A_i.
bool alb_product_add_columns(double (*sums)[3], const alb_links *links, const alb_forest *forest,
                             const alb_scatter_kernel *kernels, alb_error *error);
