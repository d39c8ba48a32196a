// What is stated of the parameters of two exponentials holds: over noise x ratio of the decays x ratio of the
// amplitudes the quoted 95 % interval covers the truth in 95 % of the measurements that call it identifiable, their sd
// is the Cramer-Rao bound, and where the bound is above half of a parameter they do not call it identifiable.
#include "check.h"
#include "fit/choose.h"
#include "fit/pairs.h"
#include "fit/profile_likelihood.h"
#include <stdlib.h>

enum { TRIALS = 2000, PARAMETERS = 4 };

typedef struct trial {
    bool stated, hit[PARAMETERS], two, one; // one: one term, and within the noise
    double estimate[PARAMETERS], error_rms; // of S over the readings, in their sd
} trial;

static double misfit(const alb_profile *fitted, const alb_profile *truth, const alb_readings *readings)
{
    double sum = 0;
    for (int i = 0; i < readings->count; i++) {
        const double r = readings->r_mm[i];
        sum += pow((alb_profile_value(fitted, r) - alb_profile_value(truth, r)) / readings->sd[i], 2);
    }
    return sqrt(sum / readings->count);
}

static trial measure(alb_readings *readings, const alb_operator *forward, const alb_profile *truth, unsigned stream,
                     unsigned t)
{
    alb_error error = {0};
    alb_outcome outcome;
    trial out = {.stated = false};
    pair_noise(readings, truth, stream, t);
    check_ok(alb_choose(&outcome, readings, forward, (alb_common_sd){0, 0}, &error), &error);
    const alb_fitted *fitted = &outcome.fitted;
    out.two = fitted->profile.form == ALB_FORM_TWO_EXPONENTIALS;
    out.one = fitted->profile.form == ALB_FORM_EXPONENTIAL && outcome.discrepancy_relative == 0;
    out.stated = out.two && fitted->identifiable;
    out.error_rms = misfit(&fitted->profile, truth, readings);
    for (int p = 0; p < PARAMETERS; p++) {
        const alb_certainty *certainty = &outcome.knowledge.parameters[p];
        out.estimate[p] = fitted->profile.parameters[p];
        out.hit[p] = certainty->lower <= truth->parameters[p] && truth->parameters[p] <= certainty->upper;
    }
    return out;
}

static void measure_all(trial *trials, const alb_profile *truth, double noise, unsigned stream)
{
#pragma omp parallel
    {
        alb_error error = {0};
        alb_readings readings = {0};
        alb_operator forward = {0};
        check_ok(pair_readings(&readings, &forward, truth, noise, &error), &error);
#pragma omp for schedule(dynamic, 8)
        for (unsigned t = 0; t < TRIALS; t++)
            trials[t] = measure(&readings, &forward, truth, stream, t);
        alb_readings_free(&readings);
        alb_operator_free(&forward);
    }
}

// Relative to the parameters; the largest is returned.
static double bound_of(double bound[PARAMETERS], const pair_cell *cell)
{
    alb_error error = {0};
    alb_readings readings = {0};
    alb_operator forward = {0};
    alb_likelihood likelihood;
    double covariance[ALB_PARAMETERS_MAX + 1][ALB_PARAMETERS_MAX + 1], condition, largest = 0;
    check_ok(pair_readings(&readings, &forward, &cell->truth, cell->noise, &error), &error);
    const alb_weighing weighing = {&readings, &forward, readings.sd, 0};
    check_ok(alb_likelihood_create(&likelihood, &cell->truth, (alb_candidate){cell->truth.form, false}, &weighing,
                                   false, &error),
             &error);
    assert_true(alb_likelihood_bound(covariance, &condition, &likelihood, &cell->truth));
    for (int p = 0; p < PARAMETERS; p++) {
        bound[p] = sqrt(covariance[p][p]);
        largest = fmax(largest, bound[p]);
    }
    alb_likelihood_free(&likelihood);
    alb_readings_free(&readings);
    alb_operator_free(&forward);
    return largest;
}

typedef struct summary {
    int stated, one, hits[PARAMETERS], wrong; // wrong: the most that any parameter is stated and missed
    double spread[PARAMETERS], error_rms;     // sd / Cramer-Rao bound; the largest where one term was taken
} summary;

