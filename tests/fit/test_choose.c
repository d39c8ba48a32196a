// Which form is taken, and what is said of it.
#include "base/random.h"
#include "check.h"
#include "fit/choose.h"
#include "fit/profile.h"

enum { READINGS = 120 };

// Relative noise, and `floor` of the value at r = 0 in quadrature.
static void make_above(alb_readings *readings, const alb_profile *truth, double range_mm, double noise, double floor,
                       int count, alb_random *random)
{
    alb_error error = {0};
    check_ok(alb_readings_create(readings, count, &error), &error);
    for (int i = 0; i < count; i++) {
        const double step = range_mm / count, r = step * (i + 0.5), value = alb_profile_value(truth, r);
        const double top = alb_profile_value(truth, alb_form_singular(truth->form) ? step / 2 : 0);
        readings->r_mm[i] = r;
        readings->sd[i] = noise * hypot(value, floor * top);
        readings->value[i] = value + readings->sd[i] * alb_random_normal(random);
        readings->area_mm2[i] = 2 * M_PI * r * step;
    }
    readings->outer_mm = range_mm;
}

static void make(alb_readings *readings, const alb_profile *truth, double range_mm, double noise, int count,
                 alb_random *random)
{
    make_above(readings, truth, range_mm, noise, 0.01, count, random);
}

static void choose(alb_outcome *outcome, const alb_readings *readings, double scale_sd)
{
    alb_error error = {0};
    alb_operator forward = {0};
    check_ok(alb_operator_identity(&forward, readings, &error), &error);
    check_ok(alb_choose(outcome, readings, &forward, (alb_common_sd){scale_sd, 0}, &error), &error);
    alb_operator_free(&forward);
}

// How often of `trials` the form is taken.
static int taken(alb_form form, const alb_profile *truth, double noise, int trials)
{
    int count = 0;
    for (int t = 0; t < trials; t++) {
        alb_random random = alb_random_at(1, (unsigned)form, (unsigned)t);
        alb_readings readings = {0};
        alb_outcome outcome;
        make(&readings, truth, 12, noise, READINGS, &random);
        choose(&outcome, &readings, 0);
        count += outcome.fitted.profile.form == form;
        for (int i = 0; i < outcome.attempt_count; i++)
            assert_true((outcome.attempts[i].form == outcome.fitted.profile.form &&
                         outcome.attempts[i].tied == outcome.tied) == !*outcome.attempts[i].rejected);
        alb_readings_free(&readings);
    }
    return count;
}

static void no_more_than_needed(void **state)
{
    (void)state;
    const alb_profile one = {ALB_FORM_EXPONENTIAL, {1, 0.7}};
    const int found = taken(ALB_FORM_EXPONENTIAL, &one, 0.01, 300);
    print_message("one exponential: a second term taken in %d of 300\n", 300 - found);
    // at 1 % the count is binomial with mean 3: above 8 in 4 of 1000 tests
    assert_true(300 - found <= 8);
}

static void as_much_as_needed(void **state)
{
    (void)state;
    const alb_profile two = {ALB_FORM_TWO_EXPONENTIALS, {1, 0.5, 1, 1.5}};
    const alb_profile flat = {ALB_FORM_SIGNED_EXPONENTIALS, {2, 0.5, -1, 1}}; // a1 b1 + a2 b2 = 0: flat at r = 0
    assert_int_equal(taken(ALB_FORM_TWO_EXPONENTIALS, &two, 0.03, 60), 60);
    assert_int_equal(taken(ALB_FORM_SIGNED_EXPONENTIALS, &flat, 0.03, 60), 60);
}

