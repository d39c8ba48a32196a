// Exposures merged to one linear image with a variance per pixel.
#pragma once
#include "base/image.h"
#include "calibrate/noise.h"

typedef struct alb_exposure {
    double time_s;
    double mean_dn; // over `frames` frames, black level included
    int frames;
    bool clipped; // some frame is at or above the white level
} alb_exposure;

// One pixel: rate in DN/s above black and its variance. False where every exposure is clipped.
bool alb_merge_pixel(double *rate, double *variance, const alb_exposure *exposures, int count, double black_dn,
                     double read_noise_dn, double gain_dn_per_electron, double white_level_dn);
// A shot: channels R,G,B then variance.R,... in DN/s and (DN/s)^2; NaN where every exposure is clipped.
bool alb_merge_shot(alb_image *merged, const alb_session *session, const alb_shot *shot, const alb_noise *noise,
                    alb_error *error);
