// F_kj, the share of the flux leaving k that arrives at j, by R cosine-weighted rays from every patch:
//     F_kj = (number of rays of k that hit j) / R
// (render/form_factor_cast.c: their pattern; render/form_factor_rows.c: how they are kept;
// render/form_factor_product.c: their product; render/form_factor_share.c: what neighbours have in common.) A row of F
// only ever integrates a bounded function over the hemisphere, which is why a few hundred equal weights do for any
// number of patches. The rows hold exactly (they sum to 1 with the sky); reciprocity A_k F_kj = A_j F_jk holds only
// statistically. Never symmetrised or normalised: that raises the error. Exact factors (form_factor_exact.h) for the
// pairs within three sizes, rays scaled to the rest of 1, change it by -8 to +5 % of itself (measured in empty rooms of
// 768 and 6,912 patches): not worth a weight a pair. Where it stops being true: sources that cover less than ~1/R of a
// hemisphere (a small bright lamp) are seen by few rays.
#include "render/form_factor.h"
#include "base/memory.h"
#include "base/progress.h"
#include "render/form_factor_cast.h"
#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

// Where the bits of a chunk begin, in words: chunks share none.
static size_t first_word(const alb_form_factors *factors, size_t chunk)
{
    return factors->rows.first[chunk] / 64 + chunk;
}

static uint64_t *sky_word(const alb_form_factors *factors, size_t patch, size_t q, uint64_t *bit)
{
    const size_t chunk = patch / ALB_CHUNK_ROWS;
    const size_t ray = factors->rows.starts[chunk * (ALB_CHUNK_ROWS + 1) + patch % ALB_CHUNK_ROWS] + q;
    *bit = 1ULL << ray % 64;
    return factors->sky_mask + first_word(factors, chunk) + ray / 64;
}

bool alb_form_factors_sees_sky(const alb_form_factors *factors, size_t patch, int q)
{
    uint64_t bit;
    return factors->sky_mask && (*sky_word(factors, patch, (size_t)q, &bit) & bit);
}

// Mean over the patch's rays of one over their length, from every fourth of them; INFINITY for one that sees a back,
// nor is known how far, or is buried.
static float nearness_per_mm(const alb_form_factors *factors, const uint32_t *hits, const alb_patches *patches,
                             size_t patch)
{
    const int rays = alb_form_factors_rays(factors, patch);
    double sum = 0;
    int count = 0;
    if (alb_patch_buried(patches, patch) || factors->back_shares[patch] > 0)
        return INFINITY;
    for (int q = 0; q < rays; q += 4, count++)
        if (hits[q] < factors->patch_count)
            sum += 1 / fmax(alb_length(alb_sub(patches->centroids[hits[q]], patches->centroids[patch])), 1e-300);
    return (float)(sum / count);
}

// Counts what a patch's rays meet beside patches.
static void note_row(alb_form_factors *factors, const uint32_t *hits, size_t patch)
{
    const size_t rays = (size_t)alb_form_factors_rays(factors, patch);
    size_t sky = 0, back = 0;
    uint64_t bit;
    for (size_t q = 0; q < rays; q++) {
        if (hits[q] == factors->patch_count) {
            uint64_t *word = sky_word(factors, patch, q, &bit);
            *word |= bit;
            sky++;
        }
        back += hits[q] == factors->patch_count + 1;
    }
    factors->sky_shares[patch] = (float)sky / (float)rays;
    factors->back_shares[patch] = (float)back / (float)rays;
    __atomic_add_fetch(&factors->sky_rays, sky, __ATOMIC_RELAXED); // counting is the same in any order
    __atomic_add_fetch(&factors->back_rays, back, __ATOMIC_RELAXED);
}

static bool allocate(alb_form_factors *factors, const uint32_t *lengths, alb_error *error)
{
    const size_t n = factors->patch_count;
    return alb_hit_rows_create(&factors->rows, lengths, n, n + 2, (uint32_t)n, factors->memory_bytes, error) &&
           (factors->sky_shares = alb_allocate(n, sizeof(float), error)) &&
           (factors->back_shares = alb_allocate(n, sizeof(float), error)) &&
           (factors->gathered = alb_allocate(n + 2, sizeof *factors->gathered, error)) &&
           (factors->sky_mask = alb_allocate(alb_hit_rows_rays(&factors->rows) / 64 + factors->rows.chunks + 1,
                                             sizeof *factors->sky_mask, error));
}

