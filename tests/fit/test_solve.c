// Parameters from no start values: always the best minimum, and errors that are what they say. Data are readings with
// stated Gaussian noise; the profile is the truth by definition, so that only the search and the covariance are under
// test.
#include "base/random.h"
#include "check.h"
#include "fit/search.h"

enum { READINGS = 120, TRIALS = 300 };

static double between(alb_random *random, double low, double high)
{
    return low * pow(high / low, alb_random_uniform(random));
}

static void make(alb_readings *readings, const alb_profile *truth, double range_mm, double noise, double unit,
                 alb_random *random)
{
    alb_error error = {0};
    check_ok(alb_readings_create(readings, READINGS, &error), &error);
    for (int i = 0; i < READINGS; i++) {
        const double r = range_mm * (0.004 + 0.996 * i / (READINGS - 1)), value = alb_profile_value(truth, r);
        readings->r_mm[i] = r;
        readings->sd[i] = noise * hypot(value, 0.01 * alb_profile_value(truth, 0)) * unit;
        readings->value[i] = value * unit + readings->sd[i] * alb_random_normal(random);
        readings->area_mm2[i] = 1;
        readings->outer_mm = r;
    }
}

static alb_profile random_truth(alb_form form, alb_random *random, double closest)
{
    alb_profile truth = {form, {between(random, 1e-5, 1e5), between(random, 0.3, 1), 0, 0}};
    double *p = truth.parameters;
    const bool three = form == ALB_FORM_THREE_EXPONENTIALS;
    const double furthest = three ? 5 : 8; // the third term must be seen by readings 0.1 mm apart
    p[3] = p[1] * between(random, closest, furthest);
    p[2] = p[0] * between(random, 0.3, 3);
    if (form == ALB_FORM_SIGNED_EXPONENTIALS)
        p[2] = -p[0] * (0.3 + 0.6 * alb_random_uniform(random));
    if (three) {
        p[5] = p[3] * between(random, closest, furthest);
        p[4] = p[2] * between(random, 1, 10); // as near the beam of a reflection: the faster, the stronger
    }
    return truth;
}

static bool search(alb_profile *found, double *chi_square, alb_form form, const alb_readings *readings,
                   double covariance[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX])
{
    alb_error error = {0};
    alb_operator forward = {0};
    alb_basis basis = {0};
    bool any, full_rank;
    check_ok(alb_operator_identity(&forward, readings, &error), &error);
    check_ok(alb_basis_create(&basis, readings, &forward, &error), &error);
    const alb_weighing weighing = {readings, &forward, readings->sd, 0};
    check_ok(alb_search(found, chi_square, &any, (alb_candidate){form, false}, &basis, &weighing, &error), &error);
    check_ok(alb_search_covariance(covariance, &full_rank, found, (alb_candidate){form, false}, &weighing, &error),
             &error);
    alb_basis_free(&basis);
    alb_operator_free(&forward);
    return any && full_rank;
}

static double chi_square_of(const alb_readings *readings, const alb_profile *profile)
{
    double sum = 0;
    for (int i = 0; i < readings->count; i++)
        sum += pow((readings->value[i] - alb_profile_value(profile, readings->r_mm[i])) / readings->sd[i], 2);
    return sum;
}

// Nothing found may be worse than the truth itself, over ten decades of amplitude and any ratio of decays.
static void always_the_best_minimum(void **state)
{
    (void)state;
    for (int form = ALB_FORM_TWO_EXPONENTIALS; form <= ALB_FORM_THREE_EXPONENTIALS; form++)
        for (unsigned t = 0; t < TRIALS; t++) {
            alb_random random = alb_random_at(1, (unsigned)form, t);
            const alb_profile truth =
                random_truth((alb_form)form, &random, form == ALB_FORM_THREE_EXPONENTIALS ? 2 : 1.3);
            alb_readings readings = {0};
            make(&readings, &truth, 12, form == ALB_FORM_THREE_EXPONENTIALS ? 0.001 : 0.01, 1, &random);
            alb_profile found;
            double chi_square, covariance[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX];
            assert_true(search(&found, &chi_square, (alb_form)form, &readings, covariance));
            check_relative(chi_square, chi_square_of(&readings, &found), 1e-8);
            check_below(chi_square, chi_square_of(&readings, &truth));
            for (int p = 3; p < alb_form_parameter_count((alb_form)form); p += 2)
                assert_true(found.parameters[p - 2] <= found.parameters[p]);
            alb_readings_free(&readings);
        }
}

