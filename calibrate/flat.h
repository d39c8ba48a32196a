// Vignetting from a photograph of an evenly lit diffuser.
#pragma once
#include "base/image.h"
#include "calibrate/calibration.h"

// Fits the polynomial of flat.c per channel to the merged diffuser; *rms (relative) is the worst channel's residual.
bool alb_flat_fit(double flat[3][ALB_FLAT_TERMS], double *rms, const alb_image *merged, const alb_lens *lens,
                  int channels, alb_error *error);
// The factor by which a pixel is darker than the middle of the picture.
double alb_flat_value(const double flat[ALB_FLAT_TERMS], const alb_lens *lens, double u, double v);
