// electrons = min(Poisson(rate * exposure), full well);  dn = clip(round(black + gain (electrons + read noise)), 0,
// 2^bits - 1) after the model of the EMVA 1288 standard. No dark current, no fixed pattern, no rolling shutter.
#include "capture/sensor.h"
#include "base/random.h"
#include <math.h>

double alb_sensor_white_level_dn(const alb_sensor *sensor)
{
    const double well =
        sensor->black_level_dn + sensor->gain_dn_per_e * (sensor->full_well_e - 6 * sensor->read_noise_e);
    return fmax(1, fmin(floor(well), (double)((1 << sensor->bits) - 1)));
}

void alb_sensor_expose(alb_image *frame, const alb_image *rate, const alb_sensor *sensor, double exposure_s,
                       uint64_t seed, uint64_t frame_id)
{
    const double highest = (double)((1 << sensor->bits) - 1);
#pragma omp parallel for schedule(static)
    for (int y = 0; y < rate->height; y++)
        for (int x = 0; x < rate->width; x++) {
            const float *in = alb_image_at(rate, x, y);
            float *out = alb_image_at(frame, x, y);
            alb_random random = alb_random_at(seed, frame_id, (uint64_t)y * (uint64_t)rate->width + (uint64_t)x);
            for (int c = 0; c < rate->channels; c++) {
                const double mean = (double)in[c] * exposure_s; // far beyond the well there is nothing to draw
                const double electrons = mean > 4 * sensor->full_well_e
                                             ? sensor->full_well_e
                                             : fmin(alb_random_poisson(&random, mean), sensor->full_well_e);
                const double read = electrons + sensor->read_noise_e * alb_random_normal(&random);
                out[c] = (float)fmin(fmax(rint(sensor->black_level_dn + sensor->gain_dn_per_e * read), 0), highest);
            }
        }
}
