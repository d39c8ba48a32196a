// R + T <= 1. A slow term that the readings hardly show has nothing else to hold it: its total 2 pi a / b^2 diverges as
// b goes to 0. So the bound is part of what is known, and the fit under it is the one of least chi-square among those
// that obey it: sum over sides D_side(t_side), D the profile likelihood of the total, under sum t_side = 1 (one side: t
// = 1; two: golden section over t of the first). Row sums of a matrix built from cell means of S are then at most 1
// too, as S >= 0 and they are integrals of S over part of a plane. The light that the face reflects as a mirror is left
// out: a sample of n = 1.5 in a beam that falls square on it has R + T <= 0.96, but what a white reference calls the
// incident flux depends on how both are lit.
#include "fit/energy.h"
#include "base/memory.h"
#include "fit/profile_likelihood.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const double rise_limit = 10.83, most = 1;

typedef struct side {
    alb_measurement *measurement;
    double *sd, total; // of the free fit
    alb_weighing weighing;
    alb_likelihood likelihood;
    alb_profile held;
} side;

static void side_free(side *s)
{
    if (s->weighing.sd)
        alb_likelihood_free(&s->likelihood);
    free(s->sd);
    *s = (side){0};
}

// The likelihood of the last fit; none where a term has vanished.
static bool side_create(side *s, alb_measurement *measurement, alb_error *error)
{
    const alb_outcome *outcome = &measurement->outcome;
    const alb_profile *profile = &outcome->fitted.profile;
    const alb_readings *readings = &measurement->readings;
    *s = (side){.measurement = measurement, .total = outcome->fitted.total, .held = *profile};
    if (alb_profile_vanishes(profile))
        return true;
    const bool misfit = outcome->discrepancy_relative > 0;
    double *model = alb_operator_readings(&measurement->forward, profile, error);
    s->sd = alb_allocate((size_t)readings->count, sizeof(double), error);
    for (int i = 0; model && s->sd && i < readings->count; i++)
        s->sd[i] = hypot(readings->sd[i], outcome->discrepancy_relative * model[i]);
    const bool ok = model && s->sd;
    free(model);
    s->weighing = (alb_weighing){readings, &measurement->forward, s->sd, misfit ? alb_energy_sd(readings) : 0};
    const alb_candidate candidate = {profile->form, outcome->tied};
    return ok && alb_likelihood_create(&s->likelihood, profile, candidate, &s->weighing, false, error);
}

static void scale_to(alb_profile *profile, double total)
{
    const double factor = total / alb_profile_total(profile) * (1 - 1e-12);
    for (int p = 0; p < alb_form_parameter_count(profile->form); p++)
        if (alb_form_parameter(profile->form, p)->flux)
            profile->parameters[p] *= factor;
}

// How much chi-square rises where the total is at most `total`; the profile goes to s->held.
static double rise_of(side *s, double total)
{
    s->held = s->measurement->outcome.fitted.profile;
    if (total >= s->total)
        return 0;
    if (!s->weighing.sd)
        return INFINITY;
    const double chi_square =
        alb_likelihood_hold(&s->held, &s->likelihood, (alb_quantity){ALB_QUANTITY_TOTAL, 0, 0}, total);
    return fmax(chi_square - s->likelihood.chi_square, 0);
}

static double rise_together(side sides[ALB_SIDES], int count, double first)
{
    return count == 1 ? rise_of(&sides[0], first) : rise_of(&sides[0], first) + rise_of(&sides[1], most - first);
}

// The totals of least rise, their sum `most`: t of the first side.
static double share_out(side sides[ALB_SIDES], int count)
{
    if (count == 1)
        return most;
    const double golden = 0.6180339887498949;
    double low = fmax(most - sides[1].total, 1e-6 * most), high = fmin(sides[0].total, (1 - 1e-6) * most);
    double x[2] = {high - golden * (high - low), low + golden * (high - low)};
    double f[2] = {rise_together(sides, count, x[0]), rise_together(sides, count, x[1])};
    for (int iteration = 0; iteration < 30; iteration++) {
        const int keep = f[0] < f[1] ? 0 : 1;
        if (keep == 0)
            high = x[1];
        else
            low = x[0];
        x[1 - keep] = x[keep];
        f[1 - keep] = f[keep];
        x[keep] = keep == 0 ? high - golden * (high - low) : low + golden * (high - low);
        f[keep] = rise_together(sides, count, x[keep]);
    }
    return (low + high) / 2;
}

