// SCENE.json -> alb_scene: its frame, lights, camera and settings; materials and objects in files of their own.
#include "base/memory.h"
#include "calibrate/calibration.h"
#include "render/scene_reader.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void alb_scene_free(alb_scene *scene)
{
    alb_mesh_free(&scene->mesh);
    for (size_t i = 0; i < scene->light_count; i++)
        alb_light_free(&scene->lights[i]);
    free(scene->lights);
    for (size_t i = 0; i < scene->surface_count; i++)
        for (int k = 0; k < 3 * ALB_SIDES; k++)
            alb_profile_free(&scene->surfaces[i].profiles[k / 3][k % 3]);
    free(scene->surfaces);
    free(scene->objects);
    *scene = (alb_scene){0};
}

bool alb_scene_frame_name(char out[ALB_PATH_SIZE], const char *name, int frame, alb_error *error)
{
    size_t length = 0;
    for (const char *at = name; *at && length < ALB_PATH_SIZE;) {
        const size_t digits = strspn(at, "#");
        if (digits) {
            const int written = snprintf(out + length, ALB_PATH_SIZE - length, "%0*d", (int)digits, frame);
            length += (size_t)written;
            at += digits;
        } else
            out[length++] = *at++;
    }
    if (length >= ALB_PATH_SIZE)
        return alb_fail(error, ALB_BAD_DATA, "%.80s: the path of frame %d is too long", name, frame);
    out[length] = '\0';
    return true;
}

// A file the scene refers to: its path, entered in the provenance.
bool alb_scene_input(char path[ALB_PATH_SIZE], alb_scene_reader *in, alb_node node, const char *key)
{
    const char *name;
    char framed[ALB_PATH_SIZE];
    return alb_node_text(&name, node, key, in->error) &&
           (in->scene->frames < 2 || alb_scene_frame_name(framed, name, in->frame, in->error)) &&
           alb_path_join(path, in->folder, in->scene->frames < 2 ? name : framed, in->error) &&
           alb_provenance_add(in->provenance, path, in->error);
}

bool alb_scene_vector(alb_vector *out, alb_node node, const char *key, alb_error *error)
{
    double v[3];
    if (!alb_node_numbers(v, 3, node, key, -ALB_SCENE_LONGEST_MM, ALB_SCENE_LONGEST_MM, error))
        return false;
    *out = (alb_vector){v[0], v[1], v[2]};
    return true;
}

static bool read_direction(alb_vector *out, alb_node node, const char *key, alb_error *error)
{
    if (!alb_scene_vector(out, node, key, error))
        return false;
    *out = alb_unit(*out);
    return alb_length(*out) > 0 || alb_node_fail(error, node, key, "a direction of length zero");
}

static bool read_environment(alb_light *light, alb_scene_reader *in, alb_node node)
{
    char path[ALB_PATH_SIZE];
    if (!alb_node_allow(node, "kind radiance file centre_mm radius_mm", in->error) ||
        (alb_node_has(node, "radius_mm") &&
         (!alb_node_number(&light->radius_mm, node, "radius_mm", 1e-6, ALB_SCENE_LONGEST_MM, in->error) ||
          !alb_scene_vector(&light->position_mm, node, "centre_mm", in->error))))
        return false;
    if (!alb_node_has(node, "file"))
        return alb_node_numbers(light->radiance, 3, node, "radiance", 0, 1e12, in->error);
    if (alb_node_has(node, "radiance"))
        return alb_node_fail(in->error, node, "radiance", "give a radiance or a file, not both");
    if (!alb_scene_input(path, in, node, "file") || !alb_image_read(&light->map, NULL, path, in->error))
        return false;
    const size_t values = (size_t)light->map.width * (size_t)light->map.height * (size_t)light->map.channels;
    for (size_t i = 0; i < values; i++)
        if (!(light->map.pixels[i] >= 0 && light->map.pixels[i] < INFINITY))
            return alb_node_fail(in->error, node, "file", "%s holds radiance that is negative or not finite", path);
    return true;
}

