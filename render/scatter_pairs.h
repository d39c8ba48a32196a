// The far and the near pairs of one body's patches.
#pragma once
#include "render/scatter.h"

// Adds to out, a row a patch, the far pairs' kernel times the amounts of the sources given (the body's own or some of
// them). Where `sums` is there also to its column sums, and row_starts[patch + 1] becomes the number of near pairs.
void alb_scatter_add_far(double (*out)[3], alb_scatter *sums, const alb_scatter_body *body, const alb_sources *sources);
// The self-term and the near pairs of the body's patch j.
void alb_scatter_fill_near(alb_scatter *scatter, const alb_scatter_body *body, const alb_patches *patches, size_t j);
