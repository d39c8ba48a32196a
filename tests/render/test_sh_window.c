// Windows: the minimum against values everywhere, and what is left of functions that ring.
#include "render/sh_project.h"
#include "render/sh_window.h"
#include "render/sh_zonal.h"
#include "sh_truth.h"

// The lowest of 400 x 400 directions: at most (0.008 l)^2 / 4 of the amplitude above the least of all.
static double lowest(const double *c, int order)
{
    double low = INFINITY;
    for (int k = 0; k < 400 * 400; k++) {
        const double theta = M_PI * (k / 400 + 0.5) / 400, phi = 2 * M_PI * (k % 400) / 400;
        const alb_vector d = {sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
        low = fmin(low, alb_sh_value(c, order, d));
    }
    return low;
}

static void minima(void **state)
{
    (void)state;
    for (int order = 1; order <= ALB_SH_ORDER_MAX; order++)
        for (uint64_t k = 0; k < 3; k++) {
            double c[64];
            alb_random random = alb_random_at(1, (uint64_t)order, k);
            random_coefficients(c, order, &random);
            alb_vector where = {0, 0, 1};
            const double found = alb_sh_minimum(&where, c, order), near = lowest(c, order);
            check_below(found, near + 1e-12);
            check_near(found, near, 1e-5 * order * order);
            check_near(alb_sh_value(c, order, where), found, 1e-14);
            check_near(alb_length(where), 1, 1e-14);
            double slopes[64];
            alb_vector t, b;
            alb_tangents(&t, &b, where);
            for (int axis = 0; axis < 2; axis++) { // flat there
                alb_sh_differentiate(slopes, order, where, axis ? b : t);
                double sum = 0;
                for (int i = 0; i < order * order; i++)
                    sum += c[i] * slopes[i];
                check_near(sum, 0, 1e-6);
            }
        }
    // closed forms: x^2 - y^2 is least along y; P_2 on the equator
    double c[9] = {0};
    c[8] = 1;
    check_near(alb_sh_minimum(NULL, c, 3), -sqrt(15 / (16 * M_PI)), 1e-14);
    c[8] = 0, c[6] = 1;
    check_near(alb_sh_minimum(NULL, c, 3), -sqrt(5 / (16 * M_PI)), 1e-14);
}

// F13: caps at order 4 leave visibility between -0.29 (of 45 deg) and 1.15.
static void ringing_of_caps(void **state)
{
    (void)state;
    alb_error error = {0};
    double zonal[8], c[64], turned[64];
    alb_sh_zonal_cap(zonal, 4, M_PI / 4);
    alb_sh_zonal_turn(c, zonal, 4, (alb_vector){0.48, 0.6, 0.64});
    alb_sh_complement(c, 4);
    check_near(alb_sh_minimum(NULL, c, 4), -0.29, 0.005);
    double highest = 0;
    for (int k = 5; k <= 90; k += 5) {
        alb_sh_project_cap(turned, 4, (alb_vector){0.48, 0.6, 0.64}, k * M_PI / 180);
        highest = fmax(highest, 1 - alb_sh_minimum(NULL, turned, 4));
    }
    check_near(highest, 1.15, 0.01);
    alb_sh_dering_report report;
    const double mean = c[0];
    check_ok(alb_sh_dering(c, &report, 4, 0, &error), &error);
    check_near(report.minimum_before, -0.29, 0.005);
    check_near(report.minimum, 0, 1e-3); // the weakest: the bound is just met
    assert_true(report.minimum >= 0 && report.strength > 0);
    assert_true(lowest(c, 4) >= -1e-12);
    check_near(c[0], mean, 0);
    check_near(report.energy, 0.963, 0.001); // stated in docs/sh.md
    // caps, and visibility beside caps, of every size and order: not below zero, energy stated
    for (int order = 2; order <= ALB_SH_ORDER_MAX; order++)
        for (uint64_t k = 0; k < 4; k++) {
            alb_random random = alb_random_at(3, (uint64_t)order, k);
            double before = 0, after = 0;
            alb_sh_zonal_cap(zonal, order, M_PI * (0.05 + 0.9 * alb_random_uniform(&random)));
            alb_sh_zonal_turn(c, zonal, order, random_direction(&random));
            if (k & 1)
                alb_sh_complement(c, order);
            for (int i = 0; i < order * order; i++)
                before += c[i] * c[i];
            check_ok(alb_sh_dering(c, &report, order, 0, &error), &error);
            for (int i = 0; i < order * order; i++)
                after += c[i] * c[i];
            check_near(report.energy, after / before, 1e-12);
            assert_true(alb_sh_minimum(NULL, c, order) >= 0);
            check_below(report.minimum_before, report.minimum + 1e-15);
        }
}

static void nothing_to_do_and_nothing_to_be_done(void **state)
{
    (void)state;
    alb_error error = {0};
    double c[16] = {1, 0.1, 0.2, 0.1, 0.05}, kept[16];
    alb_sh_dering_report report;
    memcpy(kept, c, sizeof c);
    check_ok(alb_sh_dering(c, &report, 4, 0, &error), &error);
    assert_memory_equal(c, kept, sizeof c);
    check_near(report.strength, 0, 0);
    check_near(report.energy, 1, 0);
    check_fails(alb_sh_dering(c, NULL, 4, 1, &error), &error, ALB_BAD_DATA, "of mean 0.28");
    c[3] = NAN;
    check_fails(alb_sh_dering(c, NULL, 4, 0, &error), &error, ALB_BAD_DATA, "no window");
    // a mean of zero: all else goes
    double zero[4] = {0, 1, 2, 3};
    check_ok(alb_sh_dering(zero, &report, 2, 0, &error), &error);
    for (int i = 0; i < 4; i++)
        check_near(zero[i], 0, 0);
    check_near(report.energy, 0, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(minima),
        cmocka_unit_test(ringing_of_caps),
        cmocka_unit_test(nothing_to_do_and_nothing_to_be_done),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
