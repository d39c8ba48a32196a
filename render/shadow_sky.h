// Environments as receivers of shadow fields see them.
#pragma once
#include "render/light.h"
#include "render/shadow_receivers.h"

// An environment as spherical harmonics of order ALB_SH_ORDER_MAX: radiance seen from the middle.
typedef struct alb_shadow_sky {
    float radiance[3][ALB_SH_COUNT_MAX];
    alb_vector centre_mm; // of the sphere on which it lies
    double radius_mm;     // 0: infinitely far away
} alb_shadow_sky;
// Of an environment light.
bool alb_shadow_sky_create(alb_shadow_sky *sky, const alb_light *environment, alb_error *error);

// irradiance[r][c] += integral of transfer_r times the radiance seen from points[r], not below 0; transfer of order
// ALB_SH_ORDER_MAX, [value][ALB_SHADOW_BLOCK], count <= ALB_SHADOW_BLOCK. It is used up. `law`: alb_shadow_laws.sky.
void alb_shadow_sky_add(float (*irradiance)[3], const alb_shadow_sky *sky, const alb_sh_batch *law, float *transfer,
                        const alb_vector *points, size_t count);
