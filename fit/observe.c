// Readings by distance: the rings of ring.h about the centre.
//
// A ring's value is the plain mean of its valid pixels less the glints (weights taken from noisy samples bias: dim
// pixels get too much). Its sd is what the variances of the pixels give, unless the scatter about a quadratic in r
// within the ring is larger than they allow (chi-square tail below 1e-3: texture, a spot that is not round); then it is
// what the scatter gives. Without variances it is the scatter, pooled relative to the value over neighbouring rings
// until it has 30 degrees of freedom. To either, 1e-4 of the value (what the forward operator is good to) and 1e-6 of
// the highest are added in quadrature. Errors common to many rings (scale, black level) are not in it. Rings end where
// three in a row are alike nothing: below their sd and not 3 sd below zero (kept: they bind the tail); or where the
// image does. Negative means stay.
#include "fit/observe.h"
#include "base/memory.h"
#include "base/statistics.h"
#include "fit/anisotropy.h"
#include "fit/centre.h"
#include "fit/ring.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { POOL_FREEDOM = 30 };

bool alb_readings_create(alb_readings *readings, int count, alb_error *error)
{
    *readings = (alb_readings){.count = count};
    const size_t n = (size_t)count;
    if ((readings->r_mm = alb_allocate(n, sizeof(double), error)) &&
        (readings->value = alb_allocate(n, sizeof(double), error)) &&
        (readings->sd = alb_allocate(n, sizeof(double), error)) &&
        (readings->area_mm2 = alb_allocate(n, sizeof(double), error)) &&
        (readings->sample_r_mm = alb_allocate(n, sizeof *readings->sample_r_mm, error)) &&
        (readings->sample_share = alb_allocate(n, sizeof *readings->sample_share, error)) &&
        (readings->sample_value = alb_allocate(n, sizeof *readings->sample_value, error)) &&
        (readings->harmonics = alb_allocate(n, sizeof *readings->harmonics, error)) &&
        (readings->harmonic_sd = alb_allocate(n, sizeof(double), error)))
        return true;
    alb_readings_free(readings);
    return false;
}

void alb_readings_free(alb_readings *readings)
{
    free(readings->r_mm);
    free(readings->value);
    free(readings->sd);
    free(readings->area_mm2);
    free(readings->sample_r_mm);
    free(readings->sample_share);
    free(readings->sample_value);
    free(readings->harmonics);
    free(readings->harmonic_sd);
    *readings = (alb_readings){0};
}

typedef struct ring {
    double r_mm, value, propagated; // propagated: mean variance of its pixels
    double squares;                 // about the local trend
    int freedom;                    // of the squares; 0: too few pixels
    double area_mm2;                // of the pixels read
    double sample_r_mm[ALB_RING_SAMPLES], sample_share[ALB_RING_SAMPLES], sample_value[ALB_RING_SAMPLES];
    double harmonics[4], harmonic_variance; // in the unit of the values; where the variance of a pixel is 1
    size_t count;
} ring;

static void sample(ring *out, const alb_ring_pixel *pixels, double low, double width)
{
    double r[ALB_RING_SAMPLES] = {0}, n[ALB_RING_SAMPLES] = {0}, value[ALB_RING_SAMPLES] = {0};
    for (size_t i = 0; i < out->count; i++) {
        const double share = (pixels[i].r_mm - low) / width;
        const int s = (int)fmin(fmax(share * ALB_RING_SAMPLES, 0), ALB_RING_SAMPLES - 1);
        r[s] += pixels[i].r_mm;
        value[s] += pixels[i].value;
        n[s]++;
    }
    for (int s = 0; s < ALB_RING_SAMPLES; s++) {
        out->sample_r_mm[s] = n[s] > 0 ? r[s] / n[s] : 0;
        out->sample_value[s] = n[s] > 0 ? value[s] / n[s] : 0;
        out->sample_share[s] = n[s] / (double)out->count;
    }
}

