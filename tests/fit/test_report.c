// The page of a fit and its twin: all that is known is on the page, and every number of the page is in the twin.
#include "base/file.h"
#include "base/random.h"
#include "base/record.h"
#include "check.h"
#include "fit/source.h"
#include "well_formed.h"
#include <unistd.h>

static const alb_profile truth = {ALB_FORM_TWO_EXPONENTIALS, {0.02, 0.7, 0.05, 3}};

static int enter_folder(void **state)
{
    static char folder[] = "/tmp/alb_report_XXXXXX";
    *state = mkdtemp(folder);
    return !*state || chdir(*state) != 0;
}

static int leave_folder(void **state)
{
    static const char *const files[] = {"profile.csv",
                                        "out/report/fit.csv",
                                        "out/report/fit.svg",
                                        "out/report/fit.html",
                                        "out/report/fit.json",
                                        "out/report",
                                        "out"};
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++)
        remove(files[i]);
    return chdir("/") != 0 || rmdir(*state) != 0;
}

// A noisy table, fitted and reported.
static alb_fitting *reported(double noise, const char *notes)
{
    alb_error error = {0};
    alb_text text = {0};
    alb_provenance provenance = {.command = "fit"};
    alb_random random = alb_random_at(4, 0, 0);
    alb_fitting *fitting = calloc(1, sizeof *fitting);
    alb_text_add(&text, "r_mm,value_per_mm2,sd_per_mm2\n");
    for (int i = 0; i < 100; i++) {
        const double r = 0.1 * (i + 0.5), value = alb_profile_value(&truth, r), sd = noise * value + 1e-6;
        alb_text_add(&text, "%.9g,%.9g,%.9g\n", r, value + sd * alb_random_normal(&random), sd);
    }
    check_ok(alb_file_write_text("profile.csv", &text, &error), &error);
    check_ok(alb_fitting_from_table(fitting, &provenance, "profile.csv", ALB_REFLECTION, &error), &error);
    check_ok(alb_fitting_report(fitting, &provenance, notes, "out", &error), &error);
    alb_text_free(&text);
    return fitting;
}

static char *slurp(const char *path)
{
    alb_error error = {0};
    char *bytes = NULL;
    size_t size;
    check_ok(alb_file_read(&bytes, &size, path, &error), &error);
    return bytes;
}

static void forget(alb_fitting *fitting)
{
    alb_fitting_free(fitting);
    free(fitting);
}

static void page_shows_what_is_known(void **state)
{
    (void)state;
    alb_fitting *fitting = reported(0.01, "a note\nand one with <b> & |");
    const alb_outcome *outcome = &fitting->sides[ALB_REFLECTION][0].outcome;
    char *page = slurp("out/report/fit.html");
    assert_true(well_formed(page));
    static const char *const headings[] = {"Profiles",    "Energy",       "Parameters",
                                           "Forms tried", "Correlations", "Readings",
                                           "Cramér-Rao",  "95 %",         "and one with &lt;b&gt; &amp; |"};
    for (size_t i = 0; i < sizeof headings / sizeof headings[0]; i++)
        if (!strstr(page, headings[i]))
            fail_msg("no %s on the page", headings[i]);
    assert_int_equal(occurrences(page, ">identifiable<"), alb_form_parameter_count(outcome->fitted.profile.form));
    for (int i = 0; i < outcome->attempt_count; i++)
        assert_non_null(strstr(page, alb_form_name(outcome->attempts[i].form)));
    assert_int_equal(occurrences(page, ">chosen<"), 1);
    char number[32];
    for (int p = 0; p < 4; p++) {
        snprintf(number, sizeof number, ">%.5g<", outcome->fitted.profile.parameters[p]);
        assert_non_null(strstr(page, number));
    }
    // the lower triangle: 6 correlations of four parameters
    snprintf(number, sizeof number, ">%+.3f<",
             outcome->fitted.covariance[1][0] / (outcome->fitted.sd[0] * outcome->fitted.sd[1]));
    assert_non_null(strstr(page, number));
    assert_null(strstr(page, "nan"));
    free(page);
    forget(fitting);
}

// Decays that the noise does not tell apart: the page says so and why.
static void page_says_what_is_not_known(void **state)
{
    (void)state;
    alb_fitting *fitting = reported(0.9, "");
    const alb_outcome *outcome = &fitting->sides[ALB_REFLECTION][0].outcome;
    char *page = slurp("out/report/fit.html");
    assert_true(well_formed(page));
    assert_true(occurrences(page, ">identifiable<") < 4 ||
                outcome->fitted.profile.form == ALB_FORM_EXPONENTIAL); // not two, whatever is said
    assert_null(strstr(page, "Notes"));
    free(page);
    forget(fitting);
}

static void twin_is_complete(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_fitting *fitting = reported(0.01, "kept");
    const alb_measurement *measurement = &fitting->sides[ALB_REFLECTION][0];
    const int n = measurement->readings.count;
    double *values = calloc((size_t)n, sizeof *values);
    alb_record *record = alb_record_read("out/report/fit.json", &error);
    alb_node root, node, channel;
    const char *notes;
    assert_non_null(record);
    check_ok(alb_record_root(&root, record, &error), &error);
    check_ok(alb_node_object(&node, root, "readings", &error), &error);
    check_ok(alb_node_object(&node, node, "reflection", &error), &error);
    check_ok(alb_node_object(&channel, node, "Y", &error), &error);
    check_ok(alb_node_numbers(values, (size_t)n, channel, "measured_per_mm2", -1, 1, &error), &error);
    assert_memory_equal(values, measurement->readings.value, (size_t)n * sizeof *values);
    check_ok(alb_node_numbers(values, (size_t)n, channel, "fitted_per_mm2", 0, 1, &error), &error);
    for (int i = 0; i < n; i++) // a table's readings are values of S
        check_relative(values[i],
                       alb_profile_value(&measurement->outcome.fitted.profile, measurement->readings.r_mm[i]), 1e-12);
    check_ok(alb_node_numbers(values, (size_t)n, channel, "fitted_sd_per_mm2", 0, 1, &error), &error);
    check_ok(alb_node_text(&notes, root, "notes", &error), &error);
    assert_string_equal(notes, "kept");
    check_ok(alb_node_object(&node, root, "channels", &error), &error);
    check_ok(alb_node_object(&node, node, "Y", &error), &error);
    check_ok(alb_node_object(&node, node, "reflection", &error), &error);
    assert_true(alb_node_has(node, "tried") && alb_node_has(node, "covariance") && alb_node_has(node, "parameters"));
    alb_record_free(record);
    free(values);
    forget(fitting);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(page_shows_what_is_known),
        cmocka_unit_test(page_says_what_is_not_known),
        cmocka_unit_test(twin_is_complete),
    };
    return cmocka_run_group_tests_name("report", tests, enter_folder, leave_folder);
}
