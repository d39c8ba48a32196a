// Packing of hit lists: the hits of 256 rows are sorted, cut at the blocks' ends and written block after block, in
// memory or to a file that is mapped. Products with them: render/form_factor_product.c.
#include "render/form_factor_rows.h"
#include "base/memory.h"
#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

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
            starts[r + 1] =
                starts[r] + (r < alb_hit_rows_in_chunk(rows, chunk) ? lengths[chunk * ALB_CHUNK_ROWS + r] : 0);
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

// The row's even and odd hits, each ascending, in place; `scratch` has room for a row.
static void sort_row(uint32_t *row, size_t length, uint32_t *scratch)
{
    uint32_t *const odd = scratch + alb_hit_rows_half(length, 0);
    for (size_t q = 0; q < length; q++)
        (q & 1 ? odd : scratch)[q / 2] = row[q];
    sort(row, scratch, alb_hit_rows_half(length, 0), 3);
    sort(row + alb_hit_rows_half(length, 0), odd, alb_hit_rows_half(length, 1), 3);
}

void alb_hit_rows_fill(alb_hit_rows *rows, size_t chunk, uint32_t *hits, uint32_t *scratch)
{
    const size_t begin = rows->first[chunk], base = chunk * ALB_CHUNK_ROWS, n = alb_hit_rows_in_chunk(rows, chunk);
    const uint32_t *places[ALB_CHUNK_ROWS][2], *ends[ALB_CHUNK_ROWS][2];
    for (size_t r = 0; r < n; r++) {
        uint32_t *row = hits + rows->starts[chunk * (ALB_CHUNK_ROWS + 1) + r];
        const size_t length = alb_hit_rows_length(rows, base + r);
        sort_row(row, length, scratch);
        places[r][0] = row;
        places[r][1] = ends[r][0] = row + alb_hit_rows_half(length, 0);
        ends[r][1] = row + length;
    }
    uint16_t *out = rows->hits + begin;
    for (size_t block = 0; block < rows->blocks; block++) {
        const uint32_t from = (uint32_t)(block * rows->block_size);
        uint16_t(*counts)[2] = alb_hit_rows_counts(rows, chunk, block);
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

size_t alb_hit_rows_counted(const alb_hit_rows *rows, size_t row, int half)
{
    size_t left = alb_hit_rows_half(alb_hit_rows_length(rows, row), half);
    for (size_t block = 0; block < rows->blocks; block++)
        left -= alb_hit_rows_counts(rows, row / ALB_CHUNK_ROWS, block)[row % ALB_CHUNK_ROWS][half];
    return left;
}

void alb_hit_rows_read(uint32_t *hits, const alb_hit_rows *rows, size_t row)
{
    const size_t chunk = row / ALB_CHUNK_ROWS, within = row % ALB_CHUNK_ROWS;
    uint32_t *out[2] = {hits, hits + alb_hit_rows_half(alb_hit_rows_length(rows, row), 0)};
    size_t left[2] = {alb_hit_rows_counted(rows, row, 0), alb_hit_rows_counted(rows, row, 1)};
    for (size_t block = 0; block < rows->blocks; block++) {
        const uint16_t(*counts)[2] = (const uint16_t(*)[2])alb_hit_rows_counts(rows, chunk, block);
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
