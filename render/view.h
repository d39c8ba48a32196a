// The picture of a solved scene: radiance that reaches the camera.
#pragma once
#include "base/image.h"
#include "render/solution.h"

// Channels R, G, B: radiance at the first hit, the environment where there is none, black on the back of a patch; mean
// of 2 x 2 samples a pixel. Picture elements whose line of sight the lens cannot give (beyond its field) are black.
bool alb_view_render(alb_image *picture, const alb_scene *scene, const alb_solution *solution, alb_error *error);
// The largest radiance of what does not emit, seen from anywhere: lamps and sky may be brighter.
double alb_view_brightest(const alb_scene *scene, const alb_solution *solution);
// The exposure that shows the 99th percentile of the lit pixels' largest channel at 0.9; brighter ones than
// `brightest`, lamps and sky, are left out.
bool alb_view_exposure(double *exposure, const alb_image *picture, double brightest, alb_error *error);
