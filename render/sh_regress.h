// Occlusion from afar by regression: the matrix of the cone map's form (same blocks, same multiplications) that is best
// for objects as they come, in the least squares over clusters of spheres.
//
//     M(k) = k^-2 (I + u R(u)),  u = 1 - 1/k,  R a polynomial with one coefficient matrix per power
//
// from `bench.sh_regress`, which fits it and writes render/sh_regress_data.c. From 1.02 times the bounding sphere.
// Where it stops being true: samples inside the bounding sphere; solid objects that fill it, whose shadow it takes for
// that of a nearer, smaller one (a ball of 0.98 from k = 2 on is 3 to 4 times as far off as by the windowed law).
#pragma once
#include "render/sh_scale.h"

enum { ALB_SH_REGRESS_ORDER = 4, ALB_SH_REGRESS_VALUES = 30, ALB_SH_REGRESS_POWERS = 12 };

// Chebyshev coefficients of R over u in [0, 1].
extern const float alb_sh_regress_coefficients[ALB_SH_REGRESS_POWERS][ALB_SH_REGRESS_VALUES];

// M for occlusion to occlusion at k >= 1; infinite k is nothing.
void alb_sh_regress_at(alb_sh_scaling *scaling, double k);
