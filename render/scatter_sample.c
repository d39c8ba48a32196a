// Samples of a row of S': with w_i its weights times the sources' areas, in the order of the links, sample q of n is
// the source where their running sum passes (q + u) / n of the whole; u differs from patch to patch by the golden
// ratio, so that patches side by side fill each other's gaps. Of a cluster the leaf that lies as far along as the sum
// has come. Weights are those of the clusters' centres: what their moments add is left out.
#include "render/scatter_sample.h"
#include "base/memory.h"
#include "render/scatter_run.h"
#include <math.h>
#include <stdlib.h>

// Leaves of a node.
typedef struct extent {
    uint32_t first_leaf, count;
    float area_mm2;
} extent;

static float find_extents(extent *extents, const alb_forest *forest, uint32_t node, uint32_t first_leaf, uint32_t count)
{
    if (count == 1)
        return forest->areas_mm2[first_leaf];
    const uint32_t left = alb_left_count(count);
    const float area = find_extents(extents, forest, node + 1, first_leaf, left) +
                       find_extents(extents, forest, node + left, first_leaf + left, count - left);
    extents[node] = (extent){first_leaf, count, area};
    return area;
}

static inline extent extent_of_leaf(const alb_forest *forest, uint32_t leaf)
{
    return (extent){leaf, 1, forest->areas_mm2[leaf]};
}

// One row under way.
typedef struct row {
    uint32_t *sources;
    uint32_t at, count;
    float reached, step, next; // the running sum, and where the next sample is due
} row;

static row begin_row(uint32_t *sources, const uint32_t *first, uint32_t patch, double total, double local)
{
    row out = {.sources = sources + first[patch], .count = first[patch + 1] - first[patch]};
    const double place = 0.6180339887498949 * patch, offset = place - floor(place);
    out.step = out.count ? (float)(total / out.count) : 0;
    out.next = (float)offset * out.step;
    out.reached = (float)local;
    for (; out.at < out.count && out.next <= out.reached; out.next += out.step)
        out.sources[out.at++] = patch;
    return out;
}

static inline void add_source(row *to, float weight, const extent *of, const uint32_t *patches)
{
    const float before = to->reached;
    to->reached += weight;
    for (; to->next < to->reached && to->at < to->count; to->next += to->step) {
        const uint32_t along = (uint32_t)((to->next - before) / weight * (float)of->count);
        to->sources[to->at++] = patches[of->first_leaf + (along < of->count ? along : of->count - 1)];
    }
}

static void add_links(row rows[ALB_BLOCK], int channel, const alb_link_block *block, const alb_forest *forest,
                      const alb_scatter_kernel *kernels, const extent *extents)
{
    alb_run_reader at = alb_run_begin(block, forest);
    for (const alb_link_run *run = block->runs; run < block->runs + block->run_count; alb_run_pass(&at), run++) {
        alb_run_take(&at, run, kernels);
        const uint8_t *code = at.codes;
        uint32_t source = at.first;
        for (size_t k = 0; k < at.count; k++) {
            source += at.deltas[k];
            code += alb_link_bend_bytes(at.kind);
            const extent from = at.kind <= ALB_LINK_NEAR_NODE ? extents[source] : extent_of_leaf(forest, source);
            for (int share = 0; share < alb_link_codes(at.kind); share++)
                for (uint32_t r = 0; r < ALB_BLOCK; r++, code++)
                    if (*code != ALB_NO_LINK)
                        add_source(&rows[r], at.values[*code][channel] * from.area_mm2 * alb_link_share(at.kind, share),
                                   &from, forest->patches);
        }
    }
    for (const alb_exact_pair *pair = block->pairs; pair < block->pairs + block->pair_count; pair++) {
        const extent from = extent_of_leaf(forest, pair->leaf);
        add_source(&rows[pair->row], pair->weights[channel] * from.area_mm2, &from, forest->patches);
    }
}

bool alb_links_sample(uint32_t *sources, const uint32_t *first, int channel, const alb_links *links,
                      const alb_forest *forest, const alb_scatter_kernel *kernels, const double (*totals)[3],
                      const double (*local)[3], size_t patch_count, alb_error *error)
{
    extent *extents = alb_allocate(forest->leaf_count, sizeof *extents, error);
    if (!extents)
        return false;
    for (const alb_tree *tree = forest->trees; tree < forest->trees + forest->tree_count; tree++)
        find_extents(extents, forest, tree->first_cluster - tree->first_leaf, tree->first_leaf, tree->leaf_count);
    for (uint32_t p = 0; p < patch_count; p++) // what no link reaches comes from the patch itself
        for (uint32_t k = first[p]; k < first[p + 1]; k++)
            sources[k] = p;
#pragma omp parallel for schedule(dynamic, 16)
    for (size_t b = 0; b < links->block_count; b++) {
        const alb_link_block *block = &links->blocks[b];
        row rows[ALB_BLOCK] = {{0}};
        for (uint32_t r = 0; r < block->row_count; r++) {
            const uint32_t patch = forest->patches[block->first_leaf + r];
            rows[r] = begin_row(sources, first, patch, totals[patch][channel], local[patch][channel]);
        }
        add_links(rows, channel, block, forest, kernels, extents);
    }
    free(extents);
    return true;
}
