// Two exponentials fitted to random profiles of 120 readings (fit/exhaustive.h): how often the least chi-square there
// is is missed, against time. Prints the rows and draws the chart: bench.fit_speed CHART.svg [PROFILES]
//
// Missed: chi-square more than 1e-6 of itself above the exhaustive minimum, over those profiles where a second term
// lowers it at all. The separable fit gives covariance and the chi-square of one term besides (BIC); Ceres neither.
// Ceres starts from a = c = the first reading / 2, b and d half and twice the inverse of the mean distance.
#include "base/plot.h"
#include "base/progress.h"
#include "ceres_baseline.h"
#include "fit/exhaustive.h"
#include "fit/separable.h"
#include <stdio.h>
#include <time.h>

enum { N = EXHAUSTIVE_READINGS, METHODS = 4, SETTINGS = 4, REPEATS = 5, NOISES = 3 };
typedef enum way { SEPARABLE, SEARCH, ONE_BLOCK, BLOCK_PER_READING } way;
static const char *const names[METHODS] = {"separable fit", "search of the pipeline", "Ceres, one analytic block",
                                           "Ceres, a block per reading"};
static const int iterations_of[SETTINGS] = {5, 10, 20, 50};

typedef struct profile {
    double value[N], sd[N], least; // least 0: a second term lowers nothing
} profile;

typedef struct bench {
    int count;
    profile *profiles;
    alb_readings readings;
    alb_operator forward;
    alb_basis basis;
    double *scratch;
    double seconds[METHODS][SETTINGS], missed_percent[METHODS][SETTINGS];
    double noise_percent[NOISES], rate[METHODS][NOISES];
} bench;

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static alb_weighing weighing_of(const bench *b, alb_readings *readings, profile *p)
{
    *readings = b->readings;
    readings->value = p->value;
    readings->sd = p->sd;
    return (alb_weighing){readings, &b->forward, p->sd, 0};
}

static double fit_ceres(const bench *b, const profile *p, bool one_block, int iterations)
{
    double weight = 0, moment = 0, reached;
    for (int i = 0; i < N; i++) {
        weight += p->value[i];
        moment += p->value[i] * b->readings.r_mm[i];
    }
    double x[4] = {p->value[0] / 2, weight / moment / 2, p->value[0] / 2, 2 * weight / moment};
    ceres_baseline(x, &reached, b->readings.r_mm, p->value, p->sd, N, one_block, iterations);
    return x[0] > 0 && x[2] > 0 ? reached : (double)INFINITY;
}

static double fit_once(bench *b, profile *p, way method, int setting, alb_error *error)
{
    const alb_candidate candidate = {ALB_FORM_TWO_EXPONENTIALS, false};
    alb_separable fit;
    alb_readings readings;
    alb_profile found;
    double reached = (double)INFINITY;
    bool any;
    const alb_weighing weighing = weighing_of(b, &readings, p);
    if (method == SEPARABLE) {
        alb_separable_fit(&fit, candidate, &b->basis, p->value, p->sd, 0, b->scratch);
        return fit.chi_square;
    }
    if (method == SEARCH) {
        alb_search(&found, &reached, &any, candidate, &b->basis, &weighing, error);
        return reached;
    }
    return fit_ceres(b, p, method == ONE_BLOCK, iterations_of[setting]);
}

static int by_value(const void *x, const void *y)
{
    return (*(const double *)x > *(const double *)y) - (*(const double *)x < *(const double *)y);
}

// Median seconds a fit over the repeats, and the share of minima missed.
static void measure(bench *b, double *seconds, double *missed_percent, way method, int setting, alb_error *error)
{
    double times[REPEATS];
    int missed = 0, counted = 0;
    for (int k = 0; k < REPEATS; k++) {
        const double from = now();
        missed = counted = 0;
        for (int i = 0; i < b->count; i++) {
            const double reached = fit_once(b, &b->profiles[i], method, setting, error);
            counted += b->profiles[i].least > 0;
            missed += b->profiles[i].least > 0 && !(reached <= b->profiles[i].least * (1 + 1e-6));
        }
        times[k] = (now() - from) / b->count;
    }
    qsort(times, REPEATS, sizeof *times, by_value);
    *seconds = times[REPEATS / 2];
    *missed_percent = 100.0 * missed / counted;
}

