// Which form, and what is known of it.
//
// 1. Sums of up to two exponentials are fitted by the noise alone, the simplest first: one exponential, the tied signed
//    pair (search.h), two exponentials, the signed pair: 2, 3, 4, 4 parameters. A richer one is taken where it lowers
//    chi-square by more than max(10.6, 2 ln n) for two parameters or max(7.88, ln n) for one: a likelihood-ratio test
//    at 1 % shared by two candidates (0.5 % each), or BIC, whichever asks more. Between equally rich forms the smaller
//    chi-square decides.
// 2. A form stands where P(chi-square) >= 1e-3; where the one taken does not, the simplest that does is taken. Its
//    parameters, covariance and total are those of this fit, and nothing else enters. Where the data do not identify
//    its parameters (uncertainty.c), a simpler form that stands and whose parameters they do identify is taken instead.
// 3. Where none of them stands, Burley's form, one buried source, two exponentials over r, one of each, three
// exponentials
//    and two buried sources are fitted (2, 3, 4, 5, 6, 6 parameters); of those that stand and whose parameters the data
//    identify the one of least BIC is taken. So data made by up to two exponentials see these in one case of 1000 at
//    most.
// 4. Where no form stands, the form is an approximation and its errors are not those of the noise (discrepancy.c). The
//    form of least score is taken, among those whose parameters the data decide where there is one; forms of more
//    than four parameters only where they are decided and their score is less than that of the simpler form.
// What is known of the form taken: uncertainty.c.
//
// Every attempt keeps what it came to by the noise: chi-square with its tail, BIC, the lag-1 correlation of its
// whitened residuals, e_i: sum e_i e_i+1 / sum e_i^2, normal with variance 1/n in white noise, and whether a parameter
// ended on a bound.
#include "fit/choose.h"
#include "base/memory.h"
#include "base/statistics.h"
#include "fit/discrepancy.h"
#include "fit/form_search.h"
#include "fit/uncertainty.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double reject_tail = 1e-3, tied_gain_wanted = 7.88, gain_wanted = 10.6;
// simplest first
static const alb_candidate candidates[ALB_ATTEMPTS_MAX] = {{ALB_FORM_EXPONENTIAL, false},
                                                           {ALB_FORM_SIGNED_EXPONENTIALS, true},
                                                           {ALB_FORM_TWO_EXPONENTIALS, false},
                                                           {ALB_FORM_SIGNED_EXPONENTIALS, false},
                                                           {ALB_FORM_BURLEY, false},
                                                           {ALB_FORM_BURIED_SOURCE, false},
                                                           {ALB_FORM_TWO_OVER_R, false},
                                                           {ALB_FORM_BURIED_AND_OVER_R, false},
                                                           {ALB_FORM_THREE_EXPONENTIALS, false},
                                                           {ALB_FORM_TWO_BURIED_SOURCES, false}};
enum { ONE, TIED, TWO, SIGNED, FURTHER, LAST = ALB_ATTEMPTS_MAX - 1 };

typedef struct alb_choice_fit {
    alb_profile profile;
    bool found;
    double chi_square;
} fit;

// What the whitened residuals of a fit say.
static bool describe(alb_attempt *attempt, const fit *found, alb_candidate candidate, const alb_weighing *noise,
                     alb_error *error)
{
    const alb_readings *readings = noise->readings;
    double *model = alb_operator_readings(noise->forward, &found->profile, error), before = 0, products = 0,
           squares = 0;
    if (!model)
        return false;
    for (int i = 0; i < readings->count; i++) {
        const double residual = (readings->value[i] - model[i]) / readings->sd[i];
        products += before * residual;
        squares += residual * residual;
        before = residual;
    }
    free(model);
    attempt->chi_square = found->chi_square;
    attempt->bic = found->chi_square + alb_candidate_parameters(candidate) * log(readings->count);
    attempt->p_value = alb_chi_square_tail(attempt->chi_square, attempt->degrees_of_freedom);
    attempt->lag_1 = squares > 0 ? products / squares : 0;
    attempt->lag_1_p = 0.5 * erfc(attempt->lag_1 * sqrt(readings->count / 2.0));
    attempt->at_bound = alb_search_at_bound(&found->profile, candidate, noise);
    return true;
}

