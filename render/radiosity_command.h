// alabaster render --method radiosity: all frames of a scene.
#pragma once
#include "render/picture_files.h"

// error_percent: as the scene's, 0 for what the scene says. A frame whose meshes and materials are those of the frame
// before is solved under its own lights with the form factors and the scattering that are there, as long as
// error_percent holds. A frame that fails leaves the pictures of those before.
bool alb_radiosity_render(const alb_picture_files *files, double error_percent, bool json, alb_error *error);
