// What is known of the form that was taken: covariance, total and its sd, misfit, slope of the tail, and whether the
// data decide.
#pragma once
#include "fit/choose.h"
#include "fit/search.h"

// Fills the outcome, whose profile and discrepancy are set, with the rest. `weighing` is that of the last fit,
// energy_sd the sd of the measured energy. Fails only for want of memory.
bool alb_outcome_complete(alb_outcome *outcome, alb_candidate candidate, const alb_weighing *weighing, double energy_sd,
                          alb_common_sd common, alb_error *error);
