// What patches gather, shared with the neighbours that see what they see.
#pragma once
#include "base/error.h"
#include "render/patch.h"

typedef struct alb_row_shares {
    size_t count;              // of patches; 0: nothing is shared
    uint32_t (*neighbours)[3]; // across each edge; the patch itself where there is none
    float (*weights)[3];
} alb_row_shares;

// rays: of each patch, first[p + 1] - first[p]; nearness_per_mm: mean over its rays of one over the length, INFINITY
// where nothing of it is to be shared.
bool alb_row_shares_create(alb_row_shares *shares, const alb_patches *patches, const size_t *first,
                           const float *nearness_per_mm, alb_error *error);
void alb_row_shares_free(alb_row_shares *shares);
size_t alb_row_shares_bytes(const alb_row_shares *shares);
// values = W W values; scratch has room for them. Constants stay, and so does the sum of area times value.
void alb_row_shares_apply(double (*values)[3], float (*scratch)[4], const alb_row_shares *shares);
