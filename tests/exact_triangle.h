// Oracle: the integral of a radial profile over a triangle from any point p, with the closed form of P(r), in double
// precision and without tables. Gauss's theorem in polar coordinates about the foot of p on the triangle's plane, h the
// height of p, d the signed distance of the foot from an edge's line:
//     integral S(|x - p|) dA = sum over edges  sign(d) integral [P(sqrt(h^2 + rho^2)) - P(h)] dtheta
// with rho = |d| cosh w, dtheta = dw / cosh w, eight Gauss-Legendre points on panels of at most 0.8 in w.
#pragma once
#include "fit/material.h"
#include "render/patch.h"

static inline double exact_edge(const alb_profile *profile, double at_foot, double height2, double signed_d,
                                double from, double to)
{
    static const double nodes[4] = {0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363};
    static const double shares[4] = {0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763};
    const int panels = (int)ceil((to - from) / 0.8);
    const double half = 0.5 * (to - from) / panels, d = fabs(signed_d);
    double sum = 0;
    for (int k = 0; k < 8 * panels; k++) {
        const int node = k % 8;
        const double w = from + (2 * (k / 8) + 1) * half + (node < 4 ? -half : half) * nodes[node % 4];
        const double distance = sqrt(height2 + d * d * cosh(w) * cosh(w));
        sum += half * shares[node % 4] / cosh(w) * (alb_profile_disc(profile, distance) - at_foot);
    }
    return copysign(sum, signed_d);
}

static inline double exact_triangle(const alb_profile *profile, const alb_vector triangle[3], alb_vector p)
{
    const alb_vector normal = alb_unit(alb_cross(alb_sub(triangle[1], triangle[0]), alb_sub(triangle[2], triangle[0])));
    const double height = alb_dot(normal, alb_sub(p, triangle[0]));
    const alb_vector foot = alb_sub(p, alb_times(height, normal));
    const double at_foot = alb_profile_disc(profile, fabs(height));
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        const alb_vector a = alb_sub(triangle[k], foot), b = alb_sub(triangle[(k + 1) % 3], foot);
        const alb_vector along = alb_unit(alb_sub(b, a));
        const double d = alb_dot(alb_cross(along, normal), a), length = alb_length(alb_sub(b, a));
        if (fabs(d) > 1e-12 * length) // else seen edge-on: no angle
            sum += exact_edge(profile, at_foot, height * height, d, asinh(alb_dot(along, a) / fabs(d)),
                              asinh(alb_dot(along, b) / fabs(d)));
    }
    return sum;
}
