// Minutes of work should not end at a path that cannot be written, nor one output replace another or the scene.
#include "render/picture_files.h"
#include "base/exr.h"
#include "render/scene.h"
#include <stdio.h>
#include <string.h>
#include <strings.h>

static bool name_one(char out[ALB_PATH_SIZE], const char *name, int frame, int frames, alb_error *error)
{
    if (frames > 1 && !strchr(name, '#'))
        return alb_fail(error, ALB_USAGE, "%s is one file for %d frames; put #### where their numbers should stand",
                        name, frames);
    if (frames > 1)
        return alb_scene_frame_name(out, name, frame, error);
    return snprintf(out, ALB_PATH_SIZE, "%s", name) < ALB_PATH_SIZE ||
           alb_fail(error, ALB_USAGE, "%.80s: the path is too long", name);
}

static bool ends_in(const char *name, const char *ending)
{
    const size_t length = strlen(name), tail = strlen(ending);
    return length > tail && !strcasecmp(name + length - tail, ending);
}

static bool name_png(char out[ALB_PATH_SIZE], const char *picture, alb_error *error)
{
    const size_t stem = strlen(picture) - (ends_in(picture, ".exr") ? 4 : 0);
    return snprintf(out, ALB_PATH_SIZE, "%.*s.png", (int)stem, picture) < ALB_PATH_SIZE ||
           alb_fail(error, ALB_USAGE, "%.80s: the path is too long", picture);
}

bool alb_frame_files_name(alb_frame_files *out, const alb_picture_files *files, int frame, int frames, alb_error *error)
{
    out->mesh[0] = '\0';
    if (!name_one(out->picture, files->picture, frame, frames, error) ||
        !(files->png ? name_one(out->png, files->png, frame, frames, error)
                     : name_png(out->png, out->picture, error)) ||
        (files->mesh && !name_one(out->mesh, files->mesh, frame, frames, error)))
        return false;
    const char *const paths[] = {files->scene, out->picture, out->png, out->mesh};
    static const char *const endings[] = {".json", ".exr", ".png", ".ply"};
    for (int i = 1; i < (files->mesh ? 4 : 3); i++) {
        for (int k = 0; k < i; k++)
            if (alb_file_same(paths[i], paths[k]))
                return alb_fail(error, ALB_USAGE, "%s is given for two files; give each its own", paths[i]);
        if (!alb_file_check_target(paths[i], error))
            return false;
        if (!ends_in(paths[i], endings[i]))
            return alb_fail(error, ALB_USAGE, "%s: what is written there is a %s file; give it that ending", paths[i],
                            endings[i]);
    }
    return true;
}

bool alb_frame_files_write(const alb_frame_files *files, const alb_image *picture, double exposure,
                           const alb_provenance *provenance, alb_error *error)
{
    alb_json json;
    alb_json_begin(&json, provenance);
    alb_json_end_object(&json);
    const bool ok = (!json.text.failed || alb_fail(error, ALB_NO_MEMORY, "out of memory for the provenance")) &&
                    alb_exr_write(picture, json.text.bytes, files->picture, error) &&
                    alb_image_write_png(picture, exposure, files->png, error);
    alb_json_free(&json);
    return ok;
}
