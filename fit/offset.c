// The constant as one more parameter of one exponential, the tied pair, two exponentials and the signed pair: separable
// fits of the readings less a guess (nothing, the mean of the outer tenth, half of it), each then polished with the
// constant free. The constant is a value that all readings have in common: it does not pass through the forward model.
//
// A term that hardly decays within the readings is a constant to them, and a constant costs one parameter less. So by
// BIC = chi-square + k ln n, with 10 for "decidedly" (odds of 150 to 1 in its approximation; one parameter more then
// wants chi-square less by 14.8 at 120 readings, 1 in 8000 by chance):
//   the form that was chosen stands and is identified: a constant only where it is decidedly better;
//   it does not stand against the noise, or none was found: where one with a constant does, or comes ten times nearer;
//   it stands and is not identified:                   where one with a constant is no worse, and the slow term, if the
//     form has one, decays by less than e within the readings all over its 95 % interval: what is left of it in a
//     larger range nobody has seen.
// In between it is said that a constant would do as well, where it is beyond 3 of its sd.
// Stops being true where the stray light is not constant: glare falls off with distance and looks like a term.
#include "fit/offset.h"
#include "base/memory.h"
#include "base/statistics.h"
#include "fit/profile_likelihood.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double decidedly = 10, stands_tail = 1e-3, far_better = 0.1;
enum { GUESSES = 3, CANDIDATES = 4 };
static const alb_candidate candidates[CANDIDATES] = {{ALB_FORM_EXPONENTIAL, false},
                                                     {ALB_FORM_SIGNED_EXPONENTIALS, true},
                                                     {ALB_FORM_TWO_EXPONENTIALS, false},
                                                     {ALB_FORM_SIGNED_EXPONENTIALS, false}};

typedef struct shifted {
    alb_candidate candidate;
    alb_profile profile;
    double offset, offset_sd, bic;
    bool stands;
} shifted;

static double mean_of_outer(const alb_readings *readings)
{
    double sum = 0, weight = 0;
    for (int i = readings->count - 1 - readings->count / 10; i < readings->count; i++) {
        const double w = 1 / (readings->sd[i] * readings->sd[i]);
        sum += w * readings->value[i];
        weight += w;
    }
    return sum / weight;
}

// One form from one guess; `moved` has the readings less the guess. Keeps it in *best where its BIC is less.
static bool try_guess(shifted *best, alb_candidate candidate, double guess, const alb_basis *basis,
                      const alb_weighing *moved, alb_error *error)
{
    const int n = moved->readings->count, parameters = alb_candidate_parameters(candidate) + 1;
    alb_profile profile;
    alb_likelihood likelihood;
    double chi_square, covariance[ALB_PARAMETERS_MAX + 1][ALB_PARAMETERS_MAX + 1], condition;
    bool found;
    if (n < parameters + 1)
        return true;
    if (!alb_search(&profile, &chi_square, &found, candidate, basis, moved, error))
        return false;
    for (int p = 0; found && p < alb_form_parameter_count(profile.form); p++)
        found = profile.parameters[p] != 0;
    if (!found)
        return true;
    if (!alb_likelihood_create(&likelihood, &profile, candidate, moved, true, error))
        return false;
    const double bic = likelihood.chi_square + parameters * log(n);
    if (bic < best->bic && alb_likelihood_bound(covariance, &condition, &likelihood, &likelihood.best))
        *best = (shifted){candidate,
                          likelihood.best,
                          guess + likelihood.offset,
                          sqrt(covariance[parameters - 1][parameters - 1]),
                          bic,
                          alb_chi_square_tail(likelihood.chi_square, n - parameters) >= stands_tail};
    alb_likelihood_free(&likelihood);
    return true;
}

