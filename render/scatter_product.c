// The product: for each block of exit patches, for each link, eight look-ups times one light. In single precision
// within a run of links, in double beyond it: rounding stays near 1e-7.
//     out_j += sum over links s(d_j) [light + (s'/s) u . moment + v (s''/2s) light + ...]
// u the direction to the source, v its variance along it. What stands in brackets is taken at a mean of the block's
// distances: of an exponential s'/s and s''/s are the same at all of them. Where the distances differ much s'' is taken
// at each. Of a patch at several distances each sends a share of the light and nothing else.
#include "render/scatter_product.h"
#include "base/vector_clones.h"
#include "render/scatter_run.h"
#include <string.h>

typedef double double4 __attribute__((vector_size(32)));
typedef int8_t byte4 __attribute__((vector_size(4)));

static inline __attribute__((always_inline)) void add_rows(alb_float4 rows[ALB_BLOCK], const alb_run_reader *run,
                                                           const uint8_t *codes, alb_float4 light)
{
#pragma GCC unroll 8
    for (int row = 0; row < ALB_BLOCK; row++)
        rows[row] += alb_load4(run->values[codes[row]]) * light;
}

static inline __attribute__((always_inline)) void add_near_rows(alb_float4 rows[ALB_BLOCK], const alb_run_reader *run,
                                                                const uint8_t *codes, alb_float4 light,
                                                                alb_float4 spread)
{
#pragma GCC unroll 8
    for (int row = 0; row < ALB_BLOCK; row++)
        rows[row] += alb_load4(run->values[codes[row]]) * (light + alb_load4(run->bends[codes[row]] + 4) * spread);
}

static inline __attribute__((always_inline)) void end_run(double4 sums[ALB_BLOCK], const alb_float4 rows[ALB_BLOCK])
{
    for (int row = 0; row < ALB_BLOCK; row++)
        sums[row] += __builtin_convertvector(rows[row], double4);
}

// What the first moments of a node's light add.
static inline __attribute__((always_inline)) alb_float4 by_moments(const alb_scatter_node *node, const float bend[8],
                                                                   const int8_t direction[4])
{
    byte4 bytes;
    memcpy(&bytes, direction, sizeof bytes);
    const alb_float4 to = __builtin_convertvector(bytes, alb_float4);
    const alb_float4 along =
        to[0] * alb_load4(node->moments[0]) + to[1] * alb_load4(node->moments[1]) + to[2] * alb_load4(node->moments[2]);
    return alb_load4(bend) * (1.0F / INT8_MAX) * along;
}

// Nodes: light and its moments.
static inline __attribute__((always_inline)) void add_nodes(double4 sums[ALB_BLOCK], const alb_run_reader *run,
                                                            bool near)
{
    alb_float4 rows[ALB_BLOCK] = {{0}};
    const alb_scatter_node *node = run->forest->nodes + run->first;
    const uint8_t *codes = run->codes;
    for (size_t k = 0; k < run->count; k++, codes += ALB_BLOCK) {
        const float *bend = run->bends[*codes++];
        node += run->deltas[k];
        const alb_float4 light = alb_load4(node->light), moved = light + by_moments(node, bend, run->directions[k]);
        const float spread = (float)run->directions[k][3] * (1.0F / 64) * node->light[3];
        if (near)
            add_near_rows(rows, run, codes, moved, light * spread);
        else
            add_rows(rows, run, codes, moved + light * alb_by_extent(bend, spread));
    }
    end_run(sums, rows);
}

// Patches, taken at one distance.
static inline __attribute__((always_inline)) void add_patches(double4 sums[ALB_BLOCK], const alb_run_reader *run,
                                                              bool near)
{
    alb_float4 rows[ALB_BLOCK] = {{0}};
    const float(*light)[4] = (const float(*)[4])run->forest->lights + run->first;
    const uint8_t *codes = run->codes;
    for (size_t k = 0; k < run->count; k++, codes += ALB_BLOCK) {
        light += run->deltas[k];
        const alb_float4 all = alb_load4(*light);
        if (near) {
            add_near_rows(rows, run, codes, all, all[3] * all);
        } else {
            const float *bend = run->bends[*codes++];
            add_rows(rows, run, codes, all + alb_load4(bend + 4) * all[3] * all);
        }
    }
    end_run(sums, rows);
}

// Patches whose light is shared out.
static inline __attribute__((always_inline)) void add_shares(double4 sums[ALB_BLOCK], const alb_run_reader *run,
                                                             int kind)
{
    alb_float4 rows[ALB_BLOCK] = {{0}};
    const float(*light)[4] = (const float(*)[4])run->forest->lights + run->first;
    const uint8_t *codes = run->codes;
    for (size_t k = 0; k < run->count; k++) {
        light += run->deltas[k];
        const alb_float4 all = alb_load4(*light);
        for (int code = 0; code < alb_link_codes(kind); code++, codes += ALB_BLOCK)
            add_rows(rows, run, codes, all * alb_link_share(kind, code));
    }
    end_run(sums, rows);
}

ALB_VECTOR_CLONES
static void add_run(double4 sums[ALB_BLOCK], const alb_run_reader *run)
{
    if (run->kind == ALB_LINK_NODE)
        add_nodes(sums, run, false);
    else if (run->kind == ALB_LINK_NEAR_NODE)
        add_nodes(sums, run, true);
    else if (run->kind == ALB_LINK_PATCH)
        add_patches(sums, run, false);
    else if (run->kind == ALB_LINK_NEAR_PATCH)
        add_patches(sums, run, true);
    else if (run->kind == ALB_LINK_THIRDS)
        add_shares(sums, run, ALB_LINK_THIRDS);
    else
        add_shares(sums, run, ALB_LINK_EIGHTHS);
}

