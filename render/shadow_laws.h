// The scaling laws that lighting by shadow fields needs, as tables for batches.
#pragma once
#include "render/sh_scale_batch.h"

enum { ALB_SHADOW_ORDER = 4, ALB_SHADOW_VALUES = ALB_SHADOW_ORDER * ALB_SHADOW_ORDER }; // of a receiver

typedef struct alb_shadow_laws {
    alb_sh_batch outer; // occlusion from nodes that have all of the object in front of them
    alb_sh_batch far;   // the same from the far shell, from order ALB_SH_ORDER_MAX
    alb_sh_batch inner; // occlusion from nodes that have it all around
    alb_sh_batch light; // a light's radiance, order 4
    alb_sh_batch sky;   // radiance of an environment of finite size, from order ALB_SH_ORDER_MAX
} alb_shadow_laws;

// order: of the occluders' samples. paper: occlusion scaled as printed, of which from afar a constant remains; else
// windowed.
bool alb_shadow_laws_create(alb_shadow_laws *laws, int order, bool paper, alb_error *error);
void alb_shadow_laws_free(alb_shadow_laws *laws);
