// The solver for scenes: clusters of patches first, then patches.
#pragma once
#include "render/radiosity.h"

// As alb_radiosity_solve.
bool alb_two_level_run(alb_rgb *radiosity, alb_radiosity_report *report, const alb_radiosity *equations,
                       const alb_rgb *irradiance, const alb_rgb *exitance, const alb_rgb *start, double residual,
                       alb_error *error);
