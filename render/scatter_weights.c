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

enum { TASK_LEAVES = 8192 };
static const double light_unit = 0x1p60;

// Sums of the block's rows, four sources at a time.
ALB_VECTOR_CLONES
static void add_sources(float sums[3][ALB_BLOCK], const alb_weight_block *block, const float (*lights)[4])
{
    const uint32_t mask = (uint32_t)UINT8_MAX << ALB_WEIGHT_SHIFT;
    float8 all[3] = {{0}};
    for (uint32_t group = 0; group < block->group_count; group++) {
        const float *light[ALB_WEIGHT_GROUP];
        for (int k = 0; k < ALB_WEIGHT_GROUP; k++)
            light[k] = lights[block->sources[group * ALB_WEIGHT_GROUP + (uint32_t)k]];
#pragma GCC unroll 3
        for (int c = 0; c < 3; c++) {
            word8 codes;
            memcpy(&codes, block->codes[group][c], sizeof codes);
            const float8 first = (float8)(codes << ALB_WEIGHT_SHIFT & mask),
                         second = (float8)(codes << (ALB_WEIGHT_SHIFT - 8) & mask),
                         third = (float8)(codes << (ALB_WEIGHT_SHIFT - 16) & mask),
                         fourth = (float8)(codes >> (24 - ALB_WEIGHT_SHIFT) & mask);
            all[c] += (first * light[0][c] + second * light[1][c]) + (third * light[2][c] + fourth * light[3][c]);
        }
    }
    memcpy(sums, all, sizeof all);
}

static void gather(const alb_weights *weights, const alb_forest *forest, const double (*irradiance)[3], uint32_t node,
                   uint32_t first_leaf, uint32_t count)
{
    if (count == 1) {
        for (int c = 0; c < 3; c++)
            weights->lights[first_leaf][c] = (float)(light_unit * irradiance[forest->patches[first_leaf]][c]);
        return;
    }
    const uint32_t left = alb_left_count(count);
    if (count > TASK_LEAVES) {
#pragma omp task
        gather(weights, forest, irradiance, node + 1, first_leaf, left);
        gather(weights, forest, irradiance, node + left, first_leaf + left, count - left);
#pragma omp taskwait
    } else {
        gather(weights, forest, irradiance, node + 1, first_leaf, left);
        gather(weights, forest, irradiance, node + left, first_leaf + left, count - left);
    }
    const float(*nodes)[4] = (const float(*)[4])weights->lights + forest->leaf_count;
    const float *of_left = left > 1 ? nodes[node + 1] : weights->lights[first_leaf],
                *of_right = count - left > 1 ? nodes[node + left] : weights->lights[first_leaf + left];
    for (int c = 0; c < 3; c++)
        weights->lights[forest->leaf_count + node][c] =
            of_right[c] + weights->left_shares[node] * (of_left[c] - of_right[c]);
}

void alb_weights_add(double (*out)[3], const alb_weights *weights, const alb_forest *forest,
                     const double (*irradiance)[3])
{
#pragma omp parallel
#pragma omp single
    for (const alb_tree *tree = forest->trees; tree < forest->trees + forest->tree_count; tree++) {
#pragma omp task if (tree->leaf_count > 256)
        gather(weights, forest, irradiance, tree->first_cluster - tree->first_leaf, tree->first_leaf, tree->leaf_count);
    }
#pragma omp parallel for schedule(dynamic, 32)
    for (size_t b = 0; b < weights->block_count; b++) {
        const alb_weight_block *block = &weights->blocks[b];
        float sums[3][ALB_BLOCK];
        add_sources(sums, block, (const float(*)[4])weights->lights);
        for (uint32_t row = 0; row < block->row_count; row++)
            for (int c = 0; c < 3; c++)
                out[forest->patches[block->first_leaf + row]][c] += (double)(block->scales[c][row] * sums[c][row]);
    }
}

void alb_weights_free(alb_weights *weights)
{
    for (size_t b = 0; weights->blocks && b < weights->block_count; b++)
        free(weights->blocks[b].sources);
    free(weights->blocks);
    free(weights->left_shares);
    free(weights->lights);
    *weights = (alb_weights){0};
}

size_t alb_weights_bytes(const alb_weights *weights, const alb_forest *forest)
{
    const alb_weight_block *block = weights->blocks;
    return weights->block_count * sizeof *block +
           weights->group_count * (ALB_WEIGHT_GROUP * sizeof *block->sources + sizeof *block->codes) +
           forest->leaf_count * (sizeof *weights->left_shares + 2 * sizeof *weights->lights);
}
