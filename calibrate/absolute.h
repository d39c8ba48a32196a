// The absolute scale: incident flux from the photograph of the white reference.
#pragma once
#include "base/image.h"
#include "calibrate/calibration.h"

// Flux of the pattern on a Lambertian reference in the plane of the face, per channel, in merged units times mm^2:
// Phi = pi / rho * integral of radiance dA over the lit region. `merged` has vignetting removed. ALB_BAD_DATA where the
// pattern is saturated, cut by the picture's edge or not to be seen.
bool alb_flux_measure(alb_estimate flux[3], const alb_image *merged, const alb_camera *camera,
                      const double reflectance[3], const char *shot, alb_error *error);