static bool read_beam(alb_light *light, alb_node node, alb_error *error)
{
    if (light->kind == ALB_LIGHT_SPOT)
        return alb_node_allow(node, "kind flux position_mm direction half_angle_deg", error) &&
               alb_scene_vector(&light->position_mm, node, "position_mm", error) &&
               read_direction(&light->direction, node, "direction", error) &&
               alb_node_number(&light->half_angle_deg, node, "half_angle_deg", 1e-3, 90, error);
    const bool pixels = alb_node_has(node, "pixel_mm");
    return alb_node_allow(node,
                          pixels ? "kind flux centre_mm direction blur_sd_mm pixel_mm diameter_px"
                                 : "kind flux centre_mm direction blur_sd_mm diameter_mm",
                          error) &&
           alb_scene_vector(&light->position_mm, node, "centre_mm", error) &&
           read_direction(&light->direction, node, "direction", error) &&
           (!alb_node_has(node, "blur_sd_mm") ||
            alb_node_number(&light->blur_sd_mm, node, "blur_sd_mm", 0, 1e4, error)) &&
           (pixels ? alb_node_number(&light->pixel_mm, node, "pixel_mm", 1e-6, 1e4, error) &&
                         alb_node_number(&light->diameter_px, node, "diameter_px", 1, 1000, error)
                   : alb_node_number(&light->diameter_mm, node, "diameter_mm", 0, ALB_SCENE_LONGEST_MM, error));
}

static bool read_light(alb_light *light, alb_scene_reader *in, alb_node node)
{
    int kind;
    if (!alb_node_choice(&kind, node, "kind", alb_light_names, ALB_LIGHTS, in->error))
        return false;
    light->kind = (alb_light_kind)kind;
    if (light->kind == ALB_LIGHT_ENVIRONMENT)
        return read_environment(light, in, node);
    if (!alb_node_numbers(light->flux, 3, node, "flux", 0, 1e12, in->error))
        return false;
    if (light->kind == ALB_LIGHT_POINT)
        return alb_node_allow(node, "kind flux position_mm", in->error) &&
               alb_scene_vector(&light->position_mm, node, "position_mm", in->error);
    return read_beam(light, node, in->error);
}

static bool read_light_list(alb_scene_reader *in, alb_node root)
{
    alb_node list, node;
    size_t count = 0;
    if (!alb_node_list(&list, &count, root, "lights", in->error))
        return false;
    if (count > ALB_LIGHTS_MAX)
        return alb_node_fail(in->error, root, "lights", "%zu lights; at most %d", count, ALB_LIGHTS_MAX);
    if (!(in->scene->lights = alb_allocate(count, sizeof *in->scene->lights, in->error)))
        return false;
    in->scene->light_count = count;
    for (size_t i = 0; i < count; i++)
        if (!alb_node_item_object(&node, list, i, in->error) || !read_light(&in->scene->lights[i], in, node))
            return false;
    return true;
}

// In the scene, or in a file of their own: {"format": 1, "lights": [...]}, whose paths are relative to it.
static bool read_lights(alb_scene_reader *in, alb_node root)
{
    char path[ALB_PATH_SIZE], folder[ALB_PATH_SIZE];
    alb_scene_reader apart = *in;
    alb_node top;
    if (!alb_node_has(root, "lights"))
        return true;
    if (!alb_node_is_text(root, "lights"))
        return read_light_list(in, root);
    apart.folder = folder;
    if (!alb_scene_input(path, in, root, "lights") || !alb_path_folder(folder, path, in->error))
        return false;
    alb_record *record = alb_record_read(path, in->error);
    const bool ok = record && alb_record_root(&top, record, in->error) &&
                    alb_node_allow(top, "format lights", in->error) && read_light_list(&apart, top);
    alb_record_free(record);
    return ok;
}

static bool read_calibrated(alb_scene_reader *in, alb_node node)
{
    const char *session;
    char folder[ALB_PATH_SIZE], path[ALB_PATH_SIZE];
    int side = 0;
    alb_calibration *calibration = alb_allocate(1, sizeof *calibration, in->error);
    bool ok = calibration && alb_node_allow(node, "calibration side", in->error) &&
              alb_node_text(&session, node, "calibration", in->error) &&
              alb_node_choice(&side, node, "side", alb_side_names, ALB_SIDES, in->error) &&
              alb_path_join(folder, in->folder, session, in->error) &&
              alb_calibration_read(calibration, folder, in->error) &&
              alb_path_join(path, folder, "calibration.json", in->error) &&
              alb_provenance_add(in->provenance, path, in->error);
    if (ok && !calibration->views[side].known)
        ok = alb_node_fail(in->error, node, "side", "the session has no pose of the camera for %s",
                           alb_side_names[side]);
    if (ok)
        in->scene->camera = calibration->views[side].camera;
    free(calibration);
    return ok;
}

