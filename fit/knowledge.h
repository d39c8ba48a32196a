// Which parameters the data identify: intervals by the profile likelihood, and the Cramer-Rao bound.
#pragma once
#include "fit/search.h"

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
// parameters' 99 % intervals too; see knowledge.c.
bool alb_knowledge_find(alb_knowledge *knowledge, const alb_profile *profile, alb_candidate candidate,
                        const alb_weighing *weighing, bool with_offset, alb_error *error);
// The first of n parameters that is not identifiable, n where all are.
int alb_knowledge_unidentified(const alb_knowledge *knowledge, int n);
// Whether all parameters are; the reason where one is not. Less work where the bound at the fit says no.
bool alb_identify(bool *identifiable, char because[ALB_BECAUSE_SIZE], const alb_profile *profile,
                  alb_candidate candidate, const alb_weighing *weighing, alb_error *error);
