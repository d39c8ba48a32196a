// What error shadow fields make in a scene, measured, and the settings that keep it below a wanted one.
#pragma once
#include "render/shadow_stage.h"

typedef struct alb_shadow_verdict {
    double percent, upper_percent; // rms error of the irradiance over its mean; above it in 5 of 100 scenes at most
    double rays, rays_s; // rays a vertex that err as much, and the seconds they take for all vertices; NAN for none
} alb_shadow_verdict;

// rms error of the lit stage's irradiance over vertices drawn at random, against rays; the rays' own random error is
// taken off. Worst channel. NAN where nothing is lit. The error of a share of vertices is known to some percent of
// itself: hence an upper one.
bool alb_shadow_error(alb_shadow_verdict *verdict, const alb_shadow_stage *stage, const alb_scene *scene, uint64_t seed,
                      alb_error *error);

// Lights the scene with ever better settings, fewest shells and lowest order first, until the upper error is within
// wanted_percent. False where none is: ALB_UNDECIDED names the best and suggests rays. The stage is lit on success.
bool alb_shadow_advise(alb_shadow_stage *stage, alb_shadow_verdict *verdict, const alb_scene *scene,
                       double wanted_percent, uint64_t seed, alb_error *error);
