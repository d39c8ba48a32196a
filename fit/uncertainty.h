// What is known of the form that was taken: covariance, sd of the total and of S(r), and whether the data decide.
#pragma once
#include "fit/knowledge.h"

struct alb_outcome;
struct alb_common_sd;

// Fills the outcome, whose profile, discrepancy and offset are set, with the rest. `weighing` is that of the last fit,
// energy_sd the sd of the measured energy. Fails only for want of memory.
bool alb_outcome_complete(struct alb_outcome *outcome, alb_candidate candidate, const alb_weighing *weighing,
                          double energy_sd, struct alb_common_sd common, alb_error *error);
// Adds to the covariance what all readings share, by the powers in which parameters hold flux and length.
void alb_common_add(alb_fitted *fitted, struct alb_common_sd common);
// What compares the outcome's profile with the readings: chi-square, rms, the share of the total that was measured, the
// slope of the tail.
bool alb_outcome_describe_fit(struct alb_outcome *outcome, const alb_readings *readings, const alb_operator *forward,
                              alb_error *error);
// sd of alb_energy of the readings' values, no better than 1e-4.
double alb_energy_sd(const alb_readings *readings);
// sd of S(r), 1/mm^2, by the covariance; only for sums of exponentials.
double alb_profile_sd(const alb_fitted *fitted, double r_mm);
