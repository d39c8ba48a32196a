// How the power of the spot lies about its centre, from its image on a white face: the share of each reading is
// value * area / sum. Negative shares (noise) stay, so that the noise averages out; the readings of observe.c end where
// three rings in a row drown, and those three are left out. The footprint of a pixel and the blur of the lens are in
// it. Noise moves a share s_i by sd_i area_i / sum: it is not carried into the readings of the slab, for it is the same
// small factor as the relative sd of the white reference's flux, which is carried apart.
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
    ok = true;
done:
    alb_readings_free(&readings);
    return ok;
}
