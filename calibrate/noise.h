// The sensor from its own frames: black level, read noise and gain.
#pragma once
#include "calibrate/calibration.h"

typedef struct alb_noise {
    alb_estimate black_dn[3], read_noise_dn[3], gain_dn_per_electron[3];
    double linearity; // largest relative departure of (signal / exposure) from its mean over the diffuser's exposures
} alb_noise;

// Needs a shot of the cap (dark frames) and one of the diffuser, two repeats each at least; ALB_BAD_DATA says which is
// missing or saturated.
bool alb_noise_measure(alb_noise *noise, const alb_session *session, alb_error *error);
