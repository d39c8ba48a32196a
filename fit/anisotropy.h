// How far the light is from round about its centre.
#pragma once
#include "fit/ring.h"

// Parts of cos phi, sin phi, cos 2 phi, sin 2 phi in a ring's pixels about its trend, in the unit of the values, by
// least squares with a constant; variance: of each part where the pixels' is 1. NaN where the pixels do not decide.
void alb_ring_harmonics(double harmonics[4], double *variance, const alb_ring_pixel *pixels, size_t count,
                        const alb_trend *trend);
// Fills readings->anisotropy from its harmonics.
void alb_anisotropy_of(alb_readings *readings);
