// Cosine directions: a point even on the disc (radius sqrt u, angle 2 pi v), lifted to the hemisphere. (u, v) jittered
// in a grid of cells, so that the error falls faster than that of independent rays where the light is smooth.
#include "render/shadow_rays.h"
#include "base/random.h"

void alb_shadow_sky_radiance(double radiance[3], const alb_light *sky, alb_vector from, alb_vector direction)
{
    if (!(sky->radius_mm > 0)) {
        alb_light_sky(radiance, sky, direction);
        return;
    }
    // |off + t direction| = radius
    const alb_vector off = alb_sub(from, sky->position_mm);
    const double along = alb_dot(off, direction),
                 left = along * along + sky->radius_mm * sky->radius_mm - alb_dot(off, off);
    const double t = sqrt(fmax(left, 0)) - along;
    alb_light_sky(radiance, sky, alb_unit(alb_add(off, alb_times(t, direction))));
}

static void cast(double sum[3], const alb_tracer *tracer, const float (*face_radiance)[3], const alb_light *skies,
                 size_t sky_count, alb_vector from, alb_vector direction)
{
    alb_hit hit;
    if (alb_tracer_closest(&hit, tracer, from, direction)) {
        for (int c = 0; c < 3 && hit.front; c++)
            sum[c] += (double)face_radiance[hit.face][c];
        return;
    }
    for (size_t s = 0; s < sky_count; s++) {
        double radiance[3];
        alb_shadow_sky_radiance(radiance, &skies[s], from, direction);
        for (int c = 0; c < 3; c++)
            sum[c] += radiance[c];
    }
}

void alb_shadow_cast(float (*irradiance)[3], const alb_tracer *tracer, const float (*face_radiance)[3],
                     const alb_light *skies, size_t sky_count, const alb_vector *points, const alb_vector *normals,
                     size_t count, int strata, double offset_mm, uint64_t seed)
{
#pragma omp parallel for schedule(dynamic, 16)
    for (size_t p = 0; p < count; p++) {
        alb_random random = alb_random_at(seed, 0x5ad0, p);
        const alb_vector from = alb_add(points[p], alb_times(offset_mm, normals[p]));
        alb_vector x, y;
        double sum[3] = {0};
        alb_tangents(&x, &y, normals[p]);
        for (int k = 0; k < strata * strata; k++) {
            const double u = (k % strata + alb_random_uniform(&random)) / strata;
            const double v = 2 * M_PI * (k / strata + alb_random_uniform(&random)) / strata, r = sqrt(u);
            const alb_vector flat = alb_add(alb_times(r * cos(v), x), alb_times(r * sin(v), y));
            cast(sum, tracer, face_radiance, skies, sky_count, from, alb_add(flat, alb_times(sqrt(1 - u), normals[p])));
        }
        for (int c = 0; c < 3; c++)
            irradiance[p][c] = (float)(M_PI / (strata * strata) * sum[c]);
    }
}

bool alb_shadow_buried(const alb_tracer *tracer, alb_vector point, alb_vector normal, double offset_mm)
{
    return alb_tracer_crossings(tracer, alb_add(point, alb_times(offset_mm, normal)), normal) < 0;
}
