// Inside fit/: what the solver needs of a profile beyond material.h.
#pragma once
#include "fit/material.h"

// Number of exponential terms: 1 to 3; 0 for the other forms.
int alb_form_term_count(alb_form form);
// S(r) and its derivatives by the parameters; only for sums of exponentials (term count > 0).
double alb_profile_gradient(double gradient[ALB_PARAMETERS_MAX], const alb_profile *profile, double r_mm);
// The same of the total 2 pi integral S r dr.
double alb_profile_total_gradient(double gradient[ALB_PARAMETERS_MAX], const alb_profile *profile);
