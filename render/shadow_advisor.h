// What error shadow fields make in a scene, measured, and the settings that keep it below a wanted one.
#pragma once
#include "render/shadow_stage.h"

// rms error of the lit stage's irradiance over vertices drawn at random, against rays, in percent of the mean
// irradiance; the rays' own random error is taken off. Worst channel. NAN where nothing is lit. The error of a share of
// vertices is known to some percent of itself: *upper_percent is above the true one in 95 of 100 scenes.
bool alb_shadow_error(double *percent, double *upper_percent, const alb_shadow_stage *stage, const alb_scene *scene,
                      uint64_t seed, alb_error *error);

// Lights the scene with ever better settings, fewest shells and lowest order first, until the upper error is within
// wanted_percent. False where none is: ALB_UNDECIDED names the best and suggests rays. The stage is lit on success.
bool alb_shadow_advise(alb_shadow_stage *stage, double *upper_percent, const alb_scene *scene, double wanted_percent,
                       uint64_t seed, alb_error *error);
