// What is known of the form that was taken.
//
// Covariance: (J^T J)^-1 (search.h), from which the sd of what is linear in the parameters near the fit follows as
// sqrt(g^T C g), g its gradient: of the total, of S(r), of the slope of the tail. Intervals: by the profile likelihood
// (profile_likelihood.c), as curvature at the fit says nothing of how far the data reach. Where the form is an
// approximation (discrepancy.c), half of the share of the total beyond the readings is added to the sd of the total.
// The sd of what all readings share enters last, in quadrature, and in the logarithm for intervals: of the flux, over
// amplitudes and total; of the unit of length, over amplitudes (twice) and decays.
//
// A parameter is identifiable where its Cramer-Rao bound is at most half of itself. The bound is a function of the
// unknown truth, so its value at the fit will not do: near the threshold the fit is as often on the one side as on the
// other, and those on the good side are the ones where the noise made the term look better than it is. Asked is that
// the bound holds for every profile that the data allow, and looked at are the ends of the 99 % intervals of all
// parameters. So a term whose true bound is above half is called identifiable in at most 1 % of measurements, and one
// has to have a bound of about 0.2 at the fit (0.5 / (1 + 2.58 / 2)). What is stated is then right in this sense: a
// measurement that says "identifiable" and whose 95 % interval misses happens in at most 5 % of all measurements of a
// sample. Where a sample is called identifiable only now and then, those few have the term larger than it is.
//
// The data do not decide where J^T J is singular, a parameter is not identifiable, a decay is slower than a tenth of
// the range shows, or more than half of the total lies where nothing was measured. Where no form stands against the
// noise, its intervals are no statement of the noise, and half of itself by the covariance is asked of a parameter.
#include "fit/uncertainty.h"
#include "fit/choose.h"
#include "fit/discrepancy.h"
#include "fit/profile_likelihood.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double measured_share_wanted = 0.5, bound_limit = 0.5, rise_95 = 3.841459, quantile_95 = 1.959964;

static double quadratic_form(const double *gradient, const alb_fitted *fitted, int n)
{
    double sum = 0;
    for (int p = 0; p < n; p++)
        for (int q = 0; q < n; q++)
            sum += gradient[p] * fitted->covariance[p][q] * gradient[q];
    return sum > 0 ? sum : 0;
}

static void describe_tail(alb_outcome *outcome, const alb_readings *readings)
{
    const alb_profile *profile = &outcome->fitted.profile;
    const int n = alb_form_parameter_count(profile->form);
    const double from = readings->r_mm[readings->count / 2], to = readings->r_mm[readings->count - 1];
    double g0[ALB_PARAMETERS_MAX], g1[ALB_PARAMETERS_MAX], gradient[ALB_PARAMETERS_MAX];
    const double s0 = alb_profile_gradient(g0, profile, from), s1 = alb_profile_gradient(g1, profile, to);
    for (int p = 0; p < n; p++)
        gradient[p] = (g1[p] / s1 - g0[p] / s0) / (to - from);
    outcome->slope_from_mm = from;
    outcome->slope_to_mm = to;
    outcome->slope_per_mm = log(s1 / s0) / (to - from);
    outcome->slope_sd = sqrt(quadratic_form(gradient, &outcome->fitted, n));
}

// One parameter's interval into the certainty; worst as alb_likelihood_interval raises it.
static void find_interval(alb_certainty *certainty, alb_likelihood *likelihood, alb_quantity quantity, double *worst)
{
    const alb_interval interval = alb_likelihood_interval(likelihood, quantity, rise_95, worst);
    const bool negative = interval.upper < 0;
    certainty->lower = !interval.lower_open ? interval.lower : negative ? -(double)INFINITY : 0;
    certainty->upper = !interval.upper_open ? interval.upper : negative ? 0 : (double)INFINITY;
}

