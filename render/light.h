// Lights: what they send and the irradiance E they make on each patch.
#pragma once
#include "base/image.h"
#include "render/form_factor.h"
#include "render/patch.h"

typedef enum alb_light_kind {
    ALB_LIGHT_POINT,
    ALB_LIGHT_SPOT,
    ALB_LIGHT_PROJECTOR,
    ALB_LIGHT_ENVIRONMENT,
    ALB_LIGHTS
} alb_light_kind;
extern const char *const alb_light_names[ALB_LIGHTS]; // "point", "spot", "projector", "environment"

typedef struct alb_light {
    alb_light_kind kind;
    double flux[3];         // all but the environment: what it sends in total
    alb_vector position_mm; // point, spot; projector: a point on the middle of the beam
    alb_vector direction;   // spot, projector: unit
    double half_angle_deg;  // spot: even intensity inside this cone
    double diameter_mm;     // projector: an even disc; or, where pixel_mm > 0,
    double pixel_mm;    // the square pixels whose centre lies within diameter_px/2 of the beam's middle, which is the
    double diameter_px; // corner of four pixels where the diameter is even and the centre of one where it is odd
    double blur_sd_mm;  // projector: Gaussian, each axis
    double radiance[3]; // environment: even; of no account where map.pixels is there
    alb_image map;      // environment: latitude-longitude, +y up, the middle of the picture is the direction -z
    double radius_mm;   // environment: of the sphere about position_mm on which it lies; 0: infinitely far away
} alb_light;

void alb_light_free(alb_light *light);
// Radiance of the environment from the direction (unit); zero for other kinds.
void alb_light_sky(double radiance[3], const alb_light *light, alb_vector direction);
// Radiosity of an even sky as bright as that of all the lights, RGB: pi times their mean radiance, over 256 directions
// spread evenly; zero without an environment.
void alb_lights_sky(double radiosity[3], const alb_light *lights, size_t count);
// Adds the light's irradiance to each patch (patch_count rows). Point: 16 points a patch, shadow-tested where the
// outermost four do not agree. Spot and projector: about a million stratified rays that carry flux/N each to the patch
// they meet, so that flux is conserved exactly. Environment: the sky rays of the form factors. `seed` and `stream` pick
// the random numbers.
bool alb_light_add(double (*irradiance)[3], const alb_light *light, const alb_patches *patches,
                   const alb_tracer *tracer, const alb_form_factors *factors, uint64_t seed, uint64_t stream,
                   alb_error *error);
