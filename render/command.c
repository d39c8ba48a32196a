// alabaster render: scene in, picture out.
#include "base/command.h"
#include "render/radiosity_command.h"
#include "render/shadow_command.h"
#include <string.h>

static bool run(int argc, char **argv, alb_error *error)
{
    alb_picture_files files = {0};
    const char *stated = NULL, *method = NULL;
    bool json = false;
    double percent = 0;
    const alb_option options[] = {
        {.label = "SCENE.json", .required = true, .value = &files.scene},
        {.name = "-o", .required = true, .value = &files.picture},
        {.name = "--mesh", .value = &files.mesh},
        {.name = "--png", .value = &files.png},
        {.name = "--error", .value = &stated},
        {.name = "--method", .value = &method},
        {.name = "--json", .flag = &json},
    };
    if (!alb_options_read(options, sizeof options / sizeof *options, argc, argv, error))
        return false;
    if (method && !strcmp(method, "shadow"))
        return alb_shadow_render(files.scene, files.picture, files.png, files.mesh, stated, json, error);
    if (method && strcmp(method, "radiosity") != 0)
        return alb_fail(error, ALB_USAGE, "--method %s: there are radiosity and shadow", method);
    return (!stated || alb_option_number(&percent, "--error", stated, 0.01, 100, error)) &&
           alb_radiosity_render(&files, percent, json, error);
}

const alb_command alb_render_command = {
    .name = "render",
    .summary = "render a scene of translucent and opaque meshes",
    .usage =
        "alabaster render SCENE.json -o PICTURE.exr [--png PICTURE.png] [--mesh OUT.ply] [--error PERCENT]\n"
        "                 [--method radiosity|shadow] [--json]\n"
        "\n"
        "Solves B = (I - S F)^-1 (S E + M) on the scene's meshes and writes linear radiance as EXR and, beside it,\n"
        "a PNG whose exposure shows the brightest hundredth of what is lit at 0.9.\n"
        "  -o PICTURE.exr     the picture: channels R, G, B\n"
        "  --png PICTURE.png  where the PNG goes instead of PICTURE.png\n"
        "  --mesh OUT.ply     the mesh with the radiosity of each face (red, green, blue, float)\n"
        "  --error PERCENT    rays until the irradiance by rays errs by no more than this, rms; for error_percent\n"
        "  --json             patches, rays, links, products, residual, stated error, row sums, balance of flux,\n"
        "                     and the seconds and bytes of each stage; of a sequence a list of these, \"frames\"\n"
        "  --method shadow    soft shadows of moving objects by shadow fields instead, diffuse, without bounces;\n"
        "                     --error: the cheapest setting whose stated error is no more\n"
        "Of a scene with \"frames\" every frame is rendered; a run of # in the names of files becomes the frame's "
        "number.\n"
        "Frames that differ in their lights alone are solved with the form factors and the scattering of the first.\n"
        "The scene file is described in render/scene.h.\n",
    .run = run,
};
