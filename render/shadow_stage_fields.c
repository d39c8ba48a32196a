// What a stage keeps from frame to frame, made for the first: objects with a face that emits are lights; those that are
// said to receive only cast no shadow; all others are occluders. An object of which no face is left (all stood there
// twice, say) is not there.
#include "render/shadow_stage_fields.h"
#include "base/memory.h"
#include "base/progress.h"
#include "render/shadow_cut.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool emits(const alb_scene *scene, size_t face)
{
    const double *e = scene->surfaces[scene->mesh.groups[face]].exitance;
    return e[0] + e[1] + e[2] > 0;
}

// Of a light's field samples make no use but of its sphere.
static const alb_shadow_settings sphere_alone = {.order = 2, .cells = 1, .pixels = 8, .distance = 1.1, .outer = 1};

static bool add_light(alb_shadow_stage *stage, size_t index, const alb_mesh *mesh, const float (*radiance)[3],
                      alb_error *error)
{
    const alb_shadow_settings *settings = stage->paper ? &alb_shadow_light_settings : &sphere_alone;
    if (!alb_shadow_field_create(&stage->fields[index], settings, mesh, radiance, stage->names[index], error))
        return false;
    stage->light_count++;
    return stage->paper || alb_shadow_emitter_create(&stage->emitters[stage->light_count - 1], mesh, radiance, error);
}

static bool add_occluder(alb_shadow_stage *stage, size_t index, const alb_mesh *mesh, int order, alb_error *error)
{
    alb_shadow_settings settings = stage->settings;
    settings.order = order;
    if (stage->emitters && !stage->under_skies) // lines of sight end at the first shell outside
        settings.outer = 1, settings.far = false;
    if (!alb_shadow_field_create(&stage->fields[index], &settings, mesh, NULL, stage->names[index], error))
        return false;
    stage->occluder_count++;
    return !settings.probes ||
           alb_shadow_surface_create(&stage->surfaces[index], mesh, stage->normals + stage->first_vertices[index],
                                     (size_t)settings.probes, error);
}

static bool add_field(alb_shadow_stage *stage, const alb_scene *scene, size_t o, bool light, int order,
                      alb_error *error)
{
    const size_t index = stage->occluder_count + stage->light_count;
    alb_mesh mesh = {0};
    float(*radiance)[3] = NULL;
    stage->objects[index] = o;
    stage->first_vertices[index] = scene->objects[o].first_vertex;
    snprintf(stage->names[index], sizeof *stage->names, "object %zu", o);
    stage->of_body[index] = scene->objects[o].rigid && !light;
    bool ok = alb_shadow_cut_one(&mesh, &radiance, scene, &scene->objects[o], error);
    if (ok && mesh.face_count)
        ok = light ? add_light(stage, index, &mesh, (const float(*)[3])radiance, error)
                   : add_occluder(stage, index, &mesh, order, error);
    free(radiance);
    alb_mesh_free(&mesh);
    return ok;
}

static bool find_lights(bool **shines, const alb_scene *scene, alb_error *error)
{
    if (!(*shines = alb_allocate(scene->object_count, sizeof **shines, error)))
        return false;
    for (size_t f = 0; f < scene->mesh.face_count; f++)
        for (size_t o = 0; emits(scene, f) && o < scene->object_count; o++)
            (*shines)[o] |= alb_object_owns(&scene->objects[o], scene->mesh.faces[f][0]);
    return true;
}

// What is rigid and does not shine, if skies light it.
static bool create_transport(alb_shadow_stage *stage, const alb_scene *scene, const bool *shines, alb_error *error)
{
    const double start_s = alb_clock_s();
    bool *of_body = alb_allocate(scene->object_count, sizeof *of_body, error), any = false, ok = of_body;
    for (size_t o = 0; ok && o < scene->object_count; o++)
        any |= of_body[o] = scene->objects[o].rigid && !shines[o] && stage->sky_count;
    if (any)
        ok = alb_shadow_transport_create(&stage->transport, scene, of_body, stage->normals, error);
    stage->transport_s = alb_clock_s() - start_s;
    free(of_body);
    return ok;
}

static bool create_glimpses(alb_shadow_stage *stage, alb_error *error)
{
    if (!stage->emitters || !stage->light_count || !stage->settings.probes)
        return true;
    bool ok = (stage->glimpses = alb_allocate(stage->occluder_count, sizeof *stage->glimpses, error));
    for (size_t o = 0; ok && o < stage->occluder_count; o++)
        ok = alb_shadow_glimpse_create(&stage->glimpses[o], &stage->surfaces[o], stage->light_count, error);
    return ok;
}

bool alb_shadow_stage_create_fields(alb_shadow_stage *stage, const alb_scene *scene, alb_error *error)
{
    const alb_mesh *mesh = &scene->mesh;
    const size_t n = scene->object_count;
    bool *shines = NULL, any = false;
    stage->under_skies = stage->sky_count > 0;
    bool ok = (stage->fields = alb_allocate(n, sizeof *stage->fields, error)) &&
              (stage->objects = alb_allocate(n, sizeof *stage->objects, error)) &&
              (stage->names = alb_allocate(n, sizeof *stage->names, error)) &&
              (stage->paper || (stage->emitters = alb_allocate(n, sizeof *stage->emitters, error))) &&
              (stage->of_body = alb_allocate(n, sizeof *stage->of_body, error)) &&
              (stage->surfaces = alb_allocate(n, sizeof *stage->surfaces, error)) &&
              (stage->first_vertices = alb_allocate(n, sizeof *stage->first_vertices, error)) &&
              (stage->faces = alb_allocate(mesh->face_count, sizeof *stage->faces, error)) &&
              (stage->groups = alb_allocate(mesh->face_count, sizeof *stage->groups, error)) &&
              (stage->normals = alb_allocate(mesh->vertex_count, sizeof *stage->normals, error)) &&
              (stage->irradiance = alb_allocate(mesh->vertex_count, sizeof *stage->irradiance, error)) &&
              find_lights(&shines, scene, error);
    if (ok)
        alb_shadow_stage_set_normals(stage, mesh);
    for (size_t o = 0; ok && o < n; o++)
        any |= shines[o];
    // lights with a surface are seen along lines: the finer the samples the better
    const int order = any && !stage->paper ? ALB_SH_ORDER_MAX : stage->settings.order;
    for (int light = 0; light < 2; light++) // occluders first
        for (size_t o = 0; ok && o < n; o++)
            if (shines[o] == (light == 1) && (light || !scene->objects[o].receives_only))
                ok = add_field(stage, scene, o, light, order, error);
    ok = ok && create_glimpses(stage, error) && create_transport(stage, scene, shines, error);
    free(shines);
    if (!ok)
        return false;
    memcpy(stage->faces, mesh->faces, mesh->face_count * sizeof *stage->faces);
    memcpy(stage->groups, mesh->groups, mesh->face_count * sizeof *stage->groups);
    stage->face_count = mesh->face_count;
    stage->vertex_count = mesh->vertex_count;
    if (stage->laws_order == order)
        return true;
    alb_shadow_laws_free(&stage->laws);
    stage->laws_order = 0;
    if (!alb_shadow_laws_create(&stage->laws, order, stage->paper, error))
        return false;
    stage->laws_order = order;
    return true;
}
