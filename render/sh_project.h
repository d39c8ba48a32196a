// Projection: order^2 coefficients of a function on the sphere, the integrals of f Y_i. Basis as in sh.h; order from 1
// to ALB_SH_ROTATE_MAX. On failure `out` is as it was.
#pragma once
#include "base/error.h"
#include "base/image.h"
#include "render/sh.h"

typedef double alb_sh_function(const void *context, alb_vector direction);

// Exact where the function is a polynomial of at most `degree` in x, y, z (harmonics of order degree + 1), else with
// what it has beyond folded in. degree + order - 1 at most ALB_SH_DEGREE_MAX (bad data); takes about half its square of
// calls.
enum { ALB_SH_DEGREE_MAX = 126 };
bool alb_sh_project(double *out, int order, int degree, alb_sh_function *function, const void *context,
                    alb_error *error);

// Pictures: each pixel is even over its solid angle, which is exact; what is not finite is bad data.
// Latitude-longitude, +y up, the middle of the picture is -z: as the environment light has it (light.h).
bool alb_sh_project_map(double *out, int order, const alb_image *map, int channel, alb_error *error);
// Six squares of one size, +x, -x, +y, -y, +z, -z, laid out as the cube maps of OpenGL and Direct3D.
bool alb_sh_project_cube(double *out, int order, const alb_image faces[6], int channel, alb_error *error);

// Shapes: one where the shape is seen from the origin, zero elsewhere.
// Around `axis` (unit) up to `angle`, 0 to pi.
void alb_sh_project_cap(double *out, int order, alb_vector axis, double angle);
// From within it is one everywhere.
void alb_sh_project_sphere(double *out, int order, alb_vector centre, double radius);
// A polygon of at least three vertices, from either side, in any sense. An edge through the origin is bad data. Where
// the outline crosses itself, parts of opposite sense are subtracted.
bool alb_sh_project_polygon(double *out, int order, const alb_vector *vertices, size_t count, alb_error *error);
// A flat disc. Errors near 1e-12; nearer to its rim than 1e-3 of the radius they grow. The origin on it is bad data.
bool alb_sh_project_disc(double *out, int order, alb_vector centre, alb_vector normal, double radius, alb_error *error);
