// What an object with a field hides along single lines of sight.
#pragma once
#include "render/shadow_receivers.h"

// out[count] = occlusion, 0 to 1, of the field seen from points[r] along directions[c * ALB_SHADOW_BLOCK + r] (unit);
// 0 where wanted[r] is not above 0. apart: receivers lie on surfaces of other objects. count <= ALB_SHADOW_BLOCK.
void alb_shadow_along(float *out, const alb_shadow_field *field, const alb_vector *points, const float *directions,
                      const float *wanted, bool apart, size_t count);