static void explain_parameter(alb_certainty *certainty, const char *name, double relative)
{
    const bool open = certainty->lower == 0 || certainty->upper == 0 || isinf(certainty->lower + certainty->upper);
    if (!(relative <= bound_limit))
        snprintf(certainty->because, sizeof certainty->because, "the Cramer-Rao bound of %s is %.0f %% of itself", name,
                 100 * relative);
    else if (open)
        snprintf(certainty->because, sizeof certainty->because, "the data set %s no %s limit", name,
                 certainty->lower == 0 || isinf(certainty->lower) ? "lower" : "upper");
    else if (!(certainty->worst_relative <= bound_limit))
        snprintf(
            certainty->because, sizeof certainty->because,
            "the Cramer-Rao bound of %s, %.0f %% of itself at the fit, is %.0f %% at the end of what the data allow",
            name, 100 * relative, 100 * certainty->worst_relative);
}

// The bound of every parameter at the fit, relative to it, into *relative, infinite where the rank is deficient.
static void find_bound(double relative[ALB_PARAMETERS_MAX], double *condition, alb_likelihood *likelihood)
{
    double covariance[ALB_PARAMETERS_MAX + 1][ALB_PARAMETERS_MAX + 1];
    const bool known = alb_likelihood_bound(covariance, condition, likelihood, &likelihood->best);
    for (int p = 0; p < ALB_PARAMETERS_MAX; p++)
        relative[p] = known ? sqrt(covariance[p][p]) : (double)INFINITY;
}

// Bounds at the fit first; where one is too large and no more than that is asked, nothing else.
static void find_certainties(alb_knowledge *knowledge, alb_likelihood *likelihood, int n, bool only_whether)
{
    double worst[ALB_PARAMETERS_MAX], relative[ALB_PARAMETERS_MAX];
    bool small = true;
    find_bound(worst, &knowledge->condition, likelihood);
    for (int p = 0; p < n; p++) {
        relative[p] = worst[p];
        small &= worst[p] <= bound_limit;
    }
    for (int p = 0; (small || !only_whether) && p < n; p++)
        find_interval(&knowledge->parameters[p], likelihood, (alb_quantity){ALB_QUANTITY_PARAMETER, p, 0}, worst);
    for (int p = 0; p < n; p++) {
        knowledge->parameters[p].worst_relative = worst[p];
        explain_parameter(&knowledge->parameters[p], alb_form_parameter_name(likelihood->best.form, p), relative[p]);
    }
}

static void copy_tied(alb_knowledge *knowledge)
{
    alb_certainty *tied = &knowledge->parameters[3];
    *tied = knowledge->parameters[1];
    tied->lower *= ALB_TIED_RATIO;
    tied->upper *= ALB_TIED_RATIO;
    tied->cramer_rao_sd *= ALB_TIED_RATIO;
}

static alb_knowledge unknown(void)
{
    alb_knowledge knowledge = {.condition = INFINITY, .total = {0, INFINITY, INFINITY, INFINITY, ""}};
    for (int p = 0; p < ALB_PARAMETERS_MAX; p++)
        knowledge.parameters[p] =
            (alb_certainty){-(double)INFINITY, INFINITY, INFINITY, INFINITY, "the amplitude of a term is zero"};
    return knowledge;
}

static int first_unidentified(const alb_knowledge *knowledge, int n)
{
    for (int p = 0; p < n; p++)
        if (*knowledge->parameters[p].because)
            return p;
    return n;
}

