// Blocks of a batch: items side by side, one value of each in a row of floats that lies in a few vectors. Loops over a
// row are written out for the compiler, compiled for every x86-64, for AVX2 and for AVX-512 alike: the same operations
// in the same order, the same bytes. The last block of a batch is filled up with zeros, which are computed with and not
// written: every item meets the same operations wherever the batch begins or ends.
#pragma once
#include <stddef.h>
#include <string.h>

enum { ALB_LANES = 32 };
typedef float alb_lanes[ALB_LANES] __attribute__((aligned(64)));

#define ALB_EACH_LANE _Pragma("omp simd") for (int lane = 0; lane < ALB_LANES; lane++)
#define ALB_LANES_INLINE static inline __attribute__((always_inline))

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__)
#define ALB_LANES_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define ALB_LANES_CLONES
#endif

// `values` rows of up to ALB_LANES items that begin at `in`.
ALB_LANES_INLINE void alb_lanes_load(alb_lanes *rows, const float *in, size_t stride, size_t items, int values)
{
    for (int i = 0; i < values; i++) {
        if (items >= ALB_LANES) {
            memcpy(rows[i], in + (size_t)i * stride, sizeof *rows);
        } else {
            memset(rows[i], 0, sizeof *rows);
            memcpy(rows[i], in + (size_t)i * stride, items * sizeof *in);
        }
    }
}

ALB_LANES_INLINE void alb_lanes_store(float *out, alb_lanes *rows, size_t stride, size_t items, int values)
{
    for (int i = 0; i < values; i++) {
        if (items >= ALB_LANES)
            memcpy(out + (size_t)i * stride, rows[i], sizeof *rows);
        else
            memcpy(out + (size_t)i * stride, rows[i], items * sizeof *out);
    }
}
