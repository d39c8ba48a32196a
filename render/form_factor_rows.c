// Packing of hit lists, and their product with values per index:
//     out_p = 1/R_p sum over the hits h of row p of value_h
// The product walks block by block through all chunks, so that the values of a block (at most 1 MiB) stay in a core's
// cache; where the hits lie in a file it walks chunk by chunk, as the file does, and asks for the next chunk ahead. A
// row adds its blocks in the same order either way: the same bytes. Up to 256 values are summed in single precision (in
// four lanes, so 64 additions deep: 1e-7), these sums in double.
// Stops being fast where the hits of a row are few a block (more than ~2 million patches with 256 rays).
#include "render/form_factor_rows.h"
#include "base/memory.h"
#include "base/vector_clones.h"
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

enum { PIECE = 256 };

typedef float float4 __attribute__((vector_size(16), may_alias));

static size_t rows_of(const alb_hit_rows *rows, size_t chunk)
{
    const size_t left = rows->count - chunk * ALB_CHUNK_ROWS;
    return left < ALB_CHUNK_ROWS ? left : ALB_CHUNK_ROWS;
}

static uint16_t (*counts_of(const alb_hit_rows *rows, size_t chunk, size_t block))[2]
{
    return (uint16_t(*)[2])(rows->counts + 2 * ALB_CHUNK_ROWS * (chunk * rows->blocks + block));
}

// --- memory ----------------------------------------------------------------------------------------------------------
static bool map_file(alb_hit_rows *rows, size_t bytes, alb_error *error)
{
    const char *folder = getenv("TMPDIR");
    char path[4096];
    if (!folder || !*folder)
        folder = "/var/tmp";
    const int length = snprintf(path, sizeof path, "%s/alabaster-XXXXXX", folder);
    const int file = length < (int)sizeof path ? mkstemp(path) : -1;
    if (file < 0)
        return alb_fail(error, ALB_ACCESS, "%s: no temporary file for form factors there; set TMPDIR", folder);
    unlink(path);
    int code = posix_fallocate(file, 0, (off_t)bytes);
    void *mapped = code ? MAP_FAILED : mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (!code && mapped == MAP_FAILED)
        code = errno;
    close(file);
    if (code)
        return alb_fail(error, ALB_ACCESS,
                        "%s: no room for %.1f GiB of form factors (%s); set TMPDIR, or use fewer rays_per_patch",
                        folder, (double)bytes / 0x1p30, strerror(code));
    rows->hits = mapped;
    rows->mapped_bytes = bytes;
    return true;
}

bool alb_hit_rows_create(alb_hit_rows *rows, const uint32_t *lengths, size_t count, size_t index_count,
                         uint32_t counted, size_t memory_bytes, alb_error *error)
{
    *rows = (alb_hit_rows){.count = count,
                           .counted = counted,
                           .chunks = (count + ALB_CHUNK_ROWS - 1) / ALB_CHUNK_ROWS,
                           .blocks = (index_count + ALB_BLOCK_MAX - 1) / ALB_BLOCK_MAX};
    rows->block_size = (index_count + rows->blocks - 1) / rows->blocks;
    const size_t parts = rows->chunks * rows->blocks;
    bool ok = (rows->starts = alb_allocate(rows->chunks, (ALB_CHUNK_ROWS + 1) * sizeof *rows->starts, error)) &&
              (rows->first = alb_allocate(rows->chunks + 1, sizeof *rows->first, error)) &&
              (rows->segments = alb_allocate(parts + 1, sizeof *rows->segments, error)) &&
              (rows->counts = alb_allocate(parts, 2 * ALB_CHUNK_ROWS * sizeof *rows->counts, error));
    for (size_t chunk = 0; ok && chunk < rows->chunks; chunk++) {
        uint32_t *starts = rows->starts + chunk * (ALB_CHUNK_ROWS + 1);
        for (size_t r = 0; r < ALB_CHUNK_ROWS; r++)
            starts[r + 1] = starts[r] + (r < rows_of(rows, chunk) ? lengths[chunk * ALB_CHUNK_ROWS + r] : 0);
        rows->first[chunk + 1] = rows->first[chunk] + starts[ALB_CHUNK_ROWS];
    }
    if (ok) {
        const size_t hits = rows->segments[parts] = alb_hit_rows_rays(rows);
        ok = memory_bytes && hits > memory_bytes / sizeof *rows->hits
                 ? map_file(rows, hits * sizeof *rows->hits, error)
                 : (rows->hits = alb_allocate(hits, sizeof *rows->hits, error)) != NULL;
    }
    if (!ok)
        alb_hit_rows_free(rows);
    return ok;
}

