// Forms against numerical quadrature, differences, published numbers.
#include "base/random.h"
#include "check.h"
#include "fit/profile.h"

static double between(alb_random *random, double low, double high)
{
    return low * pow(high / low, alb_random_uniform(random));
}

static alb_profile random_profile(alb_form form, alb_random *random)
{
    alb_profile profile = {.form = form};
    double *p = profile.parameters;
    p[0] = between(random, 1e-6, 1e3);
    p[1] = between(random, 1e-2, 1e2);
    p[2] = p[0] * between(random, 1e-3, 1e3);
    p[3] = p[1] * between(random, 1.01, 50);
    if (form == ALB_FORM_SIGNED_EXPONENTIALS)
        p[2] = -p[0] * alb_random_uniform(random);
    if (form == ALB_FORM_EXPONENTIAL)
        p[2] = p[3] = 0;
    if (form == ALB_FORM_THREE_EXPONENTIALS) {
        p[4] = p[0] * between(random, 1e-3, 1e3);
        p[5] = p[3] * between(random, 1.01, 20);
    }
    if (form == ALB_FORM_DIPOLE) {
        p[0] = between(random, 1e-3, 1);
        p[1] = between(random, 0.1, 10);
        p[2] = 1 + 0.6 * alb_random_uniform(random);
    }
    return profile;
}

// integral_0^rho S r dr by Gauss-Legendre with 3 points on panels that grow from `finest`.
static double disc_by_quadrature(const alb_profile *profile, double rho, double finest)
{
    static const double node[] = {-0.7745966692414834, 0, 0.7745966692414834},
                        weight[] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
    double sum = 0, from = 0;
    while (from < rho) {
        const double to = fmin(rho, fmax(from * 1.02, from + finest));
        for (int i = 0; i < 3; i++) {
            const double r = (from + to) / 2 + node[i] * (to - from) / 2;
            sum += weight[i] * (to - from) * r * alb_profile_value(profile, r);
        }
        from = to;
    }
    return sum;
}

static void discs_and_totals(void **state)
{
    (void)state;
    for (int form = ALB_FORM_EXPONENTIAL; form < ALB_FORMS; form++)
        for (unsigned i = 0; i < 200; i++) {
            alb_random random = alb_random_at(1, (unsigned)form, i);
            const alb_profile profile = random_profile((alb_form)form, &random);
            const bool dipole = form == ALB_FORM_DIPOLE;
            const double scale =
                dipole ? 1 / (profile.parameters[0] + profile.parameters[1]) : 1 / profile.parameters[1];
            const double total = alb_profile_total(&profile);
            // to cancellation in the signed form: relative to the positive term alone
            const double size =
                dipole ? total / (2 * M_PI) : profile.parameters[0] / (profile.parameters[1] * profile.parameters[1]);
            const double rho = scale * between(&random, 1e-4, 10), finest = scale / 2000;
            check_near(alb_profile_disc(&profile, rho), disc_by_quadrature(&profile, rho, fmin(finest, rho / 100)),
                       1e-8 * fmax(size, alb_profile_disc(&profile, rho)));
            check_near(2 * M_PI * alb_profile_disc(&profile, 1e7 * scale), total, 1e-10 * fmax(total, size));
            check_relative(alb_profile_disc(&profile, 1e-7 * scale),
                           0.5e-14 * scale * scale * alb_profile_value(&profile, 0), 1e-4);
        }
}

static void gradients(void **state)
{
    (void)state;
    for (int form = ALB_FORM_EXPONENTIAL; form <= ALB_FORM_THREE_EXPONENTIALS; form++)
        for (unsigned i = 0; i < 200; i++) {
            alb_random random = alb_random_at(2, (unsigned)form, i);
            const alb_profile profile = random_profile((alb_form)form, &random);
            const double r = between(&random, 1e-2, 3) / profile.parameters[1];
            double gradient[ALB_PARAMETERS_MAX], total_gradient[ALB_PARAMETERS_MAX];
            assert_true(alb_profile_gradient(gradient, &profile, r) == alb_profile_value(&profile, r));
            alb_profile_total_gradient(total_gradient, &profile);
            for (int p = 0; p < alb_form_parameter_count((alb_form)form); p++) {
                alb_profile up = profile, down = profile;
                const double h = 1e-5 * fabs(profile.parameters[p]);
                up.parameters[p] += h;
                down.parameters[p] -= h;
                // central differences: h^2 = 1e-10 relative, rounding 1e-16 / 1e-5 of the largest term
                const double size =
                    alb_profile_value(&profile, r) + fabs(profile.parameters[2]) + profile.parameters[4];
                check_near(h * gradient[p], (alb_profile_value(&up, r) - alb_profile_value(&down, r)) / 2,
                           1e-8 * fabs(h * gradient[p]) + 1e-14 * (size + profile.parameters[0]));
                const double total_size =
                    2 * M_PI * (profile.parameters[0] / pow(profile.parameters[1], 2)) *
                    (1 + (fabs(profile.parameters[2]) + profile.parameters[4]) / profile.parameters[0]);
                check_near(h * total_gradient[p], (alb_profile_total(&up) - alb_profile_total(&down)) / 2,
                           1e-8 * fabs(h * total_gradient[p]) + 1e-14 * total_size);
            }
        }
}

static void signed_pair_is_positive(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 2000; i++) {
        alb_random random = alb_random_at(3, 0, i);
        const alb_profile profile = random_profile(ALB_FORM_SIGNED_EXPONENTIALS, &random);
        for (double r = 0; r < 30 / profile.parameters[1]; r += 0.1 / profile.parameters[1])
            assert_true(alb_profile_value(&profile, r) >= 0);
    }
}

// Jensen et al. 2001 by independent evaluation (mpmath): total of the half-space.
static void dipole_digits(void **state)
{
    (void)state;
    static const struct {
        double albedo, index, total;
    } rows[] = {{0.9, 1.3, 0.299129164}, {0.99, 1.3, 0.644525488}, {0.999, 1.3, 0.863916064}, {0.9, 1, 0.385584225}};
    for (int i = 0; i < 4; i++) {
        const alb_profile profile = {ALB_FORM_DIPOLE,
                                     {2.5 * (1 - rows[i].albedo), 2.5 * rows[i].albedo, rows[i].index}};
        check_near(alb_profile_total(&profile), rows[i].total, 1e-9);
    }
}

static void names(void **state)
{
    (void)state;
    for (int form = ALB_FORM_EXPONENTIAL; form < ALB_FORMS; form++) {
        alb_form found = ALB_FORM_NONE;
        assert_true(alb_form_from_name(&found, alb_form_name((alb_form)form)));
        assert_int_equal(found, form);
        for (int p = 0; p < alb_form_parameter_count((alb_form)form); p++)
            assert_non_null(alb_form_parameter_name((alb_form)form, p));
    }
    alb_form found;
    assert_false(alb_form_from_name(&found, "none"));
    assert_false(alb_form_from_name(&found, ""));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(discs_and_totals), cmocka_unit_test(gradients),
                                       cmocka_unit_test(signed_pair_is_positive), cmocka_unit_test(dipole_digits),
                                       cmocka_unit_test(names)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