typedef float float8 __attribute__((vector_size(32)));

static inline __attribute__((always_inline)) void put_twice(float8 *out, const float values[4])
{
    const alb_float4 v = alb_load4(values);
    *out = (float8){v[0], v[1], v[2], v[3], v[0], v[1], v[2], v[3]}; // spelt out: one instruction, a load
}

// What a link's source sends, and beside it what it would send of even light: its area, which has no moments; what
// bends add to both where rows have their own.
static inline __attribute__((always_inline)) void take_source(float8 *lit, float8 *bent, const alb_run_reader *run,
                                                              size_t k, size_t at, const float bend[8], bool node,
                                                              bool near)
{
    const alb_forest *forest = run->forest;
    const alb_float4 light = alb_load4(node ? forest->nodes[at].light : forest->lights[at]);
    const float area = node ? forest->node_areas_mm2[at] : forest->areas_mm2[at],
                spread = node ? (float)run->directions[k][3] * (1.0F / 64) * light[3] : light[3];
    const alb_float4 moved = node ? light + by_moments(&forest->nodes[at], bend, run->directions[k]) : light;
    const alb_float4 zero = {0}, whole = {area, area, area, 0};
    alb_float4 extent = node ? alb_by_extent(bend, spread) : alb_load4(bend + 4) * spread;
    extent = near || run->kind > ALB_LINK_NEAR_PATCH ? zero : extent;
    *lit = __builtin_shufflevector(moved + light * extent, whole + whole * extent, 0, 1, 2, 3, 4, 5, 6, 7);
    *bent = __builtin_shufflevector(light * spread, whole * spread, 0, 1, 2, 3, 4, 5, 6, 7);
}

static inline __attribute__((always_inline)) void add_both(double4 sums[ALB_BLOCK], double4 evens[ALB_BLOCK],
                                                           const alb_run_reader *run, bool node, bool near)
{
    float8 rows[ALB_BLOCK] = {{0}};
    const uint8_t *codes = run->codes;
    size_t at = run->first;
    for (size_t k = 0; k < run->count; k++) {
        float8 lit, bent;
        at += run->deltas[k];
        take_source(&lit, &bent, run, k, at, run->bends[*codes], node, near);
        codes += alb_link_bend_bytes(run->kind);
        for (int code = 0; code < alb_link_codes(run->kind); code++, codes += ALB_BLOCK) {
            const float8 share = lit * alb_link_share(run->kind, code);
#pragma GCC unroll 8
            for (int row = 0; row < ALB_BLOCK; row++) {
                float8 value, bends;
                put_twice(&value, run->values[codes[row]]);
                if (near)
                    put_twice(&bends, run->bends[codes[row]] + 4);
                rows[row] += value * (near ? share + bends * bent : share);
            }
        }
    }
    for (int row = 0; row < ALB_BLOCK; row++) {
        sums[row] += __builtin_convertvector(__builtin_shufflevector(rows[row], rows[row], 0, 1, 2, 3), double4);
        evens[row] += __builtin_convertvector(__builtin_shufflevector(rows[row], rows[row], 4, 5, 6, 7), double4);
    }
}

// As add_run, and the same of even light.
ALB_VECTOR_CLONES
static void add_run_both(double4 sums[ALB_BLOCK], double4 evens[ALB_BLOCK], const alb_run_reader *run)
{
    if (run->kind == ALB_LINK_NODE)
        add_both(sums, evens, run, true, false);
    else if (run->kind == ALB_LINK_NEAR_NODE)
        add_both(sums, evens, run, true, true);
    else if (run->kind == ALB_LINK_NEAR_PATCH)
        add_both(sums, evens, run, false, true);
    else
        add_both(sums, evens, run, false, false);
}

static void add_pairs(double4 sums[ALB_BLOCK], double4 evens[ALB_BLOCK], const alb_link_block *block,
                      const alb_forest *forest, const alb_scatter_kernel *kernels, unsigned sides)
{
    for (const alb_exact_pair *pair = block->pairs; pair < block->pairs + block->pair_count; pair++)
        for (int c = 0; c < 3 && sides & 1U << kernels[pair->kernel].side; c++) {
            sums[pair->row][c] += (double)(pair->weights[c] * forest->lights[pair->leaf][c]);
            evens[pair->row][c] += (double)(pair->weights[c] * forest->areas_mm2[pair->leaf]);
        }
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

void alb_product_add(double (*out)[3], double (*even)[3], const alb_links *links, const alb_forest *forest,
                     const alb_scatter_kernel *kernels, unsigned sides)
{
#pragma omp parallel for schedule(dynamic, 16)
    for (size_t b = 0; b < links->block_count; b++) {
        const alb_link_block *block = &links->blocks[b];
        double4 sums[ALB_BLOCK] = {{0}}, evens[ALB_BLOCK] = {{0}};
        alb_run_reader at = alb_run_begin(block, forest);
        for (const alb_link_run *run = block->runs; run < block->runs + block->run_count; alb_run_pass(&at), run++) {
            alb_run_take(&at, run, kernels);
            if (!(sides & 1U << kernels[run->kernel].side))
                continue;
            if (even)
                add_run_both(sums, evens, &at);
            else
                add_run(sums, &at);
        }
        add_pairs(sums, evens, block, forest, kernels, sides);
        for (uint32_t row = 0; row < block->row_count; row++)
            for (int c = 0; c < 3; c++) {
                out[forest->patches[block->first_leaf + row]][c] += sums[row][c];
                if (even)
                    even[forest->patches[block->first_leaf + row]][c] += evens[row][c];
            }
    }
}
