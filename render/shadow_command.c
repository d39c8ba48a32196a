// Each frame: scene in, fields sampled, vertices lit, picture out. Fields and the pictures' exposure are kept from
// frame to frame, so that neither bounding spheres nor brightness flicker.
#include "render/shadow_command.h"
#include "base/command.h"
#include "base/progress.h"
#include "render/picture_files.h"
#include "render/shadow_advisor.h"
#include "render/shadow_picture.h"
#include "render/view.h"
#include <math.h>
#include <stdio.h>

typedef struct sequence {
    alb_picture_files to;
    alb_shadow_stage stage;
    double exposure, wanted_percent; // 0: none yet, none stated
    alb_shadow_verdict verdict;
    double small_share;
    double transport_s;                 // once
    double sampling_s, light_s, view_s; // of all frames
    int frames;
} sequence;

static bool write_frame(sequence *s, const alb_scene *scene, const alb_provenance *provenance,
                        const alb_frame_files *files, alb_error *error)
{
    alb_image picture = {0};
    double brightest;
    bool ok = alb_shadow_view(&picture, &brightest, scene, &s->stage, error);
    if (ok && !(s->exposure > 0))
        ok = alb_view_exposure(&s->exposure, &picture, brightest, error);
    ok = ok && alb_frame_files_write(files, &picture, s->exposure, provenance, error);
    alb_image_free(&picture);
    return ok;
}

// The first frame's error is measured; it stands for the others, whose settings are the same.
static bool light_first(sequence *s, const alb_scene *scene, alb_error *error)
{
    if (s->wanted_percent > 0) {
        if (!alb_shadow_advise(&s->stage, &s->verdict, scene, s->wanted_percent, scene->seed, error))
            return false;
    } else if (!alb_shadow_stage_light(&s->stage, scene, error))
        return false;
    const alb_shadow_world world = alb_shadow_stage_world(&s->stage);
    s->small_share = alb_shadow_small_lights(&world, scene->mesh.vertices, s->stage.normals, scene->mesh.vertex_count);
    if (s->small_share > 0)
        fprintf(stderr,
                "render: from %.0f %% of the vertices a light is less than %d degrees in half-angle: the edges of its "
                "shadows are blurred\n",
                100 * s->small_share, ALB_SHADOW_SMALL_DEG);
    return alb_shadow_error(&s->verdict, &s->stage, scene, scene->seed, error);
}

static bool render_frame(sequence *s, int frame, alb_error *error)
{
    alb_scene scene;
    alb_frame_files files;
    alb_provenance provenance = {.command = "render"};
    if (!alb_scene_read_frame(&scene, &provenance, s->to.scene, frame, error))
        return false;
    snprintf(provenance.options, sizeof provenance.options,
             "method shadow, frame %d of %d, error_percent %g, seed %llu", frame, scene.frames, s->wanted_percent,
             (unsigned long long)scene.seed);
    bool ok = alb_frame_files_name(&files, &s->to, frame, scene.frames, error);
    ok = ok && (frame ? alb_shadow_stage_light(&s->stage, &scene, error) : light_first(s, &scene, error));
    const double start_s = alb_clock_s();
    ok = ok && write_frame(s, &scene, &provenance, &files, error);
    s->view_s += alb_clock_s() - start_s;
    s->transport_s = s->stage.transport_s;
    s->sampling_s += s->stage.sampling_s;
    s->light_s += s->stage.light_s;
    s->frames = scene.frames;
    alb_scene_free(&scene);
    return ok;
}

// Whether fields were the right choice.
static void print_choice(const sequence *s)
{
    const double frame_s = (s->sampling_s + s->light_s) / s->frames, times = s->verdict.rays_s / frame_s;
    if (!(times > 0))
        return;
    printf("rays of that error, %.0f a vertex, would take %.0f ms a frame: ", s->verdict.rays, 1e3 * s->verdict.rays_s);
    if (times > 1)
        printf("%.0f times as long\n", times);
    else
        printf("cast rays here, or render by radiosity\n");
}