void alb_hit_rows_free(alb_hit_rows *rows)
{
    if (rows->mapped_bytes)
        munmap(rows->hits, rows->mapped_bytes);
    else
        free(rows->hits);
    free(rows->starts);
    free(rows->first);
    free(rows->segments);
    free(rows->counts);
    *rows = (alb_hit_rows){0};
}

size_t alb_hit_rows_bytes(const alb_hit_rows *rows)
{
    const size_t parts = rows->chunks * rows->blocks;
    return rows->chunks * (ALB_CHUNK_ROWS + 1) * sizeof *rows->starts + (rows->chunks + 1) * sizeof *rows->first +
           (parts + 1) * sizeof *rows->segments + parts * 2 * ALB_CHUNK_ROWS * sizeof *rows->counts +
           rows->segments[parts] * sizeof *rows->hits;
}

size_t alb_hit_rows_largest_chunk(const alb_hit_rows *rows)
{
    size_t largest = 0;
    for (size_t chunk = 0; chunk < rows->chunks; chunk++) {
        const size_t hits = rows->first[chunk + 1] - rows->first[chunk];
        largest = hits > largest ? hits : largest;
    }
    return largest;
}

// --- packing ---------------------------------------------------------------------------------------------------------
// Least significant byte first: from -> to and back; the result ends in `to` after an odd number of passes.
static void sort(uint32_t *to, uint32_t *from, size_t count, int passes)
{
    for (int pass = 0; pass < passes; pass++) {
        uint32_t places[256] = {0}, at = 0;
        for (size_t i = 0; i < count; i++)
            places[from[i] >> 8 * pass & 255]++;
        for (int k = 0; k < 256; k++) {
            const uint32_t here = places[k];
            places[k] = at;
            at += here;
        }
        for (size_t i = 0; i < count; i++)
            to[places[from[i] >> 8 * pass & 255]++] = from[i];
        uint32_t *const swapped = from;
        from = to;
        to = swapped;
    }
}

static size_t half_of(size_t length, int half) { return (length + 1 - (size_t)half) / 2; }

// The row's even and odd hits, each ascending, in place; `scratch` has room for a row.
static void sort_row(uint32_t *row, size_t length, uint32_t *scratch)
{
    uint32_t *const odd = scratch + half_of(length, 0);
    for (size_t q = 0; q < length; q++)
        (q & 1 ? odd : scratch)[q / 2] = row[q];
    sort(row, scratch, half_of(length, 0), 3);
    sort(row + half_of(length, 0), odd, half_of(length, 1), 3);
}

void alb_hit_rows_fill(alb_hit_rows *rows, size_t chunk, uint32_t *hits, uint32_t *scratch)
{
    const size_t begin = rows->first[chunk], base = chunk * ALB_CHUNK_ROWS, n = rows_of(rows, chunk);
    const uint32_t *places[ALB_CHUNK_ROWS][2], *ends[ALB_CHUNK_ROWS][2];
    for (size_t r = 0; r < n; r++) {
        uint32_t *row = hits + rows->starts[chunk * (ALB_CHUNK_ROWS + 1) + r];
        const size_t length = alb_hit_rows_length(rows, base + r);
        sort_row(row, length, scratch);
        places[r][0] = row;
        places[r][1] = ends[r][0] = row + half_of(length, 0);
        ends[r][1] = row + length;
    }
    uint16_t *out = rows->hits + begin;
    for (size_t block = 0; block < rows->blocks; block++) {
        const uint32_t from = (uint32_t)(block * rows->block_size);
        uint16_t(*counts)[2] = counts_of(rows, chunk, block);
        rows->segments[chunk * rows->blocks + block] = (size_t)(out - rows->hits);
        for (size_t r = 0; r < n; r++)
            for (int half = 0; half < 2; half++) {
                const uint32_t *at = places[r][half];
                const uint16_t *const kept = out;
                for (; at < ends[r][half] && *at < from + rows->block_size; at++)
                    if (*at != rows->counted)
                        *out++ = (uint16_t)(*at - from);
                counts[r][half] = (uint16_t)(out - kept);
                places[r][half] = at;
            }
    }
}

static size_t kept_in(const alb_hit_rows *rows, size_t chunk)
{
    size_t kept = 0;
    const uint16_t *counts = rows->counts + 2 * ALB_CHUNK_ROWS * rows->blocks * chunk;
    for (size_t i = 0; i < 2 * ALB_CHUNK_ROWS * rows->blocks; i++)
        kept += counts[i];
    return kept;
}

