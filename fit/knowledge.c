// Which parameters of a form the data identify, and how far they reach.
//
// Intervals are by the profile likelihood (profile_likelihood.c), as curvature at the fit says nothing of how far the
// data reach; the bound is Cramer and Rao's.
//
// A parameter is identifiable where its Cramer-Rao bound is at most half of itself. The bound is a function of the
// unknown truth, so its value at the fit will not do: near the threshold the fit is as often on the one side as on the
// other, and those on the good side are the ones where the noise made the term look better than it is. Asked is that
// the bound holds for every profile that the data allow, and looked at are the ends of the 99 % intervals of all
// parameters. So a term whose true bound is above half is called identifiable in at most 1 % of measurements, and one
// has to have a bound of about 0.2 at the fit (0.5 / (1 + 2.58 / 2)). What is stated is then right in this sense: a
// measurement that says "identifiable" and whose 95 % interval misses happens in at most 5 % of all measurements of a
// sample. Where a sample is called identifiable only now and then, those few have the term larger than it is.
// Stops being true where no form stands against the noise: intervals are then no statement of it (uncertainty.c).
#include "fit/knowledge.h"
#include "fit/profile_likelihood.h"
#include <math.h>
#include <stdio.h>

static const double bound_limit = 0.5, rise_95 = 3.841459;

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

int alb_knowledge_unidentified(const alb_knowledge *knowledge, int n)
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
    const int which = alb_knowledge_unidentified(&knowledge, n);
    *identifiable = which == n;
    snprintf(because, ALB_BECAUSE_SIZE, "%s", *identifiable ? "" : knowledge.parameters[which].because);
    return true;
}
