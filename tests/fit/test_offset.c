// A constant in the readings: taken off where they tell, said where they do not.
#include "one_side.h"

enum { READINGS = 100, TRIALS = 20 };

static void run(alb_fitting *fitting, const alb_profile *truth, double offset, double noise, double floor,
                double range_mm, alb_random *random)
{
    alb_error error = {0};
    one_side_start(fitting, true);
    one_side_read(fitting, ALB_REFLECTION, truth, (one_side){READINGS, range_mm, noise, floor, offset}, random);
    check_ok(alb_fitting_run(fitting, &error), &error);
}

typedef struct counts {
    int found, flagged, silent, wrong, negative;
} counts;

static counts count_over(const alb_profile *truth, double share, double noise, double floor, double range_mm,
                         unsigned stream)
{
    static alb_fitting fitting;
    counts out = {0};
    const double offset = share * alb_profile_value(truth, 0), total = alb_profile_total(truth);
    for (unsigned t = 0; t < TRIALS; t++) {
        alb_random random = alb_random_at(51, stream, t);
        run(&fitting, truth, offset, noise, floor, range_mm, &random);
        const alb_outcome *outcome = &fitting.sides[ALB_REFLECTION][0].outcome;
        const alb_fitted *fitted = &fitting.material.fitted[ALB_REFLECTION][0];
        const bool found = outcome->offset_sd > 0, flagged = !fitted->identifiable || *outcome->offset_instead;
        if (found && fabs(outcome->offset - offset) > 4.5 * outcome->offset_sd)
            out.wrong++;
        if (fitted->identifiable && !flagged && fabs(fitted->total - total) > 4.5 * fitted->total_sd)
            out.wrong++;
        out.found += found;
        out.flagged += !found && flagged;
        out.silent += !found && !flagged;
        assert_true(fitted->total <= 1);
        for (int i = 0; i < READINGS; i++)
            out.negative += !found && fitting.sides[ALB_REFLECTION][0].readings.value[i] < 0;
        alb_fitting_free(&fitting);
    }
    print_message("%-18s offset %+6.1f %% of the peak: taken off %d, flagged %d, neither %d, wrong %d of %d\n",
                  alb_form_name(truth->form), 100 * share, out.found, out.flagged, out.silent, out.wrong, TRIALS);
    return out;
}

static const alb_profile one = {ALB_FORM_EXPONENTIAL, {0.08, 0.8}},
                         two = {ALB_FORM_TWO_EXPONENTIALS, {0.01, 0.5, 0.1, 2}};

// Stray light of 0.3 to 3 % of the peak.
static void constant_offset(void **state)
{
    (void)state;
    static const double shares[] = {0.003, 0.01, 0.03};
    for (unsigned k = 0; k < 3; k++) {
        const counts plain = count_over(&one, shares[k], 0.01, 0.01, 15, k),
                     pair = count_over(&two, shares[k], 0.01, 0.01, 15, 10 + k);
        assert_int_equal(plain.wrong + pair.wrong, 0);
        assert_int_equal(plain.found + plain.flagged, TRIALS);
        assert_int_equal(pair.found + pair.flagged, TRIALS);
        assert_true(plain.found >= 0.9 * TRIALS);
    }
}

// A background taken off too much, by 0.1, 1 and 5 % of the peak: the bins below zero are kept, the constant comes
// back.
static void negative_background(void **state)
{
    (void)state;
    static const double shares[] = {-0.001, -0.01, -0.05};
    for (unsigned k = 0; k < 3; k++) {
        const counts plain = count_over(&one, shares[k], 0.01, 0.01, 15, 20 + k),
                     pair = count_over(&two, shares[k], 0.01, 0.01, 15, 30 + k);
        assert_int_equal(plain.wrong + pair.wrong, 0);
        assert_int_equal(plain.found + plain.flagged, TRIALS);
        assert_int_equal(pair.found + pair.flagged, TRIALS);
        assert_true(plain.found >= 0.9 * TRIALS);
    }
}

// Readings without a constant keep all their light.
static void no_offset_where_there_is_none(void **state)
{
    (void)state;
    static const double noises[] = {0.003, 0.01, 0.03};
    for (unsigned k = 0; k < 3; k++) {
        const counts plain = count_over(&one, 0, noises[k], 0.01, 15, 40 + k),
                     pair = count_over(&two, 0, noises[k], 0.01, 15, 50 + k);
        assert_int_equal(plain.found + pair.found + plain.wrong + pair.wrong, 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(constant_offset), cmocka_unit_test(negative_background),
                                       cmocka_unit_test(no_offset_where_there_is_none)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
