// The error of ray-cast rows, from their halves. With I_e, I_o what the even and the odd rays of a patch gather,
//     I = (I_e + I_o)/2,   half difference d = (I_e - I_o)/2,   stated error^2 = upper bound of mean d^2 / mean I^2
// over the patches, and again over their area (large patches may err more, and send more): the worse is stated. For
// random rays E d^2 is the variance of I. A lattice's halves are lattices of R/2, each of which errs 2^a times as much
// as the whole, a from 1/2 to 1: d then says up to 1.4 too much, on fine meshes 1.3 to 1.6.
//
// Refining: with s_p^2 the mean d^2 of 33 patches along a Morton curve around p (one patch's d is one draw, and rays
// may have missed a small lamp altogether), (1 + g) times as many rays for p take s_p^2 (1 - (1+g)^(-2a)) off the sum
// of squares for g R_p rays. Rows grow while that gain a ray is above the one threshold that brings the sum to what is
// asked: the fewest rays for it, ~ s_p^(2/(1+2a)).
//
// Stops being true: for light unlike the radiosity that was given, and where 33 patches with their rays all miss what
// is bright.
#include "base/memory.h"
#include "base/morton.h"
#include "render/form_factor.h"
#include <stdlib.h>
#include <string.h>

enum { WINDOW = 16, ROUNDS = 5, STEPS = 60 };

static const double quantile = 2.33; // of the normal distribution at 99 %: refining stops at a draw that looks good
static const double growth = 1.2;    // of a row's rays in a step
static const double margin = 0.95;   // aimed at, of what is asked

typedef double rgb[3];

// What a patch counts in a mean: one, or its area in units of the mean area.
enum { BY_PATCH, BY_AREA, WAYS };

static double weight(const alb_form_factors *factors, size_t patch, int way, double mean_mm2)
{
    return way == BY_AREA ? factors->areas_mm2[patch] / mean_mm2 : 1;
}

static double mean_area(const alb_form_factors *factors)
{
    double sum = 0;
    for (size_t p = 0; p < factors->patch_count; p++)
        sum += factors->areas_mm2[p];
    return sum / (double)factors->patch_count;
}

// Mean square of each channel of the irradiance, the sky's share with it.
static void mean_squares(double out[WAYS][3], const rgb *irradiance, const alb_form_factors *factors,
                         const double sky[3], double mean_mm2)
{
    memset(out, 0, WAYS * sizeof *out);
    for (size_t p = 0; p < factors->patch_count; p++)
        for (int c = 0; c < 3; c++) {
            const double all = irradiance[p][c] + (sky ? sky[c] * alb_form_factors_sky_share(factors, p) : 0);
            for (int way = 0; way < WAYS; way++)
                out[way][c] += weight(factors, p, way, mean_mm2) * all * all / (double)factors->patch_count;
        }
}

// squares[p][c] = w d^2 / mean w I^2, w 1 or the area, of the two ways the one whose sum is larger; zero in a channel
// that is black.
static bool relative_squares(rgb *squares, const alb_form_factors *factors, const rgb *radiosity, const double sky[3],
                             alb_error *error)
{
    double mean[WAYS][3], sums[WAYS][3] = {{0}};
    const double mean_mm2 = mean_area(factors);
    rgb *irradiance = alb_allocate(factors->patch_count, sizeof *irradiance, error);
    if (!irradiance)
        return false;
    alb_form_factors_apply(irradiance, factors, radiosity);
    mean_squares(mean, (const rgb *)irradiance, factors, sky, mean_mm2);
    free(irradiance);
    alb_form_factors_half_difference(squares, factors, radiosity, sky);
    for (size_t p = 0; p < factors->patch_count; p++)
        for (int c = 0; c < 3; c++) {
            squares[p][c] *= squares[p][c];
            for (int way = 0; way < WAYS; way++)
                sums[way][c] += weight(factors, p, way, mean_mm2) * squares[p][c];
        }
    for (int c = 0; c < 3; c++) {
        const int way =
            sums[BY_AREA][c] * mean[BY_PATCH][c] > sums[BY_PATCH][c] * mean[BY_AREA][c] ? BY_AREA : BY_PATCH;
        for (size_t p = 0; p < factors->patch_count; p++)
            squares[p][c] = mean[way][c] > 0 ? weight(factors, p, way, mean_mm2) * squares[p][c] / mean[way][c] : 0;
    }
    return true;
}

// From an upper bound on the mean: the error and its half difference scatter alike, each by the standard error of the
// mean, so apart by sqrt 2 of it.
static double worst_percent(const rgb *squares, size_t count)
{
    double worst = 0, n = (double)count;
    for (int c = 0; c < 3; c++) {
        double sum = 0, sum_of_squares = 0;
        for (size_t p = 0; p < count; p++) {
            sum += squares[p][c];
            sum_of_squares += squares[p][c] * squares[p][c];
        }
        const double mean = sum / n, variance = fmax(0, sum_of_squares / n - mean * mean);
        if (isnan(sum)) // fmax would leave it out
            return (double)NAN;
        worst = fmax(worst, mean + quantile * sqrt(2 * variance / n));
    }
    return 100 * sqrt(worst);
}

