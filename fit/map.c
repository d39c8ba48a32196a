// Fits of many spots, and the test of whether they are alike.
//
// All spots have one form, so that their parameters compare: the one that most of VOTERS spots, evenly spread, take by
// themselves (choose.c); of two that are taken as often the simpler one. Each spot is fitted from where those of the
// least and of the largest total came out, the better one counts, and against its own noise alone: what all share
// (scale, a form that is an approximation) moves them together and is in the mean material's sd. Two quantities say
// whether the spots are alike, for every form has them and they are known better than its parameters: the total, and
// the distance h within which half of it leaves, P(h) = total / (4 pi), whose derivatives
//   dh/dp = (dtotal/dp / (4 pi) - dP/dp) / (S(h) h)
// carry the covariance to its sd. Alike: sum (x_i - mean)^2 / sd_i^2 is chi-square distributed with n - 1 degrees of
// freedom. Stops being true where the sd are not small against the values (a spot known to half of itself), or where
// spots share noise.
#include "fit/map.h"
#include "base/memory.h"
#include "base/progress.h"
#include "base/statistics.h"
#include "fit/choose.h"
#include "fit/discrepancy.h"
#include <math.h>
#include <stdlib.h>

enum { VOTERS = 6 };

alb_spread alb_spread_of(const double *values, const double *sd, int count)
{
    alb_spread spread = {0};
    double weights = 0, sum = 0, variance = 0;
    for (int i = 0; i < count; i++)
        if (isfinite(values[i]) && sd[i] > 0 && isfinite(sd[i])) {
            const double weight = 1 / (sd[i] * sd[i]);
            spread.count++;
            weights += weight;
            sum += weight * values[i];
        }
    spread.mean = sum / weights;
    spread.mean_sd = 1 / sqrt(weights);
    for (int i = 0; i < count; i++)
        if (isfinite(values[i]) && sd[i] > 0 && isfinite(sd[i])) {
            const double off = values[i] - spread.mean;
            spread.chi_square += off * off / (sd[i] * sd[i]);
            variance += (off * off - sd[i] * sd[i]) / fmax(spread.count - 1, 1);
        }
    spread.between = sqrt(fmax(variance, 0));
    spread.tail = spread.count > 1 ? alb_chi_square_tail(spread.chi_square, spread.count - 1) : 1;
    return spread;
}

static void half_light(double *half_mm, double *half_sd_mm, const alb_fitted *fitted)
{
    const alb_profile *profile = &fitted->profile;
    const int n = alb_form_parameter_count(profile->form);
    const double wanted = fitted->total / (4 * M_PI);
    double low = 1e-150, high = 1e150, gradient[ALB_PARAMETERS_MAX], variance = 0;
    for (int i = 0; i < 100; i++) {
        const double middle = sqrt(low) * sqrt(high);
        *(alb_profile_disc(profile, middle) < wanted ? &low : &high) = middle;
    }
    for (int p = 0; p < n; p++) {
        alb_profile down = *profile, up = *profile;
        const double step = 1e-5 * fabs(profile->parameters[p]);
        down.parameters[p] -= step, up.parameters[p] += step;
        const double total = (alb_profile_total(&up) - alb_profile_total(&down)) / (4 * M_PI);
        const double disc = alb_profile_disc(&up, high) - alb_profile_disc(&down, high);
        gradient[p] = (total - disc) / (2 * step) / (alb_profile_value(profile, high) * high);
    }
    for (int p = 0; p < n; p++)
        for (int q = 0; q < n; q++)
            variance += gradient[p] * fitted->covariance[p][q] * gradient[q];
    *half_mm = high;
    *half_sd_mm = sqrt(fmax(variance, 0));
}

// What spots start from: the form and, of those asked that took it, the profiles of the least and of the largest total.
typedef struct starts {
    alb_candidate candidate;
    alb_profile ends[2];
} starts;

// Fits one spot, from both ends; form NONE where its readings do not decide.
static bool fit_spot(alb_fitted *fitted, const starts *from, double flux_sd, const alb_readings *readings,
                     const alb_operator *forward, alb_error *error)
{
    const alb_weighing weighing = {readings, forward, readings->sd, 0};
    const int n = alb_form_parameter_count(from->candidate.form);
    bool full_rank = false;
    int which;
    double gradient[ALB_PARAMETERS_MAX], variance = 0;
    *fitted = (alb_fitted){.chi_square = INFINITY};
    for (int i = 0; i < 2; i++) {
        alb_profile profile = from->ends[i];
        double chi_square = INFINITY;
        if (!alb_search_polish(&profile, &chi_square, from->candidate, &weighing, error))
            return false;
        if (chi_square < fitted->chi_square) {
            fitted->profile = profile;
            fitted->chi_square = chi_square;
        }
    }
    if (!alb_search_covariance(fitted->covariance, &full_rank, &fitted->profile, from->candidate, &weighing, error))
        return false;
    fitted->identifiable =
        isfinite(fitted->chi_square) && alb_parameters_decided(&which, &fitted->profile, full_rank, fitted->covariance);
    if (!fitted->identifiable) {
        *fitted = (alb_fitted){0};
        return true;
    }
    fitted->degrees_of_freedom = readings->count - alb_candidate_parameters(from->candidate);
    fitted->total = alb_profile_total_gradient(gradient, &fitted->profile);
    for (int p = 0; p < n; p++) {
        fitted->sd[p] = sqrt(fitted->covariance[p][p]);
        for (int q = 0; q < n; q++)
            variance += gradient[p] * fitted->covariance[p][q] * gradient[q];
    }
    fitted->total_sd = sqrt(fmax(variance, 0) + pow(flux_sd * fitted->total, 2));
    return true;
}

