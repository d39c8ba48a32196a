// The product: for each block of exit patches, for each link, eight look-ups times one cluster. In single precision
// within a run of links, in double beyond it: rounding stays near 1e-7.
//     out_j += sum over links (s(d) + v s''(d) / 2) light + s'(d) u . moment
// u the direction to the cluster, v its variance along it; of a patch in n parts light / n and the variance of a part.
#include "render/scatter_product.h"
#include "base/memory.h"
#include "base/vector_clones.h"
#include <stdlib.h>
#include <string.h>

typedef float float8 __attribute__((vector_size(32)));

// Light and its moment along the direction, R, G, B and a zero each.
static inline void take_node(float8 *light, const alb_scatter_node *node, const int8_t direction[4], float share)
{
    typedef float float4 __attribute__((vector_size(16)));
    float4 axes[3], along = {0};
    memcpy(axes, node->moments, sizeof axes);
    for (int k = 0; k < 3; k++)
        along += (float)direction[k] * (1.0F / INT8_MAX) * axes[k];
    *light = (float8){
        share * node->light[0], share * node->light[1], share * node->light[2], 0, along[0], along[1], along[2], 0};
}

// rows += (table[code] + spread table[code] bent) light, for the rows of a block.
ALB_VECTOR_CLONES
static void add_run(double sums[ALB_BLOCK][3], const float (*table)[16], const alb_scatter_node *node,
                    const uint16_t *deltas, const uint8_t *codes, const int8_t (*directions)[4], size_t count,
                    const alb_level *level)
{
    float8 rows[ALB_BLOCK] = {{0}};
    for (size_t k = 0; k < count; k++) {
        float8 light, value, bend;
        node += deltas[k];
        take_node(&light, node, directions[k], 1 / (float)level->parts);
        const float v = level->spread * node->spread_mm2 * (float)directions[k][3] / 64;
        for (int part = 0; part < level->parts; part++, codes += ALB_BLOCK)
#pragma GCC unroll 8
            for (int row = 0; row < ALB_BLOCK; row++) {
                memcpy(&value, table[codes[row]], sizeof value);
                memcpy(&bend, table[codes[row]] + 8, sizeof bend);
                rows[row] += (value + v * bend) * light;
            }
    }
    for (int row = 0; row < ALB_BLOCK; row++)
        for (int c = 0; c < 3; c++)
            sums[row][c] += (double)(rows[row][c] + rows[row][4 + c]);
}

// What one run finds in the block's deltas and codes, and steps past.
typedef struct cursor {
    const uint16_t *deltas;
    const uint8_t *codes;
    const int8_t (*directions)[4];
} cursor;

static cursor begin(const alb_link_block *block)
{
    return (cursor){block->deltas, block->codes, (const int8_t(*)[4])block->directions};
}

static void step(cursor *at, const alb_link_run *run)
{
    at->deltas += run->count;
    at->directions += run->count;
    at->codes += (size_t)run->count * (size_t)(ALB_BLOCK * alb_levels[run->level].parts);
}

static const float (*table_of(const alb_scatter_kernel *kernels, const alb_link_run *run))[16]
{
    return (const float(*)[16])kernels[run->kernel].values +
           (size_t)(run->octave - kernels[run->kernel].first_used) * ALB_CODES;
}

static void add_pairs(double sums[ALB_BLOCK][3], const alb_link_block *block, const alb_forest *forest,
                      const alb_scatter_kernel *kernels, unsigned sides)
{
    for (const alb_exact_pair *pair = block->pairs; pair < block->pairs + block->pair_count; pair++)
        for (int c = 0; c < 3 && sides & 1U << kernels[pair->kernel].side; c++)
            sums[pair->row][c] += (double)(pair->weights[c] * forest->nodes[pair->node].light[c]);
}

void alb_product_write_pairs(const alb_links *links, const alb_scatter_kernel *kernels)
{
#pragma omp parallel for schedule(dynamic, 16)
    for (size_t b = 0; b < links->block_count; b++)
        for (uint32_t k = 0; k < links->blocks[b].pair_count; k++) {
            alb_exact_pair *pair = &links->blocks[b].pairs[k];
            double integral[3];
            alb_rule_apply(integral, &pair->rule, &kernels[pair->kernel]);
            for (int c = 0; c < 3; c++)
                pair->weights[c] = (float)integral[c] * pair->per_area;
        }
}

