// The product: for each block of exit patches, for each link, eight look-ups times one light. In single precision
// within a run of links, in double beyond it: rounding stays near 1e-7.
//     out_j += sum over links s(d_j) [light + (s'/s) u . moment + v (s''/2s) light + ...]
// u the direction to the source, v its variance along it. What stands in brackets is taken at a mean of the block's
// distances: of an exponential s'/s and s''/s are the same at all of them. Where the distances differ much s'' is taken
// at each. Of a patch at several distances each sends a share of the light and nothing else.
#include "render/scatter_product.h"
#include "base/memory.h"
#include "base/vector_clones.h"
#include <stdlib.h>
#include <string.h>

typedef float float4 __attribute__((vector_size(16)));
typedef double double4 __attribute__((vector_size(32)));
typedef int8_t byte4 __attribute__((vector_size(4)));

static inline float4 load(const float values[4])
{
    float4 all;
    memcpy(&all, values, sizeof all);
    return all;
}

// Where a run is read.
typedef struct stretch {
    const float (*values)[4], (*bends)[8];
    const alb_forest *forest;
    const uint16_t *deltas;
    const uint8_t *codes;
    const int8_t (*directions)[4];
    uint32_t first;
    size_t count;
    int kind;
} stretch;

static inline __attribute__((always_inline)) void add_rows(float4 rows[ALB_BLOCK], const stretch *run,
                                                           const uint8_t *codes, float4 light)
{
#pragma GCC unroll 8
    for (int row = 0; row < ALB_BLOCK; row++)
        rows[row] += load(run->values[codes[row]]) * light;
}

static inline __attribute__((always_inline)) void add_near_rows(float4 rows[ALB_BLOCK], const stretch *run,
                                                                const uint8_t *codes, float4 light, float4 spread)
{
#pragma GCC unroll 8
    for (int row = 0; row < ALB_BLOCK; row++)
        rows[row] += load(run->values[codes[row]]) * (light + load(run->bends[codes[row]] + 4) * spread);
}

static inline __attribute__((always_inline)) void end_run(double4 sums[ALB_BLOCK], const float4 rows[ALB_BLOCK])
{
    for (int row = 0; row < ALB_BLOCK; row++)
        sums[row] += __builtin_convertvector(rows[row], double4);
}

// What the extent of a node adds to its light: v s''/2s, and the fourth order of an exponential, (s''/s)^2 m_4 / 24
// with m_4 = 12/5 v^2, that of a triangle.
static inline __attribute__((always_inline)) float4 by_extent(const float bend[8], float spread)
{
    const float4 second = load(bend + 4) * spread;
    return second + 0.4F * second * second;
}

// What the first moments of a node's light add.
static inline __attribute__((always_inline)) float4 by_moments(const alb_scatter_node *node, const float bend[8],
                                                               const int8_t direction[4])
{
    byte4 bytes;
    memcpy(&bytes, direction, sizeof bytes);
    const float4 to = __builtin_convertvector(bytes, float4);
    const float4 along =
        to[0] * load(node->moments[0]) + to[1] * load(node->moments[1]) + to[2] * load(node->moments[2]);
    return load(bend) * (1.0F / INT8_MAX) * along;
}

// Nodes: light and its moments.
static inline __attribute__((always_inline)) void add_nodes(double4 sums[ALB_BLOCK], const stretch *run, bool near)
{
    float4 rows[ALB_BLOCK] = {{0}};
    const alb_scatter_node *node = run->forest->nodes + run->first;
    const uint8_t *codes = run->codes;
    for (size_t k = 0; k < run->count; k++, codes += ALB_BLOCK) {
        const float *bend = run->bends[*codes++];
        node += run->deltas[k];
        const float4 light = load(node->light), moved = light + by_moments(node, bend, run->directions[k]);
        const float spread = (float)run->directions[k][3] * (1.0F / 64) * node->light[3];
        if (near)
            add_near_rows(rows, run, codes, moved, light * spread);
        else
            add_rows(rows, run, codes, moved + light * by_extent(bend, spread));
    }
    end_run(sums, rows);
}

// Patches, taken at one distance.
static inline __attribute__((always_inline)) void add_patches(double4 sums[ALB_BLOCK], const stretch *run, bool near)
{
    float4 rows[ALB_BLOCK] = {{0}};
    const float(*light)[4] = (const float(*)[4])run->forest->lights + run->first;
    const uint8_t *codes = run->codes;
    for (size_t k = 0; k < run->count; k++, codes += ALB_BLOCK) {
        light += run->deltas[k];
        const float4 all = load(*light);
        if (near) {
            add_near_rows(rows, run, codes, all, all[3] * all);
        } else {
            const float *bend = run->bends[*codes++];
            add_rows(rows, run, codes, all + load(bend + 4) * all[3] * all);
        }
    }
    end_run(sums, rows);
}

// Patches whose light is shared out.
static inline __attribute__((always_inline)) void add_shares(double4 sums[ALB_BLOCK], const stretch *run, int kind)
{
    float4 rows[ALB_BLOCK] = {{0}};
    const float(*light)[4] = (const float(*)[4])run->forest->lights + run->first;
    const uint8_t *codes = run->codes;
    for (size_t k = 0; k < run->count; k++) {
        light += run->deltas[k];
        const float4 all = load(*light);
        for (int code = 0; code < alb_link_codes(kind); code++, codes += ALB_BLOCK)
            add_rows(rows, run, codes, all * alb_link_share(kind, code));
    }
    end_run(sums, rows);
}

