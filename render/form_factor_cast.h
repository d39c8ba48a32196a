// The rays of one patch: cosine-weighted directions from points spread over it.
#pragma once
#include "render/patch.h"
#include "render/tracer.h"

typedef enum alb_sampling { ALB_SAMPLING_LATTICE, ALB_SAMPLING_RANDOM } alb_sampling;

enum { ALB_RAY_PHASES = 9 };

typedef struct alb_ray_pattern {
    int rays; // a patch
    uint64_t seed;
    alb_sampling sampling;
    const uint8_t *phases; // of each patch, below ALB_RAY_PHASES, of one lattice; NULL: turned at random
} alb_ray_pattern;

alb_vector alb_ray_direction(const alb_ray_pattern *pattern, const alb_patches *patches, size_t patch, int q);
// Casts the patch's rays: hits[q] is a patch, or patches->count (the sky), or one more (the back of a patch). Returns
// how many of them had slipped through a crack and were cast again.
size_t alb_rays_cast(uint32_t *hits, const alb_ray_pattern *pattern, const alb_patches *patches,
                     const alb_tracer *tracer, size_t patch);
