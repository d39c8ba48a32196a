// A frame: what has moved is sampled, then every vertex lit. Stops being true: lights hide nothing from each other or
// from the sky; what receives only hides nothing.
#include "render/shadow_stage.h"
#include "base/memory.h"
#include "base/progress.h"
#include "render/shadow_stage_fields.h"
#include <stdlib.h>
#include <string.h>

static void free_fields(alb_shadow_stage *stage)
{
    for (size_t i = 0; stage->fields && i < stage->occluder_count + stage->light_count; i++)
        alb_shadow_field_free(&stage->fields[i]);
    for (size_t i = 0; stage->emitters && i < stage->light_count; i++)
        alb_shadow_emitter_free(&stage->emitters[i]);
    free(stage->emitters);
    free(stage->fields);
    free(stage->objects);
    free(stage->names);
    free(stage->faces);
    free(stage->groups);
    free(stage->normals);
    free(stage->irradiance);
    for (size_t i = 0; stage->surfaces && i < stage->occluder_count; i++)
        alb_shadow_surface_free(&stage->surfaces[i]);
    for (size_t i = 0; stage->glimpses && i < stage->occluder_count; i++)
        alb_shadow_glimpse_free(&stage->glimpses[i]);
    free(stage->glimpses);
    free(stage->surfaces);
    free(stage->first_vertices);
    free(stage->of_body);
    alb_shadow_transport_free(&stage->transport);
    const alb_shadow_stage kept = *stage;
    *stage = (alb_shadow_stage){.settings = kept.settings,
                                .paper = kept.paper,
                                .laws = kept.laws,
                                .laws_order = kept.laws_order,
                                .skies = kept.skies,
                                .sky_count = kept.sky_count};
}

void alb_shadow_stage_free(alb_shadow_stage *stage)
{
    free_fields(stage);
    alb_shadow_laws_free(&stage->laws);
    free(stage->skies);
    *stage = (alb_shadow_stage){0};
}

void alb_shadow_stage_set(alb_shadow_stage *stage, const alb_shadow_settings *settings)
{
    free_fields(stage);
    stage->settings = *settings;
}

void alb_shadow_stage_set_normals(alb_shadow_stage *stage, const alb_mesh *mesh)
{
    alb_vector *normals = stage->normals;
    memset(normals, 0, mesh->vertex_count * sizeof *normals);
    for (size_t f = 0; f < mesh->face_count; f++) {
        const uint32_t *v = mesh->faces[f];
        const alb_vector a = mesh->vertices[v[0]],
                         twice = alb_cross(alb_sub(mesh->vertices[v[1]], a), alb_sub(mesh->vertices[v[2]], a));
        for (int k = 0; k < 3; k++)
            normals[v[k]] = alb_add(normals[v[k]], twice);
    }
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        normals[i] = alb_unit(normals[i]);
        if (!(alb_dot(normals[i], normals[i]) > 0)) // no face, or faces back to back
            normals[i] = (alb_vector){0, 0, 1};
    }
}

static bool still_fits(const alb_shadow_stage *stage, const alb_mesh *mesh)
{
    return stage->fields && stage->under_skies == (stage->sky_count > 0) && stage->face_count == mesh->face_count &&
           stage->vertex_count == mesh->vertex_count &&
           !memcmp(stage->faces, mesh->faces, mesh->face_count * sizeof *stage->faces) &&
           !memcmp(stage->groups, mesh->groups, mesh->face_count * sizeof *stage->groups);
}

static bool read_skies(alb_shadow_stage *stage, const alb_scene *scene, alb_error *error)
{
    free(stage->skies);
    stage->sky_count = 0;
    if (!(stage->skies = alb_allocate(scene->light_count, sizeof *stage->skies, error)))
        return false;
    for (size_t i = 0; i < scene->light_count; i++) {
        if (scene->lights[i].kind != ALB_LIGHT_ENVIRONMENT)
            return alb_fail(
                error, ALB_BAD_DATA,
                "light %zu is a %s: it has no soft shadow, which is what shadow fields know; give it a size "
                "as an object that emits, or render by radiosity",
                i, alb_light_names[scene->lights[i].kind]);
        if (!alb_shadow_sky_create(&stage->skies[stage->sky_count++], &scene->lights[i], error))
            return false;
    }
    return true;
}

