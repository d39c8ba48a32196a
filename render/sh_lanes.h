// Blocks of a batch: eight items side by side in a vector. The last block is filled up with zeros, which are computed
// with and not written: every item meets the same operations wherever the batch begins or ends.
#pragma once
#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { ALB_LANES = 8 };
typedef float alb_lanes __attribute__((vector_size(ALB_LANES * sizeof(float))));
typedef int32_t alb_lanes_bits __attribute__((vector_size(ALB_LANES * sizeof(int32_t))));

// `values` coefficients of up to eight items that begin at `in`.
static inline void alb_lanes_load(alb_lanes *lanes, const float *in, size_t stride, size_t items, int values)
{
    if (items >= ALB_LANES) {
        for (int i = 0; i < values; i++)
            memcpy(&lanes[i], in + (size_t)i * stride, sizeof *lanes);
        return;
    }
    memset(lanes, 0, (size_t)values * sizeof *lanes);
    for (int i = 0; i < values; i++)
        memcpy(&lanes[i], in + (size_t)i * stride, items * sizeof *in);
}

static inline void alb_lanes_store(float *out, const alb_lanes *lanes, size_t stride, size_t items, int values)
{
    if (items >= ALB_LANES) {
        for (int i = 0; i < values; i++)
            memcpy(out + (size_t)i * stride, &lanes[i], sizeof *lanes);
        return;
    }
    for (int i = 0; i < values; i++)
        memcpy(out + (size_t)i * stride, &lanes[i], items * sizeof *out);
}
