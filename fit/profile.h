// Inside fit/: what the solver needs of a profile beyond material.h.
#pragma once
#include "fit/material.h"

// Scales as flux^flux length^length.
typedef struct alb_parameter {
    const char *name; // with its unit
    int flux, length;
} alb_parameter;

const alb_parameter *alb_form_parameter(alb_form form, int i);
// Number of terms of a sum of exponentials, 1 to 3; 0 for the other forms.
int alb_form_term_count(alb_form form);
// Whether S grows as 1/r towards r = 0.
bool alb_form_singular(alb_form form);

// Whether the decays rise from term to term.
bool alb_form_ordered(alb_form form);

// S(r) and its derivatives by the parameters. r > 0 for singular forms.
double alb_profile_gradient(double gradient[ALB_PARAMETERS_MAX], const alb_profile *profile, double r_mm);
// The same of the total 2 pi integral S r dr.
double alb_profile_total_gradient(double gradient[ALB_PARAMETERS_MAX], const alb_profile *profile);
// -d ln S / dr far out, 1/mm: the slowest term's.
double alb_profile_slowest(const alb_profile *profile);
// Whether S is finite (but at r = 0 where it is singular), nowhere negative and falls off, with its terms in order.
bool alb_profile_sound(const alb_profile *profile);
// Whether a parameter is 0: a term of no light, of which there is nothing to know.
bool alb_profile_vanishes(const alb_profile *profile);
// Puts positive terms in order of their decays.
void alb_profile_order(alb_profile *profile);
