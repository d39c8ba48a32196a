// Cosine directions: a point even on the disc (radius sqrt u, angle 2 pi v), lifted to the hemisphere. (u, v) jittered
// in a grid of cells, so that the error falls faster than that of independent rays where the light is smooth.
//
// Aimed: faces by area times brightness, one ray for each 1/N of their sum, places in them by a Kronecker sequence from
// a random start. Both kinds together by the balance heuristic of Veach & Guibas 1995: a ray of either kind that meets
// radiance L counts L cos / (p + q), p = cos / pi and q = brightness r^2 / (sum cos') the densities of both.
#include "render/shadow_rays.h"
#include "base/memory.h"
#include "base/random.h"
#include <stdlib.h>

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

static double brightness(const float radiance[3]) { return (double)(radiance[0] + radiance[1] + radiance[2]); }

// The face's normal, as long as twice its area.
static alb_vector twice_area(const alb_mesh *mesh, uint32_t face)
{
    const uint32_t *v = mesh->faces[face];
    const alb_vector a = mesh->vertices[v[0]];
    return alb_cross(alb_sub(mesh->vertices[v[1]], a), alb_sub(mesh->vertices[v[2]], a));
}

bool alb_shadow_lamps_create(alb_shadow_lamps *lamps, const alb_mesh *mesh, const float (*face_radiance)[3],
                             alb_error *error)
{
    *lamps = (alb_shadow_lamps){.mesh = mesh, .radiance = face_radiance};
    if (!(lamps->faces = alb_allocate(mesh->face_count, sizeof *lamps->faces, error)) ||
        !(lamps->sums = alb_allocate(mesh->face_count + 1, sizeof *lamps->sums, error))) {
        alb_shadow_lamps_free(lamps);
        return false;
    }
    for (uint32_t f = 0; f < mesh->face_count; f++) {
        const double power = 0.5 * alb_length(twice_area(mesh, f)) * brightness(face_radiance[f]);
        if (!(power > 0))
            continue;
        lamps->faces[lamps->count++] = f;
        lamps->sums[lamps->count] = lamps->sums[lamps->count - 1] + power;
    }
    return true;
}

void alb_shadow_lamps_free(alb_shadow_lamps *lamps)
{
    free(lamps->faces);
    free(lamps->sums);
    *lamps = (alb_shadow_lamps){0};
}

typedef struct rays {
    const alb_tracer *tracer;
    const float (*radiance)[3];
    const alb_light *skies;
    size_t sky_count;
    const alb_shadow_lamps *lamps; // NULL: no rays are aimed
    int strata;
    double offset_mm;
} rays;

// The density q of aimed rays over solid angles, of a face of that normal (not unit) seen along a line.
static double density(const alb_shadow_lamps *lamps, uint32_t face, alb_vector normal, alb_vector direction,
                      double distance_mm)
{
    const double cosine = -alb_dot(normal, direction) / alb_length(normal);
    return cosine > 0
               ? brightness(lamps->radiance[face]) * distance_mm * distance_mm / (lamps->sums[lamps->count] * cosine)
               : 0;
}

// Adds radiance over the rays' density in cosines over pi.
static void cast(double sum[3], const rays *r, alb_vector from, alb_vector direction, double cosine)
{
    alb_hit hit;
    if (alb_tracer_closest(&hit, r->tracer, from, direction)) {
        double share = 1;
        if (r->lamps && hit.front && brightness(r->radiance[hit.face]) > 0) {
            const double q =
                density(r->lamps, hit.face, twice_area(r->lamps->mesh, hit.face), direction, hit.distance_mm);
            share = cosine / (cosine + M_PI * q);
        }
        for (int c = 0; c < 3 && hit.front; c++)
            sum[c] += share * (double)r->radiance[hit.face][c];
        return;
    }
    for (size_t s = 0; s < r->sky_count; s++) {
        double radiance[3];
        alb_shadow_sky_radiance(radiance, &r->skies[s], from, direction);
        for (int c = 0; c < 3; c++)
            sum[c] += radiance[c];
    }
}

static uint32_t face_at(const alb_shadow_lamps *lamps, double part)
{
    size_t low = 0, high = lamps->count - 1; // the last whose sum before it is at most the part
    while (low < high) {
        const size_t middle = (low + high + 1) / 2;
        if (lamps->sums[middle] <= part)
            low = middle;
        else
            high = middle - 1;
    }
    return lamps->faces[low];
}