ALB_VECTOR_CLONES
static void add_run(double4 sums[ALB_BLOCK], const stretch *run)
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
    const float4 v = load(values);
    *out = (float8){v[0], v[1], v[2], v[3], v[0], v[1], v[2], v[3]}; // spelt out: one instruction, a load
}

// What a link's source sends, and beside it what it would send of even light: its area, which has no moments; what
// bends add to both where rows have their own.
static inline __attribute__((always_inline)) void take_source(float8 *lit, float8 *bent, const stretch *run, size_t k,
                                                              size_t at, const float bend[8], bool node, bool near)
{
    const alb_forest *forest = run->forest;
    const float4 light = load(node ? forest->nodes[at].light : forest->lights[at]);
    const float area = node ? forest->node_areas_mm2[at] : forest->areas_mm2[at],
                spread = node ? (float)run->directions[k][3] * (1.0F / 64) * light[3] : light[3];
    const float4 moved = node ? light + by_moments(&forest->nodes[at], bend, run->directions[k]) : light;
    const float4 zero = {0}, whole = {area, area, area, 0};
    float4 extent = node ? by_extent(bend, spread) : load(bend + 4) * spread;
    extent = near || run->kind > ALB_LINK_NEAR_PATCH ? zero : extent;
    *lit = __builtin_shufflevector(moved + light * extent, whole + whole * extent, 0, 1, 2, 3, 4, 5, 6, 7);
    *bent = __builtin_shufflevector(light * spread, whole * spread, 0, 1, 2, 3, 4, 5, 6, 7);
}

static inline __attribute__((always_inline)) void add_both(double4 sums[ALB_BLOCK], double4 evens[ALB_BLOCK],
                                                           const stretch *run, bool node, bool near)
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
static void add_run_both(double4 sums[ALB_BLOCK], double4 evens[ALB_BLOCK], const stretch *run)
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

static stretch begin(const alb_link_block *block, const alb_forest *forest)
{
    return (stretch){.forest = forest,
                     .deltas = block->deltas,
                     .codes = block->codes,
                     .directions = (const int8_t(*)[4])block->directions};
}

// Points the stretch at the run.
static void take(stretch *at, const alb_link_run *run, const alb_scatter_kernel *kernels)
{
    const alb_scatter_kernel *kernel = &kernels[run->kernel];
    const size_t octave = (size_t)(run->octave - kernel->first_used) * ALB_CODES;
    at->values = (const float(*)[4])kernel->values + octave;
    at->bends = (const float(*)[8])kernel->bends + octave;
    at->first = run->first;
    at->count = run->count;
    at->kind = run->kind;
}

static void pass(stretch *at)
{
    at->deltas += at->count;
    at->codes += at->count * alb_link_code_bytes(at->kind);
    at->directions += at->kind <= ALB_LINK_NEAR_NODE ? at->count : 0;
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
        stretch at = begin(block, forest);
        for (const alb_link_run *run = block->runs; run < block->runs + block->run_count; pass(&at), run++) {
            take(&at, run, kernels);
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

// The transposed product: what the rows' areas send to each source: to a leaf, and to a node at its centre and how it
// changes from there.
typedef struct column {
    float value[3], change[3][3]; // change along x, y, z
} column;

typedef struct columns {
    float4 *leaves;
    column *nodes;
} columns;

ALB_VECTOR_CLONES
static void send_run(const columns *to, const stretch *run, const float areas[ALB_BLOCK])
{
    const int count = alb_link_codes(run->kind);
    const uint8_t *codes = run->codes;
    size_t at = run->first;
    for (size_t k = 0; k < run->count; k++) {
        at += run->deltas[k];
        const bool near = run->kind == ALB_LINK_NEAR_NODE || run->kind == ALB_LINK_NEAR_PATCH;
        const float *bend = run->bends[*codes];
        float4 sum = {0}, bent = {0};
        codes += alb_link_bend_bytes(run->kind);
        for (int code = 0; code < count; code++, codes += ALB_BLOCK)
#pragma GCC unroll 8
            for (int row = 0; row < ALB_BLOCK; row++) {
                const float4 sent = load(run->values[codes[row]]) * (areas[row] * alb_link_share(run->kind, code));
                sum += sent;
                bent += near ? sent * load(run->bends[codes[row]] + 4) : sent;
            }
        if (run->kind > ALB_LINK_NEAR_NODE) {
            bent = near ? bent : sum * load(bend + 4);
            to->leaves[at] += sum + bent * (run->kind <= ALB_LINK_NEAR_PATCH ? run->forest->lights[at][3] : 0);
            continue;
        }
        const float spread = (float)run->directions[k][3] / 64 * run->forest->nodes[at].light[3];
        const float4 change = sum * load(bend) * (1.0F / INT8_MAX),
                     whole = sum + (near ? bent * spread : sum * by_extent(bend, spread));
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
    stretch at = begin(block, forest);
    for (const alb_link_run *run = block->runs; run < block->runs + block->run_count; pass(&at), run++) {
        take(&at, run, kernels);
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
    enum { SHARES = 2 }; // as many sums however many threads: the same bytes
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
