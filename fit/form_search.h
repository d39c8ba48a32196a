// The best parameters of any form, from no start values.
#pragma once
#include "fit/search.h"

// Readings of single terms of unit amplitude on a grid of their other parameters, computed once for all fits to the
// same places. Zero is empty.
typedef struct alb_shapes {
    int count, rows;
    alb_profile *terms; // buried sources, those of depth 0 standing for a e^(-b r) / r, then Burley's
    double *readings;   // count x rows
    alb_operator coarse;
} alb_shapes;

typedef struct alb_bases {
    alb_basis exponentials;
    alb_shapes shapes; // made when first wanted
} alb_bases;

bool alb_shapes_create(alb_shapes *shapes, const alb_readings *readings, const alb_operator *forward, alb_error *error);
void alb_bases_free(alb_bases *bases);

// As alb_search, of any form but the dipoles. *found is false also where the form has no value at a reading (singular
// ones at r = 0).
bool alb_form_search(alb_profile *profile, double *chi_square, bool *found, alb_candidate candidate, alb_bases *bases,
                     const alb_weighing *weighing, alb_error *error);
