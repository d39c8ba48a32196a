// Irradiance of a block of receivers from a light with a surface.
#pragma once
#include "render/shadow_block.h"

// irradiance[r][c] += that of the world's light j.
void alb_shadow_lamp_add(float (*irradiance)[3], const alb_shadow_block *block, const alb_shadow_world *world,
                         size_t j);
