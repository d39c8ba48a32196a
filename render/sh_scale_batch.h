// Angular scaling of many receivers, each with its own k: M by linear interpolation in u = (k - 1) / (k + 1)
// (mid-range: u = k), which takes in every k from 0 to infinity; what falls off like k^-2 is stored times k^2.
#pragma once
#include "render/sh_scale.h"
#include <stddef.h>

typedef struct alb_sh_batch {
    alb_sh_law law;
    int cells;   // intervals of u in [-1, 1]
    int padded;  // values a row, a multiple of 8
    float *rows; // [cells][2][padded]: the values at a cell's start, and their rise over it
} alb_sh_batch;

// cells: even, from 8 to 4096; 256 give an error of 2e-4 in M for the cone map of order 4, a quarter of it for twice as
// many; the sphere map's has a square root at k = 1 and 256 cells give 0.04 there. Orders up to 8. Release with
// alb_sh_batch_free.
bool alb_sh_batch_create(alb_sh_batch *batch, const alb_sh_law *law, int cells, alb_error *error);
void alb_sh_batch_free(alb_sh_batch *batch);
// out[i * stride + r] = M(k[r]) in, coefficient i of receiver r < count <= stride (render/sh.h); transposed: M^T, from
// order_out^2 to order_in^2 coefficients. `out` may not overlap `in`. k below 0 counts as 0 (mid-range: beyond -1 or 1
// as there), NaN gives NaN. The same bytes wherever a batch is cut.
void alb_sh_batch_apply(float *out, const alb_sh_batch *batch, bool transposed, const float *k, const float *in,
                        size_t stride, size_t count);
