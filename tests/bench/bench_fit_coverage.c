// Intervals of two exponentials: how often the 95 % interval covers the truth, against the Cramer-Rao bound of the
// parameter, over noise x ratio of decays x ratio of amplitudes (tests/fit/pairs.h). Prints a table and draws the
// chart: bench.fit_coverage CHART.svg
//
// Wald: value +- 1.96 sd by the covariance of the fit. Profile likelihood: of every fit of two terms, where no bound is
// above 200 %. Stated: of those whose two terms alb_choose takes and calls identifiable, where it does so in half of
// the trials or more.
#include "../fit/pairs.h"
#include "base/memory.h"
#include "base/plot.h"
#include "base/progress.h"
#include "fit/choose.h"
#include "fit/profile_likelihood.h"
#include "fit/separable.h"
#include <stdio.h>
#include <stdlib.h>

enum { TRIALS = 120, PARAMETERS = 4, CELLS = PAIR_NOISES * PAIR_RATIOS * PAIR_AMPLITUDES, WAYS = 3 };
static const char *const way_names[WAYS] = {"Wald", "profile likelihood", "stated as identifiable"};

typedef struct bench {
    alb_readings readings;
    alb_operator forward;
    alb_basis basis;
    double *scratch, seconds[WAYS], largest; // bound of the cell
    int fits[WAYS], hits[WAYS][PARAMETERS];  // of one cell
    int points[WAYS], tried;                 // fits with intervals by the profile likelihood
    double bound_percent[WAYS][CELLS * PARAMETERS], coverage_percent[WAYS][CELLS * PARAMETERS];
} bench;

static void cell_free(bench *b)
{
    alb_readings_free(&b->readings);
    alb_operator_free(&b->forward);
    alb_basis_free(&b->basis);
    free(b->scratch);
    b->scratch = NULL;
}

static void count(bench *b, int way, int p, double truth, double lower, double upper)
{
    b->hits[way][p] += lower <= truth && truth <= upper;
}

static bool try_wald(bench *b, alb_separable *fit, const pair_cell *cell)
{
    alb_separable_fit(fit, (alb_candidate){ALB_FORM_TWO_EXPONENTIALS, false}, &b->basis, b->readings.value,
                      b->readings.sd, 0, b->scratch);
    if (!fit->found || !fit->full_rank)
        return fit->found;
    b->fits[0]++;
    for (int p = 0; p < PARAMETERS; p++) {
        const double half = 1.96 * sqrt(fit->covariance[p][p]), value = fit->profile.parameters[p];
        count(b, 0, p, cell->truth.parameters[p], value - half, value + half);
    }
    return true;
}

static bool try_likelihood(bench *b, const alb_profile *best, const pair_cell *cell, alb_error *error)
{
    const alb_weighing weighing = {&b->readings, &b->forward, b->readings.sd, 0};
    alb_likelihood likelihood;
    if (!alb_likelihood_create(&likelihood, best, (alb_candidate){best->form, false}, &weighing, false, error))
        return false;
    b->fits[1]++;
    b->tried++;
    for (int p = 0; p < PARAMETERS; p++) {
        const alb_interval interval =
            alb_likelihood_interval(&likelihood, (alb_quantity){ALB_QUANTITY_PARAMETER, p, 0}, 3.841459, NULL);
        count(b, 1, p, cell->truth.parameters[p], interval.lower_open ? 0 : interval.lower,
              interval.upper_open ? (double)INFINITY : interval.upper);
    }
    alb_likelihood_free(&likelihood);
    return true;
}

static bool try_stated(bench *b, const pair_cell *cell, alb_error *error)
{
    alb_outcome outcome;
    if (!alb_choose(&outcome, &b->readings, &b->forward, (alb_common_sd){0, 0}, error))
        return false;
    if (outcome.fitted.profile.form != ALB_FORM_TWO_EXPONENTIALS || !outcome.fitted.identifiable)
        return true;
    b->fits[2]++;
    for (int p = 0; p < PARAMETERS; p++)
        count(b, 2, p, cell->truth.parameters[p], outcome.knowledge.parameters[p].lower,
              outcome.knowledge.parameters[p].upper);
    return true;
}

static bool bound_of(double bound[PARAMETERS], bench *b, const pair_cell *cell, alb_error *error)
{
    const alb_weighing weighing = {&b->readings, &b->forward, b->readings.sd, 0};
    double covariance[ALB_PARAMETERS_MAX + 1][ALB_PARAMETERS_MAX + 1], condition;
    alb_likelihood likelihood;
    if (!alb_likelihood_create(&likelihood, &cell->truth, (alb_candidate){cell->truth.form, false}, &weighing, false,
                               error))
        return false;
    alb_likelihood_bound(covariance, &condition, &likelihood, &cell->truth);
    for (int p = 0; p < PARAMETERS; p++)
        bound[p] = sqrt(covariance[p][p]);
    alb_likelihood_free(&likelihood);
    return true;
}

