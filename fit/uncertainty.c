// What is known of the form that was taken.
//
// Covariance: (J^T J)^-1 (search.h), from which the sd of what is linear in the parameters near the fit follows as
// sqrt(g^T C g), g its gradient: of the total, of the slope of the tail. Where the form is an approximation
// (discrepancy.c), half of the share of the total beyond the readings is added to the sd of the total. The sd of what
// all readings share enters last: of the flux, over amplitudes and total; of the unit of length, over amplitudes
// (twice) and decays.
//
// The data do not decide where J^T J is singular, a parameter is uncertain by more than half of itself, a decay is
// slower than a tenth of the range shows, or more than half of the total lies where nothing was measured.
#include "fit/uncertainty.h"
#include "fit/discrepancy.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const double measured_share_wanted = 0.5;

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
    char *why = outcome->undecided;
    int which;
    if (!full_rank) {
        snprintf(why, ALB_REASON_SIZE, "the parameters of %s trade off fully: the Jacobian is rank-deficient",
                 alb_form_name(profile->form));
    } else if (!(outcome->measured_share >= measured_share_wanted)) {
        snprintf(why, ALB_REASON_SIZE, "%.0f %% of the total lies where nothing was measured (readings end at %.4g mm)",
                 100 * (1 - outcome->measured_share), readings->outer_mm);
    } else if (!alb_parameters_decided(&which, profile, full_rank, outcome->fitted.covariance)) {
        snprintf(why, ALB_REASON_SIZE, "%s = %.4g +- %.2g: uncertain by more than half of itself",
                 alb_form_parameter_name(profile->form, which), profile->parameters[which], fitted->sd[which]);
    } else if (profile->parameters[1] * readings->outer_mm < 0.1) {
        snprintf(why, ALB_REASON_SIZE, "the slow term (%.3g per mm) does not decay within the readings (%.4g mm)",
                 profile->parameters[1], readings->outer_mm);
    }
    outcome->fitted.identifiable = !*why;
}

// What all readings share: amplitudes are flux / length^2, decays 1 / length.
static void add_common(alb_fitted *fitted, int n, alb_common_sd common)
{
    const double *values = fitted->profile.parameters;
    for (int p = 0; p < n; p++)
        for (int q = 0; q < n; q++) {
            const double flux = p % 2 || q % 2 ? 0 : common.flux * common.flux;
            const double length = (p % 2 ? 1 : 2) * (q % 2 ? 1 : 2) * common.length * common.length;
            fitted->covariance[p][q] += values[p] * values[q] * (flux + length);
        }
}

bool alb_outcome_complete(alb_outcome *outcome, alb_candidate candidate, const alb_weighing *weighing, double energy_sd,
                          alb_common_sd common, alb_error *error)
{
    const alb_readings *readings = weighing->readings;
    alb_fitted *fitted = &outcome->fitted;
    const alb_profile *profile = &fitted->profile;
    const int n = alb_form_parameter_count(profile->form);
    bool full_rank;
    double gradient[ALB_PARAMETERS_MAX];
    if (!alb_search_covariance(fitted->covariance, &full_rank, profile, candidate, weighing, error))
        return false;
    fitted->total = alb_profile_total_gradient(gradient, profile);
    const double beyond = fitted->total - 2 * M_PI * alb_profile_disc(profile, readings->outer_mm);
    const double core = 2 * M_PI * alb_profile_disc(profile, readings->core_mm);
    double variance = quadratic_form(gradient, fitted, n);
    if (outcome->discrepancy_relative > 0)
        variance = fmax(variance, energy_sd * energy_sd) + 0.25 * (beyond * beyond + core * core);
    outcome->measured_share = 1 - (beyond + core) / fitted->total;
    add_common(fitted, n, common);
    fitted->total_sd = sqrt(variance + fitted->total * fitted->total * common.flux * common.flux);
    for (int p = 0; p < n; p++)
        fitted->sd[p] = sqrt(fitted->covariance[p][p]);
    double *model = alb_operator_readings(weighing->forward, profile, error);
    if (!model)
        return false;
    double squares = 0;
    int counted = 0;
    for (int i = 0; i < readings->count; i++) {
        const double residual = readings->value[i] - model[i], whitened = residual / readings->sd[i];
        fitted->chi_square += whitened * whitened;
        if (model[i] > 3 * readings->sd[i]) {
            squares += residual * residual / (model[i] * model[i]);
            counted++;
        }
    }
    free(model);
    fitted->degrees_of_freedom = readings->count - alb_candidate_parameters(candidate);
    outcome->rms_relative = counted ? sqrt(squares / counted) : 0;
    describe_tail(outcome, readings);
    judge(outcome, readings, full_rank);
    return true;
}
