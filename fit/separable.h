// Weighted least squares of one to three exponentials, from no start values, by variable projection: microseconds a
// fit, no allocation, for any number of threads that each have their own scratch.
#pragma once
#include "fit/columns.h"
#include "fit/search.h"

typedef struct alb_separable {
    alb_profile profile;
    bool found;            // false: no term of the wanted sign lowers chi-square below that of a simpler form
    double chi_square;     // where not found: of the best single exponential
    double chi_square_one; // of the best single exponential; of no term at all where that has no positive amplitude
    bool full_rank;        // whether the covariance, (J^T J)^-1 in the form's own parameters, could be had
    double covariance[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX];
} alb_separable;

// Doubles of scratch that a fit wants.
size_t alb_separable_scratch(const alb_basis *basis);
// value and sd: of each reading; energy_sd 0: the energy is not a reading of its own. Bad values (no value above zero,
// an sd that is not positive, anything not finite): found is false.
void alb_separable_fit(alb_separable *fit, alb_candidate candidate, const alb_basis *basis, const double *value,
                       const double *sd, double energy_sd, double *scratch);
