// A pixel is an outlier of its ring where it lies more than 4 (1 + 8 / n) s off the ring's trend in r, n pixels in the
// ring; s is the pixel's own sd or 1.4826 times the median distance of the ring's pixels from the trend, whichever is
// more: what all of a ring does (texture, a spot that is not round, a trend that bends) is no outlier. The trend starts
// from the medians of three strips of the ring and is fitted three times to the pixels that it does not reject.
// Neighbours go too, for a glint is blurred.
//
// Of clean Gaussian pixels 6e-5 are flagged, and with neighbours 6e-4 left out: the plain mean of the rest keeps its
// efficiency, which a median (1.25 times the sd) would not. What lies below 4 s stays: a tenth of a ring that is 4 s
// off moves its mean by 0.4 s. Rings of fewer than 12 pixels are taken as they are. Stops being true where more than a
// third of a ring is disturbed.
#include "fit/glint.h"
#include "base/memory.h"
#include "base/statistics.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { FEWEST = 12, SAMPLES = 400, STRIPS = 3, PASSES = 3 };

// The quadratic through the medians of three strips of the ring; a constant where a strip is empty.
static alb_trend trend_of_medians(const alb_ring_pixel *pixels, size_t count, double low_mm, double high_mm)
{
    double values[STRIPS][SAMPLES], r[STRIPS] = {0};
    size_t n[STRIPS] = {0};
    const size_t step = count / SAMPLES + 1;
    for (size_t i = 0; i < count; i += step) {
        const int s = (int)fmin(STRIPS * (pixels[i].r_mm - low_mm) / (high_mm - low_mm), STRIPS - 1);
        values[s][n[s]++] = pixels[i].value;
        r[s] += pixels[i].r_mm;
    }
    alb_ring_pixel medians[STRIPS];
    size_t filled = 0;
    for (int s = 0; s < STRIPS; s++)
        if (n[s])
            medians[filled++] = (alb_ring_pixel){.r_mm = r[s] / (double)n[s], .value = alb_median(values[s], n[s])};
    return alb_trend_fit(medians, NULL, filled, low_mm, high_mm);
}

static double scatter_about(const alb_trend *trend, const alb_ring_pixel *pixels, size_t count)
{
    double off[SAMPLES];
    size_t n = 0;
    const size_t step = count / SAMPLES + 1;
    for (size_t i = 0; i < count; i += step)
        off[n++] = fabs(pixels[i].value - alb_trend_at(trend, pixels[i].r_mm));
    return 1.4826 * alb_median(off, n);
}

// chosen: room for a flag a pixel.
static void find_in_ring(bool *glint, bool *chosen, const alb_ring_pixel *pixels, size_t count, double low_mm,
                         double high_mm)
{
    const double limit = 4 * (1 + 8 / (double)count);
    alb_trend trend = trend_of_medians(pixels, count, low_mm, high_mm);
    size_t kept = 0;
    for (int pass = 0; pass <= PASSES; pass++) {
        const double scatter = scatter_about(&trend, pixels, count);
        kept = 0;
        for (size_t i = 0; i < count; i++) {
            const double s = fmax(sqrt(pixels[i].variance), scatter);
            chosen[i] = fabs(pixels[i].value - alb_trend_at(&trend, pixels[i].r_mm)) <= limit * s;
            kept += chosen[i];
        }
        if (2 * kept < count)
            return;
        if (pass < PASSES)
            trend = alb_trend_fit(pixels, chosen, count, low_mm, high_mm);
    }
    for (size_t i = 0; i < count; i++)
        glint[pixels[i].index] = !chosen[i];
}

static bool spread_to_neighbours(bool *glint, int width, int height, alb_error *error)
{
    const size_t count = (size_t)width * (size_t)height;
    bool *found = alb_allocate(count, sizeof *found, error);
    if (!found)
        return false;
    memcpy(found, glint, count * sizeof *found);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            if (!found[(size_t)y * (size_t)width + (size_t)x])
                continue;
            for (int v = y > 0 ? y - 1 : 0; v <= y + 1 && v < height; v++)
                for (int u = x > 0 ? x - 1 : 0; u <= x + 1 && u < width; u++)
                    glint[(size_t)v * (size_t)width + (size_t)u] = true;
        }
    free(found);
    return true;
}

bool alb_glints_find(bool *glint, const alb_channel *channel, double x_mm, double y_mm, double pitch_mm,
                     alb_error *error)
{
    const int width = channel->face->width, height = channel->face->height;
    const size_t count = (size_t)width * (size_t)height;
    bool ok = false;
    bool *chosen = alb_allocate(count, sizeof *chosen, error);
    alb_rings *rings = alb_allocate(1, sizeof *rings, error);
    memset(glint, 0, count * sizeof *glint);
    if (!chosen || !rings || !alb_rings_sort(rings, channel, NULL, x_mm, y_mm, pitch_mm, error))
        goto done;
#pragma omp parallel for schedule(dynamic)
    for (int k = 0; k < ALB_RINGS_MAX; k++) {
        const size_t begin = rings->begin[k], n = rings->begin[k + 1] - begin;
        if (n >= FEWEST)
            find_in_ring(glint, chosen + begin, rings->pixels + begin, n, alb_ring_edge(k, pitch_mm),
                         alb_ring_edge(k + 1, pitch_mm));
    }
    ok = spread_to_neighbours(glint, width, height, error);
done:
    if (rings)
        alb_rings_free(rings);
    free(rings);
    free(chosen);
    return ok;
}
