// alabaster render: scene in, picture out.
#include "base/command.h"
#include "base/exr.h"
#include "base/memory.h"
#include "base/progress.h"
#include "render/shadow_command.h"
#include "render/solution.h"
#include "render/view.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct outputs {
    const char *scene, *picture, *mesh, *png;
    bool json;
} outputs;

// --png, or the picture's path with .png for its ending.
static bool png_path(char path[ALB_PATH_SIZE], const outputs *out, alb_error *error)
{
    const size_t length = strlen(out->picture),
                 stem = length >= 4 && !strcmp(out->picture + length - 4, ".exr") ? length - 4 : length;
    const char *name = alb_path_name(out->picture);
    const int written = out->png ? snprintf(path, ALB_PATH_SIZE, "%s", out->png)
                                 : snprintf(path, ALB_PATH_SIZE, "%.*s.png", (int)stem, out->picture);
    if (written >= ALB_PATH_SIZE)
        return alb_fail(error, ALB_USAGE, "%s: the path is too long", name);
    return true;
}

// Minutes of work should not end at a path that cannot be written, nor one output replace another or the scene.
static bool check_targets(const outputs *out, alb_error *error)
{
    char png[ALB_PATH_SIZE];
    if (!png_path(png, out, error))
        return false;
    const char *const paths[] = {out->scene, out->picture, png, out->mesh};
    for (int i = 1; i < 4 && paths[i]; i++) {
        for (int k = 0; k < i; k++)
            if (alb_file_same(paths[i], paths[k]))
                return alb_fail(error, ALB_USAGE, "%s is given for two files; give each its own", paths[i]);
        if (!alb_file_check_target(paths[i], error))
            return false;
    }
    return true;
}

static bool write_mesh(const char *path, const alb_solution *solution, const alb_provenance *provenance,
                       alb_error *error)
{
    const size_t n = solution->patches.count;
    char comment[256];
    float(*rgb)[3] = alb_allocate(n, sizeof *rgb, error);
    if (!rgb)
        return false;
    for (size_t p = 0; p < n; p++)
        for (int c = 0; c < 3; c++)
            rgb[p][c] = (float)solution->radiosity[p][c];
    snprintf(comment, sizeof comment, "alabaster render: radiosity per face; scene sha256 %s",
             provenance->inputs[0].sha256);
    const bool ok = alb_mesh_write_ply(solution->patches.mesh, (const float(*)[3])rgb, comment, path, error);
    free(rgb);
    return ok;
}

static bool write_picture(const outputs *out, const alb_image *picture, double brightest,
                          const alb_provenance *provenance, double *exposure, alb_error *error)
{
    char png[ALB_PATH_SIZE];
    alb_json json;
    alb_json_begin(&json, provenance);
    alb_json_end_object(&json);
    const bool ok = (!json.text.failed || alb_fail(error, ALB_NO_MEMORY, "out of memory for the provenance")) &&
                    png_path(png, out, error) && alb_view_exposure(exposure, picture, brightest, error) &&
                    alb_exr_write(picture, json.text.bytes, out->picture, error) &&
                    alb_image_write_png(picture, *exposure, png, error);
    alb_json_free(&json);
    return ok;
}

static void warn(const alb_scene *scene, const alb_solution *s)
{
    size_t open = 0;
    if (scene->mesh.dropped)
        fprintf(stderr, "render: %zu faces left out: no area, or there twice\n", scene->mesh.dropped);
    if (scene->mesh.turned)
        fprintf(stderr, "render: %zu faces turned over: they faced against their neighbours\n", scene->mesh.turned);
    if (s->patches.culled)
        fprintf(stderr, "render: %zu patches lie inside other bodies or walls, in whole or in part: left out there\n",
                s->patches.culled);
    if (s->factors.back_rays)
        fprintf(stderr,
                "render: %.2f %% of the rays between patches meet the back of a patch, which is black; is a mesh open "
                "or turned?\n",
                100.0 * (double)s->factors.back_rays / (double)alb_hit_rows_rays(&s->factors.rows));
    for (size_t b = 0; b < s->scatter.body_count; b++)
        open += !s->scatter.bodies[b].closed;
    if (open)
        fprintf(stderr,
                "render: %zu translucent bodies are not closed; light paths inside them are taken as straight\n", open);
    alb_scatter_note(stderr, "render: ", &s->scatter);
    if (s->column_sum > 1)
        fprintf(stderr, "render: the mesh is coarse for its scattering: a patch gives back %.4f of its flux\n",
                s->column_sum);
}

