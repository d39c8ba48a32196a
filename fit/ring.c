// Sorting into rings takes two passes: how many, and where to. The trend is fitted by orthogonalising 1, t, t^2 over
// the pixels; where they all lie at one or two distances the parts that they do not decide are left out.
#include "fit/ring.h"
#include "base/memory.h"
#include <math.h>
#include <stdlib.h>

enum { FINE = 16 };

double alb_ring_edge(int k, double pitch_mm)
{
    return pitch_mm * (k <= FINE ? k : FINE * pow(1 + 1.0 / FINE, k - FINE));
}

static int ring_of(double r_mm, double pitch_mm)
{
    const double r = r_mm / pitch_mm;
    const int k = r < FINE ? (int)r : FINE + (int)(log(r / FINE) / log1p(1.0 / FINE));
    return k < ALB_RINGS_MAX ? k : ALB_RINGS_MAX - 1;
}

static bool valid(const alb_channel *channel, size_t i)
{
    return isfinite(channel->value[i]) && (!channel->variance || channel->variance[i] >= 0);
}

bool alb_rings_sort(alb_rings *rings, const alb_channel *channel, const bool *glint, double x_mm, double y_mm,
                    double pitch_mm, alb_error *error)
{
    const alb_face *face = channel->face;
    const size_t count = (size_t)face->width * (size_t)face->height;
    const double end = alb_ring_edge(ALB_RINGS_MAX, pitch_mm);
    size_t next[ALB_RINGS_MAX] = {0};
    *rings = (alb_rings){.pitch_mm = pitch_mm};
    int *ring = alb_allocate(count, sizeof(int), error);
    rings->pixels = alb_allocate(count, sizeof *rings->pixels, error);
    if (!ring || !rings->pixels) {
        free(ring);
        alb_rings_free(rings);
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        const double r = hypot(face->x_mm[i] - x_mm, face->y_mm[i] - y_mm);
        ring[i] = -1;
        if (!(r < end))
            continue;
        const int k = ring_of(r, pitch_mm);
        if (!valid(channel, i))
            rings->missing[k]++;
        else if (glint && glint[i])
            rings->glints[k]++;
        else
            next[ring[i] = k]++;
    }
    for (int k = 0; k < ALB_RINGS_MAX; k++) {
        rings->begin[k + 1] = rings->begin[k] + next[k];
        next[k] = rings->begin[k];
    }
    for (size_t i = 0; i < count; i++)
        if (ring[i] >= 0) {
            const double x = face->x_mm[i] - x_mm, y = face->y_mm[i] - y_mm;
            rings->pixels[next[ring[i]]++] = (alb_ring_pixel){
                hypot(x, y),       x, y, channel->value[i], channel->variance ? channel->variance[i] : 0,
                face->area_mm2[i], i};
        }
    free(ring);
    return true;
}

void alb_rings_free(alb_rings *rings)
{
    free(rings->pixels);
    *rings = (alb_rings){0};
}

alb_trend alb_trend_fit(const alb_ring_pixel *pixels, const bool *chosen, size_t count, double low_mm, double high_mm)
{
    alb_trend trend = {.middle_mm = (low_mm + high_mm) / 2, .width_mm = high_mm - low_mm};
    double n = 0, t2 = 0, t3 = 0, t4 = 0, v0 = 0, v1 = 0, v2 = 0;
    for (size_t i = 0; i < count; i++)
        if (!chosen || chosen[i]) {
            n++;
            trend.shift += (pixels[i].r_mm - trend.middle_mm) / trend.width_mm;
            trend.mean += pixels[i].value;
        }
    trend.shift /= n;
    trend.mean /= n;
    for (size_t i = 0; i < count; i++)
        if (!chosen || chosen[i]) {
            const double t = (pixels[i].r_mm - trend.middle_mm) / trend.width_mm - trend.shift,
                         v = pixels[i].value - trend.mean;
            t2 += t * t, t3 += t * t * t, t4 += t * t * t * t;
            v0 += v, v1 += v * t, v2 += v * t * t;
        }
    trend.skew = t2 > 0 ? t3 / t2 : 0;
    trend.square = t2 / n;
    trend.linear = t2 > 0 ? v1 / t2 : 0;
    const double qq = t4 - t2 * trend.square - t3 * trend.skew, qv = v2 - v0 * trend.square - trend.skew * v1;
    trend.bend = qq > 1e-9 * t4 ? qv / qq : 0;
    return trend;
}
