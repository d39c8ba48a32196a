// material.json: what is written reads back to the same numbers; damaged ones are refused with their place.
#include "base/random.h"
#include "check.h"
#include "fit/measurement.h"
#include "fit/source.h"
#include <unistd.h>

static const char table[] = "folder/profile.csv";

static int in_own_folder(void **state)
{
    static char folder[] = "/tmp/alabaster_material_XXXXXX";
    *state = mkdtemp(folder);
    return *state == NULL || chdir(folder) != 0 || !alb_file_make_directory("folder", NULL);
}

static int leave(void **state)
{
    static const char *const files[] = {
        "folder/profile.csv",     "folder/material.json",   "folder/report/fit.csv", "folder/report/fit.svg",
        "folder/report/fit.html", "folder/report/fit.json", "folder/report",         "folder"};
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++)
        remove(files[i]);
    return chdir("/") != 0 || rmdir(*state) != 0;
}

static void write_table(const alb_profile *truth)
{
    alb_error error = {0};
    alb_text text = {0};
    alb_random random = alb_random_at(1, 0, 0);
    alb_text_add(&text, "r_mm,value_per_mm2,sd_per_mm2\n");
    for (int i = 0; i < 100; i++) {
        const double r = 0.1 * (i + 0.5), value = alb_profile_value(truth, r), sd = 0.01 * value + 1e-6;
        alb_text_add(&text, "%.9g,%.9g,%.9g\n", r, value + sd * alb_random_normal(&random), sd);
    }
    check_ok(alb_file_write_text(table, &text, &error), &error);
    alb_text_free(&text);
}

static void fit_and_write(alb_fitting *fitting, alb_side side)
{
    alb_error error = {0};
    alb_provenance provenance = {.command = "fit"};
    check_ok(alb_fitting_from_table(fitting, &provenance, table, side, &error), &error);
    check_ok(alb_material_write(fitting, &provenance, "folder", &error), &error);
    check_ok(alb_fitting_report(fitting, &provenance, "a note\nand one with <b> & |", "folder", &error), &error);
}

static void round_trip(void **state)
{
    (void)state;
    static const alb_profile truths[] = {{ALB_FORM_EXPONENTIAL, {0.02, 0.7}},
                                         {ALB_FORM_TWO_EXPONENTIALS, {0.02, 0.7, 0.05, 3}},
                                         {ALB_FORM_SIGNED_EXPONENTIALS, {0.04, 0.6, -0.03, 1.1}},
                                         {ALB_FORM_THREE_EXPONENTIALS, {0.02, 0.5, 0.1, 2, 0.8, 8}}};
    for (size_t i = 0; i < sizeof truths / sizeof truths[0]; i++) {
        alb_error error = {0};
        alb_fitting *fitting = calloc(1, sizeof *fitting);
        alb_material material;
        const alb_side side = i % 2 ? ALB_TRANSMISSION : ALB_REFLECTION;
        write_table(&truths[i]);
        fit_and_write(fitting, side);
        assert_int_equal(fitting->material.fitted[side][0].profile.form, truths[i].form);
        check_ok(alb_material_read(&material, "folder/material.json", &error), &error);
        assert_string_equal(material.name, "profile");
        assert_string_equal(material.channel_names[0], "Y");
        assert_memory_equal(&material.fitted[side][0].profile, &fitting->material.fitted[side][0].profile,
                            sizeof(alb_profile));
        assert_memory_equal(material.fitted[side][0].covariance, fitting->material.fitted[side][0].covariance,
                            sizeof material.fitted[side][0].covariance);
        check_near(material.fitted[side][0].total_sd, fitting->material.fitted[side][0].total_sd, 0);
        assert_int_equal(material.fitted[1 - side][0].profile.form, ALB_FORM_NONE);
        alb_fitting_free(fitting);
        free(fitting);
    }
}

// The file with one piece replaced.
static void check_replaced(const char *from, const char *to, const char *part)
{
    alb_error error = {0};
    char *bytes;
    size_t size;
    alb_text text = {0};
    alb_material material;
    check_ok(alb_file_read(&bytes, &size, "folder/material.json", &error), &error);
    const char *at = strstr(bytes, from);
    assert_non_null(at);
    alb_text_add_bytes(&text, bytes, (size_t)(at - bytes));
    alb_text_add(&text, "%s%s", to, at + strlen(from));
    check_ok(alb_file_write_text("folder/profile.csv", &text, &error), &error);
    check_fails(alb_material_read(&material, "folder/profile.csv", &error), &error, ALB_BAD_DATA, part);
    assert_int_equal(material.channels, 0);
    alb_text_free(&text);
    free(bytes);
}

