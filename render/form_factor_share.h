// What patches gather, shared with the neighbours that see what they see.
#pragma once
#include "base/error.h"
#include "render/form_factor_rows.h"
#include "render/patch.h"

typedef struct alb_row_shares {
    size_t count;              // of patches; 0: nothing is shared
    uint32_t (*neighbours)[3]; // across each edge; the patch itself where there is none
} alb_row_shares;

// Of all pairs that are nearly in one plane. It fails for lack of memory alone.
bool alb_row_shares_create(alb_row_shares *shares, const alb_patches *patches, alb_error *error);
void alb_row_shares_free(alb_row_shares *shares);
size_t alb_row_shares_bytes(const alb_row_shares *shares);
// phases[patch] of its rays (alb_ray_pattern), neighbours' unlike each other.
void alb_row_shares_phases(uint8_t *phases, const alb_row_shares *shares);
// Keeps the pairs that see nearly the same. nearness_per_mm: mean over a patch's rays of one over the length, INFINITY
// where nothing of it is to be shared.
void alb_row_shares_limit(alb_row_shares *shares, const alb_patches *patches, const alb_hit_rows *rows,
                          const float *nearness_per_mm);
// values = W W values; room (aligned to 16 bytes)[patch][3] holds the patch's area, in any unit, and stays; the rest of
// it is scratch. Constants stay, and so does the sum of area times value.
void alb_row_shares_apply(double (*values)[3], float (*room)[4], const alb_row_shares *shares);
