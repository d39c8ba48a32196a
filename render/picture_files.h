// The files that a command leaves for each frame of a scene: a picture, a PNG of it, and perhaps a mesh.
#pragma once
#include "base/file.h"
#include "base/image.h"
#include "base/json.h"

// As the user wrote them. Where the scene has more than one frame each has a run of # for the frame's number.
typedef struct alb_picture_files {
    const char *scene, *picture;
    const char *png;  // NULL: the picture's path with .png for its ending
    const char *mesh; // NULL: none
} alb_picture_files;

typedef struct alb_frame_files {
    char picture[ALB_PATH_SIZE], png[ALB_PATH_SIZE], mesh[ALB_PATH_SIZE]; // mesh "": none
} alb_frame_files;

// The names of one of so many frames. Fails where several frames would share a file, two outputs would be one file or
// one the scene's, a path is too long or does not end in .exr, .png and .ply, or a file could not be written there:
// before the work that makes it.
bool alb_frame_files_name(alb_frame_files *out, const alb_picture_files *files, int frame, int frames,
                          alb_error *error);
// The picture with where it comes from, and its PNG at the exposure.
bool alb_frame_files_write(const alb_frame_files *files, const alb_image *picture, double exposure,
                           const alb_provenance *provenance, alb_error *error);
