// Slabs by photons (capture/photon.c), spot of 0.5 mm radius, range 3000:1, through the operator and the choice of
// forms that every fit goes through: what the form chosen leaves, and what it makes of the total.
#include "base/file.h"
#include "check.h"
#include "fit/ballistic.h"
#include "fit/measurement.h"
#include "slabs.h"
#include <unistd.h>

enum { MORE = 4 }; // photons, of those of the table
static alb_photon_tally tallies[SLABS];

static int trace_all(void **state)
{
    (void)state;
    for (int s = 0; s < SLABS; s++)
        if (!slabs_trace(&tallies[s], &slabs[s], MORE))
            return 1;
    return 0;
}

static void fit_slab(alb_outcome *outcome, alb_readings *readings, alb_operator *forward, int s, alb_side side,
                     bool ballistic)
{
    alb_error error = {0};
    alb_spot spot = {0};
    assert_true(slabs_readings(readings, &tallies[s], side, ballistic));
    check_ok(alb_spot_disc(&spot, slabs_spot_mm, &error), &error);
    check_ok(alb_operator_create(forward, readings, &spot, &error), &error);
    check_ok(alb_choose(outcome, readings, forward, (alb_common_sd){0, 0}, &error), &error);
    if (ballistic)
        check_ok(alb_ballistic_find(outcome, readings, forward, (alb_common_sd){0, 0}, &error), &error);
    alb_spot_free(&spot);
}

// Relative rms of what a profile leaves over the readings whose photon noise is below `noise`, that noise included.
static double rms_of(int *counted, const alb_readings *readings, const alb_operator *forward,
                     const alb_profile *profile, double noise)
{
    alb_error error = {0};
    double *model = alb_operator_readings(forward, profile, &error), squares = 0;
    *counted = 0;
    assert_non_null(model);
    for (int i = 0; i < readings->count; i++) {
        if (slabs_noise(readings, i) > noise)
            continue;
        squares += pow(readings->value[i] / model[i] - 1, 2);
        (*counted)++;
    }
    free(model);
    return sqrt(squares / fmax(*counted, 1));
}

typedef struct summary {
    double rms[SLABS], total[SLABS];
    int count, totals;
} summary;

static void check_side(alb_side side, double noise, double median_rms, double worst_rms)
{
    summary all = {.count = 0};
    double worst = 0, worst_total = 0;
    alb_outcome *outcome = calloc(1, sizeof *outcome);
    for (int s = 0; s < SLABS; s++) {
        if (!slabs_seen(&tallies[s], &slabs[s], MORE, side))
            continue;
        int counted;
        alb_readings readings = {0};
        alb_operator forward = {0};
        fit_slab(outcome, &readings, &forward, s, side, false);
        const double truth = tallies[s].leaving[side] - tallies[s].unscattered[side];
        const double rms = rms_of(&counted, &readings, &forward, &outcome->fitted.profile, noise);
        const double error = outcome->fitted.total / truth - 1;
        print_message("%-18s %s %-24s%s %d parameters, rms %.2f %% of %d readings, total %+.2f %%\n", slabs[s].name,
                      side ? "T" : "R", alb_form_name(outcome->fitted.profile.form), outcome->tied ? ", tied" : "",
                      alb_form_parameter_count(outcome->fitted.profile.form) - outcome->tied, 100 * rms, counted,
                      100 * error);
        worst_total = fmax(worst_total, fabs(error));
        all.total[all.totals++] = fabs(error);
        if (counted >= 10) {
            worst = fmax(worst, rms);
            all.rms[all.count++] = rms;
        }
        alb_readings_free(&readings);
        alb_operator_free(&forward);
    }
    const double median = alb_median(all.rms, (size_t)all.count), total = alb_median(all.total, (size_t)all.totals);
    print_message("%s: rms median %.2f %%, worst %.2f %%; total median %.2f %%, worst %.2f %%\n", side ? "T" : "R",
                  100 * median, 100 * worst, 100 * total, 100 * worst_total);
    check_below(median, median_rms);
    check_below(worst, worst_rms);
    check_below(total, 0.003);
    check_below(worst_total, 0.01);
    free(outcome);
}

static void reflection_of_slabs(void **state)
{
    (void)state;
    check_side(ALB_REFLECTION, 0.01, 0.015, 0.05);
}

static void transmission_of_slabs(void **state)
{
    (void)state;
    check_side(ALB_TRANSMISSION, 0.02, 0.03, 0.08);
}

