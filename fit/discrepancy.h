// Fits where no form stands against the noise: the form is an approximation, and says by how much.
#pragma once
#include "fit/form_search.h"

typedef struct alb_discrepancy_fit {
    alb_profile profile;
    bool found;
    double relative; // t: the form misses the readings by so much of itself
    double score;    // sum ln(sd_i^2 + t^2 f_i^2) + k ln n; the lower the better
    bool decided;    // full rank, and every parameter known to half of itself
} alb_discrepancy_fit;

// The t of sum (value - fitted)^2 / (sd^2 + t^2 fitted^2) = freedom; 1e-9 where the noise suffices.
double alb_discrepancy_of(const double *value, const double *sd, const double *fitted, int count, int freedom);
// Fits one form with its discrepancy and with the energy as a reading of its own; `sd` has room for the readings and
// holds the widened ones at the end.
bool alb_discrepancy_search(alb_discrepancy_fit *fit, double *sd, alb_candidate candidate, alb_bases *bases,
                            const alb_weighing *noise, double energy_sd, alb_error *error);
// The sd of the readings with those of the form's discrepancy in quadrature.
bool alb_discrepancy_widen(double *sd, const alb_discrepancy_fit *fit, const alb_weighing *noise, alb_error *error);
// Whether the readings decide every parameter: full rank, and each known to better than half of itself; *which is the
// first that is not, -1 where the rank is deficient.
bool alb_parameters_decided(int *which, const alb_profile *profile, bool full_rank,
                            double covariance[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX]);