static void describe(alb_outcome *outcome, double sum, double sd, double rise, bool absolute)
{
    if (absolute && rise > rise_limit) {
        outcome->fitted.identifiable = false;
        snprintf(outcome->undecided, sizeof outcome->undecided,
                 "the totals of the sides are %.4g +- %.2g of the incident flux together, more than came in; held at 1 "
                 "chi-square rises by %.4g: check the white reference's reflectance and the exposures",
                 sum, sd, rise);
    }
}

// The held profile and what follows from it into the outcome.
static bool settle(side *s, double rise, alb_error *error)
{
    alb_outcome *outcome = &s->measurement->outcome;
    alb_fitted *fitted = &outcome->fitted;
    fitted->profile = s->held;
    fitted->total = alb_profile_total(&s->held);
    outcome->energy_rise = rise;
    for (int p = 0; p < alb_form_parameter_count(s->held.form); p++) {
        alb_certainty *certainty = &outcome->knowledge.parameters[p];
        certainty->lower = fmin(certainty->lower, s->held.parameters[p]);
        certainty->upper = fmax(certainty->upper, s->held.parameters[p]);
    }
    outcome->knowledge.total.lower = fmin(outcome->knowledge.total.lower, fitted->total);
    outcome->knowledge.total.upper = fmin(outcome->knowledge.total.upper, most);
    return alb_outcome_describe_fit(outcome, &s->measurement->readings, &s->measurement->forward, error);
}

static bool hold(side sides[ALB_SIDES], int count, bool absolute, alb_error *error)
{
    double sum = 0, variance = 0, flux = 0;
    for (int k = 0; k < count; k++) {
        const alb_measurement *measurement = sides[k].measurement;
        sum += sides[k].total;
        variance += pow(measurement->outcome.fitted.total_sd, 2);
        flux = fmax(flux, measurement->common.flux);
    }
    const double first = share_out(sides, count),
                 scaled = flux > 0 ? pow((sum - most) / (flux * sum), 2) : (double)INFINITY;
    double rise = rise_together(sides, count, first);
    const bool scale = !(rise <= scaled) || !isfinite(rise);
    if (scale)
        rise = scaled;
    if (!absolute && !(rise <= rise_limit))
        return true;
    for (int k = 0; k < count; k++) {
        const double wanted = scale ? sides[k].total / sum * most : k ? most - first : first;
        if (scale)
            sides[k].held = sides[k].measurement->outcome.fitted.profile;
        if (scale || !(alb_profile_total(&sides[k].held) <= fmin(wanted, sides[k].total)))
            scale_to(&sides[k].held, fmin(wanted, sides[k].total));
        if (!settle(&sides[k], rise, error))
            return false;
        describe(&sides[k].measurement->outcome, sum, sqrt(variance), rise, absolute);
    }
    return true;
}

bool alb_energy_hold(alb_fitting *fitting, int channel, alb_error *error)
{
    side sides[ALB_SIDES] = {{0}};
    int count = 0;
    double sum = 0;
    bool ok = true;
    for (int s = 0; s < ALB_SIDES; s++) {
        alb_measurement *measurement = &fitting->sides[s][channel];
        if (!measurement->measured)
            continue;
        measurement->outcome.free_total = measurement->outcome.fitted.total;
        sum += measurement->outcome.fitted.total;
        sides[count++].measurement = measurement;
    }
    if (sum <= most)
        return true;
    for (int k = 0; ok && k < count; k++)
        ok = side_create(&sides[k], sides[k].measurement, error);
    ok = ok && hold(sides, count, fitting->absolute, error);
    for (int k = 0; k < count; k++)
        side_free(&sides[k]);
    return ok;
}
