// Weights from sources, the few clusters that light a block (scatter_weights_sources.c). Contributions are rounded to 5
// bits, each with what the one before it has left (error diffusion): sources stand in the order of the tree, so that
// rounding moves light to a neighbour and the sum stays; a scale a row makes up for the last one.
#include "base/memory.h"
#include "render/scatter_weights_sources.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

// Extents of the clusters, which of them are leaves and nodes, and how their light comes about.
typedef struct finder {
    const alb_forest *forest;
    alb_weights *weights;
    alb_weight_extent *clusters;
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
    f->clusters[cluster] = (alb_weight_extent){first_leaf, count, area_mm2};
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

static void write_codes(alb_weight_block *block, const alb_weight_sources *from, int channel, uint32_t row,
                        double wanted)
{
    const double largest_code = 7 << 6;
    double largest = 0, sum = 0, left = 0;
    for (size_t k = 0; k < from->count; k++)
        largest = fmax(largest, (double)from->items[k].weights[channel][row]);
    for (size_t k = 0; k < from->count; k++) {
        if (!(from->items[k].weights[channel][row] > 0)) // what fills a gap gets nothing of others' rounding
            continue;
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
static void fill_gaps(alb_weight_maker *m)
{
    for (size_t k = 1; k < m->kept.count; k++)
        if (m->kept.items[k].cluster - m->kept.items[k - 1].cluster > UINT16_MAX) {
            const alb_weight_source filler = alb_weight_source_of(m, m->kept.items[k - 1].cluster + UINT16_MAX);
            if (!alb_weight_sources_add(m, &m->kept))
                return;
            memmove(m->kept.items + k + 1, m->kept.items + k, (m->kept.count - 1 - k) * sizeof filler);
            m->kept.items[k] = filler;
        }
}

static void write_sources(alb_weight_block *to, alb_weight_maker *m)
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

static void write_block(alb_weight_block *to, alb_weight_maker *m, const alb_link_block *from,
                        const double (*row_sums)[3], const double (*local)[3], double allowed)
{
    const uint32_t *patches = m->forest->patches + from->first_leaf;
    *to = (alb_weight_block){.first_leaf = from->first_leaf, .row_count = from->row_count};
    for (int c = 0; c < 3; c++)
        for (uint32_t row = 0; row < ALB_BLOCK; row++)
            m->allowed[c][row] = row < from->row_count ? (float)(allowed * row_sums[patches[row]][c]) : INFINITY;
    alb_weight_sources_find(m, from);
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

static bool write_blocks(alb_weights *weights, const alb_weight_maker *like, const alb_links *links,
                         const double (*row_sums)[3], const double (*local)[3], double error_wanted)
{
    bool failed = false;
#pragma omp parallel reduction(|| : failed)
    {
        alb_weight_maker m = *like;
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
    alb_weight_extent *clusters = alb_allocate(forest->cluster_count, sizeof *clusters, error);
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
    alb_weight_maker m = {
        .forest = forest, .kernels = kernels, .clusters = clusters, .of_leaves = of_leaves, .of_nodes = of_nodes};
    if (ok && !write_blocks(weights, &m, links, row_sums, local, error_wanted))
        ok = alb_fail(error, ALB_NO_MEMORY, "no memory for the weights of scattering");
    free(clusters);
    free(of_leaves);
    if (!ok)
        alb_weights_free(weights);
    return ok;
}