static void print_report(const sequence *s)
{
    printf("%s: %d frames, %zu vertices, %zu occluders, ", s->to.picture, s->frames, s->stage.vertex_count,
           s->stage.occluder_count);
    if (isnan(s->verdict.percent))
        printf("nothing is lit where an error could be found");
    else if (s->verdict.percent == 0) // less than the random error of the rays that it is found by
        printf("stated error below %.2g %%", s->verdict.upper_percent);
    else
        printf("stated error %.2g %% (within %.2g %%)", s->verdict.percent, s->verdict.upper_percent);
    printf(", %.1f ms sampling and %.1f ms lighting a frame\n", 1e3 * s->sampling_s / s->frames,
           1e3 * s->light_s / s->frames);
    print_choice(s);
}

static bool print_json(const sequence *s, alb_error *error)
{
    const alb_shadow_stage *stage = &s->stage;
    const alb_shadow_settings *settings = stage->occluder_count ? &stage->fields[0].settings : &stage->settings;
    size_t bytes = 0;
    for (size_t k = 0; k < stage->occluder_count; k++)
        bytes += alb_shadow_field_bytes(&stage->fields[k]);
    alb_json json;
    alb_json_begin(&json, NULL);
    alb_json_integer(&json, "frames", s->frames);
    alb_json_integer(&json, "vertices", (long)s->stage.vertex_count);
    alb_json_integer(&json, "occluders", (long)s->stage.occluder_count);
    alb_json_integer(&json, "lights", (long)s->stage.light_count);
    alb_json_integer(&json, "transport_vertices", (long)s->stage.transport.row_count);
    alb_json_integer(&json, "translucent_vertices", (long)s->stage.transport.matrix_count);
    alb_json_integer(&json, "order", settings->order);
    alb_json_integer(&json, "cells", settings->cells);
    alb_json_integer(&json, "shells_outside", settings->outer);
    alb_json_integer(&json, "shells_inside", settings->inner);
    alb_json_boolean(&json, "samples_as_bytes", settings->packed);
    alb_json_integer(&json, "field_bytes", (long)bytes);
    alb_json_number(&json, "stated_error_percent", s->verdict.percent);
    alb_json_number(&json, "upper_error_percent", s->verdict.upper_percent);
    alb_json_number(&json, "rays_of_that_error", s->verdict.rays);
    alb_json_number(&json, "small_light_share", s->small_share);
    alb_json_object(&json, "seconds");
    alb_json_number(&json, "transport", s->transport_s);
    alb_json_number(&json, "rays_of_that_error", s->verdict.rays_s);
    alb_json_number(&json, "sampling", s->sampling_s);
    alb_json_number(&json, "lighting", s->light_s);
    alb_json_number(&json, "view", s->view_s);
    alb_json_end_object(&json);
    alb_json_number(&json, "png_exposure", s->exposure);
    return alb_json_print(&json, error);
}

bool alb_shadow_render(const char *scene_path, const char *picture, const char *png, const char *mesh,
                       const char *stated_percent, bool json, alb_error *error)
{
    sequence s = {.to = {.scene = scene_path, .picture = picture, .png = png},
                  .stage = {.settings = alb_shadow_defaults},
                  .frames = 1};
    alb_progress progress;
    if (mesh)
        return alb_fail(error, ALB_USAGE, "--mesh belongs to radiosity; the shadow method writes pictures alone");
    if (stated_percent && !alb_option_number(&s.wanted_percent, "--error", stated_percent, 0.01, 1000, error))
        return false;
    alb_progress_begin(&progress, "frames", 1);
    bool ok = true;
    for (int frame = 0; ok && frame < s.frames; frame++) {
        ok = render_frame(&s, frame, error);
        progress.total = s.frames;
        alb_progress_at(&progress, frame + 1);
    }
    alb_progress_end(&progress);
    if (ok && !json)
        print_report(&s);
    ok = ok && (!json || print_json(&s, error));
    alb_shadow_stage_free(&s.stage);
    return ok;
}
