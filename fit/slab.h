// R(r) and T(r) of a slab by radiative transport: radiant exitance at distance r from a pencil beam that falls
// perpendicularly, per incident flux, 1/mm^2, with the Henyey-Greenstein phase function and Fresnel's faces.
//
// Good to 0.3 % from 1 to 30 transport mean free paths while S is within 1e-4 of its largest there, 1 % from half of
// one; nearer the beam R is off by 6 % (g = 0.9: 25 %); the totals by 0.08 % of the flux. Reduced albedos below
// 0.8: 1.5 % (tests/fit/test_slab.c). 6 ms.
#pragma once
#include "base/error.h"
#include "capture/session.h" // alb_side
#include "fit/harmonics.h"

enum { ALB_SLAB_KNOTS = 160 };

typedef struct alb_slab_light {
    double total[ALB_SIDES];       // scattered light that leaves, all radii
    double unscattered[ALB_SIDES]; // leaves at r = 0; of g > 0, with what scattered by too little to tell (harmonics.h)
    double first_mm, end_mm, knots_per_ln;
    double ln_value[ALB_SIDES][ALB_SLAB_KNOTS], ln_bend[ALB_SIDES][ALB_SLAB_KNOTS]; // by ln r, cubic between knots
} alb_slab_light;

// For distances up to end_mm. ALB_BAD_DATA where the slab is not one (harmonics.h tells the bounds).
bool alb_slab_light_create(alb_slab_light *light, const alb_slab *slab, double end_mm, alb_error *error);
// Constant below some thousandth of a transport mean free path, and beyond the end.
double alb_slab_light_value(const alb_slab_light *light, alb_side side, double r_mm);
