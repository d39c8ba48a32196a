// SCENE.json -> alb_scene. Materials first, so that objects can refer to them by name.
#include "render/scene.h"
#include "base/memory.h"
#include "base/record.h"
#include "calibrate/calibration.h"
#include "render/shape.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double huge_mm = 1e7;

typedef struct reader {
    alb_scene *scene;
    alb_provenance *provenance;
    const char *folder;
    alb_error *error;
} reader;

void alb_scene_free(alb_scene *scene)
{
    alb_mesh_free(&scene->mesh);
    for (size_t i = 0; i < scene->light_count; i++)
        alb_light_free(&scene->lights[i]);
    free(scene->lights);
    free(scene->surfaces);
    *scene = (alb_scene){0};
}

// A file the scene refers to: its path, entered in the provenance.
static bool input_path(char path[ALB_PATH_SIZE], reader *in, alb_node node, const char *key)
{
    const char *name;
    return alb_node_text(&name, node, key, in->error) && alb_path_join(path, in->folder, name, in->error) &&
           alb_provenance_add(in->provenance, path, in->error);
}

static bool read_vector(alb_vector *out, alb_node node, const char *key, alb_error *error)
{
    double v[3];
    if (!alb_node_numbers(v, 3, node, key, -huge_mm, huge_mm, error))
        return false;
    *out = (alb_vector){v[0], v[1], v[2]};
    return true;
}

static bool read_direction(alb_vector *out, alb_node node, const char *key, alb_error *error)
{
    if (!read_vector(out, node, key, error))
        return false;
    *out = alb_unit(*out);
    return alb_length(*out) > 0 || alb_node_fail(error, node, key, "a direction of length zero");
}

static bool read_slab_path(bool *slab, alb_node node, alb_error *error)
{
    const char *path = "solid";
    if (alb_node_has(node, "path") && !alb_node_text(&path, node, "path", error))
        return false;
    *slab = !strcmp(path, "slab");
    return *slab || !strcmp(path, "solid") ||
           alb_node_fail(error, node, "path", "'%s' is neither slab nor solid", path);
}

// The profile of a colour channel: by name, or the only one there is.
static const alb_profile *profile_of(const alb_material *material, alb_side side, int c)
{
    static const char *const names[3] = {"R", "G", "B"};
    for (int k = 0; k < material->channels; k++)
        if (material->channels == 1 || !strcmp(material->channel_names[k], names[c]))
            return &material->fitted[side][k].profile;
    return NULL;
}

static bool read_measured(alb_surface *surface, reader *in, alb_node node)
{
    char path[ALB_PATH_SIZE];
    alb_material material;
    if (!alb_node_allow(node, "measured path", in->error) || !input_path(path, in, node, "measured") ||
        !alb_material_read(&material, path, in->error) || !read_slab_path(&surface->slab, node, in->error))
        return false;
    surface->scatters = true;
    for (int side = 0; side <= (surface->slab ? ALB_TRANSMISSION : ALB_REFLECTION); side++)
        for (int c = 0; c < 3; c++) {
            const alb_profile *profile = profile_of(&material, (alb_side)side, c);
            if (!profile || profile->form == ALB_FORM_NONE)
                return alb_node_fail(in->error, node, "measured", "%s has no %s profile for channel %c%s", path,
                                     alb_side_names[side], "RGB"[c],
                                     side == ALB_TRANSMISSION ? "; \"path\": \"solid\" needs reflection alone" : "");
            surface->profiles[side][c] = *profile;
        }
    return true;
}

static bool read_dipole(alb_surface *surface, alb_node node, alb_error *error)
{
    alb_node dipole;
    double absorption[3], scattering[3], index;
    if (!alb_node_allow(node, "dipole", error) || !alb_node_object(&dipole, node, "dipole", error) ||
        !alb_node_allow(dipole, "absorption_per_mm reduced_scattering_per_mm refractive_index", error) ||
        !alb_node_numbers(absorption, 3, dipole, "absorption_per_mm", 1e-9, 1e4, error) ||
        !alb_node_numbers(scattering, 3, dipole, "reduced_scattering_per_mm", 1e-9, 1e4, error) ||
        !alb_node_number(&index, dipole, "refractive_index", 1, 3, error))
        return false;
    surface->scatters = true;
    for (int c = 0; c < 3; c++)
        surface->profiles[ALB_REFLECTION][c] =
            (alb_profile){.form = ALB_FORM_DIPOLE, .parameters = {absorption[c], scattering[c], index}};
    return true;
}

