// Shadows of square lights, small to large, on three of the animated scenes: rms error of the irradiance on the plane
// and on the model in percent of its mean, by default and with fields of lights scaled as printed:
// bench.shadow_lights
//
// The light looks at the model's middle from six of its radii, halfway up, and is as wide as its half-angle says from
// there: the skies of the scenes are out. Error: as in bench.shadow, of one frame.
#include "base/memory.h"
#include "scenes/shadow_scenes.h"
#include "scenes/shadow_truth.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ANGLES = 5 };
static const double angles_deg[ANGLES] = {2.5, 5, 10, 20, 40};
static const int scenes[] = {0, 2, 3};

// The middle and radius of the model, the second object.
static void bound(alb_vector *middle, double *radius, const alb_scene *scene)
{
    const alb_object *model = &scene->objects[1];
    const alb_vector *vertices = scene->mesh.vertices + model->first_vertex;
    *middle = (alb_vector){0};
    *radius = 0;
    for (size_t v = 0; v < model->vertex_count; v++)
        *middle = alb_add(*middle, alb_times(1 / (double)model->vertex_count, vertices[v]));
    for (size_t v = 0; v < model->vertex_count; v++)
        *radius = fmax(*radius, alb_length(alb_sub(vertices[v], *middle)));
}

static bool add_square(alb_scene *scene, alb_vector centre, alb_vector to, double half_width, alb_error *error)
{
    const alb_vector across = alb_unit(alb_cross(to, (alb_vector){0, 0, 1})), up = alb_cross(across, to);
    alb_object *objects = alb_allocate(scene->object_count + 1, sizeof *objects, error);
    alb_surface *surfaces = alb_allocate(scene->surface_count + 1, sizeof *surfaces, error);
    if (!objects || !surfaces) {
        free(objects);
        free(surfaces);
        return false;
    }
    memcpy(objects, scene->objects, scene->object_count * sizeof *objects);
    memcpy(surfaces, scene->surfaces, scene->surface_count * sizeof *surfaces);
    free(scene->objects);
    free(scene->surfaces);
    scene->objects = objects;
    scene->surfaces = surfaces;
    const uint32_t first = (uint32_t)scene->mesh.vertex_count;
    objects[scene->object_count++] = (alb_object){.first_vertex = first, .vertex_count = 4};
    surfaces[scene->surface_count] = (alb_surface){.name = "square", .exitance = {1, 1, 1}};
    const uint16_t group = (uint16_t)scene->surface_count++;
    for (int k = 0; k < 4; k++)
        if (!alb_mesh_add_vertex(&scene->mesh,
                                 alb_add(centre, alb_add(alb_times(k % 3 ? half_width : -half_width, across),
                                                         alb_times(k / 2 ? half_width : -half_width, up))),
                                 error))
            return false;
    return alb_mesh_add_face(&scene->mesh, first, first + 2, first + 1, group, error) &&
           alb_mesh_add_face(&scene->mesh, first, first + 3, first + 2, group, error);
}

static bool create_scene(alb_scene *scene, int index, double angle_deg, alb_error *error)
{
    alb_vector middle;
    double radius;
    if (!shadow_scenes[index].create(scene, shadow_scenes[index].frames / 6, error))
        return false;
    for (size_t o = 0; o < scene->object_count; o++)
        scene->objects[o].rigid = false;
    for (size_t i = 0; i < scene->light_count; i++)
        alb_light_free(&scene->lights[i]);
    scene->light_count = 0;
    bound(&middle, &radius, scene);
    const alb_vector to = alb_unit((alb_vector){-0.6, 0.4, -1});
    return add_square(scene, alb_sub(middle, alb_times(6 * radius, to)), to, 6 * radius * tan(angle_deg * M_PI / 180),
                      error);
}

static bool measure(double percent[2], int index, double angle_deg, bool paper, alb_error *error)
{
    alb_scene scene = {0};
    alb_shadow_stage stage = {.settings = alb_shadow_defaults, .paper = paper};
    static shadow_truth t;
    static float found[SHADOW_TRUTH_SAMPLES][3];
    if (paper)
        stage.settings.probes = 0;
    const bool ok = create_scene(&scene, index, angle_deg, error) && alb_shadow_stage_light(&stage, &scene, error) &&
                    shadow_truth_find(&t, &stage, &scene, error);
    for (size_t i = 0; ok && i < t.count; i++)
        memcpy(found[i], stage.irradiance[t.vertices[i]], sizeof found[i]);
    for (int model = 0; ok && model < 2; model++)
        percent[model] = shadow_truth_error(&t, (const float(*)[3])found, scene.objects[0].vertex_count, model);
    shadow_truth_free(&t);
    alb_shadow_stage_free(&stage);
    alb_scene_free(&scene);
    return ok;
}

int main(void)
{
    alb_error error = {0};
    bool ok = true;
    printf("error %% (as printed) under a square light of a half-angle of, degrees\n%-24s", "");
    for (int a = 0; a < ANGLES; a++)
        printf("%15.1f", angles_deg[a]);
    printf("\n");
    for (size_t i = 0; ok && i < sizeof scenes / sizeof *scenes; i++) {
        double percent[ANGLES][2][2];
        for (int a = 0; ok && a < ANGLES; a++)
            for (int paper = 0; ok && paper < 2; paper++)
                ok = measure(percent[a][paper], scenes[i], angles_deg[a], paper, &error);
        for (int model = 0; ok && model < 2; model++) {
            printf("%-8s %-15s", shadow_scenes[scenes[i]].name, model ? "on itself" : "on the plane");
            for (int a = 0; a < ANGLES; a++)
                printf("%8.2f (%4.1f)", percent[a][0][model], percent[a][1][model]);
            printf("\n");
        }
        fflush(stdout);
    }
    if (!ok)
        fprintf(stderr, "bench.shadow_lights: %s\n", error.text);
    return !ok;
}