// Three terms are fitted to data made by two only where the noise of the two is beyond 1e-3 (here 1 % to 0.1 %, ratios
// of decays 1.5 to 6), and taken where the data need them.
static void a_third_term(void **state)
{
    (void)state;
    enum { TRIALS = 300 };
    int tried = 0, used = 0;
    for (unsigned t = 0; t < TRIALS; t++) {
        alb_random random = alb_random_at(7, 0, t);
        const double ratio = 1.5 * pow(4, alb_random_uniform(&random)),
                     noise = 0.01 * pow(0.1, alb_random_uniform(&random));
        const alb_profile two = {ALB_FORM_TWO_EXPONENTIALS,
                                 {1, 0.5, 0.3 + 3 * alb_random_uniform(&random), 0.5 * ratio}};
        alb_readings readings = {0};
        alb_outcome outcome;
        make(&readings, &two, 12, noise, READINGS, &random);
        choose(&outcome, &readings, 0);
        tried += outcome.attempt_count > 4;
        used += outcome.fitted.profile.form == ALB_FORM_THREE_EXPONENTIALS;
        alb_readings_free(&readings);
    }
    print_message("two exponentials: a third fitted in %d of %d, taken in %d\n", tried, TRIALS, used);
    // at 1e-3 the count is Poisson with mean 0.3: above 3 in 3 of 10000 tests
    assert_true(tried <= 3 && used <= tried);
    const alb_profile three = {ALB_FORM_THREE_EXPONENTIALS, {0.1, 0.4, 1, 1.5, 10, 6}};
    assert_int_equal(taken(ALB_FORM_THREE_EXPONENTIALS, &three, 0.003, 60), 60);
}

// Decays too close for the noise to tell the three apart, but not for it to see that there are not two: the simpler
// form is taken with its discrepancy, not three that nobody knows.
static void close_decays_stay_simple(void **state)
{
    (void)state;
    enum { TRIALS = 20 };
    int undecided = 0;
    const alb_profile close = {ALB_FORM_THREE_EXPONENTIALS, {1, 0.5, 1, 0.8, 1, 1.28}};
    for (unsigned t = 0; t < TRIALS; t++) {
        alb_random random = alb_random_at(9, 0, t);
        alb_readings readings = {0};
        alb_outcome outcome;
        make(&readings, &close, 12, 0.003, READINGS, &random);
        choose(&outcome, &readings, 0);
        assert_true(outcome.fitted.identifiable);
        check_near(outcome.fitted.total, alb_profile_total(&close), 4.5 * outcome.fitted.total_sd);
        for (int i = 0; i < outcome.attempt_count; i++)
            if (outcome.attempts[i].form == ALB_FORM_THREE_EXPONENTIALS &&
                strstr(outcome.attempts[i].rejected, "fits within the noise, but")) {
                assert_true(outcome.discrepancy_relative > 0 && outcome.discrepancy_relative < 0.01);
                undecided++;
            }
        alb_readings_free(&readings);
    }
    print_message("close decays: three not decided in %d of %d\n", undecided, TRIALS);
    assert_true(undecided > 0);
}

// The terms of a positive sum cannot follow a flat top, S = (1 + r + r^2 / 3) e^(-r), however many there are.
static void flat_top_wants_a_flat_form(void **state)
{
    (void)state;
    for (unsigned t = 0; t < 10; t++) {
        alb_error error = {0};
        alb_random random = alb_random_at(8, 0, t);
        alb_readings readings = {0};
        alb_outcome outcome;
        check_ok(alb_readings_create(&readings, READINGS, &error), &error);
        for (int i = 0; i < READINGS; i++) {
            const double step = 0.1, r = step * (i + 0.5), value = (1 + r + r * r / 3) * exp(-r);
            readings.r_mm[i] = r;
            readings.sd[i] = 0.001 * value;
            readings.value[i] = value + readings.sd[i] * alb_random_normal(&random);
            readings.area_mm2[i] = 2 * M_PI * r * step;
            readings.outer_mm = r;
        }
        choose(&outcome, &readings, 0);
        assert_true(outcome.discrepancy_relative > 0);
        const alb_form form = outcome.fitted.profile.form;
        assert_true(form == ALB_FORM_SIGNED_EXPONENTIALS || form == ALB_FORM_BURIED_SOURCE ||
                    form == ALB_FORM_TWO_BURIED_SOURCES);
        alb_readings_free(&readings);
    }
}

