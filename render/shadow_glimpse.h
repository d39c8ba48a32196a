// What an object leaves of lights with a surface on its own surface: its probes aim a ray at each group of samples.
#pragma once
#include "render/shadow_emitter.h"
#include "render/shadow_surface.h"

typedef struct alb_shadow_glimpse {
    size_t probe_count, light_count;
    float (*shares)[2]; // [light][probe][group]: the cosine, 0 where it sets or the probe is buried; what is seen of it
} alb_shadow_glimpse;

bool alb_shadow_glimpse_create(alb_shadow_glimpse *glimpse, const alb_shadow_surface *surface, size_t light_count,
                               alb_error *error);
void alb_shadow_glimpse_free(alb_shadow_glimpse *glimpse);
// Of the sampled surface; normals of its vertices. A surface that hides nothing of itself casts no rays.
void alb_shadow_glimpse_take(alb_shadow_glimpse *glimpse, const alb_shadow_surface *surface, const alb_vector *normals,
                             const alb_shadow_emitter *emitter, size_t light);
// The share of a group that a vertex of the surface sees, 1 where no probe near it is above the group's horizon.
float alb_shadow_glimpse_at(const alb_shadow_glimpse *glimpse, const alb_shadow_surface *surface, size_t light,
                            size_t group, size_t vertex);