// What rays are cast from and into.
typedef struct source {
    const alb_patches *patches;
    const alb_tracer *tracer;
    float *nearness_per_mm; // of each patch, on return
} source;

static void take_row(uint32_t *row, alb_form_factors *factors, const source *from, size_t patch)
{
    const alb_ray_pattern pattern = {alb_form_factors_rays(factors, patch), factors->seed, factors->sampling,
                                     factors->phases};
    const size_t slipped = alb_rays_cast(row, &pattern, from->patches, from->tracer, patch);
    __atomic_add_fetch(&factors->reshot_rays, slipped, __ATOMIC_RELAXED); // counting is the same in any order
    note_row(factors, row, patch);
    from->nearness_per_mm[patch] = nearness_per_mm(factors, row, from->patches, patch);
}

// What no ray meets needs no shares.
static void drop_unseen(alb_form_factors *factors)
{
    if (!factors->sky_rays) {
        free(factors->sky_mask);
        free(factors->sky_shares);
        factors->sky_mask = NULL;
        factors->sky_shares = NULL;
    }
    if (!factors->back_rays) {
        free(factors->back_shares);
        factors->back_shares = NULL;
    }
}

static bool fill(alb_form_factors *factors, const source *from, alb_error *error)
{
    const size_t n = factors->patch_count, largest = alb_hit_rows_largest_chunk(&factors->rows);
    const size_t room = largest + ALB_RAYS_MAX;
    long done = 0;
    alb_progress progress;
    uint32_t *hits = alb_allocate((size_t)omp_get_max_threads(), room * sizeof *hits, error);
    if (!hits)
        return false;
    alb_progress_begin(&progress, "form factors", (long)factors->rows.chunks);
#pragma omp parallel for schedule(dynamic, 1)
    for (size_t chunk = 0; chunk < factors->rows.chunks; chunk++) {
        uint32_t *mine = hits + (size_t)omp_get_thread_num() * room, *row = mine;
        for (size_t p = chunk * ALB_CHUNK_ROWS; p < n && p < (chunk + 1) * ALB_CHUNK_ROWS; p++) {
            take_row(row, factors, from, p);
            row += alb_form_factors_rays(factors, p);
        }
        alb_hit_rows_fill(&factors->rows, chunk, mine, mine + largest);
        const long so_far = __atomic_add_fetch(&done, 1, __ATOMIC_RELAXED);
        if (omp_get_thread_num() == 0)
            alb_progress_at(&progress, so_far);
    }
    alb_progress_end(&progress);
    free(hits);
    alb_hit_rows_trim(&factors->rows);
    drop_unseen(factors);
    return true;
}

// The patches' own shares of rays, made common.
static void share_open_rays(alb_form_factors *factors, double (*room)[3])
{
    for (size_t p = 0; p < factors->patch_count; p++)
        room[p][0] = alb_form_factors_sky_share(factors, p), room[p][1] = alb_form_factors_back_share(factors, p);
    alb_form_factors_share(room, factors);
    for (size_t p = 0; p < factors->patch_count; p++) {
        if (factors->sky_shares)
            factors->sky_shares[p] = (float)room[p][0];
        if (factors->back_shares)
            factors->back_shares[p] = (float)room[p][1];
    }
}

// Neighbours, their phases, and areas in units of the mean.
static bool meet_neighbours(alb_form_factors *factors, const alb_patches *patches, alb_error *error)
{
    const size_t n = patches->count;
    double sum_mm2 = 0;
    if (!alb_row_shares_create(&factors->shares, patches, error) || !(factors->phases = alb_allocate(n, 1, error)))
        return false;
    alb_row_shares_phases(factors->phases, &factors->shares);
    for (size_t p = 0; p < n; p++)
        sum_mm2 += patches->areas_mm2[p];
    for (size_t p = 0; p < n; p++)
        factors->gathered[p][3] = (float)(patches->areas_mm2[p] * (double)n / sum_mm2);
    return true;
}

static bool build(alb_form_factors *factors, const alb_patches *patches, const alb_tracer *tracer,
                  const uint32_t *lengths, alb_error *error)
{
    const size_t n = factors->patch_count;
    double(*room)[3] = alb_allocate(n, sizeof *room, error);
    float *nearness_per_mm = room ? alb_allocate(n, sizeof *nearness_per_mm, error) : NULL;
    const source from = {patches, tracer, nearness_per_mm};
    const bool ok = nearness_per_mm && allocate(factors, lengths, error) && meet_neighbours(factors, patches, error) &&
                    fill(factors, &from, error);
    if (ok) {
        alb_row_shares_limit(&factors->shares, patches, &factors->rows, nearness_per_mm);
        share_open_rays(factors, room);
    }
    free(nearness_per_mm);
    free(room);
    if (!ok)
        alb_form_factors_free(factors);
    return ok;
}

