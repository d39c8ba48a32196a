// What is known of the form that was taken, beside what its data identify (knowledge.c).
//
// Covariance: (J^T J)^-1 (search.h), from which the sd of what is linear in the parameters near the fit follows as
// sqrt(g^T C g), g its gradient: of the total, of S(r), of the slope of the tail. Where the form is an approximation
// (discrepancy.c), half of the share of the total beyond the readings is added to the sd of the total. The sd of what
// all readings share enters last, in quadrature, and in the logarithm for intervals: of the flux, over amplitudes and
// total; of the unit of length, over amplitudes (twice) and decays. Stops being true where curvature tells little: then
// the intervals count.
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

static const double measured_share_wanted = 0.5, quantile_95 = 1.959964;

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

static void judge(alb_outcome *outcome, const alb_readings *readings, bool full_rank)
{
    const alb_fitted *fitted = &outcome->fitted;
    const alb_profile *profile = &fitted->profile;
    const int n = alb_form_parameter_count(profile->form);
    char *why = outcome->undecided;
    int which = alb_knowledge_unidentified(&outcome->knowledge, n);
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
