// The total of the form fitted again, from where it was, with a fifth of the readings given no weight: the innermost,
// then the outermost. A form that is true of the material gives the same within its sd; one that is not gives another
// one for every range, and by how much tells what the choice of the range is worth. The energy, where it is a reading,
// is left out too.
#include "fit/sensitivity.h"
#include "base/memory.h"
#include "fit/profile_likelihood.h"
#include <math.h>
#include <stdlib.h>

static const double no_weight = 1e6; // times the sd

bool alb_sensitivity_find(alb_sensitivity *sensitivity, const alb_profile *profile, alb_candidate candidate,
                          const alb_weighing *weighing, bool with_offset, alb_error *error)
{
    const int n = weighing->readings->count, fifth = n / 5;
    *sensitivity = (alb_sensitivity){(double)NAN, (double)NAN};
    if (n - fifth <= alb_candidate_parameters(candidate) + with_offset || alb_profile_vanishes(profile))
        return true;
    double *sd = alb_allocate((size_t)n, sizeof(double), error);
    bool ok = sd != NULL;
    for (int end = 0; ok && end < 2; end++) {
        const alb_weighing part = {weighing->readings, weighing->forward, sd, 0};
        alb_likelihood likelihood;
        for (int i = 0; i < n; i++)
            sd[i] = weighing->sd[i] * ((end ? i >= n - fifth : i < fifth) ? no_weight : 1);
        ok = alb_likelihood_create(&likelihood, profile, candidate, &part, with_offset, error);
        if (ok)
            *(end ? &sensitivity->without_outer : &sensitivity->without_inner) = alb_profile_total(&likelihood.best);
        if (ok)
            alb_likelihood_free(&likelihood);
    }
    free(sd);
    return ok;
}
