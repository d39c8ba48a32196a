// Objects cut out of a scene, and what their faces send.
#pragma once
#include "render/scene.h"

// Appends to an empty mesh all vertices of the scene and the faces of the objects o with chosen[o]; *radiance of each
// of those, to be freed; NULL: not wanted. On failure too what is there is to be freed.
bool alb_shadow_cut(alb_mesh *out, float (**radiance)[3], const alb_scene *scene, const bool *chosen, alb_error *error);
// The same of one object, with its own vertices alone, which count from zero.
bool alb_shadow_cut_one(alb_mesh *out, float (**radiance)[3], const alb_scene *scene, const alb_object *object,
                        alb_error *error);
