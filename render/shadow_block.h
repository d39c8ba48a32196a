// A block of receivers and what occluders hide of their cosine. Internal to lighting by shadow fields.
#pragma once
#include "render/shadow_light.h"
#include "render/shadow_receivers.h"

// Structures of arrays.
typedef struct alb_shadow_block {
    size_t first, count;
    alb_vector points[ALB_SHADOW_BLOCK], normals[ALB_SHADOW_BLOCK];
    float cosine[ALB_SHADOW_VALUES * ALB_SHADOW_BLOCK]; // max(0, n.d)
    float lobe[ALB_SH_COUNT_MAX * ALB_SHADOW_BLOCK];    // the same, or precomputed transport: what skies light
    bool in_body[ALB_SHADOW_BLOCK], coloured;           // receivers with transport; if the colours' lobes differ
    size_t own[ALB_SHADOW_BLOCK];                       // occluder on whose probed surface a receiver lies, or none
    float hidden[ALB_SHADOW_VALUES * ALB_SHADOW_BLOCK]; // by it, of the cosine
    alb_vector raised[ALB_SHADOW_OCCLUDERS_MAX][ALB_SHADOW_BLOCK];   // where each occluder's field is looked up
    double distances_mm[ALB_SHADOW_OCCLUDERS_MAX][ALB_SHADOW_BLOCK]; // to the occluders' centres
    float shares[ALB_SHADOW_OCCLUDERS_MAX][ALB_SHADOW_BLOCK];        // of the occlusion that is above the horizon
    bool hides[ALB_SHADOW_OCCLUDERS_MAX];                            // any of the shares is not 0
    float (*occlusion)[ALB_SHADOW_VALUES * ALB_SHADOW_BLOCK];        // of each occluder
    alb_shadow_seconds seconds;
} alb_shadow_block;

// From points and normals on: lobes, distances and, where a product will need it, what each occluder hides.
void alb_shadow_block_begin(alb_shadow_block *block, const alb_shadow_world *world);
// out[ALB_SHADOW_VALUES][ALB_SHADOW_BLOCK] = the lobe through all occluders; light NULL: that of skies.
void alb_shadow_block_transfer(float *out, const alb_shadow_block *block, const alb_shadow_world *world,
                               const alb_shadow_sphere *light, const double *light_mm);
// The share of an occluder that is in front of a light, both seen from the receiver.
double alb_shadow_share_before(const alb_shadow_sphere *occluder, const alb_shadow_sphere *light, double occluder_mm,
                               double light_mm);
