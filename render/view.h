// The picture of a solved scene: radiance that reaches the camera.
#pragma once
#include "base/image.h"
#include "render/scene.h"

// Radiosity at the three corners of each patch, smoothed over the patches around the corner that belong to the same
// object and material and whose normals lie within 40 degrees, weighted by area. corners has patch_count rows.
bool alb_view_smooth(float (*corners)[3][3], const alb_patches *patches, const double (*radiosity)[3],
                     alb_error *error);

// Channels R, G, B: radiosity / pi at the first hit, the environment where there is none, black on the back of a patch;
// mean of 2 x 2 samples a pixel. Picture elements whose line of sight the lens cannot give (beyond its field) are
// black.
bool alb_view_render(alb_image *picture, const alb_scene *scene, const alb_tracer *tracer, const float (*corners)[3][3],
                     alb_error *error);
