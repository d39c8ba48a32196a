// One scattering body, from its patches and what they are made of.
#pragma once
#include "render/scatter.h"

bool alb_scatter_body_create(alb_scatter_body *body, const alb_body *from, const alb_patches *patches,
                             const alb_surface *surface, alb_error *error);
void alb_scatter_body_free(alb_scatter_body *body);
