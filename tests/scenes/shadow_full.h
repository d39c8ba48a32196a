// The fully sampled shadow field of Zhou et al. 2005 as a reference: sixteen shells at 0.2 to 8 radii, even in radius,
// linear between them, nothing scaled; those within 1.1 radii by rays. One occluder under skies.
#pragma once
#include "render/scene.h"
#include "render/shadow_light.h"

enum { SHADOW_FULL = 16 };

typedef struct shadow_full {
    alb_shadow_field shells[SHADOW_FULL];
} shadow_full;

// The faces of one object.
bool shadow_full_mesh(alb_mesh *mesh, const alb_scene *scene, const alb_object *object, alb_error *error);
bool shadow_full_create(shadow_full *full, const alb_mesh *mesh, alb_error *error);
bool shadow_full_sample(shadow_full *full, const alb_vector *vertices, alb_error *error);
void shadow_full_free(shadow_full *full);
// Irradiance of points, by the sum of cosine, visibility and sky as render/shadow_light.c has it. `law`: that of skies.
void shadow_full_light(float (*irradiance)[3], const shadow_full *full, const alb_shadow_sky *sky,
                       const alb_sh_batch *law, const alb_vector *points, const alb_vector *normals, size_t count);