// The bound by the noise alone, of the parameters and of the total.
static bool find_noise_bound(alb_knowledge *knowledge, const alb_profile *profile, alb_candidate candidate,
                             const alb_weighing *weighing, bool with_offset, alb_error *error)
{
    const alb_weighing noise = {weighing->readings, weighing->forward, weighing->readings->sd, 0};
    const int n = alb_candidate_parameters(candidate);
    double covariance[ALB_PARAMETERS_MAX + 1][ALB_PARAMETERS_MAX + 1], gradient[ALB_PARAMETERS_MAX], condition;
    double variance = 0;
    alb_likelihood likelihood;
    if (!alb_likelihood_create(&likelihood, profile, candidate, &noise, with_offset, error))
        return false;
    const bool known = alb_likelihood_bound(covariance, &condition, &likelihood, profile);
    alb_likelihood_free(&likelihood);
    alb_profile_total_gradient(gradient, profile);
    for (int p = 0; p < alb_form_parameter_count(profile->form); p++)
        gradient[p] *= profile->parameters[p]; // by the logarithms
    if (candidate.tied)
        gradient[1] += gradient[3];
    for (int p = 0; known && p < n; p++) {
        knowledge->parameters[p].cramer_rao_sd = sqrt(covariance[p][p]) * fabs(profile->parameters[p]);
        for (int q = 0; q < n; q++)
            variance += gradient[p] * covariance[p][q] * gradient[q];
    }
    if (known)
        knowledge->total.cramer_rao_sd = sqrt(variance);
    return true;
}

bool alb_knowledge_find(alb_knowledge *knowledge, const alb_profile *profile, alb_candidate candidate,
                        const alb_weighing *weighing, bool with_offset, alb_error *error)
{
    const int n = alb_candidate_parameters(candidate);
    alb_likelihood likelihood;
    *knowledge = unknown();
    if (alb_profile_vanishes(profile))
        return true;
    for (int p = 0; p < ALB_PARAMETERS_MAX; p++)
        knowledge->parameters[p].because[0] = '\0';
    if (!alb_likelihood_create(&likelihood, profile, candidate, weighing, with_offset, error))
        return false;
    find_certainties(knowledge, &likelihood, n, false);
    find_interval(&knowledge->total, &likelihood, (alb_quantity){ALB_QUANTITY_TOTAL, 0, 0}, NULL);
    alb_likelihood_free(&likelihood);
    if (!find_noise_bound(knowledge, profile, candidate, weighing, with_offset, error))
        return false;
    if (candidate.tied)
        copy_tied(knowledge);
    return true;
}

bool alb_identify(bool *identifiable, char because[ALB_BECAUSE_SIZE], const alb_profile *profile,
                  alb_candidate candidate, const alb_weighing *weighing, alb_error *error)
{
    const int n = alb_candidate_parameters(candidate);
    alb_likelihood likelihood;
    alb_knowledge knowledge = unknown();
    if (!alb_profile_vanishes(profile)) {
        for (int p = 0; p < n; p++)
            knowledge.parameters[p] = (alb_certainty){.lower = 1, .upper = 1};
        if (!alb_likelihood_create(&likelihood, profile, candidate, weighing, false, error))
            return false;
        find_certainties(&knowledge, &likelihood, n, true);
        alb_likelihood_free(&likelihood);
    }
    const int which = first_unidentified(&knowledge, n);
    *identifiable = which == n;
    snprintf(because, ALB_BECAUSE_SIZE, "%s", *identifiable ? "" : knowledge.parameters[which].because);
    return true;
}

static void judge(alb_outcome *outcome, const alb_readings *readings, bool full_rank)
{
    const alb_fitted *fitted = &outcome->fitted;
    const alb_profile *profile = &fitted->profile;
    const int n = alb_form_parameter_count(profile->form);
    char *why = outcome->undecided;
    int which = first_unidentified(&outcome->knowledge, n);
    if (!full_rank) {
        snprintf(why, ALB_REASON_SIZE, "the parameters of %s trade off fully: the Jacobian is rank-deficient",
                 alb_form_name(profile->form));
    } else if (!(outcome->measured_share >= measured_share_wanted)) {
        snprintf(why, ALB_REASON_SIZE, "%.0f %% of the total lies where nothing was measured (readings end at %.4g mm)",
                 100 * (1 - outcome->measured_share), readings->outer_mm);
    } else if (outcome->discrepancy_relative > 0 &&
               !alb_parameters_decided(&which, profile, full_rank, outcome->fitted.covariance)) {
        snprintf(why, ALB_REASON_SIZE, "%s = %.4g +- %.2g: uncertain by more than half of itself",
                 alb_form_parameter_name(profile->form, which), profile->parameters[which], fitted->sd[which]);
    } else if (outcome->discrepancy_relative == 0 && which < n) {
        snprintf(why, ALB_REASON_SIZE, "%s", outcome->knowledge.parameters[which].because);
    } else if (alb_profile_slowest(profile) * readings->outer_mm < 0.1) {
        snprintf(why, ALB_REASON_SIZE, "the slow term (%.3g per mm) does not decay within the readings (%.4g mm)",
                 alb_profile_slowest(profile), readings->outer_mm);
    }
    outcome->fitted.identifiable = !*why;
}

