// What is known of the form that was taken: covariance, intervals, the Cramer-Rao bound, and which of its parameters
// the data identify.
#pragma once
#include "fit/search.h"

struct alb_outcome;
struct alb_common_sd;

enum { ALB_BECAUSE_SIZE = 200 };

// Of one parameter, or of the total.
typedef struct alb_certainty {
    double lower, upper;   // 95 %, by the profile likelihood; an open end is 0 or infinite, with the quantity's sign
    double cramer_rao_sd;  // by the noise alone, at the fit; infinite where the rank is deficient
    double worst_relative; // the same relative to the parameter, the largest that the data allow with 99 %
    char because[ALB_BECAUSE_SIZE]; // why it is not identifiable; empty where it is
} alb_certainty;

typedef struct alb_knowledge {
    alb_certainty parameters[ALB_PARAMETERS_MAX], total;
    double condition; // of J^T J scaled to unit diagonal
} alb_knowledge;

// What the readings tell of each parameter, beside a constant in all of them where one is fitted. A parameter is
// identifiable where its Cramer-Rao bound is at most half of itself not only at the fit, but at the ends of all the
// parameters' 99 % intervals too; see uncertainty.c.
bool alb_knowledge_find(alb_knowledge *knowledge, const alb_profile *profile, alb_candidate candidate,
                        const alb_weighing *weighing, bool with_offset, alb_error *error);
// Whether all parameters are; the reason where one is not. Less work where the bound at the fit says no.
bool alb_identify(bool *identifiable, char because[ALB_BECAUSE_SIZE], const alb_profile *profile,
                  alb_candidate candidate, const alb_weighing *weighing, alb_error *error);

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
