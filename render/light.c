// Irradiance of a patch, by kind of light (Phi flux, n normal, A area, N rays):
//     point        mean over the patch of  Phi cos / (4 pi d^2), where it sees the light
//     spot         Phi / (N A) for each of N rays, even in solid angle inside the cone, that meets the patch's front
//     projector    the same with parallel rays, even over the disc or its pixels, displaced by the Gaussian blur
//     environment  (pi / R) sum of L(d_q) over the sky rays q of the patch's form factors
// Stops being true: a shadow that touches none of a patch's outermost points is not there; a point light nearer to a
// patch than a tenth of its size is held at that distance; a map with a small sun is seen by few of the R rays. A ray
// that meets the back of a patch is absorbed there.
#include "render/light.h"
#include "base/memory.h"
#include "base/random.h"
#include "capture/session.h"
#include <stdlib.h>

enum { POINTS = 4, RAYS = 1 << 20 }; // POINTS^2 on a patch

const char *const alb_light_names[ALB_LIGHTS] = {"point", "spot", "projector", "environment"};

void alb_light_free(alb_light *light)
{
    alb_image_free(&light->map);
    *light = (alb_light){0};
}

void alb_light_sky(double radiance[3], const alb_light *light, alb_vector direction)
{
    for (int c = 0; c < 3; c++)
        radiance[c] = light->kind == ALB_LIGHT_ENVIRONMENT ? light->radiance[c] : 0;
    if (light->kind != ALB_LIGHT_ENVIRONMENT || !light->map.pixels)
        return;
    const alb_image *map = &light->map;
    const double u = 0.5 + atan2(direction.x, -direction.z) / (2 * M_PI);
    const double v = acos(fmin(1, fmax(-1, direction.y))) / M_PI;
    const double x = u * map->width - 0.5, y = fmin(fmax(v * map->height - 0.5, 0), map->height - 1.0);
    const int x0 = (int)floor(x), y0 = (int)y, y1 = y0 + 1 < map->height ? y0 + 1 : y0;
    for (int c = 0; c < 3; c++) {
        const int channel = map->channels >= 3 ? c : 0;
        double row[2];
        for (int k = 0; k < 2; k++) {
            const float *left = alb_image_at(map, (x0 + map->width) % map->width, k ? y1 : y0);
            const float *right = alb_image_at(map, (x0 + 1) % map->width, k ? y1 : y0);
            row[k] = (double)left[channel] + (x - x0) * (double)(right[channel] - left[channel]);
        }
        radiance[c] = row[0] + (y - y0) * (row[1] - row[0]);
    }
}

void alb_lights_sky(double radiosity[3], const alb_light *lights, size_t count)
{
    enum { DIRECTIONS = 256 };
    radiosity[0] = radiosity[1] = radiosity[2] = 0;
    for (size_t i = 0; i < count; i++)
        for (int k = 0; k < DIRECTIONS && lights[i].kind == ALB_LIGHT_ENVIRONMENT; k++) {
            double radiance[3];
            const double y = 1 - (2 * k + 1.0) / DIRECTIONS, side = sqrt(1 - y * y), angle = 2.399963229728653 * k;
            alb_light_sky(radiance, &lights[i], (alb_vector){side * cos(angle), y, side * sin(angle)});
            for (int c = 0; c < 3; c++)
                radiosity[c] += M_PI * radiance[c] / DIRECTIONS;
        }
}

static bool add_environment(double (*irradiance)[3], const alb_light *light, const alb_patches *patches,
                            const alb_form_factors *factors, alb_error *error)
{
    double(*sky)[3] = alb_allocate(patches->count, sizeof *sky, error);
    if (!sky)
        return false;
#pragma omp parallel for schedule(dynamic, 64)
    for (size_t p = 0; p < patches->count; p++) {
        double sum[3] = {0};
        const int rays = alb_form_factors_rays(factors, p);
        for (int q = 0; q < rays; q++) {
            if (!alb_form_factors_sees_sky(factors, p, q))
                continue;
            double radiance[3];
            alb_light_sky(radiance, light, alb_form_factors_direction(factors, patches, p, q));
            for (int c = 0; c < 3; c++)
                sum[c] += radiance[c];
        }
        for (int c = 0; c < 3; c++)
            sky[p][c] = M_PI * sum[c] / rays;
    }
    alb_form_factors_share(sky, factors);
    for (size_t p = 0; p < patches->count; p++)
        for (int c = 0; c < 3; c++)
            irradiance[p][c] += sky[p][c];
    free(sky);
    return true;
}