// Fits the candidates `from` to `to`.
static bool fit_by_noise(fit fits[ALB_ATTEMPTS_MAX], alb_outcome *outcome, int from, int to, alb_bases *bases,
                         const alb_weighing *noise, alb_error *error)
{
    const int n = noise->readings->count;
    outcome->attempt_count = to + 1;
    for (int f = from; f <= to; f++) {
        alb_attempt *attempt = &outcome->attempts[f];
        const int parameters = alb_candidate_parameters(candidates[f]);
        *attempt = (alb_attempt){.form = candidates[f].form,
                                 .tied = candidates[f].tied,
                                 .chi_square = (double)NAN,
                                 .bic = (double)NAN,
                                 .p_value = (double)NAN,
                                 .lag_1 = (double)NAN,
                                 .lag_1_p = (double)NAN,
                                 .bic_excess = (double)NAN,
                                 .degrees_of_freedom = n - parameters,
                                 .at_bound = -1};
        if (n < parameters + 1) {
            snprintf(attempt->rejected, ALB_REASON_SIZE, "%d readings are too few for %d parameters", n, parameters);
            continue;
        }
        if (!alb_form_search(&fits[f].profile, &fits[f].chi_square, &fits[f].found, candidates[f], bases, noise, error))
            return false;
        if (!fits[f].found)
            snprintf(attempt->rejected, ALB_REASON_SIZE, "no term of this sign lowers chi-square");
        else if (!describe(attempt, &fits[f], candidates[f], noise, error))
            return false;
    }
    return true;
}

static bool stands(const alb_attempt *attempt)
{
    return attempt->p_value >= reject_tail; // NaN: not found
}

static void explain(const fit fits[ALB_ATTEMPTS_MAX], alb_outcome *outcome, int chosen)
{
    for (int f = 0; f < outcome->attempt_count; f++) {
        alb_attempt *attempt = &outcome->attempts[f];
        if (f == chosen || !fits[f].found)
            continue;
        const double gain = attempt->chi_square - fits[chosen].chi_square;
        if (!stands(attempt))
            snprintf(attempt->rejected, ALB_REASON_SIZE, "chi-square %.5g for %d degrees of freedom (tail %.2g)",
                     attempt->chi_square, attempt->degrees_of_freedom, attempt->p_value);
        else if (gain > 0)
            snprintf(attempt->rejected, ALB_REASON_SIZE, "chi-square larger by %.4g", gain);
        else
            snprintf(attempt->rejected, ALB_REASON_SIZE, "lowers chi-square by %.4g only: not worth its parameters",
                     -gain);
    }
}

// Index of the form of up to two terms to take by the noise, -1 where none stands.
static int simplest(const fit fits[ALB_ATTEMPTS_MAX], const alb_outcome *outcome, int n)
{
    const double one = fits[ONE].found ? fits[ONE].chi_square : (double)INFINITY;
    const double tied = fits[TIED].found ? fits[TIED].chi_square : (double)INFINITY;
    const double two = fits[TWO].found ? fits[TWO].chi_square : (double)INFINITY;
    const double pair = fits[SIGNED].found ? fits[SIGNED].chi_square : (double)INFINITY;
    const double both = fmin(two, pair);
    const double step = fmax(tied_gain_wanted, log(n)), steps = fmax(gain_wanted, 2 * log(n));
    int chosen = ONE;
    if (tied < one - step && !(both < tied - step))
        chosen = TIED;
    else if (both < one - steps)
        chosen = two <= pair ? TWO : SIGNED;
    if (stands(&outcome->attempts[chosen]))
        return chosen;
    for (int f = ONE; f <= SIGNED; f++)
        if (stands(&outcome->attempts[f]))
            return f;
    return -1;
}

