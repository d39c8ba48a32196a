// Tables as profiles: closed forms where they are exact, bounds where they are not, what is refused.
#include "base/file.h"
#include "base/random.h"
#include "check.h"
#include "fit/material.h"

enum { CASES = 100, LINES = 60 };
static const char file[] = "test_tabulated.csv";

static double uniform(alb_random *random, double low, double high)
{
    return low + (high - low) * alb_random_uniform(random);
}

// S at distances that rise by random steps of at most `step`, from 0 or from one of them.
static void tabulate(const alb_profile *of, alb_random *random, double step, bool from_zero)
{
    alb_error error = {0};
    alb_text text = {0};
    double r = from_zero ? 0 : step;
    alb_text_add(&text, "r_mm,value_per_mm2\n");
    for (int i = 0; i < LINES; i++, r += uniform(random, 0.5, 1) * step)
        alb_text_add(&text, "%.17g,%.17g\n", r, alb_profile_value(of, r));
    check_ok(alb_file_write_text(file, &text, &error), &error);
    alb_text_free(&text);
}

// Of an exponential, the table, its ends and its tail included, is the exponential.
static void a_table_of_an_exponential_is_it(void **state)
{
    (void)state;
    for (uint64_t i = 0; i < CASES; i++) {
        alb_error error = {0};
        alb_random random = alb_random_at(1, 1, i);
        const double b = exp(uniform(&random, -5, 5));
        const alb_profile truth = {ALB_FORM_EXPONENTIAL, {uniform(&random, 0.01, 0.99) * b * b / (2 * M_PI), b}};
        alb_profile table;
        tabulate(&truth, &random, 0.2 / b, i % 2);
        check_ok(alb_profile_read_table(&table, file, &error), &error);
        // 17 digits of values that differ by a tenth or more: slopes are good to 1e-14
        check_relative(alb_profile_total(&table), alb_profile_total(&truth), 1e-12);
        for (int k = 0; k < 20; k++) {
            const double r = uniform(&random, 0, 20) / b;
            check_relative(alb_profile_value(&table, r), alb_profile_value(&truth, r), 1e-11);
            check_relative(alb_profile_disc(&table, r), alb_profile_disc(&truth, r), 1e-11);
        }
        check_relative(alb_profile_fastest(&table), b, 0.25); // to the next line
        alb_profile_free(&table);
    }
    remove(file);
}

// Of a convex ln S the chord lies above it, by at most h^2/8 of its second derivative.
static void a_table_errs_by_no_more_than_it_says(void **state)
{
    (void)state;
    for (uint64_t i = 0; i < CASES; i++) {
        alb_error error = {0};
        alb_random random = alb_random_at(1, 2, i);
        const double slow = uniform(&random, 0.3, 1), fast = slow + uniform(&random, 0.5, 3), step = 0.3;
        // (ln S)'' of a sum of two exponentials is at most (fast - slow)^2 / 4
        const double bound = step * step / 8 * (fast - slow) * (fast - slow) / 4;
        const alb_profile truth = {ALB_FORM_TWO_EXPONENTIALS, {0.005, slow, uniform(&random, 0.005, 0.02), fast}};
        alb_profile table;
        tabulate(&truth, &random, step, true);
        check_ok(alb_profile_read_table(&table, file, &error), &error);
        for (int k = 0; k < 50; k++) {
            const double r = uniform(&random, 0, 0.5 * step * (LINES - 1)),
                         off = alb_profile_value(&table, r) / alb_profile_value(&truth, r) - 1;
            check_below(off, expm1(bound) + 1e-12);
            check_below(-1e-12, off);
        }
        check_relative(alb_profile_total(&table), alb_profile_total(&truth), bound + 1e-3); // the tail's decay
        alb_profile_free(&table);
    }
    remove(file);
}

// Linear steps to 0 and from 0: a tent about a ring, whose integral is known.
static void steps_to_zero_are_linear(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_profile table;
    static const char text[] = "r_mm,value_per_mm2\n0,0\n1,0\n2,0.01\n4,0\n9,0\n";
    check_ok(alb_file_write(file, text, strlen(text), &error), &error);
    check_ok(alb_profile_read_table(&table, file, &error), &error);
    check_near(alb_profile_value(&table, 0.5), 0, 0);
    check_near(alb_profile_value(&table, 1.25), 0.0025, 1e-15);
    check_near(alb_profile_value(&table, 3), 0.005, 1e-15);
    check_near(alb_profile_value(&table, 100), 0, 0);
    // integral of r (r - 1) from 1 to 2 is 5/6, of r (4 - r)/2 from 2 to 4 is 8/3
    check_relative(alb_profile_total(&table), 2 * M_PI * 0.01 * (5.0 / 6 + 8.0 / 3), 1e-12);
    alb_profile_free(&table);
    remove(file);
}

static void tables_that_are_no_profiles_are_refused(void **state)
{
    (void)state;
    static const char *const cases[][2] = {
        {"0,0.02\n", "one line"},
        {"0,0.02\n1,-0.01\n2,0\n", "test_tabulated.csv:3: column 2: a profile is nowhere negative"},
        {"0,0.02\n1,0.01\n2,0.01\n", "test_tabulated.csv:4: column 2: the profile does not fall"},
        {"0,0.02\n1,0.019\n2,0.018\n", "% of the light"},
        {"2,0.02\n3,0.001\n4,0\n", "% of the light"},
        {"0,2\n1,1\n2,0.5\n4,0.01\n8,0.0001\n", "times the light that falls in"},
        {"1,x\n", "test_tabulated.csv:2: column 2: a number"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        alb_error error = {0};
        alb_text text = {0};
        alb_profile table;
        alb_text_add(&text, "r_mm,value_per_mm2\n%s", cases[i][0]);
        check_ok(alb_file_write_text(file, &text, &error), &error);
        check_fails(alb_profile_read_table(&table, file, &error), &error, ALB_BAD_DATA, cases[i][1]);
        assert_int_equal(table.form, ALB_FORM_NONE);
        alb_text_free(&text);
    }
    remove(file);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_table_of_an_exponential_is_it),
        cmocka_unit_test(a_table_errs_by_no_more_than_it_says),
        cmocka_unit_test(steps_to_zero_are_linear),
        cmocka_unit_test(tables_that_are_no_profiles_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