// Mean of cos / (4 pi d^2) over the patch, zero where the light is hidden. The four outermost points look first: where
// they agree, the others see what they see.
static double point_share(const alb_light *light, const alb_patches *patches, const alb_tracer *tracer, size_t patch,
                          uint64_t seed, uint64_t stream)
{
    enum { ALL = POINTS * POINTS };
    static const int outermost[4] = {0, POINTS - 1, ALL - POINTS, ALL - 1};
    alb_vector points[ALL];
    double sums[2] = {0}, shares[ALL], sum = 0; // hidden, seen
    alb_random random = alb_random_at(seed, stream, patch);
    const double nearest2 = 0.01 * patches->areas_mm2[patch];
    if (alb_patch_buried(patches, patch))
        return 0;
    for (int k = 0; k < ALL; k++) {
        const double u = (k % POINTS + alb_random_uniform(&random)) / POINTS;
        const double v = ((double)(k / POINTS) + alb_random_uniform(&random)) / POINTS;
        points[k] = alb_patch_point(patches, patch, u, v);
        const alb_vector to = alb_sub(light->position_mm, points[k]);
        const double cosine = alb_dot(alb_unit(to), patches->normals[patch]);
        shares[k] = fmax(0, cosine) / (4 * M_PI * fmax(alb_dot(to, to), nearest2));
        sum += shares[k];
    }
    for (int i = 0; i < 4; i++)
        if (shares[outermost[i]] > 0)
            sums[!alb_tracer_blocked(tracer, points[outermost[i]], light->position_mm)] += 1;
    if (sums[0] == 0 || sums[1] == 0)
        return sums[0] > 0 ? 0 : sum / ALL;
    sum = 0;
    for (int k = 0; k < ALL; k++)
        if (shares[k] > 0 && !alb_tracer_blocked(tracer, points[k], light->position_mm))
            sum += shares[k];
    return sum / ALL;
}

static void add_point(double (*irradiance)[3], const alb_light *light, const alb_patches *patches,
                      const alb_tracer *tracer, uint64_t seed, uint64_t stream)
{
#pragma omp parallel for schedule(dynamic, 64)
    for (size_t p = 0; p < patches->count; p++) {
        const double share = point_share(light, patches, tracer, p, seed, stream);
        for (int c = 0; c < 3; c++)
            irradiance[p][c] += share * light->flux[c];
    }
}

// The projector's pixels: their centres in mm; an even disc is one "pixel" of its own.
typedef struct beam {
    double (*pixels)[2];
    size_t pixel_count;
    int side;        // side^2 rays a pixel
    alb_vector t, b; // tangents
    double back_mm;  // where parallel rays start, behind everything
} beam;

static bool beam_create(beam *out, const alb_light *light, const alb_patches *patches, alb_error *error)
{
    alb_tangents(&out->t, &out->b, light->direction);
    for (size_t i = 0; i < patches->mesh->vertex_count; i++) {
        const double back = -alb_dot(light->direction, alb_sub(patches->mesh->vertices[i], light->position_mm));
        out->back_mm = fmax(out->back_mm, back + 1);
    }
    const int across = light->kind == ALB_LIGHT_PROJECTOR && light->pixel_mm > 0 ? (int)ceil(light->diameter_px) : 1;
    if (!(out->pixels = alb_allocate((size_t)across * (size_t)across, sizeof *out->pixels, error)))
        return false;
    for (int k = 0; k < across * across; k++) {
        const double x = k % across - 0.5 * (across - 1), y = (double)(k / across) - 0.5 * (across - 1);
        if (across > 1 && !alb_disc_lights(light->diameter_px, k % across, k / across))
            continue;
        out->pixels[out->pixel_count][0] = x * light->pixel_mm;
        out->pixels[out->pixel_count++][1] = y * light->pixel_mm;
    }
    if (!out->pixel_count)
        return alb_fail(error, ALB_BAD_DATA,
                        "a projector's disc of %g pixels across holds the centre of none; 1, or 1.42 and more",
                        light->diameter_px);
    out->side = (int)ceil(sqrt((double)RAYS / (double)out->pixel_count));
    return true;
}

