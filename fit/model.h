// What a fit sees of a profile: whitened readings, (W S)_i / sd_i, and their derivatives by the form's own parameters.
#pragma once
#include "fit/operator.h"
#include "fit/profile.h"

// What a fit sees. Borrowed.
typedef struct alb_weighing {
    const alb_readings *readings;
    const alb_operator *forward;
    const double *sd; // of each reading
    double energy_sd; // of sum value * area; 0: the energy is not a reading of its own
} alb_weighing;

// Whitened readings, the energy behind them where it has an sd: how many, and which they are.
int alb_weighing_rows(const alb_weighing *weighing);
double alb_weighing_reading(const alb_weighing *weighing, int i);
// sum value * area, of any readings.
double alb_energy(const alb_readings *readings, const double *value);

enum { ALB_MODEL_BLOCKS = (ALB_PARAMETERS_MAX + ALB_OPERATOR_COLUMNS) / ALB_OPERATOR_COLUMNS };

// Room for the values of one profile at a time; each thread has its own. Zero is empty.
typedef struct alb_model {
    const alb_weighing *weighing; // borrowed
    double
        *values[1 + ALB_PARAMETERS_MAX]; // [0] the model, [1 + p] its derivative by parameter p; alb_weighing_rows each
    double (*on_grid)[ALB_OPERATOR_COLUMNS], (*columns[ALB_MODEL_BLOCKS])[ALB_OPERATOR_COLUMNS]; // inside
} alb_model;

bool alb_model_create(alb_model *model, const alb_weighing *weighing, alb_error *error);
void alb_model_free(alb_model *model);
// Fills values. Where parameters overflow, so do the values.
void alb_model_evaluate(alb_model *model, const alb_profile *profile);
