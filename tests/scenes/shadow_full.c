#include "scenes/shadow_full.h"
#include "render/sh_product.h"
#include "render/sh_zonal.h"
#include <string.h>

enum { BLOCK = ALB_SHADOW_BLOCK, VALUES = ALB_SHADOW_VALUES, ALL = ALB_SH_COUNT_MAX };
static const double first = 0.2, step = 0.52; // radii

bool shadow_full_mesh(alb_mesh *mesh, const alb_scene *scene, const alb_object *object, alb_error *error)
{
    const uint32_t from = (uint32_t)object->first_vertex;
    bool ok = true;
    for (size_t v = 0; ok && v < object->vertex_count; v++)
        ok = alb_mesh_add_vertex(mesh, scene->mesh.vertices[from + v], error);
    for (size_t f = 0; ok && f < scene->mesh.face_count; f++) {
        const uint32_t *v = scene->mesh.faces[f];
        if (v[0] >= from && v[0] - from < object->vertex_count)
            ok = alb_mesh_add_face(mesh, v[0] - from, v[1] - from, v[2] - from, 0, error);
    }
    return ok;
}

bool shadow_full_create(shadow_full *full, const alb_mesh *mesh, alb_error *error)
{
    bool ok = true;
    *full = (shadow_full){0};
    for (int s = 0; s < SHADOW_FULL && ok; s++) {
        const double radius = first + step * s;
        alb_shadow_settings settings = alb_shadow_defaults;
        settings.inner = radius < 1.1, settings.distance = fmax(radius, 1.1);
        ok = alb_shadow_field_create(&full->shells[s], &settings, mesh, NULL, "model", error);
        if (ok && settings.inner)
            full->shells[s].shells[0].radius = radius;
    }
    return ok;
}

bool shadow_full_sample(shadow_full *full, const alb_vector *vertices, alb_error *error)
{
    bool ok = true;
    for (int s = 0; s < SHADOW_FULL && ok; s++)
        ok = alb_shadow_field_sample(&full->shells[s], vertices, error);
    return ok;
}

void shadow_full_free(shadow_full *full)
{
    for (int s = 0; s < SHADOW_FULL; s++)
        alb_shadow_field_free(&full->shells[s]);
}

// What one point sees, item r of the block.
static void look(float *visible, const shadow_full *full, alb_vector point, size_t r)
{
    const alb_shadow_sphere *sphere = &full->shells[0].sphere;
    const alb_vector off = alb_sub(point, sphere->centre_mm);
    const double place = fmin(fmax((alb_length(off) / sphere->radius_mm - first) / step, 0), SHADOW_FULL - 1 - 1e-9);
    const int below = (int)place;
    const float share = (float)(place - below);
    float low[VALUES], high[VALUES];
    alb_shadow_field_at(low, &full->shells[below], 0, off);
    alb_shadow_field_at(high, &full->shells[below + 1], 0, off);
    for (size_t i = 0; i < VALUES; i++)
        visible[i * BLOCK + r] = (i ? 0 : (float)sqrt(4 * M_PI)) - (1 - share) * low[i] - share * high[i];
}

static void light_block(float (*irradiance)[3], const shadow_full *full, const alb_shadow_sky *sky,
                        const alb_sh_batch *law, const alb_vector *points, const alb_vector *normals, size_t count)
{
    float visible[VALUES * BLOCK] = {0}, transfer[ALL * BLOCK] = {0};
    double zonal[ALB_SH_ORDER_MAX], cosine[ALL];
    alb_sh_zonal_cosine(zonal, ALB_SH_ORDER_MAX);
    for (size_t r = 0; r < count; r++) {
        look(visible, full, points[r], r);
        alb_sh_zonal_turn(cosine, zonal, ALB_SH_ORDER_MAX, normals[r]);
        for (size_t i = 0; i < ALL; i++)
            transfer[i * BLOCK + r] = (float)cosine[i];
    }
    alb_sh_product_batch(visible, transfer, visible, ALB_SHADOW_ORDER, BLOCK, count);
    for (size_t r = 0; r < count; r++) {
        const float left = fminf(fmaxf(visible[r] / transfer[r], 0), 1);
        for (size_t i = 0; i < ALL; i++)
            transfer[i * BLOCK + r] = i < VALUES ? visible[i * BLOCK + r] : left * transfer[i * BLOCK + r];
    }
    memset(irradiance, 0, count * sizeof *irradiance);
    alb_shadow_sky_add(irradiance, sky, law, transfer, points, count);
}

void shadow_full_light(float (*irradiance)[3], const shadow_full *full, const alb_shadow_sky *sky,
                       const alb_sh_batch *law, const alb_vector *points, const alb_vector *normals, size_t count)
{
#pragma omp parallel for schedule(dynamic, 1)
    for (size_t k = 0; k < count; k += BLOCK)
        light_block(irradiance + k, full, sky, law, points + k, normals + k, count - k < BLOCK ? count - k : BLOCK);
}
