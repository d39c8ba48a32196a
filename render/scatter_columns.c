// Column sums of S': the share of the flux into patch i that leaves again anywhere, for the energy balance,
//     C_i = sum_j A_j S'_ji / A_i  ~=  sum over the links from i  A_j s(d_ji)
// with the links of scatter_product.c read backwards. Each row of a block sends its area along the link; a node gets
// the sum at its centre and how it changes from there, to the order that the product has,
//     C(x) = sum A_j s [1 + (s'/s) u . (x - centre) + v s''/2s],
// and hands both down its tree. The same bytes with any number of threads: there are always two sums.
#include "base/memory.h"
#include "base/vector_clones.h"
#include "render/scatter_product.h"
#include "render/scatter_run.h"
#include <stdlib.h>

typedef struct column {
    float value[3], change[3][3]; // RGB; change along x, y, z, per mm
} column;

// What the rows have sent so far.
typedef struct columns {
    alb_float4 *leaves;
    column *nodes;
} columns;

ALB_VECTOR_CLONES
static void send_run(const columns *to, const alb_run_reader *run, const float areas[ALB_BLOCK])
{
    const int count = alb_link_codes(run->kind);
    const uint8_t *codes = run->codes;
    size_t at = run->first;
    for (size_t k = 0; k < run->count; k++) {
        at += run->deltas[k];
        const bool near = run->kind == ALB_LINK_NEAR_NODE || run->kind == ALB_LINK_NEAR_PATCH;
        const float *bend = run->bends[*codes];
        alb_float4 sum = {0}, bent = {0};
        codes += alb_link_bend_bytes(run->kind);
        for (int code = 0; code < count; code++, codes += ALB_BLOCK)
#pragma GCC unroll 8
            for (int row = 0; row < ALB_BLOCK; row++) {
                const alb_float4 sent =
                    alb_load4(run->values[codes[row]]) * (areas[row] * alb_link_share(run->kind, code));
                sum += sent;
                bent += near ? sent * alb_load4(run->bends[codes[row]] + 4) : sent;
            }
        if (run->kind > ALB_LINK_NEAR_NODE) {
            bent = near ? bent : sum * alb_load4(bend + 4);
            to->leaves[at] += sum + bent * (run->kind <= ALB_LINK_NEAR_PATCH ? run->forest->lights[at][3] : 0);
            continue;
        }
        const float spread = (float)run->directions[k][3] / 64 * run->forest->nodes[at].light[3];
        const alb_float4 change = sum * alb_load4(bend) * (1.0F / INT8_MAX),
                         whole = sum + (near ? bent * spread : sum * alb_by_extent(bend, spread));
        for (int c = 0; c < 3; c++) {
            to->nodes[at].value[c] += whole[c];
            for (int axis = 0; axis < 3; axis++)
                to->nodes[at].change[axis][c] += change[c] * (float)run->directions[k][axis];
        }
    }
}

static void add_block_columns(const columns *to, const alb_link_block *block, const alb_forest *forest,
                              const alb_scatter_kernel *kernels)
{
    float areas[ALB_BLOCK] = {0};
    memcpy(areas, forest->areas_mm2 + block->first_leaf, block->row_count * sizeof *areas);
    for (const alb_exact_pair *pair = block->pairs; pair < block->pairs + block->pair_count; pair++)
        for (int c = 0; c < 3; c++)
            to->leaves[pair->leaf][c] += areas[pair->row] * pair->weights[c];
    alb_run_reader at = alb_run_begin(block, forest);
    for (const alb_link_run *run = block->runs; run < block->runs + block->run_count; alb_run_pass(&at), run++) {
        alb_run_take(&at, run, kernels);
        send_run(to, &at, areas);
    }
}

// A column seen from a point off the centre that it was found at.
static void move(column *to, const column *from, const float off[3])
{
    *to = *from;
    for (int c = 0; c < 3; c++)
        for (int axis = 0; axis < 3; axis++)
            to->value[c] += from->change[axis][c] * off[axis];
}

// What a node got, its patches have each.
static void hand_down(double (*sums)[3], const columns *from, const alb_forest *forest, uint32_t node,
                      uint32_t first_leaf, uint32_t count, const column *above)
{
    const uint32_t left = alb_left_count(count), counts[2] = {left, count - left};
    const uint32_t nodes[2] = {node + 1, node + left}, leaves[2] = {first_leaf, first_leaf + left};
    column whole = *above;
    for (int c = 0; c < 3; c++) {
        whole.value[c] += from->nodes[node].value[c];
        for (int axis = 0; axis < 3; axis++)
            whole.change[axis][c] += from->nodes[node].change[axis][c];
    }
    for (int child = 0; child < 2; child++) {
        const uint32_t leaf = leaves[child];
        column part;
        float off[3];
        for (int k = 0; k < 3; k++)
            off[k] = (counts[child] > 1 ? forest->nodes[nodes[child]].moments[k][3] : forest->centres_mm[leaf][k]) -
                     forest->nodes[node].moments[k][3];
        move(&part, &whole, off);
        if (counts[child] > 1)
            hand_down(sums, from, forest, nodes[child], leaf, counts[child], &part);
        else
            for (int c = 0; c < 3; c++)
                sums[forest->patches[leaf]][c] += (double)part.value[c] + (double)from->leaves[leaf][c];
    }
}

bool alb_product_add_columns(double (*sums)[3], const alb_links *links, const alb_forest *forest,
                             const alb_scatter_kernel *kernels, alb_error *error)
{
    enum { SHARES = 2 };
    static const column nothing = {{0}, {{0}}};
    columns shares[SHARES] = {{0}};
    bool ok = true;
    for (int k = 0; ok && k < SHARES; k++)
        ok = (shares[k].leaves = alb_allocate(forest->leaf_count, sizeof *shares[k].leaves, error)) &&
             (shares[k].nodes = alb_allocate(forest->leaf_count, sizeof *shares[k].nodes, error));
#pragma omp parallel for schedule(dynamic, 1)
    for (size_t k = 0; k < (ok ? SHARES : 0); k++)
        for (size_t b = links->block_count * k / SHARES; b < links->block_count * (k + 1) / SHARES; b++)
            add_block_columns(&shares[k], &links->blocks[b], forest, kernels);
#pragma omp parallel for schedule(dynamic, 1)
    for (size_t t = 0; t < (ok ? forest->tree_count : 0); t++) {
        const alb_tree *tree = &forest->trees[t];
        for (int k = 0; k < SHARES; k++)
            if (tree->leaf_count > 1)
                hand_down(sums, &shares[k], forest, tree->first_cluster - tree->first_leaf, tree->first_leaf,
                          tree->leaf_count, &nothing);
            else
                for (int c = 0; c < 3; c++)
                    sums[forest->patches[tree->first_leaf]][c] += (double)shares[k].leaves[tree->first_leaf][c];
    }
    for (int k = 0; k < SHARES; k++) {
        free(shares[k].leaves);
        free(shares[k].nodes);
    }
    return ok;
}