static bool build(bench *b, int count, alb_error *error)
{
    b->count = count;
    b->profiles = calloc((size_t)count, sizeof *b->profiles);
    if (!b->profiles || !exhaustive_readings(&b->readings, error) ||
        !alb_operator_identity(&b->forward, &b->readings, error) ||
        !alb_basis_create(&b->basis, &b->readings, &b->forward, error) ||
        !(b->scratch = calloc(alb_separable_scratch(&b->basis), sizeof *b->scratch)))
        return alb_fail(error, ALB_NO_MEMORY, "out of memory");
#pragma omp parallel for schedule(dynamic)
    for (int i = 0; i < count; i++) {
        profile *p = &b->profiles[i];
        alb_error ignored = {0};
        alb_readings readings;
        alb_profile at, one = {.form = ALB_FORM_NONE};
        double single = (double)INFINITY;
        bool any = false;
        exhaustive_profile(p->value, p->sd, ALB_FORM_TWO_EXPONENTIALS, 2026, (unsigned)i);
        const alb_weighing weighing = weighing_of(b, &readings, p);
        alb_search(&one, &single, &any, (alb_candidate){ALB_FORM_EXPONENTIAL, false}, &b->basis, &weighing, &ignored);
        const alb_profile none = {.form = ALB_FORM_NONE};
        p->least = exhaustive_minimum(&at, ALB_FORM_TWO_EXPONENTIALS, &one, &none, &weighing, &b->basis);
        if (!(p->least < single * (1 - 1e-6)))
            p->least = 0;
    }
    return true;
}

// Fits a second where two terms are there to be found: decays 1 : 3, amplitudes 1 : 1.
static void measure_rates(bench *b, alb_error *error)
{
    static const double noises[NOISES] = {0.001, 0.01, 0.03};
    for (int k = 0; k < NOISES; k++) {
        for (int i = 0; i < b->count; i++) {
            profile *p = &b->profiles[i];
            alb_random random = alb_random_at(7, (unsigned)k, (unsigned)i);
            p->least = 1;
            for (int r = 0; r < N; r++) {
                const double truth = exp(-0.5 * b->readings.r_mm[r]) + exp(-1.5 * b->readings.r_mm[r]);
                p->sd[r] = noises[k] * hypot(truth, 0.02);
                p->value[r] = truth + p->sd[r] * alb_random_normal(&random);
            }
        }
        b->noise_percent[k] = 100 * noises[k];
        for (int m = 0; m < METHODS; m++) {
            double seconds, missed;
            measure(b, &seconds, &missed, (way)m, SETTINGS - 1, error);
            b->rate[m][k] = 1 / seconds;
            printf("decays 1:3, noise %4.1f %%   %-28s %9.0f fits/s\n", b->noise_percent[k], names[m], b->rate[m][k]);
        }
    }
}

static bool chart(const bench *b, const char *path, alb_error *error)
{
    alb_curve by_time[METHODS] = {{0}}, by_noise[METHODS] = {{0}};
    for (int m = 0; m < METHODS; m++) {
        by_time[m] = (alb_curve){.label = names[m],
                                 .x = b->seconds[m],
                                 .y = b->missed_percent[m],
                                 .count = m >= ONE_BLOCK ? SETTINGS : 1,
                                 .mark = m >= ONE_BLOCK ? ALB_MARK_LINE_AND_POINTS : ALB_MARK_POINTS};
        by_noise[m] = (alb_curve){.label = names[m],
                                  .x = b->noise_percent,
                                  .y = b->rate[m],
                                  .count = NOISES,
                                  .mark = ALB_MARK_LINE_AND_POINTS};
    }
    const alb_panel panels[2] = {{.title = "Two exponentials, 120 readings, noise 0.1 to 10 %, decays 1 : 1.1 to 10",
                                  .x_label = "seconds a fit, one core",
                                  .y_label = "least chi-square missed, %",
                                  .log_x = true,
                                  .y_minimum = -2,
                                  .y_maximum = 102,
                                  .curves = by_time,
                                  .curve_count = METHODS,
                                  .height = 1},
                                 {.title = "Fits a second where two terms are there to be found: decays 1 : 3",
                                  .x_label = "noise, %",
                                  .y_label = "fits a second, one core",
                                  .log_x = true,
                                  .log_y = true,
                                  .curves = by_noise,
                                  .curve_count = METHODS,
                                  .height = 1}};
    return alb_plot_write(path, panels, 2, 800, 800, error);
}

int main(int argc, char **argv)
{
    bench b = {0};
    alb_error error = {0};
    const int count = argc > 2 ? atoi(argv[2]) : 1000;
    bool ok = count > 0 && build(&b, count, &error);
    printf("%-28s %10s %12s %12s   of %d profiles\n", "method", "iterations", "us a fit", "missed, %", count);
    for (int m = 0; ok && m < METHODS; m++)
        for (int k = 0; k < (m >= ONE_BLOCK ? SETTINGS : 1); k++) {
            measure(&b, &b.seconds[m][k], &b.missed_percent[m][k], (way)m, k, &error);
            printf("%-28s %10d %12.2f %12.2f\n", names[m], m >= ONE_BLOCK ? iterations_of[k] : 0, 1e6 * b.seconds[m][k],
                   b.missed_percent[m][k]);
        }
    if (ok)
        measure_rates(&b, &error);
    if (ok && argc > 1)
        ok = chart(&b, argv[1], &error);
    if (!ok)
        fprintf(stderr, "bench.fit_speed: %s\n", error.text);
    free(b.scratch);
    alb_basis_free(&b.basis);
    alb_operator_free(&b.forward);
    alb_readings_free(&b.readings);
    free(b.profiles);
    return ok ? 0 : (int)error.status;
}
