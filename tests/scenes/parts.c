#include "scenes/parts.h"
#include "base/memory.h"
#include "render/shape.h"
#include "scenes/scenes.h"
#include <string.h>

const test_scene test_scenes[TEST_SCENES] = {
    {"cornell", "a Cornell box with a tall block of marble", 25000, 1, scene_cornell},
    {"bowls", "three bowls and a bumpy animal on a table", 73000, 1, scene_bowls},
    {"chess", "a closed room, a board, ten translucent pieces, a translucent lamp", 266000, 1, scene_chess},
    {"rose", "a rose of thin petals", 72000, 1, scene_rose},
    {"gallop", "two animals that gallop", 63000, 48, scene_gallop},
};

double test_scene_detail(const test_scene *scene, size_t patches)
{
    return sqrt((double)patches / (double)scene->patches);
}

alb_surface surface_translucent(const char *name, const double total[3], const double decay_per_mm[3])
{
    alb_surface surface = {.scatters = true};
    strncpy(surface.name, name, sizeof surface.name - 1);
    for (int c = 0; c < 3; c++) {
        const double slow = decay_per_mm[c], fast = 4 * slow, half = total[c] / (4 * M_PI);
        surface.profiles[ALB_REFLECTION][c] =
            (alb_profile){ALB_FORM_TWO_EXPONENTIALS, {half * fast * fast, fast, half * slow * slow, slow}};
    }
    return surface;
}

alb_surface surface_opaque(const char *name, double r, double g, double b)
{
    alb_surface surface = {.reflectance = {r, g, b}};
    strncpy(surface.name, name, sizeof surface.name - 1);
    return surface;
}

bool scene_furnish(alb_scene *scene, const alb_surface *surfaces, size_t surface_count, const alb_light *lights,
                   size_t light_count, alb_error *error)
{
    scene->rays_per_patch = 256;
    scene->residual = 1e-3;
    scene->seed = 1;
    if (!(scene->surfaces = alb_allocate(surface_count, sizeof *surfaces, error)) ||
        !(scene->lights = alb_allocate(light_count, sizeof *lights, error)))
        return false;
    memcpy(scene->surfaces, surfaces, surface_count * sizeof *surfaces);
    scene->surface_count = surface_count;
    if (light_count)
        memcpy(scene->lights, lights, light_count * sizeof *lights);
    scene->light_count = light_count;
    return true;
}

bool scene_add_box(alb_scene *scene, alb_vector centre, alb_vector size, double turn_deg, double edge_mm, bool inward,
                   uint16_t group, alb_error *error)
{
    alb_mesh box = {0};
    const alb_box shape = {.size_mm = size,
                           .cells = {(int)fmax(1, round(size.x / edge_mm)), (int)fmax(1, round(size.y / edge_mm)),
                                     (int)fmax(1, round(size.z / edge_mm))},
                           .grading = 1,
                           .inward = inward};
    bool ok = alb_shape_box(&box, &shape, error);
    const double turn = M_PI / 180 * turn_deg;
    for (size_t i = 0; i < box.vertex_count; i++) {
        const alb_vector v = box.vertices[i];
        box.vertices[i] = (alb_vector){cos(turn) * v.x - sin(turn) * v.y, sin(turn) * v.x + cos(turn) * v.y, v.z};
    }
    for (size_t i = 0; i < box.face_count; i++)
        box.groups[i] = group;
    ok = ok && alb_mesh_append(&scene->mesh, &box, 1, centre, error);
    alb_mesh_free(&box);
    return ok;
}