// Data of every further form choose it; what was tried beside it says by how much it loses.
static void every_form_where_it_is_true(void **state)
{
    (void)state;
    static const alb_profile truths[] = {{ALB_FORM_BURLEY, {0.7, 0.8}},
                                         {ALB_FORM_BURIED_SOURCE, {0.3, 0.5, 2}},
                                         {ALB_FORM_TWO_OVER_R, {0.1, 0.4, 1, 2}},
                                         {ALB_FORM_BURIED_AND_OVER_R, {0.1, 0.4, 1.5, 0.3, 2}},
                                         {ALB_FORM_TWO_BURIED_SOURCES, {0.1, 0.4, 1.5, 1, 2, 0.3}}};
    for (size_t i = 0; i < sizeof truths / sizeof truths[0]; i++) {
        int wrong = 0;
        for (unsigned t = 0; t < 20; t++) {
            alb_random random = alb_random_at(10, (unsigned)i, t);
            alb_readings readings = {0};
            alb_outcome outcome;
            make_above(&readings, &truths[i], 12, 0.003, 1e-6, READINGS, &random);
            choose(&outcome, &readings, 0);
            assert_true(outcome.fitted.identifiable && outcome.discrepancy_relative == 0);
            check_near(outcome.fitted.total, alb_profile_total(&truths[i]), 4.5 * outcome.fitted.total_sd);
            wrong += outcome.fitted.profile.form != truths[i].form;
            for (int k = 0; outcome.fitted.profile.form == truths[i].form && k < outcome.attempt_count; k++) {
                const alb_attempt *attempt = &outcome.attempts[k];
                if (attempt->form == truths[i].form) {
                    assert_true(attempt->p_value >= 1e-3 && attempt->bic_excess == 0 && attempt->at_bound < 0);
                    assert_true(fabs(attempt->lag_1) < 5 / sqrt(READINGS)); // white
                } else if (isfinite(attempt->chi_square)) {
                    assert_true(attempt->p_value < 1e-3 || attempt->bic_excess > 0);
                }
            }
            alb_readings_free(&readings);
        }
        // a form with two more parameters has the least BIC in 1 % of all data: three of 20 in one of 1000 tests
        assert_true(wrong <= 2);
    }
}

// Decays that coincide, S = (1 + r) e^(-r), the transmission of a thick slab: the tied pair stands for it, decided.
static void coinciding_decays(void **state)
{
    (void)state;
    for (unsigned t = 0; t < 60; t++) {
        alb_error error = {0};
        alb_random random = alb_random_at(6, 0, t);
        alb_readings readings = {0};
        alb_outcome outcome;
        check_ok(alb_readings_create(&readings, READINGS, &error), &error);
        for (int i = 0; i < READINGS; i++) {
            const double step = 0.1, r = step * (i + 0.5), value = (1 + r) * exp(-r);
            readings.r_mm[i] = r;
            readings.sd[i] = 0.02 * hypot(value, 0.01);
            readings.value[i] = value + readings.sd[i] * alb_random_normal(&random);
            readings.area_mm2[i] = 2 * M_PI * r * step;
            readings.outer_mm = r;
        }
        choose(&outcome, &readings, 0);
        assert_int_equal(outcome.fitted.profile.form, ALB_FORM_SIGNED_EXPONENTIALS);
        assert_true(outcome.tied && outcome.fitted.identifiable);
        check_near(outcome.fitted.total, 6 * M_PI, 4.5 * outcome.fitted.total_sd); // 2 pi (1 + 2)
        alb_readings_free(&readings);
    }
}

// With data of a form, neither the choice nor the energy moves the total; the sd of the scale is added once.
static void totals_are_honest(void **state)
{
    (void)state;
    enum { TRIALS = 200 };
    double mean = 0, squares = 0;
    const alb_profile two = {ALB_FORM_TWO_EXPONENTIALS, {0.02, 0.5, 0.05, 1.5}};
    for (unsigned t = 0; t < TRIALS; t++) {
        alb_random random = alb_random_at(2, 0, t);
        alb_readings readings = {0};
        alb_outcome outcome;
        make(&readings, &two, 12, 0.02, READINGS, &random);
        const double scale = 1 + 0.01 * alb_random_normal(&random);
        for (int i = 0; i < READINGS; i++) {
            readings.value[i] *= scale;
            readings.sd[i] *= scale;
        }
        choose(&outcome, &readings, 0.01);
        const double z = (outcome.fitted.total - alb_profile_total(&two)) / outcome.fitted.total_sd;
        mean += z / TRIALS;
        squares += z * z / TRIALS;
        alb_readings_free(&readings);
    }
    print_message("total: z mean %+.3f, mean square %.3f\n", mean, squares);
    check_near(mean, 0, 4 / sqrt(TRIALS));
    check_near(squares, 1, 4 * sqrt(2.0 / TRIALS));
}

