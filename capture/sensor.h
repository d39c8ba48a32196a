// What a sensor makes of light: photon noise, full well, read noise, gain, black level, quantisation.
#pragma once
#include "base/image.h"
#include "capture/truth.h"

// Fills `frame` (allocated, same size as `rate`) with raw DN. `rate`: electrons per second, three channels.
// The noise of a pixel is a function of (seed, frame_id, pixel) alone.
void alb_sensor_expose(alb_image *frame, const alb_image *rate, const alb_sensor *sensor, double exposure_s,
                       uint64_t seed, uint64_t frame_id);
// Values at or above are saturated: the end of the converter, or of the full well less six times the read noise.
double alb_sensor_white_level_dn(const alb_sensor *sensor);