// Where the data do not identify the parameters of the form taken, the richest simpler one that stands and whose they
// do is taken in its place; *unidentified is the one given up, -1 for none.
static bool settle_for_identified(int *chosen, int *unidentified, char because[ALB_BECAUSE_SIZE],
                                  const fit fits[ALB_ATTEMPTS_MAX], const alb_outcome *outcome,
                                  const alb_weighing *noise, alb_error *error)
{
    char other[ALB_BECAUSE_SIZE];
    *unidentified = -1;
    for (int f = *chosen; f >= ONE; f--) {
        bool identifiable;
        const bool simpler = alb_candidate_parameters(candidates[f]) < alb_candidate_parameters(candidates[*chosen]);
        if (!fits[f].found || !stands(&outcome->attempts[f]) || (f != *chosen && !simpler))
            continue;
        if (!alb_identify(&identifiable, f == *chosen ? because : other, &fits[f].profile, candidates[f], noise, error))
            return false;
        if (identifiable) {
            *unidentified = f == *chosen ? -1 : *chosen;
            *chosen = f;
            break;
        }
    }
    return true;
}

// Of the further forms the one of least BIC that stands and whose parameters the data identify, -1 for none.
static bool choose_further(int *chosen, const fit fits[ALB_ATTEMPTS_MAX], const alb_outcome *outcome,
                           const alb_weighing *noise, alb_error *error)
{
    char because[ALB_BECAUSE_SIZE];
    bool refused[ALB_ATTEMPTS_MAX] = {false}, identifiable = false;
    do {
        *chosen = -1;
        for (int f = FURTHER; f <= LAST; f++)
            if (!refused[f] && stands(&outcome->attempts[f]) &&
                (*chosen < 0 || outcome->attempts[f].bic < outcome->attempts[*chosen].bic))
                *chosen = f;
        if (*chosen < 0)
            return true;
        if (!alb_identify(&identifiable, because, &fits[*chosen].profile, candidates[*chosen], noise, error))
            return false;
        refused[*chosen] = true;
    } while (!identifiable);
    return true;
}

// *chosen is the index of the form to take by the noise, -1 where none stands.
static bool choose_by_noise(int *chosen, fit fits[ALB_ATTEMPTS_MAX], alb_outcome *outcome, alb_bases *bases,
                            const alb_weighing *noise, alb_error *error)
{
    char because[ALB_BECAUSE_SIZE];
    int unidentified;
    if (!fit_by_noise(fits, outcome, ONE, SIGNED, bases, noise, error))
        return false;
    *chosen = simplest(fits, outcome, noise->readings->count);
    if (*chosen < 0 && (!fit_by_noise(fits, outcome, FURTHER, LAST, bases, noise, error) ||
                        !choose_further(chosen, fits, outcome, noise, error)))
        return false;
    if (*chosen < 0)
        return true;
    if (!settle_for_identified(chosen, &unidentified, because, fits, outcome, noise, error))
        return false;
    explain(fits, outcome, *chosen);
    if (unidentified >= 0)
        snprintf(outcome->attempts[unidentified].rejected, ALB_REASON_SIZE,
                 "lowers chi-square by %.4g, but is not identifiable: %s",
                 fits[*chosen].chi_square - fits[unidentified].chi_square, because);
    return true;
}

static bool better(int f, const alb_discrepancy_fit *one, const alb_discrepancy_fit *best)
{
    if (alb_candidate_parameters(candidates[f]) > 4)
        return one->decided && one->score < best->score;
    return one->decided == best->decided ? one->score < best->score : one->decided;
}