alb_shadow_world alb_shadow_stage_world(const alb_shadow_stage *stage)
{
    return (alb_shadow_world){.occluders = stage->fields,
                              .occluder_count = stage->occluder_count,
                              .lights = stage->fields + stage->occluder_count,
                              .light_count = stage->light_count,
                              .emitters = stage->emitters,
                              .skies = stage->skies,
                              .sky_count = stage->sky_count,
                              .laws = &stage->laws,
                              .transport = stage->transport.row_count ? &stage->transport : NULL,
                              .of_body = stage->of_body,
                              .surfaces = stage->settings.probes ? stage->surfaces : NULL,
                              .glimpses = stage->settings.probes ? stage->glimpses : NULL,
                              .first_vertices = stage->first_vertices};
}

static bool place_lights(alb_shadow_stage *stage, const alb_vector *vertices, alb_error *error)
{
    bool ok = true;
    for (size_t j = 0; ok && stage->emitters && j < stage->light_count; j++) {
        const size_t light = stage->occluder_count + j;
        ok = alb_shadow_emitter_place(&stage->emitters[j], vertices + stage->first_vertices[light],
                                      &stage->fields[light].sphere, error);
    }
    return ok;
}

// After the lights are placed.
static bool sample_surfaces(alb_shadow_stage *stage, const alb_vector *vertices, alb_error *error)
{
    for (size_t i = 0; stage->settings.probes && i < stage->occluder_count; i++) {
        alb_shadow_surface *surface = &stage->surfaces[i];
        const size_t first = stage->first_vertices[i];
        const alb_vector *here = vertices + first, *normals = stage->normals + first;
        if (!stage->light_count && stage->of_body[i]) // skies have the transport of what is rigid
            continue;
        const bool moved =
            !surface->sampled || memcmp(here, surface->mesh.vertices, surface->mesh.vertex_count * sizeof *here) != 0;
        if (!alb_shadow_surface_sample(surface, here, normals, error))
            return false;
        for (size_t j = 0; stage->glimpses && j < stage->light_count; j++)
            if (moved || stage->emitters[j].moved)
                alb_shadow_glimpse_take(&stage->glimpses[i], surface, normals, &stage->emitters[j], j);
    }
    return true;
}

bool alb_shadow_stage_light(alb_shadow_stage *stage, const alb_scene *scene, alb_error *error)
{
    const double start_s = alb_clock_s();
    const alb_mesh *mesh = &scene->mesh;
    double made_s = 0;
    bool ok = read_skies(stage, scene, error);
    if (ok && !still_fits(stage, mesh)) {
        free_fields(stage);
        ok = alb_shadow_stage_create_fields(stage, scene, error);
        made_s = stage->transport_s;
    } else if (ok) {
        alb_shadow_stage_set_normals(stage, mesh);
    }
    if (ok && !stage->light_count && !stage->sky_count)
        ok = alb_fail(error, ALB_BAD_DATA, "there is no light: no environment and no object that emits");
    ok = ok && alb_shadow_transport_follow(&stage->transport, mesh->vertices, error);
    for (size_t i = 0; ok && i < stage->occluder_count + stage->light_count; i++)
        ok = alb_shadow_field_sample(&stage->fields[i], mesh->vertices + scene->objects[stage->objects[i]].first_vertex,
                                     error);
    ok = ok && place_lights(stage, mesh->vertices, error) && sample_surfaces(stage, mesh->vertices, error);
    const double sampled_s = alb_clock_s();
    if (ok) {
        const alb_shadow_world world = alb_shadow_stage_world(stage);
        stage->seconds = (alb_shadow_seconds){0};
        ok = alb_shadow_irradiance(stage->irradiance, &world, mesh->vertices, stage->normals, mesh->vertex_count,
                                   &stage->seconds, error);
    }
    stage->sampling_s = sampled_s - start_s - made_s;
    stage->light_s = alb_clock_s() - sampled_s;
    if (!ok)
        free_fields(stage);
    return ok;
}
