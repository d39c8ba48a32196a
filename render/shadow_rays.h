// Irradiance by rays: what shadow fields approximate, and what they are measured against.
#pragma once
#include "render/light.h"
#include "render/tracer.h"

// irradiance[count][3] of points with unit normals, E = pi / N sum of the radiance that N rays meet, N the square of
// `strata`, spread as the cosine over the hemisphere, one in each of strata^2 cells. The tracer's faces have
// face_radiance seen from the front and are black from the back; skies are what no face hides. Rays start offset_mm
// above the point. `seed` picks the random numbers; the error is random, without bias.
void alb_shadow_cast(float (*irradiance)[3], const alb_tracer *tracer, const float (*face_radiance)[3],
                     const alb_light *skies, size_t sky_count, const alb_vector *points, const alb_vector *normals,
                     size_t count, int strata, double offset_mm, uint64_t seed);

// What emits, as a place for rays to be aimed at; mesh and radiance are borrowed.
typedef struct alb_shadow_lamps {
    const alb_mesh *mesh;
    const float (*radiance)[3]; // of its faces
    uint32_t *faces;            // those that emit
    double *sums;               // of area times brightness up to each, and its end
    size_t count;
} alb_shadow_lamps;
bool alb_shadow_lamps_create(alb_shadow_lamps *lamps, const alb_mesh *mesh, const float (*face_radiance)[3],
                             alb_error *error);
void alb_shadow_lamps_free(alb_shadow_lamps *lamps);
// The same irradiance with as many rays more, aimed at what emits, where anything does: far less error from small
// lights.
void alb_shadow_cast_aimed(float (*irradiance)[3], const alb_tracer *tracer, const alb_shadow_lamps *lamps,
                           const alb_light *skies, size_t sky_count, const alb_vector *points,
                           const alb_vector *normals, size_t count, int strata, double offset_mm, uint64_t seed);
// Radiance of an environment seen from a point, also one of finite size.
void alb_shadow_sky_radiance(double radiance[3], const alb_light *sky, alb_vector from, alb_vector direction);
// Whether the point lies inside a closed part of the mesh: what is there is never seen.
bool alb_shadow_buried(const alb_tracer *tracer, alb_vector point, alb_vector normal, double offset_mm);