static bool print_json(const alb_scene *scene, const alb_solution *s, double view_s, double exposure, alb_error *error)
{
    alb_json json;
    double imbalance[3];
    const alb_balance *b = &s->balance;
    for (int c = 0; c < 3; c++)
        imbalance[c] = b->in[c] > 0 ? (b->in[c] - b->absorbed[c] - b->escaped[c] - b->lost[c]) / b->in[c] : 0;
    alb_json_begin(&json, NULL);
    alb_json_integer(&json, "patches", (long)s->patches.count);
    alb_json_integer(&json, "dropped_faces", (long)scene->mesh.dropped);
    alb_json_integer(&json, "turned_faces", (long)scene->mesh.turned);
    alb_json_integer(&json, "culled_patches", (long)s->patches.culled);
    alb_json_integer(&json, "rays_per_patch", s->factors.rays);
    alb_json_integer(&json, "rays", (long)alb_hit_rows_rays(&s->factors.rows));
    alb_json_integer(&json, "rays_cast_again", (long)s->factors.reshot_rays);
    alb_json_integer(&json, "links", (long)s->scatter.link_count);
    alb_json_integer(&json, "iterations", s->report.iterations);
    alb_json_number(&json, "residual", s->report.residual);
    alb_json_number(&json, "radiosity_bound_percent", 100 * s->bound);
    alb_json_number(&json, "rays_error_percent", s->rays_error_percent);
    alb_json_number(&json, "stated_error_percent", s->stated_error_percent);
    alb_json_number(&json, "largest_row_sum", s->row_sum);
    alb_json_number(&json, "largest_column_sum", s->column_sum);
    alb_json_object(&json, "flux");
    alb_json_numbers(&json, "in", b->in, 3);
    alb_json_numbers(&json, "absorbed", b->absorbed, 3);
    alb_json_numbers(&json, "escaped", b->escaped, 3);
    alb_json_numbers(&json, "lost_on_backs", b->lost, 3);
    alb_json_numbers(&json, "relative_imbalance", imbalance, 3);
    alb_json_end_object(&json);
    alb_json_object(&json, "seconds");
    for (int i = 0; i < ALB_STAGES; i++)
        alb_json_number(&json, alb_stage_names[i], s->seconds[i]);
    alb_json_number(&json, "view", view_s);
    alb_json_end_object(&json);
    alb_json_object(&json, "bytes");
    for (int i = 0; i < ALB_STAGES; i++)
        alb_json_integer(&json, alb_stage_names[i], (long)s->bytes[i]);
    alb_json_end_object(&json);
    alb_json_number(&json, "png_exposure", exposure);
    return alb_json_print(&json, error);
}

static bool report(const outputs *out, const alb_scene *scene, const alb_solution *s, double view_s, double exposure,
                   alb_error *error)
{
    double total_s = view_s;
    for (int i = 0; i < ALB_STAGES; i++)
        total_s += s->seconds[i];
    if (out->json)
        return print_json(scene, s, view_s, exposure, error);
    printf("%s: %zu patches, %d products to residual %.1e, stated error %.2f %%, largest row sum %.4f, %.1f s\n",
           out->picture, s->patches.count, s->report.iterations, s->report.residual, s->stated_error_percent,
           s->row_sum, total_s);
    return true;
}

static bool render(const outputs *out, alb_scene *scene, alb_provenance *provenance, alb_error *error)
{
    alb_solution solution = {0};
    alb_image picture = {0};
    double exposure = 1;
    bool ok = false;
    if (!alb_solution_create(&solution, scene, error))
        goto done;
    warn(scene, &solution);
    const double start_s = alb_clock_s();
    if (!alb_view_render(&picture, scene, &solution, error))
        goto done;
    const double view_s = alb_clock_s() - start_s;
    ok = write_picture(out, &picture, alb_view_brightest(scene, &solution), provenance, &exposure, error) &&
         (!out->mesh || write_mesh(out->mesh, &solution, provenance, error)) &&
         report(out, scene, &solution, view_s, exposure, error);
done:
    alb_image_free(&picture);
    alb_solution_free(&solution);
    return ok;
}

static bool run(int argc, char **argv, alb_error *error)
{
    outputs out = {0};
    const char *stated = NULL, *method = NULL;
    const alb_option options[] = {
        {.label = "SCENE.json", .required = true, .value = &out.scene},
        {.name = "-o", .required = true, .value = &out.picture},
        {.name = "--mesh", .value = &out.mesh},
        {.name = "--png", .value = &out.png},
        {.name = "--error", .value = &stated},
        {.name = "--method", .value = &method},
        {.name = "--json", .flag = &out.json},
    };
    alb_scene scene = {0};
    alb_provenance provenance = {.command = "render"};
    if (!alb_options_read(options, sizeof options / sizeof *options, argc, argv, error))
        return false;
    if (method && !strcmp(method, "shadow"))
        return alb_shadow_render(out.scene, out.picture, out.png, out.mesh, stated, out.json, error);
    if (method && strcmp(method, "radiosity") != 0)
        return alb_fail(error, ALB_USAGE, "--method %s: there are radiosity and shadow", method);
    if (!check_targets(&out, error) || !alb_scene_read(&scene, &provenance, out.scene, error))
        return false;
    double percent = 0;
    const bool given = !stated || alb_option_number(&percent, "--error", stated, 0.01, 100, error);
    if (given && stated)
        alb_scene_ask_error(&scene, percent);
    snprintf(provenance.options, sizeof provenance.options,
             "rays_per_patch %d, error_percent %g, residual %g, seed %llu", scene.rays_per_patch, scene.error_percent,
             scene.residual, (unsigned long long)scene.seed);
    const bool ok = given && render(&out, &scene, &provenance, error);
    alb_scene_free(&scene);
    return ok;
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
        "                     and the seconds and bytes of each stage\n"
        "  --method shadow    soft shadows of moving objects by shadow fields instead, diffuse, without bounces: "
        "every\n"
        "                     frame of the scene; a run of # in the names of pictures becomes the frame's number;\n"
        "                     --error: the cheapest setting whose stated error is no more\n"
        "The scene file is described in render/scene.h.\n",
    .run = run,
};
