// Weights from links. A link from a cluster lights a row by
//     s(d) A [(1 + second order) E + (s'/s) u . moment of E]
// The moment is left out: where that could cost more than what is allowed, the cluster is split, each child with the
// weight that the slope gives it. Where two children light all rows nearly alike, their parent stands for both. With C
// a contribution and A an area, either costs a row, where light differs between the children by its mean,
//     |C_l A_r - C_r A_l| / (A_l + A_r)
// and that is kept below a tenth of the error wanted of the row's sum: some hundred sources, each off by less in its
// own direction, together stay within it.
//
// Contributions are rounded to 8 bits, each with what the one before it has left (error diffusion): sources stand in
// the order of the tree, so that rounding moves light to a neighbour and the sum stays; a scale a row makes up for the
// last one.
#include "base/memory.h"
#include "render/scatter_block.h"
#include "render/scatter_weights.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

// Leaves of a cluster; of nodes, kept while weights are made.
typedef struct extent {
    uint32_t first_leaf, count;
    float area_mm2;
} extent;

typedef struct source {
    extent of;
    uint32_t index;              // leaf, or leaf_count + node
    float weights[3][ALB_BLOCK]; // for even irradiance of one
    float slopes[3][3];          // [channel][axis]: relative change of the weights, per mm
} source;

typedef struct sources {
    source *items;
    size_t count, capacity;
} sources;

typedef struct maker {
    const alb_forest *forest;
    const alb_scatter_kernel *kernels;
    const extent *nodes;
    float allowed[3][ALB_BLOCK]; // of the block under way
    sources found, kept;
    bool failed;
} maker;

static float find_extents(extent *nodes, float *left_shares, const alb_forest *forest, uint32_t node,
                          uint32_t first_leaf, uint32_t count)
{
    if (count == 1)
        return forest->areas_mm2[first_leaf];
    const uint32_t left = alb_left_count(count);
    const float of_left = find_extents(nodes, left_shares, forest, node + 1, first_leaf, left),
                of_right = find_extents(nodes, left_shares, forest, node + left, first_leaf + left, count - left);
    nodes[node] = (extent){first_leaf, count, of_left + of_right};
    left_shares[node] = of_left / (of_left + of_right);
    return of_left + of_right;
}

static source *add_source(maker *m, sources *to)
{
    to->items = alb_grow(&m->failed, to->items, &to->capacity, to->count, 1, sizeof *to->items);
    return m->failed ? NULL : &to->items[to->count++];
}

// ---- Links as sources ----

// What the extent of a node adds, as the product takes it.
static float by_extent(float bend, float spread)
{
    const float second = bend * spread;
    return second + 0.4F * second * second;
}

// One link: codes of the rows, and before them the one that all rows share.
static void take_link(source *to, int kind, const uint8_t *codes, const int8_t direction[4], float spread,
                      const float (*values)[4], const float (*bends)[8])
{
    const float *bend = bends[*codes];
    const bool even = kind == ALB_LINK_NODE || kind == ALB_LINK_PATCH,
               near = kind == ALB_LINK_NEAR_NODE || kind == ALB_LINK_NEAR_PATCH, node = kind <= ALB_LINK_NEAR_NODE;
    codes += alb_link_bend_bytes(kind);
    if (node)
        spread *= (float)direction[3] / 64;
    for (int share = 0; share < alb_link_codes(kind); share++)
        for (int row = 0; row < ALB_BLOCK; row++, codes++)
            for (int c = 0; c < 3; c++) {
                const float second = near   ? bends[*codes][4 + c] * spread
                                     : node ? by_extent(bend[4 + c], spread)
                                     : even ? bend[4 + c] * spread
                                            : 0;
                to->weights[c][row] += to->of.area_mm2 * values[*codes][c] * alb_link_share(kind, share) * (1 + second);
            }
    for (int c = 0; node && c < 3; c++)
        for (int axis = 0; axis < 3; axis++)
            to->slopes[c][axis] = bend[c] * (float)direction[axis] / INT8_MAX;
}

