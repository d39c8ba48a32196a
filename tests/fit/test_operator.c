// The forward operator against a direct two-dimensional quadrature that shares nothing with it: a Cartesian sum over
// the spot.
#include "check.h"
#include "fit/operator.h"

static double direct(const alb_profile *profile, double r_mm, double radius_mm)
{
    enum { STEPS = 1200 };
    const double h = 2 * radius_mm / STEPS;
    double sum = 0, area = 0;
    for (int j = 0; j < STEPS; j++)
        for (int i = 0; i < STEPS; i++) {
            const double x = -radius_mm + (i + 0.5) * h, y = -radius_mm + (j + 0.5) * h;
            if (x * x + y * y > radius_mm * radius_mm)
                continue;
            sum += alb_profile_value(profile, hypot(r_mm - x, y));
            area += 1;
        }
    return sum / area;
}

static void one_sample_rings(alb_readings *readings, const double *r_mm, int count)
{
    alb_error error = {0};
    check_ok(alb_readings_create(readings, count, &error), &error);
    for (int i = 0; i < count; i++) {
        readings->r_mm[i] = readings->sample_r_mm[i][0] = r_mm[i];
        readings->sample_share[i][0] = 1;
    }
}

static void follows_direct_quadrature(void **state)
{
    (void)state;
    static const double r_mm[] = {0, 0.3, 0.5, 0.55, 1, 3, 12};
    static const alb_profile profiles[] = {{ALB_FORM_EXPONENTIAL, {1, 2}},
                                           {ALB_FORM_TWO_EXPONENTIALS, {0.02, 0.3, 1, 4}},
                                           {ALB_FORM_SIGNED_EXPONENTIALS, {1, 0.8, -0.7, 1.5}},
                                           {ALB_FORM_DIPOLE, {0.0041, 2.62, 1.5}}};
    enum { ROWS = sizeof r_mm / sizeof r_mm[0] };
    alb_error error = {0};
    alb_readings readings = {0};
    alb_spot spot = {0};
    alb_operator forward = {0};
    one_sample_rings(&readings, r_mm, ROWS);
    check_ok(alb_spot_disc(&spot, 0.5, &error), &error);
    check_ok(alb_operator_create(&forward, &readings, &spot, &error), &error);
    double worst = 0;
    for (int p = 0; p < 4; p++) {
        double *found = alb_operator_readings(&forward, &profiles[p], &error);
        assert_non_null(found);
        for (int i = 0; i < ROWS; i++) {
            const double expected = direct(&profiles[p], r_mm[i], 0.5);
            worst = fmax(worst, fabs(found[i] / expected - 1));
            // 1e-4 is what the operator promises; 64 radii and 48 directions of the disc cost as much near its rim
            check_relative(found[i], expected, 5e-4);
        }
        free(found);
    }
    print_message("worst relative error against direct quadrature: %.2g\n", worst);
    alb_operator_free(&forward);
    alb_spot_free(&spot);
    alb_readings_free(&readings);
}

// Forms that are infinite at r = 0 against rings about the pixel: the share of each ring that the disc of light covers
// times the closed integral of S over it.
static double by_rings(const alb_profile *profile, double r_mm, double radius_mm)
{
    enum { RINGS = 40000 };
    const double end = r_mm + radius_mm;
    double sum = 0, before = 0;
    for (int k = 0; k < RINGS; k++) {
        const double rho = end * (k + 0.5) / RINGS, disc = alb_profile_disc(profile, end * (k + 1.0) / RINGS);
        const double c = r_mm > 0          ? (r_mm * r_mm + rho * rho - radius_mm * radius_mm) / (2 * r_mm * rho)
                         : rho < radius_mm ? -1
                                           : 1;
        sum += 2 * acos(fmin(fmax(c, -1), 1)) * (disc - before);
        before = disc;
    }
    return sum / (M_PI * radius_mm * radius_mm);
}