bool alb_form_factors_error(double *percent, const alb_form_factors *factors, const double (*radiosity)[3],
                            const double sky[3], alb_error *error)
{
    rgb *squares = alb_allocate(factors->patch_count, sizeof *squares, error);
    const bool ok = squares && relative_squares(squares, factors, radiosity, sky, error);
    if (ok)
        *percent = worst_percent((const rgb *)squares, factors->patch_count);
    free(squares);
    return ok;
}

// --- patches along a Morton curve ------------------------------------------------------------------------------------
typedef struct place {
    uint64_t code;
    uint32_t patch;
} place;

static int by_code(const void *a, const void *b)
{
    const place *p = a, *q = b;
    if (p->code != q->code)
        return p->code < q->code ? -1 : 1;
    return p->patch < q->patch ? -1 : p->patch > q->patch;
}

static void order_patches(place *places, const alb_patches *patches)
{
    const alb_morton curve = alb_morton_of(patches->centroids, patches->count);
    for (size_t p = 0; p < patches->count; p++)
        places[p] = (place){alb_morton_place(&curve, patches->centroids[p], 21), (uint32_t)p};
    qsort(places, patches->count, sizeof *places, by_code);
}

// --- how many rays ---------------------------------------------------------------------------------------------------
// pooled[p] = mean over the window of the worst channel's square.
static bool pool(double *pooled, const rgb *squares, const alb_patches *patches, alb_error *error)
{
    const size_t n = patches->count;
    place *places = alb_allocate(n, sizeof *places, error);
    double *sums = alb_allocate(n + 1, sizeof *sums, error);
    const bool ok = places && sums;
    if (ok)
        order_patches(places, patches);
    for (size_t i = 0; ok && i < n; i++) {
        const double *square = squares[places[i].patch];
        sums[i + 1] = sums[i] + fmax(square[0], fmax(square[1], square[2]));
    }
    for (size_t i = 0; ok && i < n; i++) {
        const size_t from = i < WINDOW ? 0 : i - WINDOW, to = i + WINDOW + 1 < n ? i + WINDOW + 1 : n;
        pooled[places[i].patch] = (sums[to] - sums[from]) / (double)(to - from);
    }
    free(places);
    free(sums);
    return ok;
}

// Grows each row from the rays that all began with while that gains more than the threshold a ray; returns the sum of
// squares to expect.
static double lengths_at(uint32_t *lengths, const alb_form_factors *factors, const double *squares, double threshold,
                         int rays_max)
{
    const double rate = factors->sampling == ALB_SAMPLING_LATTICE ? 0.75 : 0.5, shrink = pow(growth, -2 * rate);
    double sum = 0;
    for (size_t p = 0; p < factors->patch_count; p++) {
        double rays = factors->rays, left = squares[p] * pow(alb_form_factors_rays(factors, p) / rays, 2 * rate);
        while (growth * rays <= rays_max && left * (1 - shrink) > threshold * (growth - 1) * rays) {
            rays *= growth;
            left *= shrink;
        }
        lengths[p] = (uint32_t)rays;
        sum += left;
    }
    return sum;
}

// The largest threshold that brings the sum to the target, by bisection of its logarithm.
static void choose_lengths(uint32_t *lengths, const alb_form_factors *factors, const double *squares, double target,
                           int rays_max)
{
    double low = -700, high = 0; // exp(-700): every row at its most
    for (int k = 0; k < STEPS; k++) {
        const double middle = 0.5 * (low + high);
        *(lengths_at(lengths, factors, squares, exp(middle), rays_max) <= target ? &low : &high) = middle;
    }
    lengths_at(lengths, factors, squares, exp(low), rays_max);
}

static double total(const double *values, size_t count)
{
    double sum = 0;
    for (size_t i = 0; i < count; i++)
        sum += values[i];
    return sum;
}

static bool is_new(const uint32_t *lengths, const alb_form_factors *factors)
{
    for (size_t p = 0; p < factors->patch_count; p++)
        if (lengths[p] != (uint32_t)alb_form_factors_rays(factors, p))
            return true;
    return false;
}

bool alb_form_factors_refine(double *reached, alb_form_factors *factors, const alb_patches *patches,
                             const alb_tracer *tracer, const double (*radiosity)[3], const double sky[3],
                             double percent, int rays_max, alb_error *error)
{
    const size_t n = factors->patch_count;
    rgb *squares = alb_allocate(n, sizeof *squares, error);
    double *pooled = alb_allocate(n, sizeof *pooled, error);
    uint32_t *lengths = alb_allocate(n, sizeof *lengths, error);
    bool ok = squares && pooled && lengths;
    double now = INFINITY;
    for (int round = 0; ok; round++) {
        ok = relative_squares(squares, factors, radiosity, sky, error);
        now = ok ? worst_percent((const rgb *)squares, n) : now;
        if (!ok || now <= percent || round == ROUNDS || !(ok = pool(pooled, (const rgb *)squares, patches, error)))
            break;
        choose_lengths(lengths, factors, pooled, total(pooled, n) * pow(margin * percent / now, 2), rays_max);
        if (!is_new(lengths, factors))
            break;
        ok = alb_form_factors_cast_again(factors, patches, tracer, lengths, error);
    }
    if (reached)
        *reached = now;
    free(squares);
    free(pooled);
    free(lengths);
    return ok;
}
