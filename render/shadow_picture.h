// The picture of a scene whose vertices are lit.
#pragma once
#include "base/image.h"
#include "render/scene.h"
#include "render/shadow_stage.h"

// Channels R, G, B: radiance at the first hit, albedo E / pi + M / pi with E between the corners of the face, the
// environment where there is none, black on the back of a face; mean of 2 x 2 samples a pixel. *brightest: the largest
// radiance of what does not emit.
bool alb_shadow_view(alb_image *picture, double *brightest, const alb_scene *scene, const alb_shadow_stage *stage,
                     alb_error *error);
