// Products of packed hit lists with values per index, and F radiosity from them:
//     out_p = 1/R_p sum over the hits h of row p of value_h
// They walk block by block through all chunks, so that the values of a block (at most 1 MiB) stay in a core's
// cache; where the hits lie in a file, chunk by chunk, as the file does, and ask for the next chunk ahead. A
// row adds its blocks in the same order either way: the same bytes. Up to 256 values are summed in single precision (in
// four lanes, so 64 additions deep: 1e-7), these sums in double.
// Stops being fast where the hits of a row are few a block (more than ~2 million patches with 256 rays).
#include "base/vector_clones.h"
#include "render/form_factor.h"
#include <math.h>
#include <stdbool.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

enum { PIECE = 256 };

typedef float float4 __attribute__((vector_size(16), may_alias));

static inline void add_piece(double sum[3], const uint16_t *hits, size_t count, const float4 *values)
{
    float4 lanes[4] = {{0}};
    const uint16_t *const end = hits + count, *const fours = hits + count / 4 * 4;
    for (; hits < fours; hits += 4)
        for (int i = 0; i < 4; i++)
            lanes[i] += values[hits[i]];
    for (; hits < end; hits++)
        lanes[0] += values[*hits];
    const float4 piece = (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]);
    for (int c = 0; c < 3; c++)
        sum[c] += (double)piece[c];
}

static inline void add_hits(double sum[3], const uint16_t *hits, size_t count, const float4 *values)
{
    for (; count > PIECE; hits += PIECE, count -= PIECE)
        add_piece(sum, hits, PIECE, values);
    add_piece(sum, hits, count, values);
}

typedef struct product {
    double (*out)[3];
    const alb_hit_rows *rows;
    const float4 *values;
    bool difference;
} product;

ALB_VECTOR_CLONES static void gather(const product *p, size_t chunk, size_t block)
{
    const alb_hit_rows *rows = p->rows;
    const uint16_t(*counts)[2] = (const uint16_t(*)[2])alb_hit_rows_counts(rows, chunk, block);
    const uint16_t *hits = rows->hits + rows->segments[chunk * rows->blocks + block];
    const float4 *values = p->values + block * rows->block_size;
    double(*out)[3] = p->out + chunk * ALB_CHUNK_ROWS;
    const size_t n = alb_hit_rows_in_chunk(rows, chunk);
    for (size_t r = 0; r < n; r++) {
        const size_t count = (size_t)counts[r][0] + counts[r][1];
        add_hits(out[r], hits, count, values);
        hits += count;
    }
}

static void gather_difference(const product *p, size_t chunk, size_t block)
{
    const alb_hit_rows *rows = p->rows;
    const uint16_t(*counts)[2] = (const uint16_t(*)[2])alb_hit_rows_counts(rows, chunk, block);
    const uint16_t *hits = rows->hits + rows->segments[chunk * rows->blocks + block];
    const size_t n = alb_hit_rows_in_chunk(rows, chunk), first = chunk * ALB_CHUNK_ROWS;
    for (size_t r = 0; r < n; r++)
        for (int half = 0; half < 2; half++) {
            double sum[3] = {0};
            const double weight =
                (half ? -1.0 : 1.0) / (double)alb_hit_rows_half(alb_hit_rows_length(rows, first + r), half);
            add_hits(sum, hits, counts[r][half], p->values + block * rows->block_size);
            hits += counts[r][half];
            for (int c = 0; c < 3; c++)
                p->out[first + r][c] += 0.5 * weight * sum[c];
        }
}

static void gather_part(const product *p, size_t chunk, size_t block)
{
    if (p->difference)
        gather_difference(p, chunk, block);
    else
        gather(p, chunk, block);
}

// What comes from the index whose hits are counted: nothing, mostly.
static void start_rows(const product *p, size_t chunk)
{
    const alb_hit_rows *rows = p->rows;
    const size_t begin = chunk * ALB_CHUNK_ROWS, end = begin + alb_hit_rows_in_chunk(rows, chunk);
    memset(p->out + begin, 0, (end - begin) * sizeof *p->out);
    if (rows->counted == UINT32_MAX)
        return;
    const float4 value = p->values[rows->counted];
    for (size_t r = begin; r < end && (value[0] != 0 || value[1] != 0 || value[2] != 0); r++)
        for (int half = 0; half < 2; half++) {
            const double length = (double)alb_hit_rows_half(alb_hit_rows_length(rows, r), half),
                         weight = !p->difference ? 1 : (half ? -0.5 : 0.5) / fmax(length, 1);
            for (int c = 0; c < 3; c++)
                p->out[r][c] += weight * (double)alb_hit_rows_counted(rows, r, half) * (double)value[c];
        }
}

