// One block's links in runs by kernel, octave and kind, sources as steps of 16 bits; a wider gap is crossed by links of
// weight zero.
#include "render/scatter_block.h"
#include <stdlib.h>
#include <string.h>

void *alb_grow(bool *failed, void *items, size_t *capacity, size_t count, size_t more, size_t size)
{
    if (*failed || count + more <= *capacity)
        return items;
    const size_t wanted = 2 * count + more + 256;
    void *larger = realloc(items, wanted * size);
    *failed = !larger;
    if (larger)
        *capacity = wanted;
    return larger ? larger : items;
}

void alb_found_links_free(alb_found_links *found)
{
    free(found->links);
    free(found->order);
    free(found->codes);
    free(found->pairs);
    *found = (alb_found_links){0};
}

// The order of the links by bucket, and in each as found: by source.
static void sort_links(alb_found_links *work, uint32_t starts[ALB_BUCKETS + 1])
{
    uint32_t at[ALB_BUCKETS];
    memset(starts, 0, (ALB_BUCKETS + 1) * sizeof *starts);
    for (size_t k = 0; k < work->count; k++)
        starts[work->links[k].bucket + 1]++;
    for (int bucket = 0; bucket < ALB_BUCKETS; bucket++) {
        at[bucket] = starts[bucket];
        starts[bucket + 1] += starts[bucket];
    }
    for (size_t k = 0; k < work->count; k++)
        work->order[at[work->links[k].bucket]++] = (uint32_t)k;
}

// Steps of at most 65,535 between the sources of a bucket: how many, counting those that only fill a gap.
static size_t steps_of(const alb_found_links *work, uint32_t from, uint32_t to)
{
    size_t steps = to - from;
    for (uint32_t k = from + 1; k < to; k++)
        steps += (work->links[work->order[k]].source - work->links[work->order[k - 1]].source) / (UINT16_MAX + 1U);
    return steps;
}

static bool allocate_block(alb_link_block *block, const alb_found_links *work, const uint32_t starts[ALB_BUCKETS + 1])
{
    size_t steps = 0, codes = 0, nodes = 0;
    for (int bucket = 0; bucket < ALB_BUCKETS; bucket++)
        if (starts[bucket + 1] > starts[bucket]) {
            const size_t more = steps_of(work, starts[bucket], starts[bucket + 1]);
            block->run_count++;
            steps += more;
            codes += more * alb_link_code_bytes(bucket % ALB_LINK_KINDS);
            nodes += bucket % ALB_LINK_KINDS <= ALB_LINK_NEAR_NODE ? more : 0;
        }
    block->pair_count = (uint32_t)work->pair_count;
    block->bytes = block->pair_count * sizeof *block->pairs + block->run_count * sizeof *block->runs +
                   steps * sizeof *block->deltas + codes + nodes * sizeof *block->directions;
    if (!(block->pairs = malloc(block->bytes + 1)))
        return false;
    if (work->pair_count)
        memcpy(block->pairs, work->pairs, work->pair_count * sizeof *work->pairs);
    block->link_count = work->pair_count;
    block->runs = (alb_link_run *)(block->pairs + block->pair_count);
    block->deltas = (uint16_t *)(block->runs + block->run_count);
    block->codes = (uint8_t *)(block->deltas + steps);
    block->directions = (int8_t(*)[4])(block->codes + codes);
    return true;
}

// Where a run is written, or read.
typedef struct cursor {
    uint16_t *deltas;
    uint8_t *codes;
    int8_t (*directions)[4];
} cursor;

static void write_step(cursor *at, uint32_t delta, const alb_found_link *next, const uint8_t *codes, int kind)
{
    const size_t size = alb_link_code_bytes(kind);
    *at->deltas++ = (uint16_t)delta;
    if (next)
        memcpy(at->codes, codes, size);
    else
        memset(at->codes, ALB_NO_LINK, size);
    at->codes += size;
    if (kind <= ALB_LINK_NEAR_NODE)
        memcpy(at->directions++, next ? next->direction : (const int8_t[4]){0}, sizeof *at->directions);
}

static void write_run(alb_link_run *run, cursor *at, const alb_found_links *work, uint32_t from, uint32_t to)
{
    run->first = work->links[work->order[from]].source;
    uint32_t source = run->first;
    for (uint32_t k = from; k < to; k++) {
        const alb_found_link *next = &work->links[work->order[k]];
        for (; next->source - source > UINT16_MAX; source += UINT16_MAX)
            write_step(at, UINT16_MAX, NULL, NULL, run->kind);
        write_step(at, next->source - source, next, work->codes + next->codes, run->kind);
        source = next->source;
    }
}

void alb_link_block_write(alb_link_block *block, alb_found_links *work, const uint16_t kernels[ALB_SIDES])
{
    uint32_t starts[ALB_BUCKETS + 1];
    work->order = alb_grow(&work->failed, work->order, &work->order_capacity, 0, work->count, sizeof *work->order);
    if (work->failed)
        return;
    sort_links(work, starts);
    work->failed = !allocate_block(block, work, starts);
    if (work->failed)
        return;
    cursor at = {block->deltas, block->codes, block->directions};
    alb_link_run *run = block->runs;
    for (int bucket = 0; bucket < ALB_BUCKETS; bucket++) {
        const uint32_t from = starts[bucket], to = starts[bucket + 1];
        if (from == to)
            continue;
        *run = (alb_link_run){.count = (uint32_t)steps_of(work, from, to),
                              .kernel = kernels[bucket / (ALB_OCTAVES * ALB_LINK_KINDS)],
                              .octave = (uint8_t)(bucket / ALB_LINK_KINDS % ALB_OCTAVES),
                              .kind = (uint8_t)(bucket % ALB_LINK_KINDS)};
        write_run(run++, &at, work, from, to);
    }
    block->link_count += work->count * block->row_count;
}
