// What a stage keeps from frame to frame. Internal to render/shadow_stage.c.
#pragma once
#include "render/shadow_stage.h"

// Fields, emitters, surfaces, glimpses and transport of the scene's objects, its normals and the tables they need, for
// a stage without fields whose skies are read. False, for want of memory or as its parts fail, leaves what
// alb_shadow_stage_free can release.
bool alb_shadow_stage_create_fields(alb_shadow_stage *stage, const alb_scene *scene, alb_error *error);
// Of every vertex, the mean over its faces by area; +z where there is none.
void alb_shadow_stage_set_normals(alb_shadow_stage *stage, const alb_mesh *mesh);
