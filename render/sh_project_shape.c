// Projection of shapes. By Gauss's theorem on the sphere, Y_lm being an eigenfunction of the Laplacian there,
//     integral of Y_lm over the shape = -1 / (l (l + 1)) times the integral along its outline of dY_lm / dn
// n outwards; l = 0 is the solid angle. An edge of a polygon is an arc of a great circle: with the arc's pole for an
// axis dY / dn is a constant times cos m phi or sin m phi, integrated in closed form and rotated (in place of the zonal
// recurrences of Wang & Ramamoorthi 2018). The outline of a disc is summed at equal steps of its own angle, which
// converges faster than any power. A cap is zonal.
#include "render/sh_project.h"
#include "render/sh_rotate.h"
#include "render/sh_zonal.h"
#include <string.h>

enum { COUNT_MAX = ALB_SH_ROTATE_MAX * ALB_SH_ROTATE_MAX, STEPS_FIRST = 64, STEPS_LAST = 65536 };

void alb_sh_project_cap(double *out, int order, alb_vector axis, double angle)
{
    double zonal[ALB_SH_ROTATE_MAX];
    alb_sh_zonal_cap(zonal, order, angle);
    alb_sh_zonal_turn(out, zonal, order, axis);
}

void alb_sh_project_sphere(double *out, int order, alb_vector centre, double radius)
{
    const double distance = alb_length(centre);
    const bool inside = distance <= radius;
    alb_sh_project_cap(out, order, inside ? (alb_vector){0, 0, 1} : alb_unit(centre),
                       inside ? M_PI : asin(radius / distance));
}

// From the integrals of dY / dn and the solid angle, the sense of the outline unknown.
static void finish(double *out, const double *flux, double solid_angle, int order)
{
    const double sign = solid_angle < 0 ? -1 : 1;
    out[0] = sign * solid_angle / sqrt(4 * M_PI);
    for (int l = 1; l < order; l++)
        for (int i = l * l; i < (l + 1) * (l + 1); i++)
            out[i] = -sign * flux[i] / (l * (l + 1));
}

// Outwards of an arc from a to b, the shape on its left as seen from outside the sphere.
static void add_arc(double *flux, int order, alb_vector a, alb_vector b)
{
    const alb_vector normal = alb_cross(a, b), pole = alb_unit(normal), side = alb_cross(pole, a);
    const double length = atan2(alb_length(normal), alb_dot(a, b));
    const double world_from_arc[3][3] = {{a.x, side.x, pole.x}, {a.y, side.y, pole.y}, {a.z, side.z, pole.z}};
    double slopes[COUNT_MAX], c[COUNT_MAX];
    alb_sh_differentiate(slopes, order, (alb_vector){1, 0, 0}, (alb_vector){0, 0, -1});
    for (int m = 0; m < order; m++) {
        const double half = sin(m * length / 2);
        const double cosine = m ? sin(m * length) / m : length, sine = m ? 2 * half * half / m : 0;
        for (int l = m; l < order; l++) {
            c[alb_sh_index(l, -m)] = slopes[alb_sh_index(l, m)] * sine;
            c[alb_sh_index(l, m)] = slopes[alb_sh_index(l, m)] * cosine;
        }
    }
    alb_sh_rotate(c, c, order, world_from_arc);
    for (int i = 0; i < order * order; i++)
        flux[i] += c[i];
}

// Of the triangle of three unit vectors, signed (Van Oosterom & Strackee 1983).
static double triangle(alb_vector a, alb_vector b, alb_vector c)
{
    return 2 * atan2(alb_dot(a, alb_cross(b, c)), 1 + alb_dot(a, b) + alb_dot(b, c) + alb_dot(c, a));
}

bool alb_sh_project_polygon(double *out, int order, const alb_vector *vertices, size_t count, alb_error *error)
{
    double flux[COUNT_MAX] = {0}, solid_angle = 0;
    if (count < 3)
        return alb_fail(error, ALB_BAD_DATA, "a polygon of %zu vertices has no area", count);
    const alb_vector first = alb_unit(vertices[0]);
    for (size_t i = 0; i < count; i++) {
        const alb_vector a = alb_unit(vertices[i]), b = alb_unit(vertices[(i + 1) % count]);
        if (!(alb_length(a) > 0.5) || !(alb_length(b) > 0.5) || !isfinite(alb_length(a)) ||
            (alb_length(alb_cross(a, b)) < 1e-14 && alb_dot(a, b) < 0))
            return alb_fail(error, ALB_BAD_DATA, "polygon: the edge from vertex %zu is not finite or meets the origin",
                            i);
        if (alb_length(alb_cross(a, b)) > 0)
            add_arc(flux, order, a, b);
        solid_angle += triangle(first, a, b);
    }
    finish(out, flux, solid_angle, order);
    return true;
}

// One pass over the rim: p = centre + radius (t cos s + b sin s), r = p / |p|, the region within a hemisphere about
// `up`.
static double add_rim(double *flux, int order, alb_vector centre, alb_vector up, double radius, int steps)
{
    alb_vector t, b;
    double slopes[COUNT_MAX], solid_angle = 0;
    memset(flux, 0, (size_t)(order * order) * sizeof *flux);
    alb_tangents(&t, &b, up);
    for (int i = 0; i < steps; i++) {
        const double s = 2 * M_PI * (i + 0.5) / steps, c = radius * cos(s), d = radius * sin(s),
                     step = 2 * M_PI / steps;
        const alb_vector p = alb_add(centre, alb_add(alb_times(c, t), alb_times(d, b)));
        const alb_vector forward = alb_sub(alb_times(c * step, b), alb_times(d * step, t)), r = alb_unit(p);
        const alb_vector arc = alb_times(1 / alb_length(p), alb_sub(forward, alb_times(alb_dot(forward, r), r)));
        alb_sh_differentiate(slopes, order, r, alb_cross(arc, r));
        for (int k = 0; k < order * order; k++)
            flux[k] += slopes[k];
        solid_angle += alb_dot(up, alb_cross(r, arc)) / (1 + alb_dot(up, r)); // (1 - cos theta) d phi
    }
    return solid_angle;
}

bool alb_sh_project_disc(double *out, int order, alb_vector centre, alb_vector normal, double radius, alb_error *error)
{
    const alb_vector n = alb_unit(normal);
    const double height = alb_dot(n, centre), aside = alb_length(alb_sub(centre, alb_times(height, n)));
    if (!(radius >= 0) || !isfinite(radius + height + aside) || !(alb_length(n) > 0.5))
        return alb_fail(error, ALB_BAD_DATA, "disc: radius %g, or its centre or normal, is not one", radius);
    if (fabs(height) <= 1e-12 * radius && aside <= radius)
        return alb_fail(error, ALB_BAD_DATA, "the origin lies on the disc");
    const alb_vector up = alb_times(height < 0 ? -1 : 1, n);
    double flux[COUNT_MAX], before[COUNT_MAX], change = 1;
    double solid_angle = add_rim(flux, order, centre, up, radius, STEPS_FIRST);
    for (int steps = 2 * STEPS_FIRST; steps <= STEPS_LAST && change > 1e-14; steps *= 2) {
        memcpy(before, flux, sizeof before);
        const double last = solid_angle;
        solid_angle = add_rim(flux, order, centre, up, radius, steps);
        change = fabs(solid_angle - last);
        for (int i = 1; i < order * order; i++)
            change = fmax(change, fabs(flux[i] - before[i]));
    }
    finish(out, flux, solid_angle, order);
    return true;
}