static void take_block(maker *m, const alb_link_block *block)
{
    const alb_forest *forest = m->forest;
    const uint16_t *delta = block->deltas;
    const uint8_t *codes = block->codes;
    const int8_t(*direction)[4] = (const int8_t(*)[4])block->directions;
    m->found.count = m->kept.count = 0;
    for (const alb_link_run *run = block->runs; run < block->runs + block->run_count; run++) {
        const alb_scatter_kernel *kernel = &m->kernels[run->kernel];
        const size_t octave = (size_t)(run->octave - kernel->first_used) * ALB_CODES;
        const bool node = run->kind <= ALB_LINK_NEAR_NODE;
        uint32_t at = run->first;
        for (uint32_t k = 0; k < run->count; k++, codes += alb_link_code_bytes(run->kind)) {
            at += *delta++;
            source *to = add_source(m, &m->found);
            if (!to)
                return;
            *to = (source){.of = node ? m->nodes[at] : (extent){at, 1, forest->areas_mm2[at]},
                           .index = node ? (uint32_t)forest->leaf_count + at : at};
            take_link(to, run->kind, codes, node ? *direction : NULL,
                      node ? forest->nodes[at].light[3] : forest->lights[at][3],
                      (const float(*)[4])kernel->values + octave, (const float(*)[8])kernel->bends + octave);
            direction += node;
        }
    }
    for (const alb_exact_pair *pair = block->pairs; pair < block->pairs + block->pair_count; pair++) {
        source *to = add_source(m, &m->found);
        if (!to)
            return;
        *to = (source){.of = {pair->leaf, 1, forest->areas_mm2[pair->leaf]}, .index = pair->leaf};
        for (int c = 0; c < 3; c++)
            to->weights[c][pair->row] = pair->weights[c] * to->of.area_mm2;
    }
}

// In the order of the trees, a cluster before what it is made of.
static int compare(const void *a, const void *b)
{
    const source *p = a, *q = b;
    return p->of.first_leaf != q->of.first_leaf ? (p->of.first_leaf < q->of.first_leaf ? -1 : 1)
           : p->of.count != q->of.count         ? (p->of.count > q->of.count ? -1 : 1)
                                                : 0;
}

// Several links from one source become one.
static void sort_found(sources *found)
{
    size_t count = 0;
    if (found->count)
        qsort(found->items, found->count, sizeof *found->items, compare);
    for (size_t k = 0; k < found->count; k++) {
        if (!count || found->items[count - 1].index != found->items[k].index) {
            found->items[count++] = found->items[k];
            continue;
        }
        for (int c = 0; c < 3; c++)
            for (int row = 0; row < ALB_BLOCK; row++)
                found->items[count - 1].weights[c][row] += found->items[k].weights[c][row];
    }
    found->count = count;
}

// ---- As many sources as the error asks for ----

static float place(const alb_forest *forest, const source *of, int axis)
{
    return of->of.count > 1 ? forest->nodes[of->index - forest->leaf_count].moments[axis][3]
                            : forest->centres_mm[of->of.first_leaf][axis];
}

static source child_of(const maker *m, uint32_t node, uint32_t first_leaf, uint32_t count)
{
    return (source){.of = count > 1 ? m->nodes[node] : (extent){first_leaf, 1, m->forest->areas_mm2[first_leaf]},
                    .index = count > 1 ? (uint32_t)m->forest->leaf_count + node : first_leaf};
}

static bool differ(const maker *m, const source *left, const source *right)
{
    const float whole = left->of.area_mm2 + right->of.area_mm2, left_share = left->of.area_mm2 / whole,
                right_share = right->of.area_mm2 / whole;
    for (int c = 0; c < 3; c++)
        for (int row = 0; row < ALB_BLOCK; row++)
            if (fabsf(left->weights[c][row] * right_share - right->weights[c][row] * left_share) > m->allowed[c][row])
                return true;
    return false;
}