static bool read_surface(alb_surface *surface, reader *in, alb_node node)
{
    if (alb_node_has(node, "measured"))
        return read_measured(surface, in, node);
    if (alb_node_has(node, "dipole"))
        return read_dipole(surface, node, in->error);
    return alb_node_allow(node, "reflectance exitance", in->error) &&
           alb_node_numbers(surface->reflectance, 3, node, "reflectance", 0, 1, in->error) &&
           (!alb_node_has(node, "exitance") ||
            alb_node_numbers(surface->exitance, 3, node, "exitance", 0, 1e12, in->error));
}

static bool read_surfaces(reader *in, alb_node root)
{
    alb_node list;
    if (!alb_node_object(&list, root, "materials", in->error))
        return false;
    const size_t count = alb_node_key_count(list);
    if (count > ALB_SURFACES_MAX)
        return alb_node_fail(in->error, list, NULL, "%zu materials; at most %d", count, ALB_SURFACES_MAX);
    if (!(in->scene->surfaces = alb_allocate(count, sizeof *in->scene->surfaces, in->error)))
        return false;
    for (size_t i = 0; i < count; i++) {
        const char *name = alb_node_key(list, i);
        alb_node node;
        if (strlen(name) >= ALB_GROUP_NAME)
            return alb_node_fail(in->error, list, NULL, "material name '%.80s' is too long", name);
        snprintf(in->scene->surfaces[i].name, ALB_GROUP_NAME, "%s", name);
        if (!alb_node_object(&node, list, name, in->error) || !read_surface(&in->scene->surfaces[i], in, node))
            return false;
    }
    in->scene->surface_count = count;
    return true;
}

static bool surface_named(uint16_t *index, reader *in, alb_node node, const char *key)
{
    const char *name;
    if (!alb_node_text(&name, node, key, in->error))
        return false;
    for (size_t i = 0; i < in->scene->surface_count; i++)
        if (!strcmp(in->scene->surfaces[i].name, name)) {
            *index = (uint16_t)i;
            return true;
        }
    return alb_node_fail(in->error, node, key, "there is no material '%.80s'", name);
}

// The mesh's groups become indices of the scene's materials.
static bool assign_materials(alb_mesh *mesh, reader *in, alb_node object)
{
    uint16_t map[ALB_GROUPS_MAX] = {0};
    alb_node by_name;
    if (alb_node_has(object, "materials")) {
        if (!alb_node_object(&by_name, object, "materials", in->error))
            return false;
        for (size_t g = 0; g < mesh->group_count; g++) {
            if (!alb_node_has(by_name, mesh->group_names[g]))
                return alb_node_fail(in->error, object, "materials", "the mesh's material '%.80s' is not listed",
                                     mesh->group_names[g]);
            if (!surface_named(&map[g], in, by_name, mesh->group_names[g]))
                return false;
        }
    } else {
        if (!surface_named(&map[0], in, object, "material"))
            return false;
        for (size_t g = 1; g < mesh->group_count; g++)
            map[g] = map[0];
    }
    for (size_t f = 0; f < mesh->face_count; f++)
        mesh->groups[f] = map[mesh->groups[f]];
    return true;
}

static bool read_mesh(alb_mesh *mesh, double *scale, alb_vector *offset, reader *in, alb_node node)
{
    char path[ALB_PATH_SIZE];
    if (!alb_node_allow(node, "mesh mm_per_unit material materials translate_mm subdivide_mm", in->error) ||
        (alb_node_has(node, "mm_per_unit") && !alb_node_number(scale, node, "mm_per_unit", 1e-6, 1e6, in->error)) ||
        (alb_node_has(node, "translate_mm") && !read_vector(offset, node, "translate_mm", in->error)) ||
        !input_path(path, in, node, "mesh"))
        return false;
    return alb_mesh_read(mesh, path, in->error) && alb_mesh_weld(mesh, in->error);
}

static bool read_box(alb_mesh *mesh, reader *in, alb_node node)
{
    double size[3], cells[3];
    alb_box box = {.grading = 1};
    if (!alb_node_allow(node, "shape size_mm centre_mm cells grading inward material subdivide_mm", in->error) ||
        !alb_node_numbers(size, 3, node, "size_mm", 1e-6, huge_mm, in->error) ||
        !read_vector(&box.centre_mm, node, "centre_mm", in->error) ||
        !alb_node_numbers(cells, 3, node, "cells", 1, 4096, in->error) ||
        (alb_node_has(node, "grading") && !alb_node_number(&box.grading, node, "grading", 1, 1e4, in->error)) ||
        (alb_node_has(node, "inward") && !alb_node_boolean(&box.inward, node, "inward", in->error)))
        return false;
    box.size_mm = (alb_vector){size[0], size[1], size[2]};
    for (int k = 0; k < 3; k++) {
        if (cells[k] != floor(cells[k]))
            return alb_node_fail(in->error, node, "cells", "%g is not a whole number", cells[k]);
        box.cells[k] = (int)cells[k];
    }
    return alb_shape_box(mesh, &box, in->error);
}

