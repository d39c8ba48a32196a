// Weights from links. A link from a cluster lights a row by
//     s(d) A [(1 + second order) E + (s'/s) u . moment of E]
// The moment is left out: where that could cost more than what is allowed, the cluster is split, each child with the
// weight that the slope gives it. Where two children light all rows nearly alike, their parent stands for both. With C
// a contribution and A an area, either costs a row, where light differs between the children by its mean,
//     |C_l A_r - C_r A_l| / (A_l + A_r)
// and that is kept below a tenth of the error wanted of the row's sum: some hundred sources, each off by less in its
// own direction, together stay within it.
//
// Contributions are rounded to 5 bits, each with what the one before it has left (error diffusion): sources stand in
// the order of the tree, so that rounding moves light to a neighbour and the sum stays; a scale a row makes up for the
// last one.
#include "base/memory.h"
#include "render/scatter_block.h"
#include "render/scatter_weights.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct extent {
    uint32_t first_leaf, count;
    float area_mm2;
} extent;

typedef struct source {
    extent of;
    uint32_t cluster;
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
    const extent *clusters;
    const uint32_t *of_leaves, *of_nodes; // which clusters these are
    float allowed[3][ALB_BLOCK];          // of the block under way
    sources found, kept;
    bool failed;
} maker;

// Extents of the clusters, which of them are leaves and nodes, and how their light comes about.
typedef struct finder {
    const alb_forest *forest;
    alb_weights *weights;
    extent *clusters;
    uint32_t *of_leaves, *of_nodes;
} finder;

static float find_extents(const finder *f, uint32_t cluster, uint32_t first_leaf, uint32_t count)
{
    const uint32_t left = count > 1 ? alb_left_count(count) : 0;
    float area_mm2 = f->forest->areas_mm2[first_leaf];
    if (count > 1) {
        const float of_left = find_extents(f, cluster + 1, first_leaf, left);
        area_mm2 = of_left + find_extents(f, cluster + 2 * left, first_leaf + left, count - left);
        f->of_nodes[cluster - first_leaf] = cluster;
        f->weights->clusters[cluster] = (alb_weight_cluster){cluster + 2 * left, of_left / area_mm2};
    } else {
        f->of_leaves[first_leaf] = cluster;
        f->weights->clusters[cluster] = (alb_weight_cluster){f->forest->patches[first_leaf], -1};
    }
    f->clusters[cluster] = (extent){first_leaf, count, area_mm2};
    return area_mm2;
}

static void cut_parts(const finder *f, uint32_t cluster)
{
    alb_weights *weights = f->weights;
    const uint32_t count = f->clusters[cluster].count;
    if (count <= ALB_WEIGHT_PART) {
        weights->parts[weights->part_count][0] = cluster;
        weights->parts[weights->part_count++][1] = cluster + 2 * count - 1;
        return;
    }
    weights->tops[weights->top_count++] = cluster;
    cut_parts(f, cluster + 1);
    cut_parts(f, weights->clusters[cluster].right);
}

static source source_of(const maker *m, uint32_t cluster)
{
    return (source){.of = m->clusters[cluster], .cluster = cluster};
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
            *to = source_of(m, node ? m->of_nodes[at] : m->of_leaves[at]);
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
        *to = source_of(m, m->of_leaves[pair->leaf]);
        for (int c = 0; c < 3; c++)
            to->weights[c][pair->row] = pair->weights[c] * to->of.area_mm2;
    }
}

static int compare(const void *a, const void *b)
{
    const source *p = a, *q = b;
    return p->cluster < q->cluster ? -1 : p->cluster > q->cluster;
}