// (found - truth) / sd has mean 0 and variance 1 for every parameter.
static void honest_errors(void **state)
{
    (void)state;
    for (int form = ALB_FORM_TWO_EXPONENTIALS; form <= ALB_FORM_THREE_EXPONENTIALS; form++) {
        const int parameters = alb_form_parameter_count((alb_form)form);
        // three terms want less noise before errors are linear
        const bool three = form == ALB_FORM_THREE_EXPONENTIALS;
        double mean[ALB_PARAMETERS_MAX] = {0}, squares[ALB_PARAMETERS_MAX] = {0};
        for (unsigned t = 0; t < TRIALS; t++) {
            alb_random random = alb_random_at(2, (unsigned)form, t);
            const alb_profile truth = random_truth((alb_form)form, &random, 3);
            alb_readings readings = {0};
            make(&readings, &truth, 12, three ? 0.001 : 0.01, 1, &random);
            alb_profile found;
            double chi_square, covariance[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX];
            assert_true(search(&found, &chi_square, (alb_form)form, &readings, covariance));
            for (int p = 0; p < parameters; p++) {
                const double z = (found.parameters[p] - truth.parameters[p]) / sqrt(covariance[p][p]);
                mean[p] += z / TRIALS;
                squares[p] += z * z / TRIALS;
            }
            alb_readings_free(&readings);
        }
        for (int p = 0; p < parameters; p++) {
            print_message("%s %s: z mean %+.3f, mean square %.3f\n", alb_form_name((alb_form)form),
                          alb_form_parameter_name((alb_form)form, p), mean[p], squares[p]);
            check_near(mean[p], 0, 4 / sqrt(TRIALS));          // 4 standard errors
            check_near(squares[p], 1, 4 * sqrt(2.0 / TRIALS)); // likewise
        }
    }
}

// The same readings in other units give the same profile in those units.
static void any_unit(void **state)
{
    (void)state;
    static const double units[][2] = {{1, 1}, {1e-30, 1}, {1e30, 1}, {1, 1e-3}, {1e-6, 1e6}};
    double reference[4] = {0};
    for (int u = 0; u < 5; u++) {
        alb_random random = alb_random_at(3, 0, 0);
        const double value = units[u][0], length = units[u][1];
        const alb_profile truth = {ALB_FORM_TWO_EXPONENTIALS, {1, 0.5 / length, 2, 2 / length}};
        alb_readings readings = {0};
        make(&readings, &truth, 12 * length, 0.01, value, &random);
        alb_profile found;
        double chi_square, covariance[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX];
        assert_true(search(&found, &chi_square, ALB_FORM_TWO_EXPONENTIALS, &readings, covariance));
        for (int p = 0; p < 4; p++) {
            const double plain = found.parameters[p] * (p % 2 ? length : 1 / value);
            reference[p] = u ? reference[p] : plain;
            check_relative(plain, reference[p], 1e-6); // where the solver stops
        }
        alb_readings_free(&readings);
    }
}

// Decays that coincide are told as such, not inverted.
static void rank_deficiency_is_seen(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_random random = alb_random_at(4, 0, 0);
    const alb_profile truth = {ALB_FORM_EXPONENTIAL, {1, 0.5}},
                      twin = {ALB_FORM_TWO_EXPONENTIALS, {0.5, 0.5, 0.5, 0.5}};
    double covariance[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX];
    alb_readings readings = {0};
    alb_operator forward = {0};
    bool full_rank = true;
    make(&readings, &truth, 12, 0.01, 1, &random);
    check_ok(alb_operator_identity(&forward, &readings, &error), &error);
    const alb_weighing weighing = {&readings, &forward, readings.sd, 0};
    check_ok(alb_search_covariance(covariance, &full_rank, &twin, (alb_candidate){ALB_FORM_TWO_EXPONENTIALS, false},
                                   &weighing, &error),
             &error);
    assert_false(full_rank);
    alb_operator_free(&forward);
    alb_readings_free(&readings);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(always_the_best_minimum), cmocka_unit_test(honest_errors),
                                       cmocka_unit_test(any_unit), cmocka_unit_test(rank_deficiency_is_seen)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