static bool read_camera(alb_scene_reader *in, alb_node root)
{
    alb_node node;
    alb_vector position, target, up;
    double field;
    long width, height;
    if (!alb_node_object(&node, root, "camera", in->error))
        return false;
    if (alb_node_has(node, "calibration"))
        return read_calibrated(in, node);
    if (!alb_node_allow(node, "position_mm look_at_mm up vertical_field_deg width height", in->error) ||
        !alb_scene_vector(&position, node, "position_mm", in->error) ||
        !alb_scene_vector(&target, node, "look_at_mm", in->error) || !read_direction(&up, node, "up", in->error) ||
        !alb_node_number(&field, node, "vertical_field_deg", 0.01, 170, in->error) ||
        !alb_node_integer(&width, node, "width", 1, 16384, in->error) ||
        !alb_node_integer(&height, node, "height", 1, 16384, in->error))
        return false;
    const alb_vector forward = alb_unit(alb_sub(target, position));
    if (alb_length(alb_cross(forward, up)) < 1e-6)
        return alb_node_fail(in->error, node, "up", "the camera looks along its own up, or at itself");
    in->scene->camera = alb_camera_look_at(position, target, up, field, (int)width, (int)height);
    return true;
}

void alb_scene_ask_error(alb_scene *scene, double percent)
{
    scene->error_percent = percent;
    if (!scene->rays_given)
        scene->rays_per_patch = ALB_RAYS_REFINED_FROM;
}

static bool read_settings(alb_scene *scene, alb_node root, alb_error *error)
{
    long rays = 256, seed = 1, memory_mb = 4096, frames = 1;
    scene->residual = 1e-4;
    scene->rays_given = alb_node_has(root, "rays_per_patch");
    if ((alb_node_has(root, "error_percent") &&
         !alb_node_number(&scene->error_percent, root, "error_percent", 0.01, 100, error)) ||
        (alb_node_has(root, "memory_mb") && !alb_node_integer(&memory_mb, root, "memory_mb", 1, 1L << 24, error)) ||
        (scene->rays_given && !alb_node_integer(&rays, root, "rays_per_patch", 2, 65536, error)) ||
        (alb_node_has(root, "frames") && !alb_node_integer(&frames, root, "frames", 1, ALB_FRAMES_MAX, error)) ||
        (alb_node_has(root, "seed") && !alb_node_integer(&seed, root, "seed", 0, 0x7fffffff, error)) ||
        (alb_node_has(root, "residual") && !alb_node_number(&scene->residual, root, "residual", 1e-12, 0.1, error)))
        return false;
    scene->rays_per_patch = (int)rays;
    if (scene->error_percent > 0)
        alb_scene_ask_error(scene, scene->error_percent);
    scene->memory_bytes = (size_t)memory_mb << 20;
    scene->seed = (uint64_t)seed;
    scene->frames = (int)frames;
    return true;
}

bool alb_scene_read(alb_scene *scene, alb_provenance *provenance, const char *path, alb_error *error)
{
    return alb_scene_read_frame(scene, provenance, path, 0, error);
}

bool alb_scene_read_frame(alb_scene *scene, alb_provenance *provenance, const char *path, int frame, alb_error *error)
{
    char folder[ALB_PATH_SIZE];
    alb_node root;
    alb_scene_reader in = {scene, provenance, folder, frame, error};
    *scene = (alb_scene){0};
    if (!alb_path_folder(folder, path, error))
        return false;
    alb_record *record = alb_record_read(path, error);
    const bool ok =
        record && alb_provenance_add(provenance, path, error) && alb_record_root(&root, record, error) &&
        alb_node_allow(root,
                       "format objects materials lights camera rays_per_patch error_percent memory_mb residual seed "
                       "frames",
                       error) &&
        read_settings(scene, root, error) && alb_scene_read_surfaces(&in, root) && alb_scene_read_objects(&in, root) &&
        (scene->body_inputs = provenance->input_count) && read_lights(&in, root) && read_camera(&in, root);
    alb_record_free(record);
    if (!ok)
        alb_scene_free(scene);
    return ok;
}