// Three terms out of order, or with one that is not positive, are refused.
static void damaged_three(void **state)
{
    (void)state;
    const alb_profile truth = {ALB_FORM_THREE_EXPONENTIALS, {0.02, 0.5, 0.1, 2, 0.8, 8}};
    alb_fitting *fitting = calloc(1, sizeof *fitting);
    write_table(&truth);
    fit_and_write(fitting, ALB_REFLECTION);
    check_replaced("\"amplitude_3_per_mm2\": {\n            \"value\": ",
                   "\"amplitude_3_per_mm2\": {\n            \"value\": -", "not a positive profile");
    check_replaced("\"decay_2_per_mm\": {\n            \"value\": ", "\"decay_2_per_mm\": {\n            \"value\": 9",
                   "not a positive profile");
    check_replaced("three_exponentials", "two_exponentials", "unknown key");
    alb_fitting_free(fitting);
    free(fitting);
}

static void damaged(void **state)
{
    (void)state;
    const alb_profile truth = {ALB_FORM_TWO_EXPONENTIALS, {0.02, 0.7, 0.05, 3}};
    alb_fitting *fitting = calloc(1, sizeof *fitting);
    write_table(&truth);
    fit_and_write(fitting, ALB_REFLECTION);
    check_replaced("two_exponentials", "four_exponentials", "unknown form");
    check_replaced("\"decay_1_per_mm\"", "\"decay_1_per_cm\"", "decay_1_per_mm");
    check_replaced("\"decay_1_per_mm\": {\n            \"value\": ", "\"decay_1_per_mm\": {\n            \"value\": -",
                   "not a positive profile");
    check_replaced("\"total\": {\n          \"value\": ", "\"total\": {\n          \"value\": 1",
                   "does not belong to the parameters");
    check_replaced("\"channels\"", "\"colour\": 1, \"channels\"", "unknown key");
    check_replaced("\"channels\"", "\"finish\": \"shiny\", \"channels\"", "found \"shiny\"");
    check_replaced("\"format\": 1", "\"format\": 2", "format");
    check_replaced("\"interval_95\": [", "\"interval_95\": [7, ", "3 ends");
    check_replaced("\"cramer_rao_sd\": ", "\"cramer_rao_sd\": true, \"because\": ", "cramer_rao_sd");
    check_replaced("\"condition\": ", "\"condition\": \"good\", \"left_out_to_mm\": ", "condition");
    check_replaced("\"tried\": [", "\"tried\": [{\"form\": 3}, ", "form");
    check_replaced("\"tried\": [", "\"tried\": [{\"shape\": 3}, ", "unknown key");
    check_replaced("\"errors_from\": ", "\"errors_from\": 1, \"offset_instead\": ", "errors_from");
    check_replaced("\"covariance\": [", "\"covariance\": [[1, 1, 1, 1], ", "5 rows for 4");
    alb_fitting_free(fitting);
    free(fitting);
}

// The same input gives the same bytes.
static void same_bytes(void **state)
{
    (void)state;
    const alb_profile truth = {ALB_FORM_SIGNED_EXPONENTIALS, {0.04, 0.6, -0.03, 1.1}};
    static const char *const files[] = {"folder/material.json", "folder/report/fit.csv", "folder/report/fit.svg",
                                        "folder/report/fit.html"};
    char hashes[2][4][ALB_HASH_SIZE];
    alb_error error = {0};
    write_table(&truth);
    for (int run = 0; run < 2; run++) {
        alb_fitting *fitting = calloc(1, sizeof *fitting);
        fit_and_write(fitting, ALB_TRANSMISSION);
        alb_fitting_free(fitting);
        free(fitting);
        for (int f = 0; f < 4; f++)
            check_ok(alb_hash_file(hashes[run][f], files[f], &error), &error);
    }
    assert_memory_equal(hashes[0], hashes[1], sizeof hashes[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(round_trip), cmocka_unit_test(damaged),
                                       cmocka_unit_test(damaged_three), cmocka_unit_test(same_bytes)};
    return cmocka_run_group_tests(tests, in_own_folder, leave);
}
