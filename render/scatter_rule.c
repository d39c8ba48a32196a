// The integral of a radial profile over a triangle as a sum over its edges (Gauss's theorem in polar coordinates about
// the foot of p on the triangle's plane, h the height of p, d the signed distance of the foot from an edge's line):
//     integral s(|x - p|) dA = sum over edges  sign(d) integral [P(sqrt(h^2 + rho^2)) - P(h)] dtheta,
//     P(r) = integral_0^r s(r) r dr
// Along an edge, at t from the perpendicular, t = |d| sinh w: rho = |d| cosh w, dtheta = dw / cosh w. In w the profile
// turns over within a step of about one, however narrow it is, and Gauss-Legendre with five points an edge does: 1e-3
// of the row's sum for well-shaped triangles, 1.5e-2 at worst where w goes to 5 (aspect 100). The weights of an
// edge are scaled to the angle that it spans, so that of a profile that ends inside the patch nothing is lost.
//
// Nothing of this depends on the profile: distances and weights stay, a change of profile is table look-ups.
#include "render/scatter_rule.h"
#include "base/vector_clones.h"
#include <string.h>

enum { PER_EDGE = (ALB_RULE_NODES - 1) / 3, WHOLE_CODE = UINT16_MAX + 1, WHOLE_TURN = INT16_MAX };

static const double nodes[PER_EDGE] = {-0.9061798459386640, -0.5384693101056831, 0, 0.5384693101056831,
                                       0.9061798459386640};
static const double shares[PER_EDGE] = {0.2369268850561891, 0.4786286704993665, 0.5688888888888889, 0.4786286704993665,
                                        0.2369268850561891};

// Distances in the plane and signed angles of one edge from a to b, about the origin.
static void take_edge(double distances[PER_EDGE], double angles[PER_EDGE], alb_vector a, alb_vector b,
                      alb_vector normal)
{
    const alb_vector along = alb_unit(alb_sub(b, a));
    const double from = alb_dot(along, a), to = alb_dot(along, b), signed_d = alb_dot(alb_cross(along, normal), a),
                 d = fmax(fabs(signed_d), 1e-9 * (to - from));
    const double low = asinh(from / d), high = asinh(to / d), half = 0.5 * (high - low);
    const double angle = copysign(atan2(to, d) - atan2(from, d), signed_d);
    double sum = 0;
    for (int k = 0; k < PER_EDGE; k++) {
        const double stretch = cosh(0.5 * (low + high) + half * nodes[k]);
        distances[k] = d * stretch;
        angles[k] = shares[k] / stretch;
        sum += angles[k];
    }
    for (int k = 0; k < PER_EDGE; k++)
        angles[k] *= fabs(signed_d) > 1e-9 * (to - from) ? angle / sum : 0; // seen edge-on: no angle
}

static uint16_t code_of(double distance_mm, double near_mm)
{
    return (uint16_t)fmin(rint(sqrt(distance_mm / near_mm) * WHOLE_CODE), UINT16_MAX);
}

void alb_rule_find(alb_rule *rule, const alb_vector triangle[3], alb_vector p, double near_mm)
{
    double distances[ALB_RULE_NODES - 1], angles[ALB_RULE_NODES - 1], below = 0;
    const alb_vector normal = alb_unit(alb_cross(alb_sub(triangle[1], triangle[0]), alb_sub(triangle[2], triangle[0])));
    const double height = alb_dot(normal, alb_sub(p, triangle[0]));
    const alb_vector foot = alb_sub(p, alb_times(height, normal));
    for (int k = 0; k < 3; k++)
        take_edge(distances + k * PER_EDGE, angles + k * PER_EDGE, alb_sub(triangle[k], foot),
                  alb_sub(triangle[(k + 1) % 3], foot), normal);
    for (int k = 0; k < ALB_RULE_NODES - 1; k++) { // rounded so that they add up to the whole
        const double next = below + angles[k] / (2 * M_PI), distance = hypot(distances[k], height);
        rule->weights[k] = (int16_t)(lrint(next * WHOLE_TURN) - lrint(below * WHOLE_TURN));
        rule->codes[k] = code_of(distance, near_mm);
        below = next;
    }
    rule->weights[ALB_RULE_NODES - 1] = (int16_t)-lrint(below * WHOLE_TURN);
    rule->codes[ALB_RULE_NODES - 1] = code_of(fabs(height), near_mm);
}

ALB_VECTOR_CLONES
void alb_rule_apply(double integral[3], const alb_rule *rule, const alb_scatter_kernel *kernel)
{
    typedef float float4 __attribute__((vector_size(16)));
    enum { PER_KNOT = WHOLE_CODE / ALB_DISC_KNOTS };
    float below[ALB_RULE_NODES], above[ALB_RULE_NODES]; // shares of the knots on either side
    float4 sum = {0};
    for (int k = 0; k < ALB_RULE_NODES; k++) {
        const float u = (float)rule->codes[k] * (1.0F / WHOLE_CODE), all = (float)rule->weights[k] * u * u;
        above[k] = all * (float)(rule->codes[k] % PER_KNOT) * (1.0F / PER_KNOT);
        below[k] = all - above[k];
    }
#pragma GCC unroll 16
    for (int k = 0; k < ALB_RULE_NODES; k++) {
        float4 knots[2];
        memcpy(knots, kernel->discs[rule->codes[k] / PER_KNOT], sizeof knots);
        sum += below[k] * knots[0] + above[k] * knots[1];
    }
    const double whole = 2 * M_PI / WHOLE_TURN * kernel->near_mm;
    for (int c = 0; c < 3; c++) // quadrature noise where the profile has died away; what is no number stays that
        integral[c] = sum[c] < 0 ? 0 : whole * (double)sum[c];
}