// Uniform point of the unit disc, the square's strata kept in shape (Shirley & Chiu 1997).
static void disc_point(double *x, double *y, double u, double v)
{
    const double a = 2 * u - 1, b = 2 * v - 1;
    if (a == 0 && b == 0) {
        *x = *y = 0;
        return;
    }
    const bool wide = a * a > b * b;
    const double radius = wide ? a : b, angle = wide ? M_PI / 4 * (b / a) : M_PI / 2 - M_PI / 4 * (a / b);
    *x = radius * cos(angle);
    *y = radius * sin(angle);
}

static void beam_ray(alb_vector *origin, alb_vector *direction, const beam *from, const alb_light *light, size_t ray,
                     uint64_t seed, uint64_t stream)
{
    const size_t side = (size_t)from->side, pixel = ray / (side * side), cell = ray % (side * side);
    alb_random random = alb_random_at(seed, stream, ray);
    const double u = ((double)(cell % side) + alb_random_uniform(&random)) / (double)side;
    const double v = ((double)(cell / side) + alb_random_uniform(&random)) / (double)side;
    double x = from->pixels[pixel][0], y = from->pixels[pixel][1], dx, dy;
    disc_point(&dx, &dy, u, v);
    *origin = light->position_mm;
    *direction = light->direction;
    if (light->kind == ALB_LIGHT_SPOT) {
        // a disc of equal areas maps to equal solid angles by radius^2 = (1 - cos) / (1 - cos of the cone)
        const double cosine = 1 - (dx * dx + dy * dy) * (1 - cos(light->half_angle_deg * M_PI / 180));
        const double sine = sqrt(fmax(0, 1 - cosine * cosine)), radius = fmax(hypot(dx, dy), 1e-300);
        const alb_vector sideways = alb_add(alb_times(dx / radius, from->t), alb_times(dy / radius, from->b));
        *direction = alb_unit(alb_add(alb_times(cosine, light->direction), alb_times(sine, sideways)));
        return;
    }
    x += light->pixel_mm > 0 ? (u - 0.5) * light->pixel_mm : 0.5 * light->diameter_mm * dx;
    y += light->pixel_mm > 0 ? (v - 0.5) * light->pixel_mm : 0.5 * light->diameter_mm * dy;
    x += light->blur_sd_mm * alb_random_normal(&random);
    y += light->blur_sd_mm * alb_random_normal(&random);
    const alb_vector aside = alb_add(alb_times(x, from->t), alb_times(y, from->b));
    *origin = alb_add(*origin, alb_sub(aside, alb_times(from->back_mm, light->direction)));
}

static bool add_beam(double (*irradiance)[3], const alb_light *light, const alb_patches *patches,
                     const alb_tracer *tracer, uint64_t seed, uint64_t stream, alb_error *error)
{
    beam from = {0};
    uint32_t *counts = alb_allocate(patches->count, sizeof *counts, error);
    const bool ok = counts && beam_create(&from, light, patches, error);
    const size_t rays = ok ? from.pixel_count * (size_t)from.side * (size_t)from.side : 0;
#pragma omp parallel for schedule(dynamic, 4096)
    for (size_t ray = 0; ray < rays; ray++) {
        alb_vector origin, direction;
        alb_hit hit;
        beam_ray(&origin, &direction, &from, light, ray, seed, stream);
        if (alb_tracer_closest(&hit, tracer, origin, direction) && hit.front)
            __atomic_add_fetch(&counts[hit.face], 1, __ATOMIC_RELAXED); // counting is the same in any order
    }
    for (size_t p = 0; ok && p < patches->count; p++)
        for (int c = 0; c < 3; c++)
            irradiance[p][c] += light->flux[c] * counts[p] / (double)rays / patches->areas_mm2[p];
    free(from.pixels);
    free(counts);
    return ok;
}

bool alb_light_add(double (*irradiance)[3], const alb_light *light, const alb_patches *patches,
                   const alb_tracer *tracer, const alb_form_factors *factors, uint64_t seed, uint64_t stream,
                   alb_error *error)
{
    switch (light->kind) {
    case ALB_LIGHT_ENVIRONMENT:
        return add_environment(irradiance, light, patches, factors, error);
    case ALB_LIGHT_POINT:
        add_point(irradiance, light, patches, tracer, seed, stream);
        return true;
    default:
        return add_beam(irradiance, light, patches, tracer, seed, stream, error);
    }
}