static void summarise(ring *out, const alb_ring_pixel *pixels, int k, double pitch_mm)
{
    const double low = alb_ring_edge(k, pitch_mm), high = alb_ring_edge(k + 1, pitch_mm), n = (double)out->count;
    double variance = 0, r = 0;
    const alb_trend trend = alb_trend_fit(pixels, NULL, out->count, low, high);
    for (size_t i = 0; i < out->count; i++) {
        const double residual = pixels[i].value - alb_trend_at(&trend, pixels[i].r_mm);
        out->squares += residual * residual;
        r += pixels[i].r_mm;
        variance += pixels[i].variance;
        out->area_mm2 += pixels[i].area_mm2;
    }
    out->r_mm = r / n;
    out->value = trend.mean;
    out->propagated = variance / n;
    out->freedom = out->count >= 6 ? (int)fmin(n - 3, 1e9) : 0;
    sample(out, pixels, low, high - low);
    alb_ring_harmonics(out->harmonics, &out->harmonic_variance, pixels, out->count, &trend);
}

// Relative variance of one pixel from the scatter in rings about k (variance itself where the values are not positive).
static double pooled_variance(const ring *rings, int k)
{
    double squares = 0, relative = 0, freedom = 0;
    bool positive = rings[k].value > 0;
    for (int width = 0; width < ALB_RINGS_MAX && freedom < POOL_FREEDOM; width++)
        for (int side = -1; side <= (width ? 1 : -1); side += 2) {
            const int j = k + side * width;
            if (j < 0 || j >= ALB_RINGS_MAX || rings[j].freedom == 0)
                continue;
            freedom += rings[j].freedom;
            squares += rings[j].squares;
            positive &= rings[j].value > 0;
            relative += positive ? rings[j].squares / (rings[j].value * rings[j].value) : 0;
        }
    if (freedom <= 0)
        return 0;
    return positive ? relative / freedom * rings[k].value * rings[k].value : squares / freedom;
}

// Of one pixel of the ring.
static double pixel_variance(const ring *rings, int k, bool with_variance)
{
    const ring *one = &rings[k];
    const double variance = with_variance ? one->propagated : pooled_variance(rings, k);
    if (with_variance && one->freedom &&
        (variance <= 0 || alb_chi_square_tail(one->squares / variance, one->freedom) < 1e-3))
        return fmax(variance, one->squares / one->freedom);
    return variance;
}

// Distance from the centre to the nearest pixel of the image's border.
static double border_distance(const alb_face *face, double x_mm, double y_mm)
{
    double nearest = INFINITY;
    for (int y = 0; y < face->height; y++)
        for (int x = 0; x < face->width; x += y == 0 || y == face->height - 1 ? 1 : face->width - 1) {
            const size_t i = (size_t)y * (size_t)face->width + (size_t)x;
            nearest = fmin(nearest, hypot(face->x_mm[i] - x_mm, face->y_mm[i] - y_mm));
        }
    return nearest;
}

// Where the readings end: ring *end, of which *kept hold pixels. Fills variance (of one pixel) and sd up to there.
static bool find_end(int *end, int *kept, double *variance, double *sd, const ring *rings, bool with_variance)
{
    double top = 0;
    int drowned = 0;
    *end = *kept = 0;
    for (int k = 0; k < ALB_RINGS_MAX; k++)
        top = fmax(top, rings[k].count ? fabs(rings[k].value) : 0);
    for (int k = 0; k < ALB_RINGS_MAX && drowned < 3; k++) {
        const ring *one = &rings[k];
        if (one->count == 0)
            continue;
        variance[k] = pixel_variance(rings, k, with_variance);
        sd[k] = sqrt(variance[k] / (double)one->count + 1e-8 * one->value * one->value + 1e-12 * top * top);
        drowned = fabs(one->value) < sd[k] || (one->value < 0 && one->value > -3 * sd[k]) ? drowned + 1 : 0;
        *end = k + 1;
        (*kept)++;
    }
    return drowned >= 3;
}

static void put_reading(alb_readings *out, int i, const ring *one, double variance, double sd, double area_mm2)
{
    out->r_mm[i] = one->r_mm;
    out->value[i] = one->value;
    out->sd[i] = sd;
    out->area_mm2[i] = area_mm2;
    memcpy(out->sample_r_mm[i], one->sample_r_mm, sizeof one->sample_r_mm);
    memcpy(out->sample_share[i], one->sample_share, sizeof one->sample_share);
    memcpy(out->sample_value[i], one->sample_value, sizeof one->sample_value);
    for (int h = 0; h < 4; h++)
        out->harmonics[i][h] = one->harmonics[h] / one->value;
    out->harmonic_sd[i] = sqrt(one->harmonic_variance * variance) / fabs(one->value);
}

