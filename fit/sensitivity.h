// How much of a fit rests on where its readings begin and end.
#pragma once
#include "fit/search.h"

typedef struct alb_sensitivity {
    double without_inner, without_outer; // total of the same form without a fifth of the readings there; NaN: none
} alb_sensitivity;

bool alb_sensitivity_find(alb_sensitivity *sensitivity, const alb_profile *profile, alb_candidate candidate,
                          const alb_weighing *weighing, bool with_offset, alb_error *error);