typedef struct ballot {
    alb_candidate candidate;
    alb_profile profile;
    bool decided;
    alb_error reason;
} ballot;

static ballot ask_spot(int spot, alb_map_read read, const void *context)
{
    ballot out = {.decided = false};
    alb_readings readings = {0};
    alb_operator forward = {0};
    alb_outcome outcome = {.tied = false};
    if (read(&readings, &forward, spot, context, &out.reason) &&
        alb_choose(&outcome, &readings, &forward, (alb_common_sd){0, 0}, &out.reason)) {
        out.decided = outcome.fitted.identifiable;
        out.candidate = (alb_candidate){outcome.fitted.profile.form, outcome.tied};
        out.profile = outcome.fitted.profile;
        if (!out.decided)
            alb_fail(&out.reason, ALB_UNDECIDED, "%s", outcome.undecided);
    }
    alb_readings_free(&readings);
    alb_operator_free(&forward);
    return out;
}

static bool agree(const ballot *a, const ballot *b)
{
    return a->decided && b->decided && a->candidate.form == b->candidate.form && a->candidate.tied == b->candidate.tied;
}

static bool vote(starts *from, int count, alb_map_read read, const void *context, alb_error *error)
{
    ballot ballots[VOTERS] = {{.decided = false}};
    const ballot *chosen = NULL;
    const int voters = count < VOTERS ? count : VOTERS;
    int most = 0;
#pragma omp parallel for schedule(dynamic)
    for (int v = 0; v < voters; v++)
        ballots[v] = ask_spot((int)((v + 0.5) * count / voters), read, context);
    for (int v = 0; v < voters; v++) {
        int same = 0;
        for (int w = 0; w < voters; w++)
            same += agree(&ballots[v], &ballots[w]);
        if (same > most ||
            (same && same == most &&
             alb_candidate_parameters(ballots[v].candidate) < alb_candidate_parameters(chosen->candidate))) {
            most = same;
            chosen = &ballots[v];
        }
    }
    if (!chosen)
        return alb_fail(error, ballots[0].reason.status == ALB_NO_MEMORY ? ALB_NO_MEMORY : ALB_UNDECIDED,
                        "none of the %d spots asked decides; the first: %s", voters, ballots[0].reason.text);
    *from = (starts){chosen->candidate, {chosen->profile, chosen->profile}};
    for (int v = 0; v < voters; v++)
        if (agree(chosen, &ballots[v])) {
            const double total = alb_profile_total(&ballots[v].profile);
            if (total < alb_profile_total(&from->ends[0]))
                from->ends[0] = ballots[v].profile;
            if (total > alb_profile_total(&from->ends[1]))
                from->ends[1] = ballots[v].profile;
        }
    return true;
}

static bool allocate(alb_map_layer *layer, int count, alb_error *error)
{
    *layer = (alb_map_layer){.count = count};
    if ((layer->spots = alb_allocate((size_t)count, sizeof *layer->spots, error)) &&
        (layer->half_mm = alb_allocate((size_t)count, sizeof(double), error)) &&
        (layer->half_sd_mm = alb_allocate((size_t)count, sizeof(double), error)))
        return true;
    alb_map_layer_free(layer);
    return false;
}

void alb_map_layer_free(alb_map_layer *layer)
{
    free(layer->spots);
    free(layer->half_mm);
    free(layer->half_sd_mm);
    *layer = (alb_map_layer){.candidate = {ALB_FORM_NONE, false}};
}

static bool summarise(alb_map_layer *layer, alb_error *error)
{
    const size_t n = (size_t)layer->count;
    double *values = alb_allocate(2 * n, sizeof(double), error);
    if (!values)
        return false;
    for (int i = 0; i < layer->count; i++) {
        const alb_fitted *spot = &layer->spots[i];
        const bool known = spot->profile.form != ALB_FORM_NONE;
        values[i] = known ? spot->total : (double)NAN;
        values[n + (size_t)i] = spot->total_sd;
    }
    layer->total = alb_spread_of(values, values + n, layer->count);
    layer->half = alb_spread_of(layer->half_mm, layer->half_sd_mm, layer->count);
    free(values);
    return true;
}

bool alb_map_layer_fit(alb_map_layer *layer, int count, double flux_sd, alb_map_read read, const void *context,
                       const char *label, alb_error *error)
{
    alb_progress progress;
    starts from;
    bool out_of_memory = false;
    int done = 0;
    if (!allocate(layer, count, error) || !vote(&from, count, read, context, error)) {
        alb_map_layer_free(layer);
        return false;
    }
    layer->candidate = from.candidate;
    alb_progress_begin(&progress, label, count);
#pragma omp parallel for schedule(dynamic)
    for (int i = 0; i < count; i++) {
        alb_readings readings = {0};
        alb_operator forward = {0};
        alb_error reason = {0};
        layer->half_mm[i] = layer->half_sd_mm[i] = NAN;
        if (read(&readings, &forward, i, context, &reason) &&
            fit_spot(&layer->spots[i], &from, flux_sd, &readings, &forward, &reason) &&
            layer->spots[i].profile.form != ALB_FORM_NONE)
            half_light(&layer->half_mm[i], &layer->half_sd_mm[i], &layer->spots[i]);
        alb_readings_free(&readings);
        alb_operator_free(&forward);
        if (reason.status == ALB_NO_MEMORY)
#pragma omp atomic write
            out_of_memory = true;
#pragma omp critical(alb_map_progress)
        alb_progress_at(&progress, ++done);
    }
    alb_progress_end(&progress);
    if (out_of_memory || !summarise(layer, error)) {
        alb_map_layer_free(layer);
        return alb_fail(error, ALB_NO_MEMORY, "%s: out of memory", label);
    }
    return true;
}