static summary summarise(const trial *trials, const pair_cell *cell, const double bound[PARAMETERS])
{
    summary out = {0};
    double mean[PARAMETERS] = {0}, squares[PARAMETERS] = {0};
    for (int t = 0; t < TRIALS; t++) {
        if (trials[t].one) {
            out.one++;
            out.error_rms = fmax(out.error_rms, trials[t].error_rms);
        }
        if (!trials[t].stated)
            continue;
        out.stated++;
        for (int p = 0; p < PARAMETERS; p++) {
            const double e = trials[t].estimate[p] / cell->truth.parameters[p] - 1;
            mean[p] += e;
            squares[p] += e * e;
            out.hits[p] += trials[t].hit[p];
        }
    }
    for (int p = 0; p < PARAMETERS; p++)
        out.wrong = out.stated - out.hits[p] > out.wrong ? out.stated - out.hits[p] : out.wrong;
    for (int p = 0; out.stated > 1 && p < PARAMETERS; p++) {
        mean[p] /= out.stated;
        out.spread[p] = sqrt((squares[p] / out.stated - mean[p] * mean[p]) * out.stated / (out.stated - 1)) / bound[p];
    }
    return out;
}

static void print_cell(const pair_cell *cell, double largest, const summary *s)
{
    const double stated = s->stated / (double)TRIALS;
    print_message("%5.1f %% %5.2f %5.2f | %8.1f %% | %6.1f %% %6.1f %% |", 100 * cell->noise,
                  cell->truth.parameters[3] / 0.5, cell->truth.parameters[2], 100 * largest, 100 * stated,
                  100 * s->one / (double)TRIALS);
    for (int p = 0; stated >= 0.5 && p < PARAMETERS; p++)
        print_message(" %5.1f", 100.0 * s->hits[p] / s->stated);
    for (int p = 0; stated >= 0.5 && p < PARAMETERS; p++)
        print_message("%s%.3f", p ? " " : " | ", s->spread[p]);
    print_message(stated >= 0.5 ? "\n" : " S off by %.2f sd\n", s->error_rms);
}

// 95 +- 1.5 % and sd / bound up to 1.05 are asked; beyond them one sd of the binomial count (0.5 %) and four of the
// ratio (1.8 %) are left to chance, as 84 cells of four parameters are looked at. Where some measurements of a cell are
// not called identifiable, they are those that underestimate the term: too low an estimate seldom counts, coverage may
// come out up to 2.5 % too high and the spread too small.
static void check_cell(const pair_cell *cell, trial *trials)
{
    double bound[PARAMETERS];
    const double largest = bound_of(bound, cell);
    measure_all(trials, &cell->truth, cell->noise, cell->index);
    const summary s = summarise(trials, cell, bound);
    print_cell(cell, largest, &s);
    if (largest > 0.5)
        check_below(s.stated, 0.01 * TRIALS + 1);
    check_below(s.wrong, (0.05 + 0.015) * TRIALS);
    if (s.stated > 0.99 * TRIALS || largest > 0.5)
        check_below(s.error_rms, 1); // within the noise
    for (int p = 0; s.stated >= 0.5 * TRIALS && p < PARAMETERS; p++) {
        const double coverage = s.hits[p] / (double)s.stated;
        check_below(0.935 - 0.005, coverage);
        check_below(coverage, s.stated > 0.99 * TRIALS ? 0.965 + 0.005 : 0.99);
        check_below(s.spread[p], 1.05 + 4 * 0.018);
    }
}

static void grid(void **state)
{
    (void)state;
    trial *trials = calloc(TRIALS, sizeof *trials);
    print_message(
        "noise  b2/b1 a2/a1 | largest bound | identifiable, one term | coverage of a1 b1 a2 b2, %% | sd / bound\n");
    for (int n = 0; n < PAIR_NOISES; n++)
        for (int r = 0; r < PAIR_RATIOS; r++)
            for (int a = 0; a < PAIR_AMPLITUDES; a++) {
                const pair_cell cell = pair_at(n, r, a);
                check_cell(&cell, trials);
            }
    free(trials);
}

// One exponential: a second term in at most 1 %.
static void single_exponential(void **state)
{
    (void)state;
    trial *trials = calloc(TRIALS, sizeof *trials);
    for (int n = 0; n < PAIR_NOISES; n++) {
        const alb_profile one = {ALB_FORM_EXPONENTIAL, {1, 0.5}};
        int others = 0;
        measure_all(trials, &one, pair_noises[n], 1000 + (unsigned)n);
        for (int t = 0; t < TRIALS; t++)
            others += trials[t].two;
        print_message("one exponential, noise %.1f %%: a second term in %.2f %%\n", 100 * pair_noises[n],
                      100.0 * others / TRIALS);
        check_below(others, 0.01 * TRIALS);
    }
    free(trials);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(single_exponential), cmocka_unit_test(grid)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