static double widened(double end, double estimate, double relative_sd)
{
    const double distance = log(end / estimate); // an open end stays open
    return estimate * exp(copysign(hypot(distance, quantile_95 * relative_sd), distance));
}

static void widen_intervals(alb_outcome *outcome, int n, alb_common_sd common, double total_extra_sd)
{
    alb_knowledge *knowledge = &outcome->knowledge;
    for (int p = 0; p < n; p++) {
        alb_certainty *certainty = &knowledge->parameters[p];
        const alb_parameter *parameter = alb_form_parameter(outcome->fitted.profile.form, p);
        const double sd = hypot(parameter->flux * common.flux, parameter->length * common.length);
        const double value = outcome->fitted.profile.parameters[p];
        certainty->lower = widened(certainty->lower, value, sd);
        certainty->upper = widened(certainty->upper, value, sd);
    }
    const double total = outcome->fitted.total, sd = hypot(common.flux, total_extra_sd / total);
    knowledge->total.lower = widened(knowledge->total.lower, total, sd);
    knowledge->total.upper = widened(knowledge->total.upper, total, sd);
}

void alb_common_add(alb_fitted *fitted, alb_common_sd common)
{
    const double *values = fitted->profile.parameters;
    const int n = alb_form_parameter_count(fitted->profile.form);
    for (int p = 0; p < n; p++)
        for (int q = 0; q < n; q++) {
            const alb_parameter *one = alb_form_parameter(fitted->profile.form, p);
            const alb_parameter *other = alb_form_parameter(fitted->profile.form, q);
            const double flux = one->flux * other->flux * common.flux * common.flux;
            const double length = one->length * other->length * common.length * common.length;
            fitted->covariance[p][q] += values[p] * values[q] * (flux + length);
        }
}

double alb_energy_sd(const alb_readings *readings)
{
    double variance = 0;
    for (int i = 0; i < readings->count; i++)
        variance += pow(readings->area_mm2[i] * readings->sd[i], 2);
    return hypot(sqrt(variance), 1e-4 * fabs(alb_energy(readings, readings->value)));
}

// Of the total, what lies beyond the readings and inside the first.
static void find_unmeasured(double *beyond, double *core, const alb_fitted *fitted, const alb_readings *readings)
{
    *beyond = fitted->total - 2 * M_PI * alb_profile_disc(&fitted->profile, readings->outer_mm);
    *core = 2 * M_PI * alb_profile_disc(&fitted->profile, readings->core_mm);
}

bool alb_outcome_describe_fit(alb_outcome *outcome, const alb_readings *readings, const alb_operator *forward,
                              alb_error *error)
{
    alb_fitted *fitted = &outcome->fitted;
    double *model = alb_operator_readings(forward, &fitted->profile, error), squares = 0, beyond, core;
    int counted = 0;
    if (!model)
        return false;
    fitted->chi_square = 0;
    for (int i = 0; i < readings->count; i++) {
        const double residual = readings->value[i] - model[i], whitened = residual / readings->sd[i];
        fitted->chi_square += whitened * whitened;
        if (model[i] > 3 * readings->sd[i]) {
            squares += residual * residual / (model[i] * model[i]);
            counted++;
        }
    }
    free(model);
    outcome->rms_relative = counted ? sqrt(squares / counted) : 0;
    find_unmeasured(&beyond, &core, fitted, readings);
    outcome->measured_share = 1 - (beyond + core) / fitted->total;
    describe_tail(outcome, readings);
    return true;
}

