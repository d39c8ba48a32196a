// The calibrated images of a session.
#pragma once
#include "base/image.h"
#include "calibrate/calibration.h"
#include "calibrate/noise.h"

// Fills calibration->products and images[i] (owned by the caller) for every spot or grid on the white reference and on
// the slab; see calibration.h for what the images hold. Each slab shot needs one of the same pattern on the white
// reference.
bool alb_products_make(alb_calibration *calibration, alb_image images[ALB_SHOTS_MAX], const alb_session *session,
                       const alb_noise *noise, alb_error *error);
