// alabaster render --method shadow: all frames of a scene.
#pragma once
#include "base/error.h"
#include <stdbool.h>

// picture and png (may be NULL: beside the picture) have a run of # for the frame's number where the scene has more
// than one. stated_percent (may be NULL) is the text of --error. mesh must be NULL: ALB_USAGE.
bool alb_shadow_render(const char *scene_path, const char *picture, const char *png, const char *mesh,
                       const char *stated_percent, bool json, alb_error *error);