void alb_hit_rows_trim(alb_hit_rows *rows)
{
    size_t kept = 0;
    if (rows->mapped_bytes || rows->counted == UINT32_MAX)
        return;
    for (size_t chunk = 0; chunk < rows->chunks; chunk++) {
        size_t *segments = rows->segments + chunk * rows->blocks;
        const size_t count = kept_in(rows, chunk), from = segments[0];
        memmove(rows->hits + kept, rows->hits + from, count * sizeof *rows->hits);
        for (size_t block = 0; block < rows->blocks; block++)
            segments[block] -= from - kept;
        kept += count;
    }
    uint16_t *smaller = realloc(rows->hits, (kept ? kept : 1) * sizeof *rows->hits);
    if (smaller) {
        rows->hits = smaller;
        rows->segments[rows->chunks * rows->blocks] = kept;
    }
}

// Hits of the row's half that are counted alone.
static size_t missing(const alb_hit_rows *rows, size_t row, int half)
{
    size_t left = half_of(alb_hit_rows_length(rows, row), half);
    for (size_t block = 0; block < rows->blocks; block++)
        left -= counts_of(rows, row / ALB_CHUNK_ROWS, block)[row % ALB_CHUNK_ROWS][half];
    return left;
}

void alb_hit_rows_read(uint32_t *hits, const alb_hit_rows *rows, size_t row)
{
    const size_t chunk = row / ALB_CHUNK_ROWS, within = row % ALB_CHUNK_ROWS;
    uint32_t *out[2] = {hits, hits + half_of(alb_hit_rows_length(rows, row), 0)};
    size_t left[2] = {missing(rows, row, 0), missing(rows, row, 1)};
    for (size_t block = 0; block < rows->blocks; block++) {
        const uint16_t(*counts)[2] = (const uint16_t(*)[2])counts_of(rows, chunk, block);
        const uint16_t *at = rows->hits + rows->segments[chunk * rows->blocks + block];
        for (size_t r = 0; r < within; r++)
            at += (size_t)counts[r][0] + counts[r][1];
        for (int half = 0; half < 2; half++)
            for (unsigned k = 0; k < counts[within][half]; k++) {
                const uint32_t hit = (uint32_t)(block * rows->block_size + *at++);
                for (; left[half] && rows->counted < hit; left[half]--)
                    *out[half]++ = rows->counted;
                *out[half]++ = hit;
            }
    }
    for (int half = 0; half < 2; half++)
        for (; left[half]; left[half]--)
            *out[half]++ = rows->counted;
}

// --- products --------------------------------------------------------------------------------------------------------
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
    const uint16_t(*counts)[2] = (const uint16_t(*)[2])counts_of(rows, chunk, block);
    const uint16_t *hits = rows->hits + rows->segments[chunk * rows->blocks + block];
    const float4 *values = p->values + block * rows->block_size;
    double(*out)[3] = p->out + chunk * ALB_CHUNK_ROWS;
    const size_t n = rows_of(rows, chunk);
    for (size_t r = 0; r < n; r++) {
        const size_t count = (size_t)counts[r][0] + counts[r][1];
        add_hits(out[r], hits, count, values);
        hits += count;
    }
}

static void gather_difference(const product *p, size_t chunk, size_t block)
{
    const alb_hit_rows *rows = p->rows;
    const uint16_t(*counts)[2] = (const uint16_t(*)[2])counts_of(rows, chunk, block);
    const uint16_t *hits = rows->hits + rows->segments[chunk * rows->blocks + block];
    const size_t n = rows_of(rows, chunk), first = chunk * ALB_CHUNK_ROWS;
    for (size_t r = 0; r < n; r++)
        for (int half = 0; half < 2; half++) {
            double sum[3] = {0};
            const double weight = (half ? -1.0 : 1.0) / (double)half_of(alb_hit_rows_length(rows, first + r), half);
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
    const size_t begin = chunk * ALB_CHUNK_ROWS, end = begin + rows_of(rows, chunk);
    memset(p->out + begin, 0, (end - begin) * sizeof *p->out);
    if (rows->counted == UINT32_MAX)
        return;
    const float4 value = p->values[rows->counted];
    for (size_t r = begin; r < end && (value[0] != 0 || value[1] != 0 || value[2] != 0); r++)
        for (int half = 0; half < 2; half++) {
            const double length = (double)half_of(alb_hit_rows_length(rows, r), half),
                         weight = !p->difference ? 1 : (half ? -0.5 : 0.5) / fmax(length, 1);
            for (int c = 0; c < 3; c++)
                p->out[r][c] += weight * (double)missing(rows, r, half) * (double)value[c];
        }
}

static void finish_rows(const product *p, size_t chunk)
{
    for (size_t r = chunk * ALB_CHUNK_ROWS, end = r + rows_of(p->rows, chunk); !p->difference && r < end; r++)
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
