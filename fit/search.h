// The best parameters of one form, from no start values.
#pragma once
#include "fit/columns.h"
#include "fit/model.h"

// A form as it is fitted. Tied: signed exponentials with b2 = ALB_TIED_RATIO b1, three parameters. As b2 comes close to
// b1 the pair tends to (A + B r) e^(-b r) and its amplitudes grow without bound while S stays: the tied pair stands for
// all of those, which no data can tell apart, and says what the transmission of a thick slab looks like in three
// numbers.
typedef struct alb_candidate {
    alb_form form;
    bool tied;
} alb_candidate;
#define ALB_TIED_RATIO 1.1
int alb_candidate_parameters(alb_candidate candidate); // free ones

// *found false where no term of the wanted sign lowers chi-square (the form collapses to a simpler one).
// *chi_square is over the readings and, where it has an sd, the energy.
bool alb_search(alb_profile *profile, double *chi_square, bool *found, alb_candidate candidate, const alb_basis *basis,
                const alb_weighing *weighing, alb_error *error);
// From the profile given to the nearest minimum.
bool alb_search_polish(alb_profile *profile, double *chi_square, alb_candidate candidate, const alb_weighing *weighing,
                       alb_error *error);
// The first parameter that lies on a bound of the search (an amplitude that vanishes, a decay or depth that the
// readings cannot show, decays as close as is allowed), -1 for none.
int alb_search_at_bound(const alb_profile *profile, alb_candidate candidate, const alb_weighing *weighing);
// Inverse of the normal matrix J^T J, both in the form's own parameters; false (and zeros) where a column of J is
// linear in those before it but for 1e-11 (1 - R^2).
bool alb_candidate_covariance(double covariance[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX],
                              double normal[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX], alb_candidate candidate);
// Inverse of J^T J in the form's own parameters (of rank 3 where the pair is tied); *full_rank false (and zeros) where
// the scaled matrix cannot be inverted.
bool alb_search_covariance(double covariance[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX], bool *full_rank,
                           const alb_profile *profile, alb_candidate candidate, const alb_weighing *weighing,
                           alb_error *error);