static void aim(double sum[3], const rays *r, alb_vector from, alb_vector normal, double part, double u, double v)
{
    const alb_shadow_lamps *lamps = r->lamps;
    const uint32_t face = face_at(lamps, part * lamps->sums[lamps->count]), *corners = lamps->mesh->faces[face];
    const alb_vector *vertices = lamps->mesh->vertices, twice = twice_area(lamps->mesh, face);
    const double root = sqrt(u), weights[3] = {1 - root, root * (1 - v), root * v};
    alb_vector at = alb_times(r->offset_mm, alb_unit(twice));
    for (int k = 0; k < 3; k++)
        at = alb_add(at, alb_times(weights[k], vertices[corners[k]]));
    const alb_vector to = alb_sub(at, from), direction = alb_unit(to);
    const double cosine = alb_dot(direction, normal), q = density(lamps, face, twice, direction, alb_length(to));
    if (!(cosine > 0 && q > 0) || alb_tracer_blocked(r->tracer, from, at))
        return;
    for (int c = 0; c < 3; c++)
        sum[c] += cosine / (cosine + M_PI * q) * (double)lamps->radiance[face][c];
}

static void cast_from(float irradiance[3], const rays *r, alb_vector point, alb_vector normal, alb_random random)
{
    const int strata = r->strata, count = strata * strata;
    const alb_vector from = alb_add(point, alb_times(r->offset_mm, normal));
    alb_vector x, y;
    double sum[3] = {0};
    alb_tangents(&x, &y, normal);
    for (int k = 0; k < count; k++) {
        const double u = (k % strata + alb_random_uniform(&random)) / strata;
        const double v = 2 * M_PI * (k / strata + alb_random_uniform(&random)) / strata, radius = sqrt(u);
        const alb_vector flat = alb_add(alb_times(radius * cos(v), x), alb_times(radius * sin(v), y));
        cast(sum, r, from, alb_add(flat, alb_times(sqrt(1 - u), normal)), sqrt(1 - u));
    }
    double u = alb_random_uniform(&random), v = alb_random_uniform(&random);
    for (int k = 0; k < count && r->lamps; k++) {
        aim(sum, r, from, normal, (k + alb_random_uniform(&random)) / count, u, v);
        u = fmod(u + 0.7548776662466927, 1); // 1 / x and 1 / x^2 of x^3 = x + 1
        v = fmod(v + 0.5698402909980532, 1);
    }
    for (int c = 0; c < 3; c++)
        irradiance[c] = (float)(M_PI / count * sum[c]);
}

static void cast_all(float (*irradiance)[3], const rays *r, const alb_vector *points, const alb_vector *normals,
                     size_t count, uint64_t seed)
{
#pragma omp parallel for schedule(dynamic, 16)
    for (size_t p = 0; p < count; p++)
        cast_from(irradiance[p], r, points[p], normals[p], alb_random_at(seed, 0x5ad0, p));
}

void alb_shadow_cast(float (*irradiance)[3], const alb_tracer *tracer, const float (*face_radiance)[3],
                     const alb_light *skies, size_t sky_count, const alb_vector *points, const alb_vector *normals,
                     size_t count, int strata, double offset_mm, uint64_t seed)
{
    cast_all(irradiance, &(rays){tracer, face_radiance, skies, sky_count, NULL, strata, offset_mm}, points, normals,
             count, seed);
}

void alb_shadow_cast_aimed(float (*irradiance)[3], const alb_tracer *tracer, const alb_shadow_lamps *lamps,
                           const alb_light *skies, size_t sky_count, const alb_vector *points,
                           const alb_vector *normals, size_t count, int strata, double offset_mm, uint64_t seed)
{
    cast_all(irradiance,
             &(rays){tracer, lamps->radiance, skies, sky_count, lamps->count ? lamps : NULL, strata, offset_mm}, points,
             normals, count, seed);
}

bool alb_shadow_buried(const alb_tracer *tracer, alb_vector point, alb_vector normal, double offset_mm)
{
    return alb_tracer_crossings(tracer, alb_add(point, alb_times(offset_mm, normal)), normal) < 0;
}