// A profile that no form follows (a dipole): the energy of the readings is kept, and the tail goes on.
static void energy_is_kept_where_no_form_fits(void **state)
{
    (void)state;
    static const double materials[][3] = {{0.0021, 2.19, 1.5}, {0.0071, 3.0, 1.5}, {0.05, 1.5, 1.3}};
    for (int m = 0; m < 3; m++) {
        const alb_profile truth = {ALB_FORM_DIPOLE, {materials[m][0], materials[m][1], materials[m][2]}};
        const double sigma = sqrt(3 * materials[m][0] * (materials[m][0] + materials[m][1]));
        alb_random random = alb_random_at(3, 0, (unsigned)m);
        alb_readings readings = {0};
        alb_outcome outcome;
        make_above(&readings, &truth, 5 / sigma, 0.003, 1e-5, 400, &random);
        choose(&outcome, &readings, 0);
        print_message("dipole %d: %s, misses by %.1f %%, rms %.1f %%, total %.5f +- %.5f, truth %.5f (%+.2f %%)\n", m,
                      alb_form_name(outcome.fitted.profile.form), 100 * outcome.discrepancy_relative,
                      100 * outcome.rms_relative, outcome.fitted.total, outcome.fitted.total_sd,
                      alb_profile_total(&truth), 100 * (outcome.fitted.total / alb_profile_total(&truth) - 1));
        assert_true(outcome.discrepancy_relative > 0.001);
        // six parameters follow distances to 60 mean free paths to 5 %; two exponentials leave 5 to 35 %
        assert_int_equal(alb_form_parameter_count(outcome.fitted.profile.form), 6);
        check_below(outcome.rms_relative, 5 / sigma * (materials[m][0] + materials[m][1]) < 60 ? 0.05 : 0.08);
        check_relative(outcome.fitted.total, alb_profile_total(&truth), 0.002);
        check_near(outcome.fitted.total, alb_profile_total(&truth), 4 * outcome.fitted.total_sd);
        alb_readings_free(&readings);
    }
}

static void undecided(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_random random = alb_random_at(4, 0, 0);
    alb_readings readings = {0};
    alb_operator forward = {0};
    alb_outcome outcome;
    const alb_profile slow = {ALB_FORM_EXPONENTIAL, {1, 0.01}}, plain = {ALB_FORM_EXPONENTIAL, {1, 0.7}};
    make(&readings, &slow, 5, 0.01, READINGS, &random);
    choose(&outcome, &readings, 0);
    assert_false(outcome.fitted.identifiable);
    assert_non_null(strstr(outcome.undecided, "nothing was measured"));
    alb_readings_free(&readings);

    make(&readings, &plain, 3, 0.8, 3, &random); // drowned in noise
    choose(&outcome, &readings, 0);
    assert_false(outcome.fitted.identifiable);
    assert_true(*outcome.undecided);
    alb_readings_free(&readings);

    make(&readings, &plain, 3, 0.01, 2, &random);
    check_ok(alb_operator_identity(&forward, &readings, &error), &error);
    check_fails(alb_choose(&outcome, &readings, &forward, (alb_common_sd){0, 0}, &error), &error, ALB_UNDECIDED,
                "2 readings");
    alb_operator_free(&forward);
    alb_readings_free(&readings);

    make(&readings, &plain, 12, 0.01, READINGS,
         &random); // rising, and all negative: an answer or a refusal, never a crash
    for (int kind = 0; kind < 2; kind++) {
        for (int i = 0; i < READINGS; i++)
            readings.value[i] = kind ? -1 : 1e-3 * i * i;
        check_ok(alb_operator_identity(&forward, &readings, &error), &error);
        if (alb_choose(&outcome, &readings, &forward, (alb_common_sd){0, 0}, &error))
            assert_false(outcome.fitted.identifiable);
        else
            assert_int_equal(error.status, ALB_UNDECIDED);
        error = (alb_error){0};
        alb_operator_free(&forward);
    }
    alb_readings_free(&readings);
}

