// The page of a calibration: SESSION/report/calibrate.html.
#pragma once
#include "base/image.h"
#include "calibrate/calibration.h"
#include "calibrate/target.h"

// images[i] belong to calibration->products[i]; their pictures are written beside the page.
bool alb_calibration_report(const alb_calibration *calibration, const alb_board_views *boards, double linearity,
                            double flat_rms, const alb_image *images, alb_error *error);
