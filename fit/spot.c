// How the power of the spot lies about its centre, from its image on a white face: the share of each reading is
// value * area / sum. Negative shares (noise) stay, so that the noise averages out; the readings of observe.c end where
// three rings in a row drown, and those three are left out. The footprint of a pixel and the blur of the lens are in
// it. Noise moves a share s_i by sd_i area_i / sum: it is not carried into the readings of the slab, for it is the same
// small factor as the relative sd of the white reference's flux, which is carried apart.
// A stated spot (disc, Gaussian) has no pixel in it: alb_spot_see puts it there, as the mean over the directions that a
// pixel can be turned in, which is what the mean over a ring of pixels sees.
// Stops being true where the white face is itself translucent on the scale of the spot.
#include "base/memory.h"
#include "fit/observe.h"
#include <math.h>
#include <stdlib.h>

static bool allocate(alb_spot *spot, int count, alb_error *error)
{
    *spot = (alb_spot){.count = count};
    if ((spot->r_mm = alb_allocate((size_t)count, sizeof(double), error)) &&
        (spot->share = alb_allocate((size_t)count, sizeof(double), error)))
        return true;
    alb_spot_free(spot);
    return false;
}

void alb_spot_free(alb_spot *spot)
{
    free(spot->r_mm);
    free(spot->share);
    *spot = (alb_spot){0};
}

bool alb_spot_disc(alb_spot *spot, double radius_mm, alb_error *error)
{
    enum { RADII = 64 };
    const int count = radius_mm > 0 ? RADII : 1;
    if (!allocate(spot, count, error))
        return false;
    for (int i = 0; i < count; i++) {
        spot->r_mm[i] = count == 1 ? 0 : radius_mm * (i + 0.5) / count;
        spot->share[i] = count == 1 ? 1 : (2 * i + 1) / (double)(count * count);
    }
    return true;
}

bool alb_spot_gaussian(alb_spot *spot, double radius_mm, alb_error *error)
{
    enum { RADII = 96 };
    const double reach = 2.5; // e^(-2 2.5^2) = 4e-6 of the light lies beyond
    if (!allocate(spot, RADII, error))
        return false;
    for (int i = 0; i < RADII; i++) {
        const double low = reach * i / RADII, high = reach * (i + 1) / RADII;
        spot->r_mm[i] = radius_mm * (low + high) / 2;
        spot->share[i] = (exp(-2 * low * low) - exp(-2 * high * high)) / -expm1(-2 * reach * reach);
    }
    return true;
}

bool alb_spot_see(alb_spot *spot, double pixel_mm, alb_error *error)
{
    enum { RADII = 128, ACROSS = 24, DIRECTIONS = 32 };
    double furthest = 0;
    alb_spot seen;
    for (int j = 0; j < spot->count; j++)
        furthest = fmax(furthest, spot->r_mm[j]);
    const double end = (furthest + pixel_mm / M_SQRT2) * (1 + 1e-12);
    if (!allocate(&seen, RADII, error))
        return false;
    for (int j = 0; j < spot->count; j++)
        for (int k = 0; k < DIRECTIONS * ACROSS * ACROSS; k++) { // a quarter of the pixel stands for all
            const double phi = 2 * M_PI * (k % DIRECTIONS + 0.5) / DIRECTIONS, h = pixel_mm / (2 * ACROSS);
            const double x = spot->r_mm[j] * cos(phi) + h * (k / DIRECTIONS % ACROSS + 0.5), // NOLINT: whole cells
                y = spot->r_mm[j] * sin(phi) + h * (k / (DIRECTIONS * ACROSS) + 0.5),        // NOLINT
                r = hypot(x, y), share = spot->share[j] / (DIRECTIONS * ACROSS * ACROSS);
            const int bin = (int)(RADII * r / end);
            seen.r_mm[bin] += share * r;
            seen.share[bin] += share;
        }
    for (int i = 0; i < RADII; i++)
        seen.r_mm[i] = seen.share[i] > 0 ? seen.r_mm[i] / seen.share[i] : 0;
    alb_spot_free(spot);
    *spot = seen;
    return true;
}

bool alb_spot_measure(alb_spot *spot, const alb_channel *white, alb_error *error)
{
    bool ok = false;
    alb_readings readings = {0};
    *spot = (alb_spot){0};
    if (!alb_observe_whole(&readings, white, error))
        return false;
    if (readings.core_mm > 0) {
        alb_fail(error, ALB_BAD_DATA,
                 "%s: the spot on the white reference is not measured out to %g mm (saturated); add a shorter exposure",
                 white->name, readings.core_mm);
        goto done;
    }
    const int count = readings.count - (readings.drowned ? 3 : 0);
    double sum = 0;
    for (int i = 0; i < count; i++)
        sum += readings.value[i] * readings.area_mm2[i];
    if (!(sum > 0)) {
        alb_fail(error, ALB_BAD_DATA, "%s: the spot on the white reference holds no power", white->name);
        goto done;
    }
    if (!allocate(spot, count * ALB_RING_SAMPLES, error))
        goto done;
    for (int i = 0; i < count; i++)
        for (int k = 0; k < ALB_RING_SAMPLES; k++) {
            spot->r_mm[i * ALB_RING_SAMPLES + k] = readings.sample_r_mm[i][k];
            spot->share[i * ALB_RING_SAMPLES + k] =
                readings.sample_value[i][k] * readings.sample_share[i][k] * readings.area_mm2[i] / sum;
        }
    spot->x_mm = readings.x_mm;
    spot->y_mm = readings.y_mm;
    ok = true;
done:
    alb_readings_free(&readings);
    return ok;
}