void alb_product_add(double (*out)[3], const alb_links *links, const alb_forest *forest,
                     const alb_scatter_kernel *kernels, unsigned sides)
{
#pragma omp parallel for schedule(dynamic, 16)
    for (size_t b = 0; b < links->block_count; b++) {
        const alb_link_block *block = &links->blocks[b];
        double sums[ALB_BLOCK][3] = {{0}};
        cursor at = begin(block);
        for (const alb_link_run *run = block->runs; run < block->runs + block->run_count; step(&at, run++)) {
            if (sides & 1U << kernels[run->kernel].side)
                add_run(sums, table_of(kernels, run), forest->nodes + run->first, at.deltas, at.codes, at.directions,
                        run->count, &alb_levels[run->level]);
        }
        add_pairs(sums, block, forest, kernels, sides);
        for (uint32_t row = 0; row < block->row_count; row++)
            for (int c = 0; c < 3; c++)
                out[forest->patches[block->first_leaf + row]][c] += sums[row][c];
    }
}

// The transposed product: what the rows' areas send to each cluster, at its centre and how it changes from there.
typedef struct column {
    float value[3], change[3][3]; // change along x, y, z
} column;

static void add_block_columns(column *columns, const alb_link_block *block, const alb_forest *forest,
                              const alb_scatter_kernel *kernels)
{
    const float *areas = forest->areas_mm2 + block->first_leaf;
    for (const alb_exact_pair *pair = block->pairs; pair < block->pairs + block->pair_count; pair++)
        for (int c = 0; c < 3; c++)
            columns[pair->node].value[c] += areas[pair->row] * pair->weights[c];
    cursor at = begin(block);
    for (const alb_link_run *run = block->runs; run < block->runs + block->run_count; step(&at, run++)) {
        const float(*table)[16] = table_of(kernels, run);
        const uint8_t *codes = at.codes;
        const alb_level *level = &alb_levels[run->level];
        size_t node = run->first;
        for (uint32_t k = 0; k < run->count; k++) {
            float8 sum = {0}, value, bend;
            node += at.deltas[k];
            const float v = level->spread * forest->nodes[node].spread_mm2 * (float)at.directions[k][3] / 64;
            for (int part = 0; part < level->parts; part++, codes += ALB_BLOCK)
                for (uint32_t row = 0; row < block->row_count; row++) {
                    memcpy(&value, table[codes[row]], sizeof value);
                    memcpy(&bend, table[codes[row]] + 8, sizeof bend);
                    sum += (value + v * bend) * areas[row];
                }
            for (int c = 0; c < 3; c++) {
                columns[node].value[c] += sum[c] / (float)level->parts;
                for (int axis = 0; axis < 3; axis++)
                    columns[node].change[axis][c] += sum[4 + c] * (float)at.directions[k][axis] / INT8_MAX;
            }
        }
    }
}

// What a cluster got, its patches have each.
static void hand_down(double (*sums)[3], const column *columns, const alb_forest *forest, uint32_t node,
                      uint32_t first_leaf, uint32_t count, const column *above, uint32_t parent)
{
    column here = *above;
    for (int c = 0; c < 3; c++) {
        for (int axis = 0; axis < 3; axis++) {
            here.value[c] += above->change[axis][c] *
                             (forest->nodes[node].moments[axis][3] - forest->nodes[parent].moments[axis][3]);
            here.change[axis][c] += columns[node].change[axis][c];
        }
        here.value[c] += columns[node].value[c];
        if (count == 1)
            sums[forest->patches[first_leaf]][c] += (double)here.value[c];
    }
    if (count == 1)
        return;
    const uint32_t left = alb_left_count(count);
    hand_down(sums, columns, forest, node + 1, first_leaf, left, &here, node);
    hand_down(sums, columns, forest, node + 2 * left, first_leaf + left, count - left, &here, node);
}

bool alb_product_add_columns(double (*sums)[3], const alb_links *links, const alb_forest *forest,
                             const alb_scatter_kernel *kernels, alb_error *error)
{
    enum { SHARES = 2 }; // as many sums however many threads: the same bytes
    static const column nothing = {{0}, {{0}}};
    column *columns = alb_allocate(SHARES * forest->node_count, sizeof *columns, error);
    if (!columns)
        return false;
#pragma omp parallel for schedule(dynamic, 1)
    for (size_t share = 0; share < SHARES; share++)
        for (size_t b = links->block_count * share / SHARES; b < links->block_count * (share + 1) / SHARES; b++)
            add_block_columns(columns + share * forest->node_count, &links->blocks[b], forest, kernels);
#pragma omp parallel for schedule(dynamic, 1)
    for (size_t t = 0; t < forest->tree_count; t++) {
        const alb_tree *tree = &forest->trees[t];
        for (size_t share = 0; share < SHARES; share++)
            hand_down(sums, columns + share * forest->node_count, forest, tree->first_node, tree->first_leaf,
                      tree->leaf_count, &nothing, tree->first_node);
    }
    free(columns);
    return true;
}