// The form with a constant of least BIC, that of no form infinite.
static bool find_best(shifted *best, alb_measurement *measurement, alb_error *error)
{
    alb_readings moved = measurement->readings; // but for its values
    const double mean = mean_of_outer(&moved), guesses[GUESSES] = {0, mean, mean / 2};
    const alb_weighing weighing = {&moved, &measurement->forward, moved.sd, 0};
    alb_basis basis = {0};
    *best = (shifted){.bic = INFINITY};
    double *values = alb_allocate((size_t)moved.count, sizeof(double), error);
    bool ok = values && alb_basis_create(&basis, &moved, &measurement->forward, error);
    for (int g = 0; ok && g < GUESSES; g++) {
        for (int i = 0; i < moved.count; i++)
            values[i] = measurement->readings.value[i] - guesses[g];
        moved.value = values;
        for (int c = 0; ok && c < CANDIDATES; c++)
            ok = try_guess(best, candidates[c], guesses[g], &basis, &weighing, error);
    }
    alb_basis_free(&basis);
    free(values);
    return ok;
}

// Whether the slowest term, by its interval, hardly decays within the readings.
static bool slow_term_is_flat(const alb_outcome *outcome, const alb_readings *readings)
{
    return outcome->fitted.profile.form != ALB_FORM_TWO_EXPONENTIALS ||
           outcome->knowledge.parameters[1].upper * readings->outer_mm < 1;
}

static double least_chi_square(const alb_outcome *outcome)
{
    double least = INFINITY;
    for (int i = 0; i < outcome->attempt_count; i++)
        least = fmin(least, outcome->attempts[i].chi_square); // NaN, not fitted, is passed over
    return least;
}

static bool take_off(alb_measurement *measurement, const shifted *best, alb_error *error)
{
    alb_readings *readings = &measurement->readings;
    for (int i = 0; i < readings->count; i++)
        readings->value[i] -= best->offset;
    if (!alb_choose(&measurement->outcome, readings, &measurement->forward, measurement->common, error))
        return false;
    alb_outcome *outcome = &measurement->outcome;
    outcome->offset = best->offset;
    outcome->offset_sd = best->offset_sd;
    if (outcome->discrepancy_relative > 0)
        return true;
    const alb_weighing noise = {readings, &measurement->forward, readings->sd, 0};
    const alb_candidate candidate = {outcome->fitted.profile.form, outcome->tied};
    return alb_outcome_complete(outcome, candidate, &noise, 0, measurement->common, error);
}

// Beside the form that was chosen by the noise: whether one with a constant takes its place; where it is no worse, the
// outcome says so.
static bool displaces(const shifted *best, alb_outcome *outcome, const alb_attempt *chosen,
                      const alb_readings *readings)
{
    if (!best->stands && !(best->bic < far_better * least_chi_square(outcome)))
        return false;
    const double excess = best->bic - chosen->bic;
    if (excess < -decidedly || (!outcome->fitted.identifiable && excess <= 0 && slow_term_is_flat(outcome, readings)))
        return true;
    if (excess <= decidedly && fabs(best->offset) > 3 * best->offset_sd)
        snprintf(outcome->offset_instead, sizeof outcome->offset_instead,
                 "a constant of %.3g +- %.2g under %s would do as well (BIC %+.3g)", best->offset, best->offset_sd,
                 alb_form_name(best->candidate.form), excess);
    return false;
}

// A form beside a discrepancy is looked for only where none with a constant serves: most of the work, and in vain
// otherwise.
bool alb_offset_choose(alb_measurement *measurement, alb_error *error)
{
    alb_outcome *outcome = &measurement->outcome;
    alb_error none = {0};
    alb_choice choice;
    shifted best;
    if (!alb_choice_by_noise(&choice, outcome, &measurement->readings, &measurement->forward, measurement->common,
                             error))
        return false;
    bool ok = find_best(&best, measurement, error), take = false;
    const bool stood = choice.chosen >= 0;
    if (ok && !stood)
        take = best.stands || best.bic < far_better * least_chi_square(outcome);
    if (ok && !take && !alb_choice_complete(&choice, outcome, &none)) {
        take = none.status == ALB_UNDECIDED && isfinite(best.bic);
        ok = take || alb_fail(error, none.status, "%s", none.text);
    } else if (ok && stood) {
        take = displaces(&best, outcome, &outcome->attempts[choice.chosen], &measurement->readings);
    }
    alb_choice_free(&choice);
    return ok && (!take || take_off(measurement, &best, error));
}
