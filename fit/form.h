// Inside fit/: one row of the table of forms (profile.c).
#pragma once
#include "fit/profile.h"

// All take the form's own parameters p and, where it is a sum, its number of terms. `gradient` may be NULL.
typedef struct alb_form_row {
    const char *name;
    int parameter_count, term_count;
    bool singular; // S grows as 1/r towards r = 0
    alb_parameter parameters[ALB_PARAMETERS_MAX];
    double (*value)(double *gradient, const double *p, int terms, double r_mm);
    double (*total)(double *gradient, const double *p, int terms);
    double (*disc)(const double *p, int terms, double rho_mm);
    double (*slowest)(const double *p, int terms); // -d ln S / dr far out
    bool (*sound)(const double *p, int terms);     // S finite, nowhere negative, falling off; terms in order
} alb_form_row;

extern const alb_form_row alb_dipole_row, alb_burley_row, alb_two_exponentials_over_r_row, alb_buried_source_row,
    alb_two_buried_sources_row;