// Several links from one source become one.
static void sort_found(sources *found)
{
    size_t count = 0;
    if (found->count)
        qsort(found->items, found->count, sizeof *found->items, compare);
    for (size_t k = 0; k < found->count; k++) {
        if (!count || found->items[count - 1].cluster != found->items[k].cluster) {
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
    return of->of.count > 1 ? forest->nodes[of->cluster - of->of.first_leaf].moments[axis][3]
                            : forest->centres_mm[of->of.first_leaf][axis];
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

// Keeps the cluster, or what it is made of.
static void split(maker *m, const source *from)
{
    if (from->of.count == 1) {
        keep(m, from);
        return;
    }
    const uint32_t right = from->cluster + 2 * alb_left_count(from->of.count);
    source parts[2] = {source_of(m, from->cluster + 1), source_of(m, right)};
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
static void settle(maker *m, uint32_t cluster, size_t from, size_t to)
{
    const source *items = m->found.items;
    if (from < to && items[from].cluster == cluster)
        split(m, &items[from++]);
    if (from == to)
        return;
    const size_t before = m->kept.count;
    const uint32_t right = cluster + 2 * alb_left_count(m->clusters[cluster].count);
    size_t border = from;
    while (border < to && items[border].cluster < right)
        border++;
    settle(m, cluster + 1, from, border);
    settle(m, right, border, to);
    if (m->failed || m->kept.count != before + 2)
        return;
    source *parts = m->kept.items + before, parent = source_of(m, cluster);
    if (parts[0].cluster != cluster + 1 || parts[1].cluster != right || differ(m, &parts[0], &parts[1]))
        return;
    for (int c = 0; c < 3; c++)
        for (int row = 0; row < ALB_BLOCK; row++)
            parent.weights[c][row] = parts[0].weights[c][row] + parts[1].weights[c][row];
    parts[0] = parent;
    m->kept.count--;
}

// ---- Five bits ----

// The code nearest to a value of 7 2^6 and less: whole numbers from 4 on, of three bits and shifted.
static uint32_t code_of(double value)
{
    int exponent;
    if (value < 4)
        return value < 2 ? 0 : 4;
    const int mantissa = (int)lround(8 * frexp(value, &exponent)), // 4..8
        code = (exponent - 2) * 4 + mantissa - 4;
    return (uint32_t)(code > 31 ? 31 : code);
}

static double value_of(uint32_t code) { return code ? ldexp(4 + code % 4, (int)(code / 4) - 1) : 0; }

static void write_codes(alb_weight_block *block, const sources *from, int channel, uint32_t row, double wanted)
{
    const double largest_code = 7 << 6;
    double largest = 0, sum = 0, left = 0;
    for (size_t k = 0; k < from->count; k++)
        largest = fmax(largest, (double)from->items[k].weights[channel][row]);
    for (size_t k = 0; k < from->count && largest > 0; k++) {
        left += (double)from->items[k].weights[channel][row] / largest * largest_code;
        const uint32_t code = code_of(left);
        block->codes[k / ALB_WEIGHT_GROUP][k % ALB_WEIGHT_GROUP / 2][row] |=
            code << (16 * (k % 2) + (size_t)(ALB_WEIGHT_BITS * channel));
        sum += value_of(code);
        left -= value_of(code);
    }
    block->scales[channel][row] = (float)(sum > 0 ? fmax(wanted, 0) / sum * 0x1p68 : 0);
}

// Sources of no weight into gaps that 16 bits do not span.
static void fill_gaps(maker *m)
{
    for (size_t k = 1; k < m->kept.count; k++)
        if (m->kept.items[k].cluster - m->kept.items[k - 1].cluster > UINT16_MAX) {
            const source filler = source_of(m, m->kept.items[k - 1].cluster + UINT16_MAX);
            if (!add_source(m, &m->kept))
                return;
            memmove(m->kept.items + k + 1, m->kept.items + k, (m->kept.count - 1 - k) * sizeof filler);
            m->kept.items[k] = filler;
        }
}

static void write_sources(alb_weight_block *to, maker *m)
{
    const size_t groups = (m->kept.count + ALB_WEIGHT_GROUP - 1) / ALB_WEIGHT_GROUP;
    to->codes = m->failed ? NULL : calloc(groups + 1, sizeof *to->codes);
    to->gaps = m->failed ? NULL : calloc(groups + 1, sizeof *to->gaps);
    m->failed = !to->codes || !to->gaps;
    if (m->failed)
        return;
    to->group_count = (uint32_t)groups;
    to->first_source = m->kept.count ? m->kept.items[0].cluster : 0;
    for (size_t k = 1; k < m->kept.count; k++)
        to->gaps[k / ALB_WEIGHT_GROUP][k % ALB_WEIGHT_GROUP] =
            (uint16_t)(m->kept.items[k].cluster - m->kept.items[k - 1].cluster);
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
        while (at < m->found.count && m->found.items[at].cluster < tree->first_cluster + 2 * tree->leaf_count - 1)
            at++;
        settle(m, tree->first_cluster, first, at);
    }
    fill_gaps(m);
    write_sources(to, m);
    if (m->failed)
        return;
    for (int c = 0; c < 3; c++)
        for (uint32_t row = 0; row < to->row_count; row++)
            write_codes(to, &m->kept, c, row, row_sums[patches[row]][c] - local[patches[row]][c]);
}

// What the blocks hold, side by side: a product reads on from one to the next.
static bool join_blocks(alb_weights *weights)
{
    size_t at = 0;
    for (size_t b = 0; b < weights->block_count; b++)
        weights->group_count += weights->blocks[b].group_count;
    weights->codes = calloc(weights->group_count + ALB_WEIGHT_GROUPS_AHEAD, sizeof *weights->codes);
    weights->gaps = calloc(weights->group_count + 1, sizeof *weights->gaps);
    for (alb_weight_block *block = weights->blocks; block < weights->blocks + weights->block_count; block++) {
        if (weights->codes && weights->gaps && block->group_count) {
            memcpy(weights->codes + at, block->codes, block->group_count * sizeof *block->codes);
            memcpy(weights->gaps + at, block->gaps, block->group_count * sizeof *block->gaps);
        }
        free(block->codes);
        free(block->gaps);
        block->codes = weights->codes + (weights->codes ? at : 0);
        block->gaps = weights->gaps + (weights->gaps ? at : 0);
        at += block->group_count;
    }
    return weights->codes && weights->gaps;
}

static bool write_blocks(alb_weights *weights, const maker *like, const alb_links *links, const double (*row_sums)[3],
                         const double (*local)[3], double error_wanted)
{
    bool failed = false;
#pragma omp parallel reduction(|| : failed)
    {
        maker m = *like;
#pragma omp for schedule(dynamic, 16)
        for (size_t b = 0; b < links->block_count; b++)
            if (!m.failed)
                write_block(&weights->blocks[b], &m, &links->blocks[b], row_sums, local, 0.1 * error_wanted);
        failed = m.failed;
        free(m.found.items);
        free(m.kept.items);
    }
    return join_blocks(weights) && !failed;
}

bool alb_weights_create(alb_weights *weights, const alb_links *links, const alb_forest *forest,
                        const alb_scatter_kernel *kernels, const double (*row_sums)[3], const double (*local)[3],
                        double error_wanted, alb_error *error)
{
    const size_t most_parts = forest->tree_count + forest->leaf_count / (ALB_WEIGHT_PART / 4); // of a quarter at least
    extent *clusters = alb_allocate(forest->cluster_count, sizeof *clusters, error);
    uint32_t *of_leaves = clusters ? alb_allocate(2 * forest->leaf_count, sizeof *of_leaves, error) : NULL,
             *of_nodes = of_leaves + (of_leaves ? forest->leaf_count : 0);
    *weights = (alb_weights){.block_count = links->block_count};
    bool ok = of_leaves && (weights->blocks = alb_allocate(links->block_count, sizeof *weights->blocks, error)) &&
              (weights->clusters = alb_allocate(forest->cluster_count, sizeof *weights->clusters, error)) &&
              (weights->parts = alb_allocate(most_parts, sizeof *weights->parts, error)) &&
              (weights->tops = alb_allocate(most_parts, sizeof *weights->tops, error)) &&
              (weights->lights = alb_allocate(forest->cluster_count, sizeof *weights->lights, error));
    const finder f = {forest, weights, clusters, of_leaves, of_nodes};
    for (const alb_tree *tree = forest->trees; ok && tree < forest->trees + forest->tree_count; tree++) {
        find_extents(&f, tree->first_cluster, tree->first_leaf, tree->leaf_count);
        cut_parts(&f, tree->first_cluster);
    }
    maker m = {
        .forest = forest, .kernels = kernels, .clusters = clusters, .of_leaves = of_leaves, .of_nodes = of_nodes};
    if (ok && !write_blocks(weights, &m, links, row_sums, local, error_wanted))
        ok = alb_fail(error, ALB_NO_MEMORY, "no memory for the weights of scattering");
    free(clusters);
    free(of_leaves);
    if (!ok)
        alb_weights_free(weights);
    return ok;
}
