// The product with stored weights: for each block of exit patches
//     out_j += scale_j sum over sources i of V(code_ij) E_i,    E_i the mean irradiance of a patch or a cluster
// V(code) is the code shifted into the exponent and the mantissa of a float, 2^-126 and more: light is brought up by
// 2^60 and what comes out by the rest, in the scales. It holds for light from 1e-18 to 1e20.
#include "render/scatter_weights.h"
#include "base/vector_clones.h"
#include <stdlib.h>
#include <string.h>

typedef float float8 __attribute__((vector_size(32)));
typedef uint32_t word8 __attribute__((vector_size(32)));

static const double light_unit = 0x1p60;

// Weights of a channel of the source in the low half of the codes' words, or in the high one.
static inline __attribute__((always_inline)) void take(float8 *out, const word8 *codes, int half, int channel)
{
    const int shift = ALB_WEIGHT_SHIFT - 16 * half - ALB_WEIGHT_BITS * channel;
    const word8 moved = shift >= 0 ? *codes << shift : *codes >> -shift;
    *out = (float8)(moved & 31U << ALB_WEIGHT_SHIFT);
}

// Sums of the block's rows.
ALB_VECTOR_CLONES
static void add_sources(float sums[3][ALB_BLOCK], const alb_weight_block *block, const float (*lights)[4])
{
    float8 all[3] = {{0}};
    const uint16_t *gaps = *block->gaps;
    lights += block->first_source;
    for (uint32_t group = 0; group < block->group_count; group++) {
        __builtin_prefetch(block->codes[group + ALB_WEIGHT_GROUPS_AHEAD]);
#pragma GCC unroll 2
        for (int pair = 0; pair < ALB_WEIGHT_GROUP / 2; pair++) {
            word8 codes;
            memcpy(&codes, block->codes[group][pair], sizeof codes);
            const float *first = *(lights += *gaps++), *second = *(lights += *gaps++);
#pragma GCC unroll 3
            for (int c = 0; c < 3; c++) {
                float8 weights[2];
                take(&weights[0], &codes, 0, c);
                take(&weights[1], &codes, 1, c);
                all[c] += weights[0] * first[c] + weights[1] * second[c];
            }
        }
    }
    memcpy(sums, all, sizeof all);
}

// Children stand behind their parents.
static inline void gather_one(const alb_weights *weights, const double (*irradiance)[3], size_t cluster)
{
    const alb_weight_cluster *of = &weights->clusters[cluster];
    float *out = weights->lights[cluster];
    if (of->left_share < 0)
        for (int c = 0; c < 3; c++)
            out[c] = (float)(light_unit * irradiance[of->right][c]);
    else
        for (int c = 0; c < 3; c++)
            out[c] = weights->lights[of->right][c] + of->left_share * (out[4 + c] - weights->lights[of->right][c]);
}

static void gather(const alb_weights *weights, const double (*irradiance)[3])
{
#pragma omp parallel for schedule(dynamic, 1)
    for (size_t part = 0; part < weights->part_count; part++)
        for (size_t cluster = weights->parts[part][1]; cluster-- > weights->parts[part][0];)
            gather_one(weights, irradiance, cluster);
    for (size_t top = weights->top_count; top-- > 0;)
        gather_one(weights, irradiance, weights->tops[top]);
}

void alb_weights_apply(double (*out)[3], const alb_weights *weights, const alb_forest *forest, const double (*local)[3],
                       const double (*irradiance)[3])
{
    gather(weights, irradiance);
#pragma omp parallel for schedule(dynamic, 32)
    for (size_t b = 0; b < weights->block_count; b++) {
        const alb_weight_block *block = &weights->blocks[b];
        float sums[3][ALB_BLOCK];
        add_sources(sums, block, (const float(*)[4])weights->lights);
        for (uint32_t row = 0; row < block->row_count; row++) {
            const uint32_t p = forest->patches[block->first_leaf + row];
            for (int c = 0; c < 3; c++)
                out[p][c] = local[p][c] * irradiance[p][c] + (double)(block->scales[c][row] * sums[c][row]);
        }
    }
}

void alb_weights_free(alb_weights *weights)
{
    free(weights->blocks);
    free(weights->codes);
    free(weights->gaps);
    free(weights->clusters);
    free(weights->parts);
    free(weights->tops);
    free(weights->lights);
    *weights = (alb_weights){0};
}

size_t alb_weights_bytes(const alb_weights *weights, const alb_forest *forest)
{
    const alb_weight_block *block = weights->blocks;
    return weights->block_count * sizeof *block + weights->group_count * (sizeof *block->gaps + sizeof *block->codes) +
           weights->part_count * sizeof *weights->parts + weights->top_count * sizeof *weights->tops +
           (weights->clusters ? forest->cluster_count * (sizeof *weights->clusters + sizeof *weights->lights) : 0);
}
