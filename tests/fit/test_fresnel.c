// Fresnel's moments against a sum over the cosine that shares no substitution with them, and against the literature.
#include "check.h"
#include "fit/fresnel.h"

// Midpoint rule over mu above the critical cosine, graded towards it: mu = c + (1 - c) v^2.
static double moment(double n, int power)
{
    enum { STEPS = 200000 };
    const double c = sqrt(1 - 1 / (n * n));
    double sum = 0;
    for (int i = 0; i < STEPS; i++) {
        const double v = (i + 0.5) / STEPS, mu = c + (1 - c) * v * v;
        sum += alb_fresnel_inside(n, mu) * pow(mu, power) * 2 * (1 - c) * v / STEPS;
    }
    return pow(c, power + 1) + (power + 1) * sum;
}

static void moments(void **state)
{
    (void)state;
    // R1, R2, A to six digits
    static const double known[][4] = {
        {1.33, 0.471949, 0.328239, 2.51536}, {1.4, 0.528985, 0.388783, 2.94849}, {1.5, 0.596346, 0.464431, 3.62793}};
    for (int i = 0; i < 3; i++) {
        const alb_fresnel_moments m = alb_fresnel_moments_at(known[i][0]);
        check_near(m.first, known[i][1], 0.6e-6);
        check_near(m.second, known[i][2], 0.6e-6);
        check_near(m.boundary, known[i][3], 0.6e-5);
    }
    for (double n = 1.0001; n < 4; n += 0.13) {
        const alb_fresnel_moments m = alb_fresnel_moments_at(n);
        check_near(m.first, moment(n, 1), 1e-9);
        check_near(m.second, moment(n, 2), 1e-9);
    }
    const alb_fresnel_moments none = alb_fresnel_moments_at(1);
    check_near(none.first, 0, 1e-15);
    check_near(none.boundary, 1, 1e-15);
}

static void reflectance(void **state)
{
    (void)state;
    check_near(alb_fresnel_inside(1.5, 1), 0.04, 1e-15);
    check_near(alb_fresnel_inside(1.5, 0.5), 1, 0);
    const double brewster = 1.5 / sqrt(1 + 1.5 * 1.5); // tan theta = 1 / n inside: no parallel light
    check_near(alb_fresnel_inside(1.5, brewster), 0.5 * pow((2.25 - 1) / (2.25 + 1), 2), 1e-14);
    for (double mu = 0; mu <= 1; mu += 0.01)
        check_near(alb_fresnel_inside(1, mu), mu > 0 ? 0 : 1, 1e-15);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(moments), cmocka_unit_test(reflectance)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