static void keep(maker *m, const source *from)
{
    const source held = *from; // it may lie in what grows
    source *to = add_source(m, &m->kept);
    if (to)
        *to = held;
}

// Keeps the node, or what it is made of.
static void split(maker *m, const source *from)
{
    const uint32_t count = from->of.count, left = alb_left_count(count), leaf = from->of.first_leaf,
                   node = from->index - (uint32_t)m->forest->leaf_count;
    if (count == 1) {
        keep(m, from);
        return;
    }
    source parts[2] = {child_of(m, node + 1, leaf, left), child_of(m, node + left, leaf + left, count - left)};
    for (int k = 0; k < 2; k++)
        for (int c = 0; c < 3; c++) {
            float factor = 1;
            for (int axis = 0; axis < 3; axis++) {
                factor += from->slopes[c][axis] * (place(m->forest, &parts[k], axis) - place(m->forest, from, axis));
                parts[k].slopes[c][axis] = from->slopes[c][axis];
            }
            factor = fminf(fmaxf(factor, 0), 2) * parts[k].of.area_mm2 / from->of.area_mm2;
            for (int row = 0; row < ALB_BLOCK; row++)
                parts[k].weights[c][row] = from->weights[c][row] * factor;
        }
    if (!differ(m, &parts[0], &parts[1])) {
        keep(m, from);
        return;
    }
    split(m, &parts[0]);
    split(m, &parts[1]);
}

// Keeps what stands for found[from .. to), which lies in the cluster.
static void settle(maker *m, uint32_t node, uint32_t first_leaf, uint32_t count, size_t from, size_t to)
{
    const source *items = m->found.items;
    if (from < to && items[from].of.count == count) // all of the cluster
        split(m, &items[from++]);
    if (from == to)
        return;
    const size_t before = m->kept.count;
    const uint32_t left = alb_left_count(count);
    size_t border = from;
    while (border < to && items[border].of.first_leaf < first_leaf + left)
        border++;
    settle(m, node + 1, first_leaf, left, from, border);
    settle(m, node + left, first_leaf + left, count - left, border, to);
    if (m->failed || m->kept.count != before + 2)
        return;
    source *parts = m->kept.items + before, parent = child_of(m, node, first_leaf, count);
    if (parts[0].of.count != left || parts[1].of.count != count - left || differ(m, &parts[0], &parts[1]))
        return;
    for (int c = 0; c < 3; c++)
        for (int row = 0; row < ALB_BLOCK; row++)
            parent.weights[c][row] = parts[0].weights[c][row] + parts[1].weights[c][row];
    parts[0] = parent;
    m->kept.count--;
}

// ---- Eight bits ----

// The code nearest to a value of 31 2^14 and less: whole numbers from 16 on, of five bits and shifted.
static uint8_t code_of(double value)
{
    int exponent;
    if (value < 16)
        return value < 8 ? 0 : 16;
    const int mantissa = (int)lround(32 * frexp(value, &exponent)); // 16..32
    const int code = (exponent - 4) * 16 + mantissa - 16;
    return (uint8_t)(code > UINT8_MAX ? UINT8_MAX : code);
}

static double value_of(uint8_t code) { return code ? ldexp(16 + code % 16, code / 16 - 1) : 0; }

static void write_codes(alb_weight_block *block, const sources *from, int channel, uint32_t row, double wanted)
{
    const double largest_code = 31 << 14;
    double largest = 0, sum = 0, left = 0;
    for (size_t k = 0; k < from->count; k++)
        largest = fmax(largest, (double)from->items[k].weights[channel][row]);
    for (size_t k = 0; k < from->count && largest > 0; k++) {
        left += (double)from->items[k].weights[channel][row] / largest * largest_code;
        const uint8_t code = code_of(left);
        block->codes[k / ALB_WEIGHT_GROUP][channel][row] |= (uint32_t)code << (8 * (k % ALB_WEIGHT_GROUP));
        sum += value_of(code);
        left -= value_of(code);
    }
    block->scales[channel][row] = (float)(sum > 0 ? fmax(wanted, 0) / sum * 0x1p70 : 0);
}

