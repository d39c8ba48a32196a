// Rows of hit indices, packed: what form factors by rays are kept as.
//
// A row's hits are its even rays and its odd ones apart, each half ascending. Indices are cut in
// even blocks of at most 65,536 and stored as the 16 bits within their block. Rows go in chunks of ALB_CHUNK_ROWS; a
// chunk holds for each block the hits of all its rows, so that a product can stay in one block's radiosity (1 MiB at
// most: a core's cache) over all rows. Hits of one index, the sky's in a scene that is open, are what is missing from a
// row's length: they are counted and not kept.
#pragma once
#include "base/error.h"
#include <stddef.h>
#include <stdint.h>

enum { ALB_CHUNK_ROWS = 256, ALB_BLOCK_MAX = 1 << 16 };

typedef struct alb_hit_rows {
    size_t count, chunks, blocks, block_size;
    uint32_t counted; // the index whose hits are not kept
    uint32_t *starts; // [chunk * (ALB_CHUNK_ROWS + 1) + row in chunk]: of a row's rays among those of its chunk
    size_t *first;    // [chunks + 1]: rays of the chunks before
    size_t *segments; // [chunk * blocks + block]: where in hits the block's part begins; at the end: room for hits
    uint16_t *counts; // [((chunk * blocks + block) * ALB_CHUNK_ROWS + row in chunk) * 2 + half]
    uint16_t *hits;
    size_t mapped_bytes; // of hits, where they lie in a file; 0: in memory
} alb_hit_rows;

// Rows of lengths[p] (1..65,536) hits to indices below index_count, to be filled chunk by chunk; counted: the index
// whose hits are not kept, UINT32_MAX for none. If hits may take more than memory_bytes (0: no limit) they go to an
// unlinked temporary file in TMPDIR or /var/tmp.
bool alb_hit_rows_create(alb_hit_rows *rows, const uint32_t *lengths, size_t count, size_t index_count,
                         uint32_t counted, size_t memory_bytes, alb_error *error);
void alb_hit_rows_free(alb_hit_rows *rows);
static inline size_t alb_hit_rows_length(const alb_hit_rows *rows, size_t row)
{
    const uint32_t *start = rows->starts + row / ALB_CHUNK_ROWS * (ALB_CHUNK_ROWS + 1) + row % ALB_CHUNK_ROWS;
    return start[1] - start[0];
}
// Of all rows.
static inline size_t alb_hit_rows_rays(const alb_hit_rows *rows) { return rows->first[rows->chunks]; }
size_t alb_hit_rows_bytes(const alb_hit_rows *rows);
// Hits of the largest chunk: room for the arguments of fill.
size_t alb_hit_rows_largest_chunk(const alb_hit_rows *rows);
// Fills a chunk from the hits of its rows one after the other, in ray order; they end up sorted. `scratch` has room for
// one row. Chunks may be filled by different threads.
void alb_hit_rows_fill(alb_hit_rows *rows, size_t chunk, uint32_t *hits, uint32_t *scratch);
// Gives back the room that the filled rows do not need.
void alb_hit_rows_trim(alb_hit_rows *rows);
// The hits of one row: even rays ascending, then odd rays ascending.
void alb_hit_rows_read(uint32_t *hits, const alb_hit_rows *rows, size_t row);
// out[row] = mean over the row's hits of values[hit]; difference: half the mean over its even rays minus half the mean
// over its odd ones. Four channels are gathered (16 bytes, aligned so), three come out.
void alb_hit_rows_gather(double (*out)[3], const alb_hit_rows *rows, const float (*values)[4]);
void alb_hit_rows_gather_difference(double (*out)[3], const alb_hit_rows *rows, const float (*values)[4]);

// --- what packing and products know of the layout --------------------------------------------------------------------
static inline size_t alb_hit_rows_in_chunk(const alb_hit_rows *rows, size_t chunk)
{
    const size_t left = rows->count - chunk * ALB_CHUNK_ROWS;
    return left < ALB_CHUNK_ROWS ? left : ALB_CHUNK_ROWS;
}
// Of each row of the chunk, hits of its even and of its odd rays within the block.
static inline uint16_t (*alb_hit_rows_counts(const alb_hit_rows *rows, size_t chunk, size_t block))[2]
{
    return (uint16_t(*)[2])(rows->counts + 2 * ALB_CHUNK_ROWS * (chunk * rows->blocks + block));
}
static inline size_t alb_hit_rows_half(size_t length, int half) { return (length + 1 - (size_t)half) / 2; }
// Hits of the row's half that are counted and not kept.
size_t alb_hit_rows_counted(const alb_hit_rows *rows, size_t row, int half);
