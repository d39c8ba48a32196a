// The product: for each block of exit patches, for each link, eight look-ups times one cluster. In single precision
// within a run of links, in double beyond it: rounding stays near 1e-7.
//     out_j += sum over links (s(d) + v s''(d) / 2) light + s'(d) u . moment
// u the direction to the cluster, v its variance along it; of a patch in n parts light / n and the variance of a part.
#include "render/scatter_product.h"
#include "base/memory.h"
#include "base/vector_clones.h"
#include <stdlib.h>
#include <string.h>

typedef float float4 __attribute__((vector_size(16)));
typedef float float8 __attribute__((vector_size(32)));
typedef int8_t byte4 __attribute__((vector_size(4)));

// Light of a part and its moment along the direction, R, G and B each; what follows them meets zeros in the tables.
static inline void take_node(float8 *light, const alb_scatter_node *node, const int8_t direction[4], float share)
{
    float4 all, axes[3];
    byte4 bytes;
    memcpy(&all, node, sizeof all);
    memcpy(axes, node->moments, sizeof axes);
    memcpy(&bytes, direction, sizeof bytes);
    const float4 to = __builtin_convertvector(bytes, float4) * (1.0F / INT8_MAX);
    const float4 along = to[0] * axes[0] + to[1] * axes[1] + to[2] * axes[2];
    *light = __builtin_shufflevector(share * all, along, 0, 1, 2, 3, 4, 5, 6, 7);
}

static inline float variance_of(const alb_scatter_node *node, const int8_t direction[4], const alb_level *level)
{
    return level->spread * node->spread_mm2 * (1.0F / 64) * (float)direction[3];
}

// Where a run is read.
typedef struct stretch {
    const float (*table)[16];
    const alb_scatter_node *node;
    const uint16_t *deltas;
    const uint8_t *codes;
    const int8_t (*directions)[4];
    size_t count;
    const alb_level *level;
} stretch;

// rows += (value + v bend) light, for the rows of a block; `parts` is the level's, told apart for the compiler.
static inline __attribute__((always_inline)) void add_links(double sums[ALB_BLOCK][3], const stretch *run, int parts)
{
    float8 rows[ALB_BLOCK] = {{0}};
    const alb_scatter_node *node = run->node;
    const uint8_t *codes = run->codes;
    for (size_t k = 0; k < run->count; k++) {
        float8 light, value, bend;
        node += run->deltas[k];
        take_node(&light, node, run->directions[k], 1 / (float)parts);
        const float v = variance_of(node, run->directions[k], run->level);
        for (int part = 0; part < parts; part++, codes += ALB_BLOCK)
#pragma GCC unroll 8
            for (int row = 0; row < ALB_BLOCK; row++) {
                memcpy(&value, run->table[codes[row]], sizeof value);
                memcpy(&bend, run->table[codes[row]] + 8, sizeof bend);
                rows[row] += (value + v * bend) * light;
            }
    }
    for (int row = 0; row < ALB_BLOCK; row++)
        for (int c = 0; c < 3; c++)
            sums[row][c] += (double)(rows[row][c] + rows[row][4 + c]);
}

ALB_VECTOR_CLONES
static void add_run(double sums[ALB_BLOCK][3], const stretch *run)
{
    if (run->level->parts == 1)
        add_links(sums, run, 1);
    else
        add_links(sums, run, run->level->parts);
}

static stretch begin(const alb_link_block *block)
{
    return (stretch){
        .deltas = block->deltas, .codes = block->codes, .directions = (const int8_t(*)[4])block->directions};
}

// Points the stretch at the run.
static void take(stretch *at, const alb_link_run *run, const alb_forest *forest, const alb_scatter_kernel *kernels)
{
    const alb_scatter_kernel *kernel = &kernels[run->kernel];
    at->table = (const float(*)[16])kernel->values + (size_t)(run->octave - kernel->first_used) * ALB_CODES;
    at->node = forest->nodes + run->first;
    at->count = run->count;
    at->level = &alb_levels[run->level];
}

static void pass(stretch *at)
{
    at->deltas += at->count;
    at->directions += at->count;
    at->codes += at->count * (size_t)(ALB_BLOCK * at->level->parts);
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
        stretch at = begin(block);
        for (const alb_link_run *run = block->runs; run < block->runs + block->run_count; pass(&at), run++) {
            take(&at, run, forest, kernels);
            if (sides & 1U << kernels[run->kernel].side)
                add_run(sums, &at);
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

ALB_VECTOR_CLONES
static void send_run(column *to, const stretch *run, const float areas[ALB_BLOCK])
{
    const alb_scatter_node *node = run->node;
    const uint8_t *codes = run->codes;
    for (size_t k = 0; k < run->count; k++) {
        float8 sum = {0}, value, bend;
        node += run->deltas[k];
        to += run->deltas[k];
        const float v = variance_of(node, run->directions[k], run->level), share = 1 / (float)run->level->parts;
        for (int part = 0; part < run->level->parts; part++, codes += ALB_BLOCK)
#pragma GCC unroll 8
            for (int row = 0; row < ALB_BLOCK; row++) {
                memcpy(&value, run->table[codes[row]], sizeof value);
                memcpy(&bend, run->table[codes[row]] + 8, sizeof bend);
                sum += (value + v * bend) * areas[row];
            }
        for (int c = 0; c < 3; c++) {
            to->value[c] += sum[c] * share;
            for (int axis = 0; axis < 3; axis++)
                to->change[axis][c] += sum[4 + c] * (float)run->directions[k][axis] * (1.0F / INT8_MAX);
        }
    }
}

static void add_block_columns(column *columns, const alb_link_block *block, const alb_forest *forest,
                              const alb_scatter_kernel *kernels)
{
    float areas[ALB_BLOCK] = {0};
    memcpy(areas, forest->areas_mm2 + block->first_leaf, block->row_count * sizeof *areas);
    for (const alb_exact_pair *pair = block->pairs; pair < block->pairs + block->pair_count; pair++)
        for (int c = 0; c < 3; c++)
            columns[pair->node].value[c] += areas[pair->row] * pair->weights[c];
    stretch at = begin(block);
    for (const alb_link_run *run = block->runs; run < block->runs + block->run_count; pass(&at), run++) {
        take(&at, run, forest, kernels);
        send_run(columns + run->first, &at, areas);
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
