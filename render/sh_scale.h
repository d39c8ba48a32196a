// Angular scaling of spherical harmonics: the matrix that takes the coefficients of a function seen from a sample point
// to those of F(tau(theta), phi), seen from a receiver on the same axis (z). Source: Wang et al. 2006, eq. 6.
//
//     M_(lm),(l'm') = delta_mm' 2 pi int K_l^m P_l^m(cos theta) K_l'^m P_l'^m(cos tau) eta dtheta     m = |m|
//
// eta = sin theta keeps values (visibility, radiance), eta = sin(tau) tau' keeps the integral over the sphere
// ("energy"; no light does that). One block for each |m|, the same for m and -m.
//
// Do not chain: M(a) M(b) is not M(ab), 13 to 80 % off at order 4. Scale from the sample as it was taken.
#pragma once
#include "render/sh.h"
#include "render/sh_map.h"

enum { ALB_SH_SCALING_ORDER_MAX = 16, ALB_SH_SCALING_VALUES_MAX = 1496 };

typedef enum alb_sh_measure { ALB_SH_VISIBILITY, ALB_SH_ENERGY } alb_sh_measure;

// Blocks m = 0, 1, ... of (order_out - m) x (order_in - m) values, rows l = m, m+1, ...: alb_sh_scaling_count values.
typedef struct alb_sh_scaling {
    int order_out, order_in;
    double value[ALB_SH_SCALING_VALUES_MAX];
} alb_sh_scaling;

// Stored values: 30 for order 4, 70 for order 8 to 4.
int alb_sh_scaling_count(int order_out, int order_in);
// Where the value of (m, l_out, l_in) is stored; 0 <= m <= l_out < order_out, m <= l_in < order_in.
int alb_sh_scaling_index(int order_out, int order_in, int m, int l_out, int l_in);

// The orders, and their values zero; what is behind them stays. ALB_USAGE where an order is not from 1 to
// ALB_SH_SCALING_ORDER_MAX.
bool alb_sh_scaling_begin(alb_sh_scaling *scaling, int order_out, int order_in, alb_error *error);
// M by adaptive Gauss quadrature along the map, within 1e-13. Fails with ALB_BAD_DATA where a map of
// the caller's has no finite integral. Some 40 us at order 4, more near the map's limits.
bool alb_sh_scaling_compute(alb_sh_scaling *scaling, const alb_sh_map *map, alb_sh_measure measure, int order_out,
                            int order_in, alb_error *error);
// The mid-range map's M in closed form, within 1e-13 for every |k| < 1; same bounds and values as by quadrature.
bool alb_sh_scaling_midrange(alb_sh_scaling *scaling, double k, alb_sh_measure measure, int order_out, int order_in,
                             alb_error *error);

// out[order_out^2] = M in[order_in^2]; they may not overlap.
void alb_sh_scaling_apply(double *out, const alb_sh_scaling *scaling, const double *in);

// What a function of the sample becomes at a receiver k times as far away, by name.
typedef enum alb_sh_law_kind {
    ALB_SH_LAW_VISIBILITY, // M with eta = sin theta: as printed. From afar it goes to a constant that is not 1
    ALB_SH_LAW_ENERGY,     // M with eta = sin(tau) tau': as printed. A light's flux never falls off
    ALB_SH_LAW_LIGHT,      // k^-2 times the former for k > 1: a light's flux falls off; visibility's law for k < 1
    ALB_SH_LAW_OCCLUSION,  // 1 - visibility: M for k <= 1, from 1.3 on only tau < pi/2 of it; a blend between
    ALB_SH_LAW_REGRESSED,  // 1 - visibility, k > 1: least squares over clusters of spheres (render/sh_regress.h)
    ALB_SH_LAWS
} alb_sh_law_kind;

typedef struct alb_sh_law {
    alb_sh_law_kind kind;
    alb_sh_map_kind map;
    double alpha_deg; // cone only
    int order_out, order_in;
} alb_sh_law;

// "visibility", "energy", "light", "occlusion", "regressed".
extern const char *const alb_sh_law_names[ALB_SH_LAWS];
// "cone", "midrange", "sphere".
extern const char *const alb_sh_map_names[ALB_SH_MAP_CUSTOM];

// Whether such a law exists: the sphere map knows occlusion only, the mid-range map visibility and energy only, the
// regressed law is of the cone map, alpha 45, order 4. ALB_USAGE.
bool alb_sh_law_check(const alb_sh_law *law, alb_error *error);
// M of the law at k, continuous in k, the identity at k = 1 (mid-range 0) for square cone and mid-range laws.
bool alb_sh_law_at(alb_sh_scaling *scaling, const alb_sh_law *law, double k, alb_error *error);
