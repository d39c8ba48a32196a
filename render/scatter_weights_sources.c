// Sources from links. A link from a cluster lights a row by
//     s(d) A [(1 + second order) E + (s'/s) u . moment of E]
// The moment is left out: where that could cost more than what is allowed, the cluster is split, each child with the
// weight that the slope gives it. Where two children light all rows nearly alike, their parent stands for both. With C
// a contribution and A an area, either costs a row, where light differs between the children by its mean,
//     |C_l A_r - C_r A_l| / (A_l + A_r)
// and that is kept below a tenth of the error wanted of the row's sum: some hundred sources, each off by less in its
// own direction, together stay within it.
#include "render/scatter_weights_sources.h"
#include "base/memory.h"
#include "render/scatter_block.h"
#include "render/scatter_run.h"
#include <math.h>
#include <stdlib.h>

alb_weight_source *alb_weight_sources_add(alb_weight_maker *m, alb_weight_sources *to)
{
    to->items = alb_grow(&m->failed, to->items, &to->capacity, to->count, 1, sizeof *to->items);
    return m->failed ? NULL : &to->items[to->count++];
}

// ---- Links as sources ----

// Link k of the run: codes of the rows, and before them the one that all rows share.
static void take_link(alb_weight_source *to, const alb_run_reader *run, size_t k, uint32_t at)
{
    const uint8_t *codes = run->codes + k * alb_link_code_bytes(run->kind);
    const float *bend = run->bends[*codes];
    const bool near = run->kind == ALB_LINK_NEAR_NODE || run->kind == ALB_LINK_NEAR_PATCH,
               node = run->kind <= ALB_LINK_NEAR_NODE;
    const float spread =
        node ? run->forest->nodes[at].light[3] * ((float)run->directions[k][3] / 64) : run->forest->lights[at][3];
    const alb_float4 none = {0}, even = run->kind > ALB_LINK_NEAR_PATCH ? none
                                        : node                          ? alb_by_extent(bend, spread)
                                                                        : alb_load4(bend + 4) * spread;
    codes += alb_link_bend_bytes(run->kind);
    for (int share = 0; share < alb_link_codes(run->kind); share++)
        for (int row = 0; row < ALB_BLOCK; row++, codes++)
            for (int c = 0; c < 3; c++) {
                const float second = near ? run->bends[*codes][4 + c] * spread : even[c];
                to->weights[c][row] +=
                    to->of.area_mm2 * run->values[*codes][c] * alb_link_share(run->kind, share) * (1 + second);
            }
    for (int c = 0; node && c < 3; c++)
        for (int axis = 0; axis < 3; axis++)
            to->slopes[c][axis] = bend[c] * (float)run->directions[k][axis] / INT8_MAX;
}

static void take_block(alb_weight_maker *m, const alb_link_block *block)
{
    alb_run_reader run = alb_run_begin(block, m->forest);
    m->found.count = m->kept.count = 0;
    for (uint32_t r = 0; r < block->run_count; alb_run_pass(&run), r++) {
        alb_run_take(&run, &block->runs[r], m->kernels);
        uint32_t at = run.first;
        for (size_t k = 0; k < run.count; k++) {
            at += run.deltas[k];
            alb_weight_source *to = alb_weight_sources_add(m, &m->found);
            if (!to)
                return;
            *to = alb_weight_source_of(m, run.kind <= ALB_LINK_NEAR_NODE ? m->of_nodes[at] : m->of_leaves[at]);
            take_link(to, &run, k, at);
        }
    }
    for (const alb_exact_pair *pair = block->pairs; pair < block->pairs + block->pair_count; pair++) {
        alb_weight_source *to = alb_weight_sources_add(m, &m->found);
        if (!to)
            return;
        *to = alb_weight_source_of(m, m->of_leaves[pair->leaf]);
        for (int c = 0; c < 3; c++)
            to->weights[c][pair->row] = pair->weights[c] * to->of.area_mm2;
    }
}

static int compare(const void *a, const void *b)
{
    const alb_weight_source *p = a, *q = b;
    return p->cluster < q->cluster ? -1 : p->cluster > q->cluster;
}

// Several links from one source become one.
static void sort_found(alb_weight_sources *found)
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

static float place(const alb_forest *forest, const alb_weight_source *of, int axis)
{
    return of->of.count > 1 ? forest->nodes[of->cluster - of->of.first_leaf].moments[axis][3]
                            : forest->centres_mm[of->of.first_leaf][axis];
}

static bool differ(const alb_weight_maker *m, const alb_weight_source *left, const alb_weight_source *right)
{
    const float whole = left->of.area_mm2 + right->of.area_mm2, left_share = left->of.area_mm2 / whole,
                right_share = right->of.area_mm2 / whole;
    for (int c = 0; c < 3; c++)
        for (int row = 0; row < ALB_BLOCK; row++)
            if (fabsf(left->weights[c][row] * right_share - right->weights[c][row] * left_share) > m->allowed[c][row])
                return true;
    return false;
}

static void keep(alb_weight_maker *m, const alb_weight_source *from)
{
    const alb_weight_source held = *from; // it may lie in what grows
    alb_weight_source *to = alb_weight_sources_add(m, &m->kept);
    if (to)
        *to = held;
}

// Keeps the cluster, or what it is made of.
static void split(alb_weight_maker *m, const alb_weight_source *from)
{
    if (from->of.count == 1) {
        keep(m, from);
        return;
    }
    const uint32_t right = from->cluster + 2 * alb_left_count(from->of.count);
    alb_weight_source parts[2] = {alb_weight_source_of(m, from->cluster + 1), alb_weight_source_of(m, right)};
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
static void settle(alb_weight_maker *m, uint32_t cluster, size_t from, size_t to)
{
    const alb_weight_source *items = m->found.items;
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
    alb_weight_source *parts = m->kept.items + before, parent = alb_weight_source_of(m, cluster);
    if (parts[0].cluster != cluster + 1 || parts[1].cluster != right || differ(m, &parts[0], &parts[1]))
        return;
    for (int c = 0; c < 3; c++)
        for (int row = 0; row < ALB_BLOCK; row++)
            parent.weights[c][row] = parts[0].weights[c][row] + parts[1].weights[c][row];
    parts[0] = parent;
    m->kept.count--;
}

void alb_weight_sources_find(alb_weight_maker *m, const alb_link_block *block)
{
    const alb_forest *forest = m->forest;
    take_block(m, block);
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
}