static void singular_forms(void **state)
{
    (void)state;
    static const double r_mm[] = {0.02, 0.1, 0.3, 0.46, 0.5, 0.54, 0.7, 1, 3, 12};
    static const alb_profile profiles[] = {{ALB_FORM_TWO_OVER_R, {0.1, 0.3, 1, 4}},
                                           {ALB_FORM_BURLEY, {0.7, 0.4}},
                                           {ALB_FORM_TWO_BURIED_SOURCES, {0.1, 0.3, 1.5, 1, 4, 1e-5}}};
    enum { ROWS = sizeof r_mm / sizeof r_mm[0] };
    const double width = 0.04; // of a ring of pixels
    alb_error error = {0};
    alb_readings readings = {0};
    alb_spot spot = {0};
    alb_operator forward = {0};
    one_sample_rings(&readings, r_mm, ROWS);
    for (int i = 0; i < ROWS; i++)
        for (int k = 0; k < ALB_RING_SAMPLES; k++) {
            readings.sample_r_mm[i][k] = r_mm[i] + width * ((k + 0.5) / ALB_RING_SAMPLES - 0.5);
            readings.sample_share[i][k] = 1.0 / ALB_RING_SAMPLES;
        }
    check_ok(alb_spot_disc(&spot, 0.5, &error), &error);
    check_ok(alb_operator_create(&forward, &readings, &spot, &error), &error);
    double worst = 0;
    for (int p = 0; p < 3; p++) {
        double *found = alb_operator_readings(&forward, &profiles[p], &error);
        assert_non_null(found);
        for (int i = 0; i < ROWS; i++) {
            double expected = 0;
            for (int k = 0; k < ALB_RING_SAMPLES; k++)
                expected += by_rings(&profiles[p], readings.sample_r_mm[i][k], 0.5) / ALB_RING_SAMPLES;
            worst = fmax(worst, fabs(found[i] / expected - 1));
            // one pixel distance against 64 radii of the disc is off by up to 1 %, either way; over a ring that
            // averages out
            check_relative(found[i], expected, 3e-3);
        }
        free(found);
    }
    print_message("worst relative error of singular forms: %.2g\n", worst);
    alb_operator_free(&forward);
    alb_spot_free(&spot);
    alb_readings_free(&readings);
}

static void pencil_beam_reads_the_profile(void **state)
{
    (void)state;
    double r_mm[60];
    for (int i = 0; i < 60; i++)
        r_mm[i] = 0.02 * pow(1.12, i);
    alb_error error = {0};
    alb_readings readings = {0};
    alb_spot spot = {0};
    alb_operator forward = {0};
    one_sample_rings(&readings, r_mm, 60);
    check_ok(alb_spot_disc(&spot, 0, &error), &error);
    check_ok(alb_operator_create(&forward, &readings, &spot, &error), &error);
    for (double b = 0.1; b < 50; b *= 2) {
        const alb_profile profile = {ALB_FORM_EXPONENTIAL, {3, b}};
        double *found = alb_operator_readings(&forward, &profile, &error);
        assert_non_null(found);
        for (int i = 0; i < 60; i++)
            if (b * b * r_mm[i] * r_mm[59] < 3200) // where 1e-4 is promised
                check_relative(found[i], alb_profile_value(&profile, r_mm[i]), 1.01e-4);
        free(found);
    }
    alb_operator_free(&forward);
    alb_spot_free(&spot);
    alb_readings_free(&readings);
}

// A constant stays constant: the spot's power is 1.
static void keeps_power(void **state)
{
    (void)state;
    const double r_mm[] = {0, 0.1, 1, 5};
    alb_error error = {0};
    alb_readings readings = {0};
    alb_spot spot = {0};
    alb_operator forward = {0};
    one_sample_rings(&readings, r_mm, 4);
    check_ok(alb_spot_disc(&spot, 2, &error), &error);
    check_ok(alb_operator_create(&forward, &readings, &spot, &error), &error);
    for (int i = 0; i < 4; i++) {
        double sum = 0;
        for (size_t k = forward.offset[i]; k < forward.offset[i + 1]; k++)
            sum += forward.weight[k];
        check_near(sum, 1, 1e-12);
    }
    alb_operator_free(&forward);
    alb_spot_free(&spot);
    alb_readings_free(&readings);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(follows_direct_quadrature), cmocka_unit_test(singular_forms),
                                       cmocka_unit_test(pencil_beam_reads_the_profile), cmocka_unit_test(keeps_power)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