bool alb_form_factors_create_within(alb_form_factors *factors, const alb_patches *patches, const alb_tracer *tracer,
                                    int rays, uint64_t seed, alb_sampling sampling, size_t memory_bytes,
                                    alb_error *error)
{
    *factors = (alb_form_factors){.patch_count = patches->count,
                                  .areas_mm2 = patches->areas_mm2,
                                  .rays = rays,
                                  .seed = seed,
                                  .sampling = sampling,
                                  .memory_bytes = memory_bytes};
    uint32_t *lengths = alb_allocate(patches->count, sizeof *lengths, error);
    for (size_t p = 0; lengths && p < patches->count; p++)
        lengths[p] = (uint32_t)rays;
    const bool ok = lengths && build(factors, patches, tracer, lengths, error);
    free(lengths);
    return ok;
}

bool alb_form_factors_create(alb_form_factors *factors, const alb_patches *patches, const alb_tracer *tracer, int rays,
                             uint64_t seed, alb_sampling sampling, alb_error *error)
{
    return alb_form_factors_create_within(factors, patches, tracer, rays, seed, sampling, 0, error);
}

bool alb_form_factors_cast_again(alb_form_factors *factors, const alb_patches *patches, const alb_tracer *tracer,
                                 const uint32_t *lengths, alb_error *error)
{
    alb_form_factors again = {.patch_count = factors->patch_count,
                              .areas_mm2 = factors->areas_mm2,
                              .rays = factors->rays,
                              .seed = factors->seed,
                              .sampling = factors->sampling,
                              .memory_bytes = factors->memory_bytes};
    if (!build(&again, patches, tracer, lengths, error))
        return false;
    alb_form_factors_free(factors);
    *factors = again;
    return true;
}

void alb_form_factors_free(alb_form_factors *factors)
{
    alb_hit_rows_free(&factors->rows);
    alb_row_shares_free(&factors->shares);
    free(factors->sky_shares);
    free(factors->back_shares);
    free(factors->sky_mask);
    free(factors->phases);
    free(factors->gathered);
    *factors = (alb_form_factors){0};
}

size_t alb_form_factors_bytes(const alb_form_factors *factors)
{
    const size_t n = factors->patch_count, words = alb_hit_rows_rays(&factors->rows) / 64 + factors->rows.chunks + 1;
    const size_t shares = (size_t)(factors->sky_shares != NULL) + (size_t)(factors->back_shares != NULL);
    return alb_hit_rows_bytes(&factors->rows) + alb_row_shares_bytes(&factors->shares) + shares * n * sizeof(float) +
           (factors->phases ? n : 0) + (n + 2) * sizeof *factors->gathered +
           (factors->sky_mask ? words * sizeof *factors->sky_mask : 0);
}

void alb_form_factors_row(uint32_t *hits, const alb_form_factors *factors, size_t patch)
{
    alb_hit_rows_read(hits, &factors->rows, patch);
}

void alb_form_factors_group_row(uint32_t *hits, uint32_t length, const alb_form_factors *factors,
                                const uint32_t *patches, size_t count, uint32_t *row)
{
    double all = 0, before = 0;
    uint32_t q = 0;
    for (size_t i = 0; i < count; i++)
        all += factors->areas_mm2[patches[i]];
    for (size_t i = 0; i < count; i++) {
        const double area = factors->areas_mm2[patches[i]], step = all / length,
                     rays = alb_form_factors_rays(factors, patches[i]);
        alb_form_factors_row(row, factors, patches[i]);
        for (; q < length && ((q + 0.5) * step < before + area || i + 1 == count); q++) {
            const double into = fmin(fmax(((q + 0.5) * step - before) / area, 0), 1);
            hits[q] = row[(size_t)fmin(into * rays, rays - 1)];
        }
        before += area;
    }
}

alb_vector alb_form_factors_direction(const alb_form_factors *factors, const alb_patches *patches, size_t patch, int q)
{
    const alb_ray_pattern pattern = {alb_form_factors_rays(factors, patch), factors->seed, factors->sampling,
                                     factors->phases};
    return alb_ray_direction(&pattern, patches, patch, q);
}
