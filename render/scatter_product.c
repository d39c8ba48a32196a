// The product: for each block of exit patches, for each link, eight look-ups times one cluster. In single precision
// within a run of links, in double beyond it: rounding stays near 1e-7.
//     out_j += sum over links (s(d) + v s''(d) / 2) node,   v the variance of the node
// of a patch in n parts: node / n and the variance of a part.
#include "render/scatter_product.h"
#include "base/memory.h"
#include "base/vector_clones.h"
#include <stdlib.h>
#include <string.h>

typedef float float8 __attribute__((vector_size(32)));

// Colour and colour times variance.
static inline void spread_node(float8 *both, const float node[4], float share, float spread)
{
    const float red = share * node[0], green = share * node[1], blue = share * node[2], v = spread * node[3];
    *both = (float8){red, green, blue, 0, v * red, v * green, v * blue, 0};
}

ALB_VECTOR_CLONES
static void add_whole(double sums[ALB_BLOCK][3], const float (*table)[8], const float (*nodes)[4],
                      const uint16_t *deltas, const uint8_t *codes, size_t count)
{
    float8 rows[ALB_BLOCK] = {{0}};
    const float(*node)[4] = nodes;
    for (size_t k = 0; k < count; k++, codes += ALB_BLOCK) {
        float8 both, weights;
        node += deltas[k];
        spread_node(&both, *node, 1, 1);
#pragma GCC unroll 8
        for (int row = 0; row < ALB_BLOCK; row++) {
            memcpy(&weights, table[codes[row]], sizeof weights);
            rows[row] += weights * both;
        }
    }
    for (int row = 0; row < ALB_BLOCK; row++)
        for (int c = 0; c < 3; c++)
            sums[row][c] += (double)(rows[row][c] + rows[row][4 + c]);
}

ALB_VECTOR_CLONES
static void add_parted(double sums[ALB_BLOCK][3], const float (*table)[8], const float (*nodes)[4],
                       const uint16_t *deltas, const uint8_t *codes, size_t count, const alb_level *level)
{
    float8 rows[ALB_BLOCK] = {{0}};
    const float(*node)[4] = nodes;
    for (size_t k = 0; k < count; k++) {
        float8 both, weights, all[ALB_BLOCK] = {{0}};
        node += deltas[k];
        spread_node(&both, *node, 1 / (float)level->parts, level->spread);
        for (int part = 0; part < level->parts; part++, codes += ALB_BLOCK)
#pragma GCC unroll 8
            for (int row = 0; row < ALB_BLOCK; row++) {
                memcpy(&weights, table[codes[row]], sizeof weights);
                all[row] += weights;
            }
        for (int row = 0; row < ALB_BLOCK; row++)
            rows[row] += all[row] * both;
    }
    for (int row = 0; row < ALB_BLOCK; row++)
        for (int c = 0; c < 3; c++)
            sums[row][c] += (double)(rows[row][c] + rows[row][4 + c]);
}

// What one run finds in the block's deltas and codes, and steps past.
typedef struct cursor {
    const uint16_t *deltas;
    const uint8_t *codes;
} cursor;

static void step(cursor *at, const alb_link_run *run)
{
    at->deltas += run->count;
    at->codes += (size_t)run->count * (size_t)(ALB_BLOCK * alb_levels[run->level].parts);
}

static const float (*table_of(const alb_scatter_kernel *kernels, const alb_link_run *run))[8]
{
    return (const float(*)[8])kernels[run->kernel].values + (size_t)run->octave * ALB_CODES;
}

