#include "scenes/shadow_truth.h"
#include "base/random.h"
#include <stdlib.h>

static bool in_light(const alb_shadow_stage *stage, const alb_scene *scene, size_t vertex)
{
    for (size_t i = stage->occluder_count; i < stage->occluder_count + stage->light_count; i++) {
        const alb_object *o = &scene->objects[stage->objects[i]];
        if (vertex >= o->first_vertex && vertex - o->first_vertex < o->vertex_count)
            return true;
    }
    return false;
}

bool shadow_truth_find(shadow_truth *t, const alb_shadow_stage *stage, const alb_scene *scene, alb_error *error)
{
    t->casters = (alb_mesh){0};
    bool ok = (t->radiance = calloc(scene->mesh.face_count, sizeof *t->radiance)) != NULL;
    for (size_t v = 0; ok && v < scene->mesh.vertex_count; v++)
        ok = alb_mesh_add_vertex(&t->casters, scene->mesh.vertices[v], error);
    for (size_t f = 0; ok && f < scene->mesh.face_count; f++) {
        const uint32_t *v = scene->mesh.faces[f];
        if (v[0] < scene->objects[0].vertex_count) // the ground casts nothing
            continue;
        const size_t count = t->casters.face_count;
        ok = alb_mesh_add_face(&t->casters, v[0], v[1], v[2], 0, error);
        for (int c = 0; c < 3 && t->casters.face_count > count; c++)
            t->radiance[count][c] = (float)(scene->surfaces[scene->mesh.groups[f]].exitance[c] / M_PI);
    }
    ok = ok && alb_tracer_create(&t->tracer, &t->casters, error) &&
         alb_shadow_lamps_create(&t->lamps, &t->casters, (const float(*)[3])t->radiance, error);
    alb_random random = alb_random_at(3, 1, 0);
    for (t->count = 0; ok && t->count < SHADOW_TRUTH_SAMPLES;) {
        const size_t v = (size_t)(alb_random_uniform(&random) * (double)scene->mesh.vertex_count);
        if (in_light(stage, scene, v) ||
            alb_shadow_buried(&t->tracer, scene->mesh.vertices[v], stage->normals[v], 256 * t->tracer.slack_mm))
            continue;
        t->vertices[t->count] = v;
        t->points[t->count] = scene->mesh.vertices[v];
        t->normals[t->count++] = stage->normals[v];
    }
    for (int half = 0; ok && half < 2; half++)
        alb_shadow_cast_aimed(t->halves[half], &t->tracer, &t->lamps, scene->lights, scene->light_count, t->points,
                              t->normals, t->count, 45, 256 * t->tracer.slack_mm, 1 + (uint64_t)half);
    return ok;
}

void shadow_truth_free(shadow_truth *t)
{
    alb_shadow_lamps_free(&t->lamps);
    alb_tracer_free(&t->tracer);
    alb_mesh_free(&t->casters);
    free(t->radiance);
}

double shadow_truth_error(const shadow_truth *t, const float (*found)[3], size_t ground, bool model)
{
    double sum = 0, mean = 0;
    size_t count = 0;
    for (size_t n = 0; n < t->count; n++) {
        if (model == (t->vertices[n] < ground))
            continue;
        for (int c = 0; c < 3; c++) {
            const double a = (double)t->halves[0][n][c], b = (double)t->halves[1][n][c], x = (double)found[n][c];
            sum += (x - a) * (x - b); // the halves' own errors are independent: they cancel on the mean
            mean += 0.5 * (a + b);
        }
        count += 3;
    }
    return count ? 100 * sqrt(fmax(sum, 0) / (double)count) / (mean / (double)count) : 0;
}
