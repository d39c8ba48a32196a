// The exact integral of a radial profile over a triangle, as a sum over its edges (Gauss's theorem in polar coordinates
// about the foot of p on the triangle's plane, h the height of p, d the signed distance of the foot from an edge's
// line):
//     integral S(|x - p|) dA = sum over edges  sign(d) integral [P(sqrt(h^2 + rho^2)) - P(h)] dtheta,
//     P(x) = integral_0^x S(r) r dr
// Along an edge, at s from the perpendicular, s = |d| sinh w: rho = |d| cosh w, dtheta = dw / cosh w. In w the profile
// turns over within a step of about one, however narrow it is and however close the foot lies to the edge, so that
// Gauss-Legendre with eight points on panels of at most 1.5 holds for triangles of any shape. For p anywhere: inside,
// outside or above.
//
// Away from the triangle the profile is smooth over it, and seven points that are exact to degree five (Radon 1948) do:
// from 1.25 longest edges on within 1e-4 of the integral where S turns over in no less than a third of an edge.
#include "render/scatter.h"

static const double nodes[4] = {0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363};
static const double shares[4] = {0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763};

static void add_edge(double integral[3], const alb_profile profiles[3], const double at_foot[3], double height2,
                     double signed_d, double from, double to)
{
    const int panels = (int)ceil((to - from) / 1.5);
    const double half = 0.5 * (to - from) / panels, d = fabs(signed_d);
    for (int k = 0; k < 8 * panels; k++) {
        const int node = k % 8;
        const double w = from + (2 * (k / 8) + 1) * half + (node < 4 ? -half : half) * nodes[node % 4];
        const double stretch = cosh(w), weight = copysign(half * shares[node % 4] / stretch, signed_d);
        const double distance = sqrt(height2 + d * d * stretch * stretch);
        for (int c = 0; c < 3; c++)
            integral[c] += weight * (alb_profile_disc(&profiles[c], distance) - at_foot[c]);
    }
}

void alb_scatter_triangle(double integral[3], const alb_profile profiles[3], const alb_vector triangle[3], alb_vector p)
{
    const alb_vector normal = alb_unit(alb_cross(alb_sub(triangle[1], triangle[0]), alb_sub(triangle[2], triangle[0])));
    const double height = alb_dot(normal, alb_sub(p, triangle[0]));
    const alb_vector foot = alb_sub(p, alb_times(height, normal));
    double at_foot[3];
    for (int c = 0; c < 3; c++) {
        at_foot[c] = alb_profile_disc(&profiles[c], fabs(height));
        integral[c] = 0;
    }
    for (int k = 0; k < 3; k++) {
        const alb_vector a = alb_sub(triangle[k], foot), b = alb_sub(triangle[(k + 1) % 3], foot);
        const alb_vector along = alb_unit(alb_sub(b, a));
        const double signed_d = alb_dot(alb_cross(along, normal), a), d = fabs(signed_d);
        if (d > 1e-12 * alb_length(alb_sub(b, a))) // else seen edge-on: no angle
            add_edge(integral, profiles, at_foot, height * height, signed_d, asinh(alb_dot(along, a) / d),
                     asinh(alb_dot(along, b) / d));
    }
}

void alb_scatter_triangle_from_afar(double integral[3], const alb_profile profiles[3], const alb_vector triangle[3],
                                    alb_vector p)
{
    static const double shares_of[3] = {0.225, 0.132394152788506, 0.125939180544827};
    static const double own[3] = {1.0 / 3, 0.059715871789770,
                                  0.797426985353087}; // weight of one corner, the others alike
    const double area =
        0.5 * alb_length(alb_cross(alb_sub(triangle[1], triangle[0]), alb_sub(triangle[2], triangle[0])));
    const alb_vector sum = alb_add(triangle[0], alb_add(triangle[1], triangle[2]));
    for (int c = 0; c < 3; c++)
        integral[c] = 0;
    for (int k = 0; k < 7; k++) {
        const int ring = (k + 2) / 3, corner = (k + 2) % 3; // the middle, then two rings of three
        const double other = 0.5 * (1 - own[ring]);
        const alb_vector x = alb_add(alb_times(other, sum), alb_times(own[ring] - other, triangle[corner]));
        const double distance = alb_length(alb_sub(x, p));
        for (int c = 0; c < 3; c++)
            integral[c] += area * shares_of[ring] * alb_profile_value(&profiles[c], distance);
    }
}