static bool read_sphere(alb_mesh *mesh, reader *in, alb_node node)
{
    alb_sphere sphere = {0};
    long subdivisions;
    if (!alb_node_allow(node, "shape radius_mm centre_mm subdivisions inward material", in->error) ||
        !alb_node_number(&sphere.radius_mm, node, "radius_mm", 1e-6, huge_mm, in->error) ||
        !read_vector(&sphere.centre_mm, node, "centre_mm", in->error) ||
        !alb_node_integer(&subdivisions, node, "subdivisions", 0, 8, in->error) ||
        (alb_node_has(node, "inward") && !alb_node_boolean(&sphere.inward, node, "inward", in->error)))
        return false;
    sphere.subdivisions = (int)subdivisions;
    return alb_shape_sphere(mesh, &sphere, in->error);
}

static bool read_shape(alb_mesh *mesh, reader *in, alb_node node)
{
    const char *shape;
    if (!alb_node_text(&shape, node, "shape", in->error))
        return false;
    if (!strcmp(shape, "box"))
        return read_box(mesh, in, node);
    if (!strcmp(shape, "sphere"))
        return read_sphere(mesh, in, node);
    return alb_node_fail(in->error, node, "shape", "'%.40s' is neither box nor sphere", shape);
}

static bool read_object(reader *in, alb_node node)
{
    double scale = 1, longest_mm = 0;
    alb_vector offset = {0};
    alb_mesh mesh = {0}, placed = {0};
    bool ok = alb_node_has(node, "mesh") ? read_mesh(&mesh, &scale, &offset, in, node) : read_shape(&mesh, in, node);
    ok = ok && assign_materials(&mesh, in, node) && alb_mesh_append(&placed, &mesh, scale, offset, in->error);
    if (ok && alb_node_has(node, "subdivide_mm"))
        ok = alb_node_number(&longest_mm, node, "subdivide_mm", 1e-6, huge_mm, in->error) &&
             alb_mesh_subdivide(&placed, longest_mm, in->error);
    ok = ok && alb_mesh_append(&in->scene->mesh, &placed, 1, (alb_vector){0}, in->error);
    alb_mesh_free(&mesh);
    alb_mesh_free(&placed);
    return ok;
}

static bool read_environment(alb_light *light, reader *in, alb_node node)
{
    char path[ALB_PATH_SIZE];
    if (!alb_node_allow(node, "kind radiance file", in->error))
        return false;
    if (!alb_node_has(node, "file"))
        return alb_node_numbers(light->radiance, 3, node, "radiance", 0, 1e12, in->error);
    if (alb_node_has(node, "radiance"))
        return alb_node_fail(in->error, node, "radiance", "give a radiance or a file, not both");
    if (!input_path(path, in, node, "file") || !alb_image_read(&light->map, NULL, path, in->error))
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
               read_vector(&light->position_mm, node, "position_mm", error) &&
               read_direction(&light->direction, node, "direction", error) &&
               alb_node_number(&light->half_angle_deg, node, "half_angle_deg", 1e-3, 90, error);
    const bool pixels = alb_node_has(node, "pixel_mm");
    return alb_node_allow(node,
                          pixels ? "kind flux centre_mm direction blur_sd_mm pixel_mm diameter_px"
                                 : "kind flux centre_mm direction blur_sd_mm diameter_mm",
                          error) &&
           read_vector(&light->position_mm, node, "centre_mm", error) &&
           read_direction(&light->direction, node, "direction", error) &&
           (!alb_node_has(node, "blur_sd_mm") ||
            alb_node_number(&light->blur_sd_mm, node, "blur_sd_mm", 0, 1e4, error)) &&
           (pixels ? alb_node_number(&light->pixel_mm, node, "pixel_mm", 1e-6, 1e4, error) &&
                         alb_node_number(&light->diameter_px, node, "diameter_px", 1, 1000, error)
                   : alb_node_number(&light->diameter_mm, node, "diameter_mm", 0, huge_mm, error));
}

