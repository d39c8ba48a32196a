// What a stage's irradiance should be at vertices drawn at random, by two independent halves of 2025 rays each,
// and as many aimed at lights with a surface.
#pragma once
#include "render/scene.h"
#include "render/shadow_rays.h"
#include "render/shadow_stage.h"

enum { SHADOW_TRUTH_SAMPLES = 2000 };

typedef struct shadow_truth {
    size_t count, vertices[SHADOW_TRUTH_SAMPLES];
    alb_vector points[SHADOW_TRUTH_SAMPLES], normals[SHADOW_TRUTH_SAMPLES];
    float halves[2][SHADOW_TRUTH_SAMPLES][3];
    alb_mesh casters;
    alb_tracer tracer;
    float (*radiance)[3];
    alb_shadow_lamps lamps;
} shadow_truth;

// Vertices that do not shine and do not lie inside anything. The first object, the ground, casts nothing.
bool shadow_truth_find(shadow_truth *truth, const alb_shadow_stage *stage, const alb_scene *scene, alb_error *error);
void shadow_truth_free(shadow_truth *truth);
// rms error of found[samples] in percent of the mean, the rays' own taken off, on the ground (vertices below `ground`)
// or on the model.
double shadow_truth_error(const shadow_truth *truth, const float (*found)[3], size_t ground, bool model);
