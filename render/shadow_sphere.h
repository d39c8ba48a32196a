// The bounding sphere of a shadow field's object, kept still while a deforming object allows it.
#pragma once
#include "base/error.h"
#include "base/vector.h"
#include <stddef.h>

typedef struct alb_shadow_sphere {
    alb_vector centre_mm;
    double radius_mm; // 0: none yet
} alb_shadow_sphere;

// A sphere around all points. What stands in *sphere stays where it still holds them and is less than 1.4 times as wide
// as what they need; otherwise a new one, within 2 % of the smallest, and 10 % wider than needed where there was one
// before, so that an object that grows does not move its sphere at every frame. `name` is for messages.
// ALB_BAD_DATA: no points, one that is not finite, or all of them in one place, as far as double precision tells.
bool alb_shadow_sphere_follow(alb_shadow_sphere *sphere, const alb_vector *points, size_t count, const char *name,
                              alb_error *error);
