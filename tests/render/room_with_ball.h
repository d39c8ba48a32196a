// A closed room with a ball in it, and what tests of its balance of light share.
#pragma once
#include "check.h"
#include "render/shape.h"
#include "render/solution.h"

static inline void add_mesh(alb_scene *scene, alb_mesh *part, uint16_t group)
{
    alb_error error = {0};
    const size_t first = scene->mesh.face_count;
    if (first)
        check_ok(alb_mesh_append(&scene->mesh, part, 1, (alb_vector){0}, &error), &error);
    else {
        scene->mesh = *part;
        *part = (alb_mesh){0};
    }
    for (size_t i = first; i < scene->mesh.face_count; i++)
        scene->mesh.groups[i] = group;
    alb_mesh_free(part);
}

// Room for that many surfaces and two lights.
static inline void begin(alb_scene *scene, size_t surfaces, int rays, double residual)
{
    *scene = (alb_scene){.rays_per_patch = rays, .residual = residual, .seed = 5, .surface_count = surfaces};
    scene->surfaces = calloc(surfaces, sizeof *scene->surfaces);
    scene->lights = calloc(2, sizeof *scene->lights);
}

static inline alb_surface diffuse(double r, double g, double b)
{
    return (alb_surface){.name = "diffuse", .reflectance = {r, g, b}};
}

// Profile exp(-rate r), all that leaves the plane: albedo.
static inline alb_surface wax(double albedo, double rate_per_mm)
{
    alb_surface out = {.name = "wax", .scatters = true};
    for (int c = 0; c < 3; c++)
        out.profiles[0][c] =
            (alb_profile){ALB_FORM_EXPONENTIAL, {albedo * rate_per_mm * rate_per_mm / (2 * M_PI), rate_per_mm}};
    return out;
}

// A closed room of 60 mm with a ball in it; surface 0 the walls, 1 the ball; a spot and a point of light.
static inline void room_with_ball(alb_scene *scene, int cells)
{
    alb_error error = {0};
    alb_mesh walls = {0}, ball = {0};
    const alb_box box = {.size_mm = {60, 60, 60}, .cells = {cells, cells, cells}, .grading = 1, .inward = true};
    const alb_sphere sphere = {.radius_mm = 12, .centre_mm = {5, -4, -10}, .subdivisions = 2};
    check_ok(alb_shape_box(&walls, &box, &error), &error);
    check_ok(alb_shape_sphere(&ball, &sphere, &error), &error);
    add_mesh(scene, &walls, 0);
    add_mesh(scene, &ball, 1);
    scene->lights[0] = (alb_light){.kind = ALB_LIGHT_SPOT,
                                   .position_mm = {0, 0, 29},
                                   .direction = {0, 0, -1},
                                   .half_angle_deg = 30,
                                   .flux = {1, 2, 1}};
    scene->lights[1] = (alb_light){.kind = ALB_LIGHT_POINT, .position_mm = {20, 20, 20}, .flux = {1, 2, 3}};
}

// |a - b| / |b|, all channels.
static inline double difference(const alb_solution *s, const alb_rgb *a, const alb_rgb *b)
{
    double off = 0, all = 0;
    for (size_t p = 0; p < s->patches.count; p++)
        for (int c = 0; c < 3; c++) {
            off += s->patches.areas_mm2[p] * pow(a[p][c] - b[p][c], 2);
            all += s->patches.areas_mm2[p] * pow(b[p][c], 2);
        }
    return sqrt(off / all);
}
