// What of the patches lies buried: inside other bodies, beyond the walls of a room, flush on another face.
#pragma once
#include "render/patch.h"
#include "render/tracer.h"

// Sets free_cells and culled and takes the buried parts off the areas, where there are any; a patch that is buried
// altogether keeps a trace of its area. Fails for want of memory alone.
bool alb_patches_cull(alb_patches *patches, const alb_tracer *tracer, alb_error *error);