// *chosen is the index of the form to take where none stands; sd has room for the readings and holds the widened ones
// at the end.
static bool choose_with_discrepancy(int *chosen, fit fits[ALB_ATTEMPTS_MAX], double *sd, alb_outcome *outcome,
                                    alb_bases *bases, const alb_weighing *noise, double energy_sd, alb_error *error)
{
    alb_discrepancy_fit misfits[ALB_ATTEMPTS_MAX] = {{.found = false}};
    int best = -1;
    for (int f = 0; f < ALB_ATTEMPTS_MAX; f++) {
        char *why = outcome->attempts[f].rejected;
        if (stands(&outcome->attempts[f]))
            snprintf(why, ALB_REASON_SIZE, "fits within the noise, but its parameters are not decided");
        else if (noise->readings->count > alb_candidate_parameters(candidates[f]) &&
                 !alb_discrepancy_search(&misfits[f], sd, candidates[f], bases, noise, energy_sd, error))
            return false;
        if (!misfits[f].found) {
            if (!*why)
                snprintf(why, ALB_REASON_SIZE, "no term of this sign lowers chi-square beside the discrepancy");
            continue;
        }
        snprintf(why, ALB_REASON_SIZE, "no form fits within the noise; this one misses by %.3g relative%s",
                 misfits[f].relative, misfits[f].decided ? "" : " and its parameters are not decided");
        if (best < 0 || better(f, &misfits[f], &misfits[best]))
            best = f;
    }
    if (best < 0)
        return alb_fail(error, ALB_UNDECIDED, "no form follows the readings: they do not fall with distance");
    outcome->attempts[best].rejected[0] = '\0';
    outcome->discrepancy_relative = misfits[best].relative;
    fits[best].profile = misfits[best].profile;
    *chosen = best;
    return alb_discrepancy_widen(sd, &misfits[best], noise, error);
}

void alb_choice_free(alb_choice *choice)
{
    alb_bases_free(&choice->bases);
    free(choice->fits);
    free(choice->sd);
    *choice = (alb_choice){0};
}

bool alb_choice_by_noise(alb_choice *choice, alb_outcome *outcome, const alb_readings *readings,
                         const alb_operator *forward, alb_common_sd common, alb_error *error)
{
    *choice = (alb_choice){.readings = readings, .forward = forward, .common = common, .chosen = -1};
    *outcome = (alb_outcome){0};
    if (readings->count < 3)
        return alb_fail(error, ALB_UNDECIDED, "%d readings do not decide between profiles; 3 at least",
                        readings->count);
    const alb_weighing noise = {readings, forward, readings->sd, 0};
    choice->fits = alb_allocate(ALB_ATTEMPTS_MAX, sizeof *choice->fits, error);
    choice->sd = alb_allocate((size_t)readings->count, sizeof(double), error);
    if (choice->fits && choice->sd && alb_basis_create(&choice->bases.exponentials, readings, forward, error) &&
        choose_by_noise(&choice->chosen, choice->fits, outcome, &choice->bases, &noise, error))
        return true;
    alb_choice_free(choice);
    return false;
}

bool alb_choice_complete(alb_choice *choice, alb_outcome *outcome, alb_error *error)
{
    const alb_readings *readings = choice->readings;
    const double energy_sd = alb_energy_sd(readings);
    const alb_weighing noise = {readings, choice->forward, readings->sd, 0};
    alb_weighing weighing = noise;
    int chosen = choice->chosen;
    if (chosen < 0) {
        if (!choose_with_discrepancy(&chosen, choice->fits, choice->sd, outcome, &choice->bases, &noise, energy_sd,
                                     error))
            return false;
        weighing = (alb_weighing){readings, choice->forward, choice->sd, energy_sd};
    }
    for (int f = 0; f < outcome->attempt_count; f++)
        outcome->attempts[f].bic_excess = outcome->attempts[f].bic - outcome->attempts[chosen].bic;
    outcome->fitted.profile = choice->fits[chosen].profile;
    outcome->tied = candidates[chosen].tied;
    return alb_outcome_complete(outcome, candidates[chosen], &weighing, energy_sd, choice->common, error);
}

bool alb_choose(alb_outcome *outcome, const alb_readings *readings, const alb_operator *forward, alb_common_sd common,
                alb_error *error)
{
    alb_choice choice;
    if (!alb_choice_by_noise(&choice, outcome, readings, forward, common, error))
        return false;
    const bool ok = alb_choice_complete(&choice, outcome, error);
    alb_choice_free(&choice);
    return ok;
}