// From pixels to totals: pictures of a profile under a disc of light, convolved by summing over a fine square lattice.
static void pictures_to_totals(void **state)
{
    (void)state;
    enum { SIZE = 120, FINE = 24, TRIALS = 12 };
    static double clean[SIZE * SIZE], value[SIZE * SIZE], variance[SIZE * SIZE];
    const double pitch = 0.1, radius = 0.42;
    const alb_profile truth = {ALB_FORM_TWO_EXPONENTIALS, {0.02, 0.8, 0.2, 3}};
    alb_error error = {0};
    alb_face face = {0};
    alb_spot spot = {0};
    check_ok(alb_face_flat(&face, SIZE, SIZE, pitch, &error), &error);
    check_ok(alb_spot_disc(&spot, radius, &error), &error);
    for (int i = 0; i < SIZE * SIZE; i++) {
        double sum = 0, weight = 0;
        for (int k = 0; k < FINE * FINE; k++) {
            const double u = radius * ((k % FINE + 0.5) * 2 / FINE - 1), v = radius * ((k / FINE + 0.5) * 2 / FINE - 1);
            if (hypot(u, v) > radius)
                continue;
            sum += alb_profile_value(&truth, hypot(face.x_mm[i] - 5.93 - u, face.y_mm[i] - 6.07 - v));
            weight++;
        }
        clean[i] = sum / weight;
    }
    double mean = 0, squares = 0;
    for (unsigned t = 0; t < TRIALS; t++) {
        alb_random random = alb_random_at(5, 0, t);
        for (int i = 0; i < SIZE * SIZE; i++) {
            variance[i] = 1e-4 * clean[i] * (clean[i] + 1e-3);
            value[i] = clean[i] + sqrt(variance[i]) * alb_random_normal(&random);
        }
        const alb_channel channel = {&face, value, variance, "test"};
        alb_readings readings = {0};
        alb_operator forward = {0};
        alb_outcome outcome;
        check_ok(alb_observe(&readings, &channel, &error), &error);
        check_ok(alb_operator_create(&forward, &readings, &spot, &error), &error);
        check_ok(alb_choose(&outcome, &readings, &forward, (alb_common_sd){0, 0}, &error), &error);
        assert_int_equal(outcome.fitted.profile.form, ALB_FORM_TWO_EXPONENTIALS);
        assert_true(outcome.fitted.identifiable);
        // the disc of the lattice is only 1/24 fine: its radius is known to about 0.3 %, hence the total
        check_relative(outcome.fitted.total, alb_profile_total(&truth), 0.01);
        const double z = (outcome.fitted.total - alb_profile_total(&truth)) / outcome.fitted.total_sd;
        mean += z / TRIALS;
        squares += z * z / TRIALS;
        alb_readings_free(&readings);
        alb_operator_free(&forward);
    }
    print_message("total from pictures: z mean %+.2f, mean square %.2f\n", mean, squares);
    check_near(mean, 0, 4 / sqrt(TRIALS));
    alb_spot_free(&spot);
    alb_face_free(&face);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(no_more_than_needed),
                                       cmocka_unit_test(as_much_as_needed),
                                       cmocka_unit_test(a_third_term),
                                       cmocka_unit_test(close_decays_stay_simple),
                                       cmocka_unit_test(flat_top_wants_a_flat_form),
                                       cmocka_unit_test(every_form_where_it_is_true),
                                       cmocka_unit_test(coinciding_decays),
                                       cmocka_unit_test(totals_are_honest),
                                       cmocka_unit_test(energy_is_kept_where_no_form_fits),
                                       cmocka_unit_test(undecided),
                                       cmocka_unit_test(pictures_to_totals)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
