// How a block's runs of links are read: by the products, by what samples them and by what lays them down as weights.
//     alb_run_reader at = alb_run_begin(block, forest);
//     for (run = block->runs; run < block->runs + block->run_count; alb_run_pass(&at), run++) {
//         alb_run_take(&at, run, kernels);
//         ...                           source k: at.first + at.deltas[0] + ... + at.deltas[k]
//     }
#pragma once
#include "render/scatter_links.h"
#include <string.h>

typedef float alb_float4 __attribute__((vector_size(16)));

static inline alb_float4 alb_load4(const float values[4])
{
    alb_float4 all;
    memcpy(&all, values, sizeof all);
    return all;
}

// One run: everything borrowed, from the block, the forest and the kernel.
typedef struct alb_run_reader {
    const float (*values)[4], (*bends)[8]; // of the run's kernel and octave, by code
    const alb_forest *forest;
    const uint16_t *deltas;        // [link]
    const uint8_t *codes;          // alb_link_code_bytes of each link
    const int8_t (*directions)[4]; // [link], of nodes alone
    uint32_t first;
    size_t count;
    int kind; // alb_link_kind
} alb_run_reader;

static inline alb_run_reader alb_run_begin(const alb_link_block *block, const alb_forest *forest)
{
    return (alb_run_reader){.forest = forest,
                            .deltas = block->deltas,
                            .codes = block->codes,
                            .directions = (const int8_t(*)[4])block->directions};
}

// Points the reader, which stands where the run begins, at it.
static inline void alb_run_take(alb_run_reader *at, const alb_link_run *run, const alb_scatter_kernel *kernels)
{
    const alb_scatter_kernel *kernel = &kernels[run->kernel];
    const size_t octave = (size_t)(run->octave - kernel->first_used) * ALB_CODES;
    at->values = (const float(*)[4])kernel->values + octave;
    at->bends = (const float(*)[8])kernel->bends + octave;
    at->first = run->first;
    at->count = run->count;
    at->kind = run->kind;
}

// On to where the next run begins.
static inline void alb_run_pass(alb_run_reader *at)
{
    at->deltas += at->count;
    at->codes += at->count * alb_link_code_bytes(at->kind);
    at->directions += at->kind <= ALB_LINK_NEAR_NODE ? at->count : 0;
}

// What the extent of a node adds to its light, relative to it, RGB: v s''/2s, and the fourth order of an exponential,
// (s''/s)^2 m_4 / 24 with m_4 = 12/5 v^2, that of a triangle. bend: the kernel's at the distance; spread: the node's
// variance v along the line of sight, mm^2.
static inline __attribute__((always_inline)) alb_float4 alb_by_extent(const float bend[8], float spread)
{
    const alb_float4 second = alb_load4(bend + 4) * spread;
    return second + 0.4F * second * second;
}