// What lies beyond the readings, out to the border of the image: the mean over the pixels.
static void look_beyond(alb_readings *readings, const ring *rings, int end, bool with_variance)
{
    double sum = 0, variance = 0, count = 0;
    for (int k = end; k < ALB_RINGS_MAX; k++) {
        const double n = (double)rings[k].count;
        if (rings[k].count == 0)
            continue;
        sum += n * rings[k].value;
        variance += n * pixel_variance(rings, k, with_variance);
        count += n;
    }
    readings->far_value = count > 0 ? sum / count : 0;
    readings->far_sd = count > 0 ? sqrt(variance) / count : 0;
}

static bool rings_to_readings(alb_readings *readings, const ring *rings, const alb_rings *sorted, bool with_variance,
                              double complete_mm, alb_error *error)
{
    double variance[ALB_RINGS_MAX], sd[ALB_RINGS_MAX];
    int end, kept;
    const bool drowned = find_end(&end, &kept, variance, sd, rings, with_variance);
    if (!alb_readings_create(readings, kept, error))
        return false;
    readings->drowned = drowned;
    readings->outer_mm = alb_ring_edge(end, sorted->pitch_mm);
    readings->complete_mm = complete_mm;
    for (int k = 0; k < end && 4 * sorted->missing[k] >= sorted->missing[k] + rings[k].count && sorted->missing[k]; k++)
        readings->core_mm = alb_ring_edge(k + 1, sorted->pitch_mm);
    for (int k = 0, i = 0; k < end; k++) {
        const double low = alb_ring_edge(k, sorted->pitch_mm), high = alb_ring_edge(k + 1, sorted->pitch_mm);
        const bool whole = sorted->missing[k] + sorted->glints[k] == 0 && high < complete_mm;
        readings->pixels += (long)rings[k].count;
        readings->missing += (long)sorted->missing[k];
        readings->glints += (long)sorted->glints[k];
        if (rings[k].count)
            put_reading(readings, i++, &rings[k], variance[k], sd[k],
                        whole ? rings[k].area_mm2 : M_PI * (high * high - low * low));
    }
    look_beyond(readings, rings, end, with_variance);
    alb_anisotropy_of(readings);
    return true;
}

static bool observe(alb_readings *readings, const alb_channel *channel, bool leave_out_glints, alb_error *error)
{
    bool ok = false;
    alb_centre centre;
    const size_t count = (size_t)channel->face->width * (size_t)channel->face->height;
    *readings = (alb_readings){0};
    ring *rings = alb_allocate(ALB_RINGS_MAX, sizeof *rings, error);
    alb_rings *sorted = alb_allocate(1, sizeof *sorted, error);
    bool *glint = alb_allocate(count, sizeof *glint, error);
    if (!rings || !sorted || !glint || !alb_centre_find(&centre, glint, leave_out_glints, channel, error) ||
        !alb_rings_sort(sorted, channel, glint, centre.x_mm, centre.y_mm, centre.pitch_mm, error))
        goto done;
#pragma omp parallel for schedule(dynamic)
    for (int k = 0; k < ALB_RINGS_MAX; k++)
        if ((rings[k].count = sorted->begin[k + 1] - sorted->begin[k]))
            summarise(&rings[k], sorted->pixels + sorted->begin[k], k, centre.pitch_mm);
    if (!rings_to_readings(readings, rings, sorted, channel->variance != NULL,
                           border_distance(channel->face, centre.x_mm, centre.y_mm), error))
        goto done;
    readings->x_mm = centre.x_mm;
    readings->y_mm = centre.y_mm;
    memcpy(readings->centre_covariance_mm2, centre.covariance_mm2, sizeof centre.covariance_mm2);
    ok = true;
done:
    if (sorted)
        alb_rings_free(sorted);
    free(sorted);
    free(glint);
    free(rings);
    return ok;
}

bool alb_observe(alb_readings *readings, const alb_channel *channel, alb_error *error)
{
    return observe(readings, channel, true, error);
}

bool alb_observe_whole(alb_readings *readings, const alb_channel *channel, alb_error *error)
{
    return observe(readings, channel, false, error);
}