static void finish_rows(const product *p, size_t chunk)
{
    for (size_t r = chunk * ALB_CHUNK_ROWS, end = r + alb_hit_rows_in_chunk(p->rows, chunk); !p->difference && r < end;
         r++)
        for (int c = 0; c < 3; c++)
            p->out[r][c] /= (double)alb_hit_rows_length(p->rows, r);
}

static void ask_ahead(const alb_hit_rows *rows, size_t chunk)
{
    if (chunk >= rows->chunks)
        return;
    const uintptr_t page = (uintptr_t)sysconf(_SC_PAGESIZE), begin = (uintptr_t)(rows->hits + rows->first[chunk]);
    const uintptr_t end = (uintptr_t)(rows->hits + rows->first[chunk + 1]), from = begin / page * page;
    madvise((void *)from, end - from, MADV_WILLNEED);
}

static void run(const product *p)
{
    const size_t chunks = p->rows->chunks, blocks = p->rows->blocks;
    if (p->rows->mapped_bytes) {
#pragma omp parallel for schedule(static)
        for (size_t chunk = 0; chunk < chunks; chunk++) {
            ask_ahead(p->rows, chunk + 1);
            start_rows(p, chunk);
            for (size_t block = 0; block < blocks; block++)
                gather_part(p, chunk, block);
            finish_rows(p, chunk);
        }
        return;
    }
#pragma omp parallel
    {
        // the same static shares each time: a thread finishes what it began
#pragma omp for schedule(static) nowait
        for (size_t chunk = 0; chunk < chunks; chunk++)
            start_rows(p, chunk);
        for (size_t block = 0; block < blocks; block++) {
#pragma omp for schedule(static) nowait
            for (size_t chunk = 0; chunk < chunks; chunk++)
                gather_part(p, chunk, block);
        }
#pragma omp for schedule(static) nowait
        for (size_t chunk = 0; chunk < chunks; chunk++)
            finish_rows(p, chunk);
    }
}

void alb_hit_rows_gather(double (*out)[3], const alb_hit_rows *rows, const float (*values)[4])
{
    run(&(product){out, rows, (const float4 *)values, false});
}

void alb_hit_rows_gather_difference(double (*out)[3], const alb_hit_rows *rows, const float (*values)[4])
{
    run(&(product){out, rows, (const float4 *)values, true});
}

// --- products of F ---------------------------------------------------------------------------------------------------
static void take_values(const alb_form_factors *factors, const double (*radiosity)[3], const double sky[3])
{
    const size_t n = factors->patch_count;
#pragma omp parallel for schedule(static)
    for (size_t p = 0; p < n; p++)
        for (int c = 0; c < 3; c++)
            factors->gathered[p][c] = (float)radiosity[p][c];
    for (int c = 0; c < 3; c++)
        factors->gathered[n][c] = sky ? (float)sky[c] : 0;
}

void alb_form_factors_share(double (*values)[3], const alb_form_factors *factors)
{
    alb_row_shares_apply(values, factors->gathered, &factors->shares);
}

void alb_form_factors_apply_rows(double (*out)[3], const alb_form_factors *factors, const double (*radiosity)[3])
{
    take_values(factors, radiosity, NULL);
    alb_hit_rows_gather(out, &factors->rows, (const float(*)[4])factors->gathered);
}

void alb_form_factors_apply(double (*out)[3], const alb_form_factors *factors, const double (*radiosity)[3])
{
    alb_form_factors_apply_rows(out, factors, radiosity);
    alb_form_factors_share(out, factors);
}

void alb_form_factors_half_difference(double (*out)[3], const alb_form_factors *factors, const double (*radiosity)[3],
                                      const double sky[3])
{
    take_values(factors, radiosity, sky);
    alb_hit_rows_gather_difference(out, &factors->rows, (const float(*)[4])factors->gathered);
    alb_form_factors_share(out, factors);
}
