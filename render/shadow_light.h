// Irradiance of receivers from skies and lights with fields, in the soft shadows of occluders with fields.
#pragma once
#include "render/shadow_emitter.h"
#include "render/shadow_field.h"
#include "render/shadow_glimpse.h"
#include "render/shadow_laws.h"
#include "render/shadow_sky.h"
#include "render/shadow_surface.h"
#include "render/shadow_transport.h"

enum { ALB_SHADOW_OCCLUDERS_MAX = 64 };

// What lights and what hides; all borrowed.
typedef struct alb_shadow_world {
    const alb_shadow_field *occluders, *lights;
    const alb_shadow_emitter *emitters; // of the lights; NULL: each light is its field alone, in products of order 4
    const alb_shadow_sky *skies;
    size_t occluder_count, light_count, sky_count; // at most ALB_SHADOW_OCCLUDERS_MAX occluders
    const alb_shadow_laws *laws;
    const alb_shadow_transport *transport; // NULL: none; else receivers are the vertices it was made for
    const bool *of_body;                   // whether each occluder belongs to its body
    const alb_shadow_surface *surfaces;    // NULL: none; else of each occluder, without probes where it has none
    const alb_shadow_glimpse *glimpses;    // of the surfaces, where there are both surfaces and emitters
    const size_t *first_vertices;          // of each occluder with a surface, among the receivers
} alb_shadow_world;

// Seconds summed over threads: looking up and scaling of samples; products with all that follows.
typedef struct alb_shadow_seconds {
    double scaling, products;
} alb_shadow_seconds;

// irradiance[count][3] at points with unit normals: W/mm^2 where radiance is W/(mm^2 sr). seconds may be NULL.
// ALB_BAD_DATA: too many occluders, or a receiver on or beyond the sphere of a sky.
bool alb_shadow_irradiance(float (*irradiance)[3], const alb_shadow_world *world, const alb_vector *points,
                           const alb_vector *normals, size_t count, alb_shadow_seconds *seconds, alb_error *error);

// Of the receivers that face a light with a field, the share from which its bounding sphere is less than
// ALB_SHADOW_SMALL_DEG in half-angle: what its shadows have finer than order 8 is then lost.
#define ALB_SHADOW_SMALL_DEG 20
double alb_shadow_small_lights(const alb_shadow_world *world, const alb_vector *points, const alb_vector *normals,
                               size_t count);
