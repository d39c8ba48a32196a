// Albedo: an opaque surface's reflectance; of a translucent one the total of its reflection profile, which is what all
// of it together gives back of even light. Stops being true where light comes out far from where it went in: shadows on
// translucent materials are as sharp as on opaque ones here, but for those of environments on rigid bodies (transport).
#include "render/shadow_picture.h"
#include "base/memory.h"
#include "render/shadow_rays.h"
#include <stdlib.h>

static void set_albedos(double (*albedos)[3], const alb_scene *scene)
{
    for (size_t s = 0; s < scene->surface_count; s++)
        for (int c = 0; c < 3; c++) {
            const alb_surface *surface = &scene->surfaces[s];
            albedos[s][c] =
                surface->scatters ? alb_profile_total(&surface->profiles[ALB_REFLECTION][c]) : surface->reflectance[c];
        }
}

// Radiance that leaves the face at the hit.
static double leaves(const alb_scene *scene, const alb_shadow_stage *stage, const double (*albedos)[3],
                     const alb_hit *hit, int c)
{
    const uint32_t *v = scene->mesh.faces[hit->face];
    const uint16_t surface = scene->mesh.groups[hit->face];
    const double weights[3] = {1 - hit->u - hit->v, hit->u, hit->v};
    double irradiance = 0;
    for (int k = 0; k < 3; k++)
        irradiance += weights[k] * (double)stage->irradiance[v[k]][c];
    return (albedos[surface][c] * irradiance + scene->surfaces[surface].exitance[c]) / M_PI;
}

static void add_radiance(double sum[3], const alb_scene *scene, const alb_shadow_stage *stage,
                         const double (*albedos)[3], const alb_tracer *tracer, double u, double v)
{
    alb_vector origin, direction;
    alb_hit hit;
    if (!alb_camera_ray(&origin, &direction, &scene->camera, u, v))
        return;
    if (alb_tracer_closest(&hit, tracer, origin, direction)) {
        for (int c = 0; hit.front && c < 3; c++)
            sum[c] += leaves(scene, stage, albedos, &hit, c);
        return;
    }
    for (size_t i = 0; i < scene->light_count; i++) {
        double sky[3];
        alb_shadow_sky_radiance(sky, &scene->lights[i], origin, direction);
        for (int c = 0; c < 3; c++)
            sum[c] += sky[c];
    }
}

static double find_brightest(const alb_scene *scene, const alb_shadow_stage *stage, const double (*albedos)[3])
{
    double brightest = 0;
    for (size_t f = 0; f < scene->mesh.face_count; f++) {
        const uint16_t surface = scene->mesh.groups[f];
        const double *exitance = scene->surfaces[surface].exitance;
        for (int k = 0; k < 9 && exitance[0] + exitance[1] + exitance[2] <= 0; k++)
            brightest = fmax(brightest, albedos[surface][k % 3] / M_PI *
                                            (double)stage->irradiance[scene->mesh.faces[f][k / 3]][k % 3]);
    }
    return brightest;
}

bool alb_shadow_view(alb_image *picture, double *brightest, const alb_scene *scene, const alb_shadow_stage *stage,
                     alb_error *error)
{
    const alb_lens *lens = &scene->camera.lens;
    alb_tracer tracer = {0};
    double(*albedos)[3] = alb_allocate(scene->surface_count, sizeof *albedos, error);
    const bool ok = albedos && alb_tracer_create(&tracer, &scene->mesh, error) &&
                    alb_image_create(picture, lens->width, lens->height, "R,G,B", error);
    if (ok) {
        set_albedos(albedos, scene);
        *brightest = find_brightest(scene, stage, (const double(*)[3])albedos);
    }
#pragma omp parallel for schedule(dynamic, 4)
    for (int y = 0; y < (ok ? lens->height : 0); y++)
        for (int x = 0; x < lens->width; x++) {
            double sum[3] = {0};
            for (int k = 0; k < 4; k++)
                add_radiance(sum, scene, stage, (const double(*)[3])albedos, &tracer, x + (k % 2 ? 0.25 : -0.25),
                             y + (k / 2 ? 0.25 : -0.25));
            for (int c = 0; c < 3; c++)
                alb_image_at(picture, x, y)[c] = (float)(0.25 * sum[c]);
        }
    alb_tracer_free(&tracer);
    free(albedos);
    return ok;
}
