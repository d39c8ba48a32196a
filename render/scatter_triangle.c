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
//
// P is tabulated as P / r^2, which tends to S(0) / 2 and keeps the digits of small discs, by cubic Hermite pieces:
// error (b d)^4 / 384 of it at spacing d for e^(-b r), 3e-10 at b d = 0.02. Where the middles of the pieces say more
// than 1e-6 (and for forms that go as 1/r) the closed form stays. S is tabulated by straight pieces in floats: (b d)^2
// / 8 of it.
#include "base/memory.h"
#include "render/scatter.h"
#include <stdlib.h>

static const double nodes[4] = {0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363};
static const double shares[4] = {0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763};

static double disc_from_table(const double (*piece)[3][2], int c, double t)
{
    const double u = 1 - t, *low = piece[0][c], *high = piece[1][c];
    return u * u * ((1 + 2 * t) * low[0] + t * low[1]) + t * t * ((1 + 2 * u) * high[0] - u * high[1]);
}

// P(r) of the three profiles.
static void discs_at(double out[3], const alb_radial *radial, double r_mm)
{
    const double at = r_mm * radial->entries_per_mm;
    if (radial->discs && at < ALB_SCATTER_TABLE + 1) {
        const int entry = (int)at;
        for (int c = 0; c < 3; c++)
            out[c] = r_mm * r_mm * disc_from_table((const double(*)[3][2])radial->discs + entry, c, at - entry);
    } else {
        for (int c = 0; c < 3; c++)
            out[c] = alb_profile_disc(&radial->profiles[c], r_mm);
    }
}

static void values_at(double out[3], const alb_radial *radial, double r_mm)
{
    const double at = r_mm * radial->entries_per_mm;
    const int entry = (int)fmin(at, ALB_SCATTER_TABLE);
    for (int c = 0; c < 3; c++) {
        if (radial->values && at < ALB_SCATTER_TABLE + 1) {
            const double low = (double)radial->values[entry][c], high = (double)radial->values[entry + 1][c];
            out[c] = low + (at - entry) * (high - low);
        } else {
            out[c] = alb_profile_value(&radial->profiles[c], r_mm);
        }
    }
}

// Whether the pieces agree with the closed form in their middles; looked at where S has not died away.
static bool discs_hold(const alb_radial *radial)
{
    for (int k = 0; k < ALB_SCATTER_TABLE; k += k < 256 ? 1 : 61)
        for (int c = 0; c < 3; c++) {
            const double r_mm = (k + 0.5) / radial->entries_per_mm,
                         exact = alb_profile_disc(&radial->profiles[c], r_mm);
            const double found = r_mm * r_mm * disc_from_table((const double(*)[3][2])radial->discs + k, c, 0.5);
            if (!(fabs(found - exact) <= 1e-6 * fabs(exact)))
                return false;
        }
    return true;
}

bool alb_radial_create(alb_radial *radial, const alb_profile profiles[3], double end_mm, alb_error *error)
{
    *radial = (alb_radial){profiles, ALB_SCATTER_TABLE / fmax(1.0001 * end_mm, 1e-9), NULL, NULL};
    if (!(radial->values = alb_allocate(ALB_SCATTER_TABLE + 2, sizeof *radial->values, error)) ||
        !(radial->discs = alb_allocate(ALB_SCATTER_TABLE + 2, sizeof *radial->discs, error))) {
        alb_radial_free(radial);
        return false;
    }
    for (int k = 0; k < ALB_SCATTER_TABLE + 2; k++)
        for (int c = 0; c < 3; c++) {
            const double r = k / radial->entries_per_mm, near = 0.5 / radial->entries_per_mm;
            const double at = alb_profile_value(&profiles[c], r);
            // a form that is infinite at 0: its mean nearby
            const double s = isfinite(at) ? at : alb_profile_ring(&profiles[c], 0, near);
            const double p = k ? alb_profile_disc(&profiles[c], r) / (r * r) : 0.5 * s;
            // (P / r^2)' = S / r - 2 P / r^3
            radial->discs[k][c][0] = p;
            radial->discs[k][c][1] = k ? (s - 2 * p) / k : 0;
            radial->values[k][c] = (float)s;
        }
    for (int c = 0; c < 3; c++) // the parabola through what is known of the first piece
        radial->discs[0][c][1] = 2 * (radial->discs[1][c][0] - radial->discs[0][c][0]) - radial->discs[1][c][1];
    if (!discs_hold(radial)) {
        free(radial->discs);
        radial->discs = NULL;
    }
    return true;
}

void alb_radial_free(alb_radial *radial)
{
    free(radial->values);
    free(radial->discs);
    *radial = (alb_radial){0};
}

static void add_edge(double integral[3], const alb_radial *radial, const double at_foot[3], double height2,
                     double signed_d, double from, double to)
{
    const int panels = (int)ceil((to - from) / 1.5);
    const double half = 0.5 * (to - from) / panels, d = fabs(signed_d);
    for (int k = 0; k < 8 * panels; k++) {
        const int node = k % 8;
        const double w = from + (2 * (k / 8) + 1) * half + (node < 4 ? -half : half) * nodes[node % 4];
        const double stretch = cosh(w), weight = copysign(half * shares[node % 4] / stretch, signed_d);
        const double distance = sqrt(height2 + d * d * stretch * stretch);
        double discs[3];
        discs_at(discs, radial, distance);
        for (int c = 0; c < 3; c++)
            integral[c] += weight * (discs[c] - at_foot[c]);
    }
}

double alb_longest_edge(const alb_vector t[3])
{
    return fmax(alb_length(alb_sub(t[1], t[0])),
                fmax(alb_length(alb_sub(t[2], t[1])), alb_length(alb_sub(t[0], t[2]))));
}

void alb_scatter_triangle(double integral[3], const alb_radial *radial, const alb_vector triangle[3], alb_vector p)
{
    const alb_vector normal = alb_unit(alb_cross(alb_sub(triangle[1], triangle[0]), alb_sub(triangle[2], triangle[0])));
    const double height = alb_dot(normal, alb_sub(p, triangle[0]));
    const alb_vector foot = alb_sub(p, alb_times(height, normal));
    double at_foot[3];
    discs_at(at_foot, radial, fabs(height));
    integral[0] = integral[1] = integral[2] = 0;
    for (int k = 0; k < 3; k++) {
        const alb_vector a = alb_sub(triangle[k], foot), b = alb_sub(triangle[(k + 1) % 3], foot);
        const alb_vector along = alb_unit(alb_sub(b, a));
        const double signed_d = alb_dot(alb_cross(along, normal), a), d = fabs(signed_d);
        if (d > 1e-12 * alb_length(alb_sub(b, a))) // else seen edge-on: no angle
            add_edge(integral, radial, at_foot, height * height, signed_d, asinh(alb_dot(along, a) / d),
                     asinh(alb_dot(along, b) / d));
    }
}

void alb_scatter_triangle_from_afar(double integral[3], const alb_radial *radial, const alb_vector triangle[3],
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
        double values[3];
        values_at(values, radial, alb_length(alb_sub(x, p)));
        for (int c = 0; c < 3; c++)
            integral[c] += area * shares_of[ring] * values[c];
    }
}
