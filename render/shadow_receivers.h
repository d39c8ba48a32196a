// A block of receivers around one field: which samples speak to each, and what they say.
#pragma once
#include "render/shadow_field.h"
#include "render/shadow_laws.h"

enum { ALB_SHADOW_BLOCK = 64 };

typedef struct alb_shadow_receivers {
    size_t count;                            // at most ALB_SHADOW_BLOCK
    double distances_mm[ALB_SHADOW_BLOCK];   // from the field's centre
    alb_vector directions[ALB_SHADOW_BLOCK]; // from there; +z in the centre itself
    float axes[3 * ALB_SHADOW_BLOCK];        // back to it: [component][receiver]
    float k[ALB_SHADOW_BLOCK];               // distance over the shell's
    float weights[ALB_SHADOW_BLOCK];         // of the shell
} alb_shadow_receivers;

void alb_shadow_receivers_at(alb_shadow_receivers *receivers, const alb_shadow_field *field, const alb_vector *points,
                             size_t count);
// Sets k and the weights, which sum to one over the shells of the field. False where none is above 0.
bool alb_shadow_receivers_weigh(alb_shadow_receivers *receivers, const alb_shadow_field *field, int shell);
// Occlusion in the world's frame, out[ALB_SHADOW_VALUES][ALB_SHADOW_BLOCK].
void alb_shadow_receivers_occlusion(float *out, alb_shadow_receivers *receivers, const alb_shadow_field *field,
                                    const alb_shadow_laws *laws);