// Slabs of 12 transport mean free paths or more: T is flat at r = 0, and sums of positive terms cannot follow it.
static void flat_top_T(void **state)
{
    (void)state;
    alb_outcome *outcome = calloc(1, sizeof *outcome);
    for (int s = 0; s < SLABS; s++) {
        const double paths = (slabs[s].absorption_per_mm + slabs[s].reduced_scattering_per_mm) * slabs[s].thickness_mm;
        if (paths < 12 || !slabs_seen(&tallies[s], &slabs[s], MORE, ALB_TRANSMISSION))
            continue;
        int counted;
        alb_readings readings = {0};
        alb_operator forward = {0};
        fit_slab(outcome, &readings, &forward, s, ALB_TRANSMISSION, false);
        const alb_form form = outcome->fitted.profile.form;
        const double rms = rms_of(&counted, &readings, &forward, &outcome->fitted.profile, 0.02);
        print_message("%s: %s, rms %.2f %%\n", slabs[s].name, alb_form_name(form), 100 * rms);
        assert_true(form == ALB_FORM_SIGNED_EXPONENTIALS || form == ALB_FORM_BURIED_SOURCE ||
                    form == ALB_FORM_TWO_BURIED_SOURCES);
        check_below(rms, 0.04);
        for (int i = 0; i < outcome->attempt_count; i++) // rejected, with the number
            if (outcome->attempts[i].form == ALB_FORM_EXPONENTIAL)
                assert_true(outcome->attempts[i].p_value < 1e-3 && *outcome->attempts[i].rejected);
        alb_readings_free(&readings);
        alb_operator_free(&forward);
    }
    free(outcome);
}

// Slabs through which light comes straight: how much, to within its sd, beside the profile of the rest.
static void ballistic_spike(void **state)
{
    (void)state;
    alb_outcome *outcome = calloc(1, sizeof *outcome);
    int found = 0;
    for (int s = 0; s < SLABS; s++) {
        const double truth = tallies[s].unscattered[ALB_TRANSMISSION];
        alb_readings readings = {0};
        alb_operator forward = {0};
        if (!slabs_seen(&tallies[s], &slabs[s], MORE, ALB_TRANSMISSION))
            continue;
        fit_slab(outcome, &readings, &forward, s, ALB_TRANSMISSION, true);
        if (truth < 1e-3) { // nothing straight: nothing found that matters
            check_below(outcome->ballistic_share, 1e-3);
        } else {
            print_message("%s: straight %.4f, found %.4f +- %.4f; %s, rms %.2f %%\n", slabs[s].name, truth,
                          outcome->ballistic_share, outcome->ballistic_sd, alb_form_name(outcome->fitted.profile.form),
                          100 * outcome->rms_relative);
            check_below(outcome->rms_relative, 0.04);
            const double all = tallies[s].leaving[ALB_TRANSMISSION];
            if (outcome->ballistic_share > 0) {
                check_near(outcome->ballistic_share, truth, 4 * outcome->ballistic_sd);
                check_near(outcome->fitted.total, all - truth, 4 * outcome->fitted.total_sd);
                found++;
            } else { // little enough for a fast term to hold it
                check_below(truth, 0.05 * all);
                check_relative(outcome->fitted.total, all, 0.01);
            }
        }
        alb_readings_free(&readings);
        alb_operator_free(&forward);
    }
    assert_true(found >= 3);
    free(outcome);
}

// The amount is in the material.
static void ballistic_spike_is_written(void **state)
{
    (void)state;
    char folder[] = "/tmp/alabaster_slabs_XXXXXX", path[64];
    alb_error error = {0};
    alb_fitting *fitting = calloc(1, sizeof *fitting);
    alb_measurement *through = &fitting->sides[ALB_TRANSMISSION][0];
    alb_material material;
    alb_provenance provenance = {.command = "fit"};
    int s = 0;
    while (strcmp(slabs[s].name, "thin 5 mm") != 0)
        s++;
    alb_spot spot = {0};
    assert_non_null(mkdtemp(folder));
    snprintf(fitting->material.name, sizeof fitting->material.name, "thin");
    snprintf(fitting->material.channel_names[0], sizeof fitting->material.channel_names[0], "Y");
    fitting->material.channels = 1;
    assert_true(slabs_readings(&through->readings, &tallies[s], ALB_TRANSMISSION, true));
    check_ok(alb_spot_disc(&spot, slabs_spot_mm, &error), &error);
    check_ok(alb_operator_create(&through->forward, &through->readings, &spot, &error), &error);
    check_ok(alb_fitting_run(fitting, &error), &error);
    assert_true(through->outcome.ballistic_share > 0.05);
    check_ok(alb_material_write(fitting, &provenance, folder, &error), &error);
    snprintf(path, sizeof path, "%s/material.json", folder);
    char *bytes;
    size_t size;
    check_ok(alb_file_read(&bytes, &size, path, &error), &error);
    assert_non_null(strstr(bytes, "\"ballistic_share\""));
    check_ok(alb_material_read(&material, path, &error), &error);
    remove(path);
    rmdir(folder);
    free(bytes);
    alb_spot_free(&spot);
    alb_fitting_free(fitting);
    free(fitting);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(reflection_of_slabs), cmocka_unit_test(transmission_of_slabs),
                                       cmocka_unit_test(flat_top_T), cmocka_unit_test(ballistic_spike),
                                       cmocka_unit_test(ballistic_spike_is_written)};
    return cmocka_run_group_tests(tests, trace_all, NULL);
}