static void write_block(alb_weight_block *to, maker *m, const alb_link_block *from, const double (*row_sums)[3],
                        const double (*local)[3], double allowed)
{
    const alb_forest *forest = m->forest;
    const uint32_t *patches = forest->patches + from->first_leaf;
    *to = (alb_weight_block){.first_leaf = from->first_leaf, .row_count = from->row_count};
    for (int c = 0; c < 3; c++)
        for (uint32_t row = 0; row < ALB_BLOCK; row++)
            m->allowed[c][row] = row < from->row_count ? (float)(allowed * row_sums[patches[row]][c]) : INFINITY;
    take_block(m, from);
    if (m->failed)
        return;
    sort_found(&m->found);
    for (size_t t = 0, at = 0; t < forest->tree_count; t++) {
        const alb_tree *tree = &forest->trees[t];
        const size_t first = at;
        while (at < m->found.count && m->found.items[at].of.first_leaf < tree->first_leaf + tree->leaf_count)
            at++;
        settle(m, tree->first_cluster - tree->first_leaf, tree->first_leaf, tree->leaf_count, first, at);
    }
    const size_t groups = (m->kept.count + ALB_WEIGHT_GROUP - 1) / ALB_WEIGHT_GROUP,
                 size = ALB_WEIGHT_GROUP * sizeof *to->sources + sizeof *to->codes;
    to->sources = m->failed ? NULL : calloc(groups + 1, size);
    m->failed = !to->sources;
    if (m->failed)
        return;
    to->group_count = (uint32_t)groups;
    to->codes = (uint32_t(*)[3][ALB_BLOCK])(to->sources + groups * ALB_WEIGHT_GROUP);
    for (size_t k = 0; k < m->kept.count; k++)
        to->sources[k] = m->kept.items[k].index;
    for (int c = 0; c < 3; c++)
        for (uint32_t row = 0; row < to->row_count; row++)
            write_codes(to, &m->kept, c, row, row_sums[patches[row]][c] - local[patches[row]][c]);
}

bool alb_weights_create(alb_weights *weights, const alb_links *links, const alb_forest *forest,
                        const alb_scatter_kernel *kernels, const double (*row_sums)[3], const double (*local)[3],
                        double error_wanted, alb_error *error)
{
    *weights = (alb_weights){0};
    extent *nodes = alb_allocate(forest->leaf_count, sizeof *nodes, error);
    bool failed = !nodes;
    if (failed || !(weights->blocks = alb_allocate(links->block_count, sizeof *weights->blocks, error)) ||
        !(weights->left_shares = alb_allocate(forest->leaf_count, sizeof *weights->left_shares, error)) ||
        !(weights->lights = alb_allocate(2 * forest->leaf_count, sizeof *weights->lights, error))) {
        free(nodes);
        alb_weights_free(weights);
        return false;
    }
    weights->block_count = links->block_count;
    for (const alb_tree *tree = forest->trees; tree < forest->trees + forest->tree_count; tree++)
        find_extents(nodes, weights->left_shares, forest, tree->first_cluster - tree->first_leaf, tree->first_leaf,
                     tree->leaf_count);
#pragma omp parallel reduction(|| : failed)
    {
        maker m = {.forest = forest, .kernels = kernels, .nodes = nodes};
#pragma omp for schedule(dynamic, 16)
        for (size_t b = 0; b < links->block_count; b++)
            if (!m.failed)
                write_block(&weights->blocks[b], &m, &links->blocks[b], row_sums, local, 0.1 * error_wanted);
        failed = m.failed;
        free(m.found.items);
        free(m.kept.items);
    }
    free(nodes);
    for (size_t b = 0; b < links->block_count; b++)
        weights->group_count += weights->blocks[b].group_count;
    if (failed) {
        alb_weights_free(weights);
        return alb_fail(error, ALB_NO_MEMORY, "no memory for the weights of scattering");
    }
    return true;
}
