// Real spherical harmonics: the basis, its conventions, and converters to and from other people's.
//
//     Y_lm(d) = sqrt(2) K_l^m P_l^m(cos theta) cos(m phi)      m > 0        d = (x, y, z) unit; theta from +z,
//               K_l^0 P_l^0(cos theta)                         m = 0        phi from +x towards +y
//               sqrt(2) K_l^|m| P_l^|m|(cos theta) sin(|m| phi)  m < 0
//     K_l^m = sqrt((2l + 1) (l - m)! / (4 pi (l + m)!))
//
// Orthonormal over the sphere; P_l^m without the Condon-Shortley phase: Y_1,-1, Y_10, Y_11 = sqrt(3 / 4 pi) (y, z, x),
// as in three.js. Order N means the bands l = 0 .. N-1, N^2 coefficients, Y_lm at l (l + 1) + m (where "order" or
// "degree" is the highest l, N is one more).
//
// Batches are structures of arrays: coefficient i of item r at [i * stride + r], r < count <= stride; the same for the
// components of directions. What is done to one item does not depend on the others: batches may be cut anywhere, the
// bytes are the same. Single precision, orders 1 to ALB_SH_ORDER_MAX. `out` may be `in` where both are there.
#pragma once
#include "base/vector.h"
#include <stddef.h>

enum { ALB_SH_ORDER_MAX = 8, ALB_SH_COUNT_MAX = ALB_SH_ORDER_MAX * ALB_SH_ORDER_MAX };

static inline int alb_sh_index(int l, int m) { return l * (l + 1) + m; }

// K_l^m P_l^m for 0 <= m <= l < order at l (l + 1) / 2 + m, by recurrence in l, upwards. `sine` 1 instead of sin theta
// leaves out the factor sin^m theta. Errors stay near 1e-15 times the largest value of the band; order up to 256.
void alb_sh_legendre(double *values, int order, double cosine, double sine);

// order^2 values of the basis along a unit direction; order up to 256.
void alb_sh_evaluate(double *values, int order, alb_vector direction);
// Derivatives along `tangent`, which stands at right angles to the unit direction: of Y per radian times its length.
void alb_sh_differentiate(double *values, int order, alb_vector direction, alb_vector tangent);
// values[i * stride + r] of directions[c * stride + r], c = 0, 1, 2 for x, y, z; errors below 2e-6.
void alb_sh_evaluate_batch(float *values, int order, const float *directions, size_t stride, size_t count);

// sum c_i Y_i(direction); order up to 256.
double alb_sh_value(const double *coefficients, int order, alb_vector direction);

// From or to the basis with the Condon-Shortley phase ((-1)^m Y_lm; google/spherical-harmonics, DirectXMath): the
// coefficients of odd m change sign. Its own inverse.
void alb_sh_condon_shortley(double *coefficients, int order);
// From visibility to occlusion or back: the constant one, sqrt(4 pi) in the first coefficient, less the coefficients.
void alb_sh_complement(double *coefficients, int order);