static void note_cell(bench *b, const pair_cell *cell, const double bound[PARAMETERS])
{
    printf("%4.1f %% %5.2f %5.2f  bound %9.2f %%", 100 * cell->noise, cell->truth.parameters[3] / 0.5,
           cell->truth.parameters[2], 100 * b->largest);
    for (int way = 0; way < WAYS; way++) {
        printf("  |%4d", b->fits[way]);
        for (int p = 0; p < PARAMETERS; p++) {
            const double coverage = 100.0 * b->hits[way][p] / b->fits[way];
            printf(b->fits[way] ? " %5.1f" : "     -", coverage);
            if (b->fits[way] < (way == 2 ? TRIALS / 2 : 20))
                continue;
            b->bound_percent[way][b->points[way]] = 100 * bound[p];
            b->coverage_percent[way][b->points[way]++] = coverage;
        }
    }
    printf("\n");
}

static bool try_cell(bench *b, const pair_cell *cell, alb_error *error)
{
    double bound[PARAMETERS];
    for (int way = 0; way < WAYS; way++) {
        b->fits[way] = 0;
        for (int p = 0; p < PARAMETERS; p++)
            b->hits[way][p] = 0;
    }
    if (!pair_readings(&b->readings, &b->forward, &cell->truth, cell->noise, error) ||
        !alb_basis_create(&b->basis, &b->readings, &b->forward, error) ||
        !(b->scratch = alb_allocate(alb_separable_scratch(&b->basis), sizeof(double), error)) ||
        !bound_of(bound, b, cell, error))
        return false;
    b->largest = fmax(fmax(bound[0], bound[1]), fmax(bound[2], bound[3]));
    for (unsigned t = 0; t < TRIALS; t++) {
        alb_separable fit;
        pair_noise(&b->readings, &cell->truth, 9000 + cell->index, t);
        double start_s = alb_clock_s();
        const bool found = try_wald(b, &fit, cell);
        b->seconds[0] += alb_clock_s() - start_s;
        start_s = alb_clock_s();
        if (found && b->largest <= 2 && !try_likelihood(b, &fit.profile, cell, error))
            return false;
        b->seconds[1] += alb_clock_s() - start_s;
        start_s = alb_clock_s();
        if (!try_stated(b, cell, error))
            return false;
        b->seconds[2] += alb_clock_s() - start_s;
    }
    note_cell(b, cell, bound);
    return true;
}

static bool chart(const bench *b, const char *path, alb_error *error)
{
    static const double ends[2] = {0.02, 5e4}, nominal[2] = {95, 95}, limit[2] = {50, 50}, height[2] = {0, 100};
    alb_curve curves[WAYS + 2];
    for (int way = 0; way < WAYS; way++)
        curves[way] = (alb_curve){.label = way_names[way],
                                  .x = b->bound_percent[way],
                                  .y = b->coverage_percent[way],
                                  .count = (size_t)b->points[way],
                                  .mark = ALB_MARK_POINTS};
    curves[WAYS] =
        (alb_curve){.label = "95 %", .colour = "#888", .x = ends, .y = nominal, .count = 2, .mark = ALB_MARK_DASHES};
    curves[WAYS + 1] = (alb_curve){
        .label = "bound 50 %", .colour = "#bbb", .x = limit, .y = height, .count = 2, .mark = ALB_MARK_LINE};
    const alb_panel panel = {.title = "Two exponentials: coverage of 95 % intervals against the Cramer-Rao bound",
                             .x_label = "Cramer-Rao bound of the parameter, % of itself",
                             .y_label = "coverage, %",
                             .log_x = true,
                             .y_minimum = 0,
                             .y_maximum = 100,
                             .curves = curves,
                             .curve_count = WAYS + 2,
                             .height = 1};
    return alb_plot_write(path, &panel, 1, 800, 500, error);
}

int main(int argc, char **argv)
{
    static bench b;
    alb_error error = {0};
    bool ok = true;
    printf("noise b2/b1 a2/a1, largest bound | fits and coverage of a1 b1 a2 b2 in %%: Wald | profile likelihood | "
           "stated as identifiable\n");
    for (int k = 0; ok && k < CELLS; k++) {
        const pair_cell cell =
            pair_at(k / (PAIR_RATIOS * PAIR_AMPLITUDES), k / PAIR_AMPLITUDES % PAIR_RATIOS, k % PAIR_AMPLITUDES);
        ok = try_cell(&b, &cell, &error);
        cell_free(&b);
    }
    for (int way = 0; way < WAYS; way++)
        printf("%-22s %8.0f microseconds a fit\n", way_names[way],
               1e6 * b.seconds[way] / (way == 1 ? b.tried : CELLS * TRIALS));
    if (ok && argc > 1)
        ok = chart(&b, argv[1], &error);
    if (!ok)
        fprintf(stderr, "bench.fit_coverage: %s\n", error.text);
    return ok ? 0 : (int)error.status;
}