static bool read_light(alb_light *light, reader *in, alb_node node)
{
    const char *kind;
    int k = 0;
    if (!alb_node_text(&kind, node, "kind", in->error))
        return false;
    while (k < ALB_LIGHTS && strcmp(kind, alb_light_names[k]))
        k++;
    if (k == ALB_LIGHTS)
        return alb_node_fail(in->error, node, "kind", "'%.40s' is none of point, spot, projector, environment", kind);
    light->kind = (alb_light_kind)k;
    if (light->kind == ALB_LIGHT_ENVIRONMENT)
        return read_environment(light, in, node);
    if (!alb_node_numbers(light->flux, 3, node, "flux", 0, 1e12, in->error))
        return false;
    if (light->kind == ALB_LIGHT_POINT)
        return alb_node_allow(node, "kind flux position_mm", in->error) &&
               read_vector(&light->position_mm, node, "position_mm", in->error);
    return read_beam(light, node, in->error);
}

static bool read_lights(reader *in, alb_node root)
{
    alb_node list, node;
    size_t count = 0;
    if (!alb_node_has(root, "lights"))
        return true;
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

static bool read_calibrated(reader *in, alb_node node)
{
    const char *session, *name;
    char folder[ALB_PATH_SIZE], path[ALB_PATH_SIZE];
    int side = 0;
    alb_calibration *calibration = alb_allocate(1, sizeof *calibration, in->error);
    bool ok = calibration && alb_node_allow(node, "calibration side", in->error) &&
              alb_node_text(&session, node, "calibration", in->error) &&
              alb_node_text(&name, node, "side", in->error) && alb_path_join(folder, in->folder, session, in->error) &&
              alb_calibration_read(calibration, folder, in->error) &&
              alb_path_join(path, folder, "calibration.json", in->error) &&
              alb_provenance_add(in->provenance, path, in->error);
    while (ok && side < ALB_SIDES && strcmp(name, alb_side_names[side]))
        side++;
    if (ok && side == ALB_SIDES)
        ok = alb_node_fail(in->error, node, "side", "'%.40s' is neither reflection nor transmission", name);
    if (ok && !calibration->views[side].known)
        ok = alb_node_fail(in->error, node, "side", "the session has no pose of the camera for %s", name);
    if (ok)
        in->scene->camera = calibration->views[side].camera;
    free(calibration);
    return ok;
}

static bool read_camera(reader *in, alb_node root)
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
        !read_vector(&position, node, "position_mm", in->error) ||
        !read_vector(&target, node, "look_at_mm", in->error) || !read_direction(&up, node, "up", in->error) ||
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

static bool read_settings(alb_scene *scene, alb_node root, alb_error *error)
{
    long rays = 256, seed = 1;
    scene->residual = 1e-4;
    if ((alb_node_has(root, "rays_per_patch") && !alb_node_integer(&rays, root, "rays_per_patch", 1, 65536, error)) ||
        (alb_node_has(root, "seed") && !alb_node_integer(&seed, root, "seed", 0, 0x7fffffff, error)) ||
        (alb_node_has(root, "residual") && !alb_node_number(&scene->residual, root, "residual", 1e-12, 0.1, error)))
        return false;
    scene->rays_per_patch = (int)rays;
    scene->seed = (uint64_t)seed;
    return true;
}

static bool read_objects(reader *in, alb_node root)
{
    alb_node list, node;
    size_t count;
    if (!alb_node_list(&list, &count, root, "objects", in->error))
        return false;
    if (!count || count > ALB_OBJECTS_MAX)
        return alb_node_fail(in->error, root, "objects", "%zu objects; 1 to %d are needed", count, ALB_OBJECTS_MAX);
    for (size_t i = 0; i < count; i++)
        if (!alb_node_item_object(&node, list, i, in->error) || !read_object(in, node))
            return false;
    return true;
}

bool alb_scene_read(alb_scene *scene, alb_provenance *provenance, const char *path, alb_error *error)
{
    char folder[ALB_PATH_SIZE];
    alb_node root;
    reader in = {scene, provenance, folder, error};
    *scene = (alb_scene){0};
    if (!alb_path_folder(folder, path, error))
        return false;
    alb_record *record = alb_record_read(path, error);
    const bool ok =
        record && alb_provenance_add(provenance, path, error) && alb_record_root(&root, record, error) &&
        alb_node_allow(root, "format objects materials lights camera rays_per_patch residual seed", error) &&
        read_settings(scene, root, error) && read_surfaces(&in, root) && read_objects(&in, root) &&
        read_lights(&in, root) && read_camera(&in, root);
    alb_record_free(record);
    if (!ok)
        alb_scene_free(scene);
    return ok;
}