static void add_pairs(double sums[ALB_BLOCK][3], const alb_link_block *block, const alb_forest *forest,
                      const alb_scatter_kernel *kernels, unsigned sides)
{
    for (const alb_exact_pair *pair = block->pairs; pair < block->pairs + block->pair_count; pair++)
        for (int c = 0; c < 3 && sides & 1U << kernels[pair->kernel].side; c++)
            sums[pair->row][c] += (double)(pair->weights[c] * forest->nodes[pair->node][c]);
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
        cursor at = {block->deltas, block->codes};
        for (const alb_link_run *run = block->runs; run < block->runs + block->run_count; step(&at, run++)) {
            const float(*nodes)[4] = (const float(*)[4])forest->nodes + run->first;
            if (!(sides & 1U << kernels[run->kernel].side))
                continue;
            if (run->level)
                add_parted(sums, table_of(kernels, run), nodes, at.deltas, at.codes, run->count,
                           &alb_levels[run->level]);
            else
                add_whole(sums, table_of(kernels, run), nodes, at.deltas, at.codes, run->count);
        }
        add_pairs(sums, block, forest, kernels, sides);
        for (uint32_t row = 0; row < block->row_count; row++)
            for (int c = 0; c < 3; c++)
                out[forest->patches[block->first_leaf + row]][c] += sums[row][c];
    }
}

// The transposed product: what the rows' areas send to the nodes.
static void add_block_columns(float (*nodes)[4], const alb_link_block *block, const alb_forest *forest,
                              const alb_scatter_kernel *kernels)
{
    const float *areas = forest->areas_mm2 + block->first_leaf;
    for (const alb_exact_pair *pair = block->pairs; pair < block->pairs + block->pair_count; pair++)
        for (int c = 0; c < 3; c++)
            nodes[pair->node][c] += areas[pair->row] * pair->weights[c];
    cursor at = {block->deltas, block->codes};
    for (const alb_link_run *run = block->runs; run < block->runs + block->run_count; step(&at, run++)) {
        const float(*table)[8] = table_of(kernels, run);
        const uint8_t *codes = at.codes;
        const alb_level *level = &alb_levels[run->level];
        size_t node = run->first;
        for (uint32_t k = 0; k < run->count; k++) {
            float8 sum = {0}, weights;
            node += at.deltas[k];
            for (int part = 0; part < level->parts; part++, codes += ALB_BLOCK)
                for (uint32_t row = 0; row < block->row_count; row++) {
                    memcpy(&weights, table[codes[row]], sizeof weights);
                    sum += weights * areas[row];
                }
            const float v = forest->nodes[node][3] * level->spread;
            for (int c = 0; c < 3; c++)
                nodes[node][c] += (sum[c] + v * sum[4 + c]) / (float)level->parts;
        }
    }
}

// What a cluster got, its patches have each.
static void hand_down(double (*sums)[3], const float (*nodes)[4], const alb_forest *forest, uint32_t node,
                      uint32_t first_leaf, uint32_t count, const double above[3])
{
    double here[3];
    for (int c = 0; c < 3; c++)
        here[c] = above[c] + (double)nodes[node][c];
    if (count == 1) {
        for (int c = 0; c < 3; c++)
            sums[forest->patches[first_leaf]][c] += here[c];
        return;
    }
    const uint32_t left = alb_left_count(count);
    hand_down(sums, nodes, forest, node + 1, first_leaf, left, here);
    hand_down(sums, nodes, forest, node + 2 * left, first_leaf + left, count - left, here);
}

bool alb_product_add_columns(double (*sums)[3], const alb_links *links, const alb_forest *forest,
                             const alb_scatter_kernel *kernels, alb_error *error)
{
    enum { SHARES = 4 }; // as many sums however many threads: the same bytes
    static const double nothing[3] = {0};
    float(*nodes)[4] = alb_allocate(SHARES * forest->node_count, sizeof *nodes, error);
    if (!nodes)
        return false;
#pragma omp parallel for schedule(dynamic, 1)
    for (size_t share = 0; share < SHARES; share++)
        for (size_t b = links->block_count * share / SHARES; b < links->block_count * (share + 1) / SHARES; b++)
            add_block_columns(nodes + share * forest->node_count, &links->blocks[b], forest, kernels);
#pragma omp parallel for schedule(dynamic, 1)
    for (size_t t = 0; t < forest->tree_count; t++) {
        const alb_tree *tree = &forest->trees[t];
        for (size_t share = 0; share < SHARES; share++)
            hand_down(sums, (const float(*)[4])nodes + share * forest->node_count, forest, tree->first_node,
                      tree->first_leaf, tree->leaf_count, nothing);
    }
    free(nodes);
    return true;
}
