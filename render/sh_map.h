// Angular maps: where a direction seen from the receiver lies as seen from the sample point. Angles are polar, from the
// axis that both points share; the azimuth stays. F_receiver(theta, phi) = F_sample(tau(theta), phi).
//
// k is the receiver's distance over the sample's, from the object's centre (cone, sphere), or the receiver's signed
// distance from the centre over the environment's radius (mid-range).
#pragma once
#include "base/error.h"
#include <stdbool.h>
#include <stddef.h>

typedef enum alb_sh_map_kind {
    ALB_SH_MAP_CONE,     // the silhouette lies on a cone of half-angle alpha around the axis, apex at the centre
    ALB_SH_MAP_MIDRANGE, // all light comes from a sphere around; the sample is at its centre
    ALB_SH_MAP_SPHERE,   // tangents to spheres around the centre
    ALB_SH_MAP_CUSTOM,
    ALB_SH_MAP_KINDS
} alb_sh_map_kind;

// tau at theta in [0, pi], from 0 to pi; its derivative in *slope.
typedef double alb_sh_tau(const void *context, double theta, double *slope);

typedef struct alb_sh_map {
    alb_sh_map_kind kind;
    bool windowed; // only tau < pi/2 is mapped; zero is seen beyond
    double k, cot_alpha;
    alb_sh_tau *tau;
    const void *context;
} alb_sh_map;

// A point of the map with the derivatives of both angles by a parameter along which the map is smooth.
typedef struct alb_sh_map_point {
    double cos_theta, sin_theta, theta_slope, cos_tau, sin_tau, tau_slope;
} alb_sh_map_point;

// tau = atan2(k sin theta, cos theta + (1 - k) cot(alpha) sin theta). k from 0 (the receiver at the centre), also
// infinite: beyond 1e-12 and 1e12 the limits, which M has reached there. alpha from 10 to 80 degrees: at 0 the
// cone is a needle, at 90 a disc that rings to half of the light from afar. ALB_USAGE says which bound was missed.
bool alb_sh_map_cone(alb_sh_map *map, double k, double alpha_deg, alb_error *error);
// tau = theta - asin(k sin theta), -1 < k < 1: on and outside the environment's sphere there is no such map.
bool alb_sh_map_midrange(alb_sh_map *map, double k, alb_error *error);
// tau = asin(k sin theta) for theta < asin(min(1, 1/k)): occlusion only, nothing is seen beyond (windowed). k as for
// the cone.
bool alb_sh_map_sphere(alb_sh_map *map, double k, alb_error *error);
// The caller's own function, which must be continuous and rise; borrowed with its context.
void alb_sh_map_custom(alb_sh_map *map, alb_sh_tau *tau, const void *context);

// A map given as a table: both angles rise from 0 to pi. Between the knots the monotone cubic of Fritsch & Butland
// 1984.
typedef struct alb_sh_tau_table {
    const double *theta, *tau; // [count], borrowed
    size_t count;
} alb_sh_tau_table;

// ALB_BAD_DATA names the row that is out of order.
bool alb_sh_map_table(alb_sh_map *map, const alb_sh_tau_table *table, alb_error *error);

// tau in [0, pi] at theta in [0, pi] (clamped), whole map, window aside; its derivative where `slope` is not NULL.
double alb_sh_map_tau(const alb_sh_map *map, double theta, double *slope);
// The map as a curve: `at` in [0, end].
double alb_sh_map_end(const alb_sh_map *map);
void alb_sh_map_at(alb_sh_map_point *point, const alb_sh_map *map, double at);
