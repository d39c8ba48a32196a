// Tables of angular scaling: M(k) from stored values, by schemes with names, and whole tables of the cone map at once.
#pragma once
#include "render/sh_scale.h"

typedef enum alb_sh_scheme {
    ALB_SH_SCHEME_LINEAR,    // between knots equally far apart in ln k (Wang et al. 2006: 40), mid-range in k
    ALB_SH_SCHEME_SPLINE,    // cubic, the same knots; value and slope are stored
    ALB_SH_SCHEME_CHEBYSHEV, // one polynomial in ln k (in k)
    ALB_SH_SCHEME_DIRECT,    // nothing stored: the law itself
    ALB_SH_SCHEMES
} alb_sh_scheme;

// "linear", "spline", "chebyshev", "direct".
extern const char *const alb_sh_scheme_names[ALB_SH_SCHEMES];

typedef struct alb_sh_table {
    alb_sh_law law;
    alb_sh_scheme scheme;
    int knots;
    double from, to; // of k
    float *values;   // [knots][count], spline [knots][2][count]; coefficients of Chebyshev polynomials
} alb_sh_table;

// knots from 6 (linear 2) to 1000; 0 < from < to (mid-range -1 < from < to < 1). A law whose slope jumps inside
// (light at 1) wants a table on either side. Release with alb_sh_table_free.
bool alb_sh_table_create(alb_sh_table *table, const alb_sh_law *law, alb_sh_scheme scheme, int knots, double from,
                         double to, alb_error *error);
void alb_sh_table_free(alb_sh_table *table);
// Never extrapolates: outside [from, to] the law itself is evaluated.
bool alb_sh_table_at(alb_sh_scaling *scaling, const alb_sh_table *table, double k, alb_error *error);
// Bytes of stored values.
size_t alb_sh_table_bytes(const alb_sh_table *table);

// The cone map's M of both measures at `count` k, which rise and lie in [1/16, 16]: visibility[i * values + v],
// energy likewise, values = alb_sh_scaling_count(order, order), order 1 to 8. Within 1e-6.
// 40 k of order 4 take some 35 us at alpha 45. ALB_USAGE where k, alpha or order are out of bounds.
bool alb_sh_table_cone(float *visibility, float *energy, const double *k, int count, double alpha_deg, int order,
                       alb_error *error);
