// Inside fit/: one row of the table of forms (profile.c).
#pragma once
#include "fit/profile.h"

typedef struct alb_form_row alb_form_row;
// All take the row and the form's own parameters p. `gradient` may be NULL.
struct alb_form_row {
    const char *name;
    int parameter_count, term_count;
    int stride;    // parameters of a term; the last may have fewer
    bool singular; // S grows as 1/r towards r = 0
    alb_parameter parameters[ALB_PARAMETERS_MAX];
    double (*value)(double *gradient, const alb_form_row *row, const double *p, double r_mm);
    double (*total)(double *gradient, const alb_form_row *row, const double *p);
    double (*disc)(const alb_form_row *row, const double *p, double rho_mm);
    double (*slowest)(const alb_form_row *row, const double *p); // -d ln S / dr far out
    bool (*sound)(const alb_form_row *row, const double *p);     // S finite, nowhere negative, falling off; in order
};

extern const alb_form_row alb_dipole_row, alb_better_dipole_row, alb_burley_row, alb_two_over_r_row,
    alb_buried_source_row, alb_two_buried_sources_row, alb_buried_and_over_r_row, alb_multipole_reflection_row,
    alb_multipole_transmission_row, alb_tabulated_row;

double alb_tabulated_fastest(const alb_profile *profile);