// Where a constant is fitted too: its sd enters that of the parameters.
static bool find_covariance_beside_offset(double covariance[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX], bool *full_rank,
                                          const alb_profile *profile, alb_candidate candidate,
                                          const alb_weighing *weighing, alb_error *error)
{
    const int all = alb_form_parameter_count(profile->form), n = alb_candidate_parameters(candidate);
    double relative[ALB_PARAMETERS_MAX + 1][ALB_PARAMETERS_MAX + 1], condition;
    alb_likelihood likelihood;
    memset(covariance, 0, sizeof(double[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX]));
    *full_rank = !alb_profile_vanishes(profile);
    if (!*full_rank)
        return true;
    if (!alb_likelihood_create(&likelihood, profile, candidate, weighing, true, error))
        return false;
    *full_rank = alb_likelihood_bound(relative, &condition, &likelihood, profile);
    alb_likelihood_free(&likelihood);
    for (int p = 0; *full_rank && p < all; p++)
        for (int q = 0; q < all; q++) // a tied decay goes with the first
            covariance[p][q] = profile->parameters[p] * profile->parameters[q] * relative[p < n ? p : 1][q < n ? q : 1];
    return true;
}

bool alb_outcome_complete(alb_outcome *outcome, alb_candidate candidate, const alb_weighing *weighing, double energy_sd,
                          alb_common_sd common, alb_error *error)
{
    const alb_readings *readings = weighing->readings;
    alb_fitted *fitted = &outcome->fitted;
    const alb_profile *profile = &fitted->profile;
    const int n = alb_form_parameter_count(profile->form);
    bool full_rank;
    double gradient[ALB_PARAMETERS_MAX], beyond, core;
    const bool with_offset = outcome->offset_sd > 0;
    if (!(with_offset
              ? find_covariance_beside_offset(fitted->covariance, &full_rank, profile, candidate, weighing, error)
              : alb_search_covariance(fitted->covariance, &full_rank, profile, candidate, weighing, error)))
        return false;
    fitted->total = alb_profile_total_gradient(gradient, profile);
    outcome->free_total = fitted->total;
    double variance = quadratic_form(gradient, fitted, n), extra = 0;
    if (outcome->discrepancy_relative > 0) {
        find_unmeasured(&beyond, &core, fitted, readings);
        extra = 0.25 * (beyond * beyond + core * core);
        variance = fmax(variance, energy_sd * energy_sd) + extra;
    }
    if (!alb_knowledge_find(&outcome->knowledge, profile, candidate, weighing, with_offset, error) ||
        !alb_sensitivity_find(&outcome->sensitivity, profile, candidate, weighing, with_offset, error))
        return false;
    widen_intervals(outcome, n, common, sqrt(extra));
    alb_common_add(fitted, common);
    fitted->total_sd = sqrt(variance + fitted->total * fitted->total * common.flux * common.flux);
    for (int p = 0; p < n; p++)
        fitted->sd[p] = sqrt(fitted->covariance[p][p]);
    for (int p = 0; !full_rank && p < n; p++)
        fitted->sd[p] = NAN;
    fitted->total_sd = full_rank ? fitted->total_sd : (double)NAN;
    fitted->degrees_of_freedom = readings->count - alb_candidate_parameters(candidate) - with_offset;
    if (!alb_outcome_describe_fit(outcome, readings, weighing->forward, error))
        return false;
    outcome->undecided[0] = '\0';
    judge(outcome, readings, full_rank);
    return true;
}

double alb_profile_sd(const alb_fitted *fitted, double r_mm)
{
    double gradient[ALB_PARAMETERS_MAX];
    alb_profile_gradient(gradient, &fitted->profile, r_mm);
    return sqrt(quadratic_form(gradient, fitted, alb_form_parameter_count(fitted->profile.form)));
}
