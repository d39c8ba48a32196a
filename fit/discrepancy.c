// Each reading gets a relative discrepancy t in quadrature, sd_i^2 + (t f_i)^2, f the fitted form, with t such that
// chi-square equals its degrees of freedom; this inflates the covariance. The energy that the image itself shows,
// sum value * area, is one more reading with the small sd the noise gives it: the form conserves the measured energy,
// whatever it does between. Without that, two exponentials lose 8 % of the energy of a real reflection.
// Equal relative weight down to 1e-5 of the peak is what a log plot rewards, and it is meant: a profile is used at
// every distance (the far one under a wide light or in shade, where the peak is not seen), and the energy, which a
// picture weighs by, is held by its own reading. Weights that favour the peak (discrepancy as f^0.75, or with a floor
// of 1e-3 of it) take the picture of the spot itself from 4.7 to 4.3 % rms on wax and leave the totals where they are,
// but double to triple the rms of the curve from 0.5 mm outwards. Not sound where the relative error of the readings
// themselves grows outwards beyond their sd (stray light). Forms are compared by sum ln(sd_i^2 + t^2 f_i^2) + k ln n,
// -2 ln of the likelihood but for constants, with BIC's price.
#include "fit/discrepancy.h"
#include <math.h>
#include <stdlib.h>

static const double relative_sd_limit = 0.5, first_discrepancy = 0.1;

// By bisection in ln t.
double alb_discrepancy_of(const double *value, const double *sd, const double *fitted, int count, int freedom)
{
    double low = 1e-9, high = 1e3;
    for (int iteration = 0; iteration < 60; iteration++) {
        const double middle = sqrt(low * high);
        double sum = 0;
        for (int i = 0; i < count; i++) {
            const double residual = value[i] - fitted[i], extra = middle * fitted[i];
            sum += residual * residual / (sd[i] * sd[i] + extra * extra);
        }
        if (sum > freedom)
            low = middle;
        else
            high = middle;
    }
    return high;
}

static void widen(double *sd, const alb_readings *readings, const double *fitted, double discrepancy)
{
    for (int i = 0; i < readings->count; i++)
        sd[i] = hypot(readings->sd[i], discrepancy * fitted[i]);
}

bool alb_parameters_decided(int *which, const alb_profile *profile, bool full_rank,
                            double covariance[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX])
{
    *which = -1;
    for (int p = 0; full_rank && p < alb_form_parameter_count(profile->form); p++)
        if (!(sqrt(covariance[p][p]) <= relative_sd_limit * fabs(profile->parameters[p]))) {
            *which = p;
            return false;
        }
    return full_rank;
}

// Fits and widens in turn until the discrepancy no longer moves.
static bool settle(alb_discrepancy_fit *out, double *sd, alb_candidate candidate, const alb_weighing *noise,
                   const alb_weighing *widened, alb_error *error)
{
    const alb_readings *readings = noise->readings;
    const int freedom = readings->count - alb_candidate_parameters(candidate);
    double chi_square;
    for (int iteration = 0; iteration < 12; iteration++) {
        double *fitted = alb_operator_readings(noise->forward, &out->profile, error);
        if (!fitted)
            return false;
        const double before = out->relative;
        out->relative = alb_discrepancy_of(readings->value, readings->sd, fitted, readings->count, freedom);
        widen(sd, readings, fitted, out->relative);
        free(fitted);
        if (!alb_search_polish(&out->profile, &chi_square, candidate, widened, error))
            return false;
        if (fabs(out->relative - before) < 1e-4 * before)
            break;
    }
    return true;
}

bool alb_discrepancy_search(alb_discrepancy_fit *fit, double *sd, alb_candidate candidate, alb_bases *bases,
                            const alb_weighing *noise, double energy_sd, alb_error *error)
{
    const alb_readings *readings = noise->readings;
    const alb_weighing widened = {readings, noise->forward, sd, energy_sd};
    double chi_square, covariance[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX];
    bool full_rank;
    int which;
    *fit = (alb_discrepancy_fit){.found = false};
    widen(sd, readings, readings->value, first_discrepancy);
    if (!alb_form_search(&fit->profile, &chi_square, &fit->found, candidate, bases, &widened, error))
        return false;
    if (!fit->found)
        return true;
    if (!settle(fit, sd, candidate, noise, &widened, error) ||
        !alb_search_covariance(covariance, &full_rank, &fit->profile, candidate, &widened, error))
        return false;
    fit->decided = alb_parameters_decided(&which, &fit->profile, full_rank, covariance);
    fit->score = alb_candidate_parameters(candidate) * log(readings->count);
    for (int i = 0; i < readings->count; i++)
        fit->score += 2 * log(sd[i]);
    return true;
}

bool alb_discrepancy_widen(double *sd, const alb_discrepancy_fit *fit, const alb_weighing *noise, alb_error *error)
{
    double *fitted = alb_operator_readings(noise->forward, &fit->profile, error);
    if (!fitted)
        return false;
    widen(sd, noise->readings, fitted, fit->relative);
    free(fitted);
    return true;
}
