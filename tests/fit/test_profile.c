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
    const double amplitude = between(random, 1e-6, 1e3), decay = between(random, 1e-2, 1e2);
    for (int i = 0; i < alb_form_parameter_count(form); i++) {
        const alb_parameter *parameter = alb_form_parameter(form, i);
        p[i] = parameter->flux         ? amplitude * between(random, 1e-3, 1e3)
               : parameter->length < 0 ? decay * between(random, 0.1, 100)
                                       : between(random, 1e-3, 10) / decay;
    }
    if (form == ALB_FORM_SIGNED_EXPONENTIALS) {
        p[2] = -p[0] * alb_random_uniform(random);
        p[3] = p[1] * between(random, 1.01, 50);
    }
    if (alb_form_parameter_name(form, 2) && !strcmp(alb_form_parameter_name(form, 2), "refractive_index")) {
        p[0] = between(random, 1e-3, 1);
        p[1] = between(random, 0.1, 10);
        p[2] = 1.01 + 0.6 * alb_random_uniform(random);
        p[3] = between(random, 1.1, 10) / (p[0] + p[1]); // of multipoles
    }
    alb_profile_order(&profile);
    assert_true(alb_profile_sound(&profile));
    return profile;
}

// Lengths over which the profile changes, the least and the largest.
static void scales_of(double *least, double *largest, const alb_profile *profile)
{
    *least = *largest = 1 / alb_profile_slowest(profile);
    for (int i = 0; i < alb_form_parameter_count(profile->form); i++) {
        const alb_parameter *parameter = alb_form_parameter(profile->form, i);
        if (parameter->flux || !parameter->length)
            continue;
        const double scale = parameter->length < 0 ? 1 / profile->parameters[i] : profile->parameters[i];
        *least = fmin(*least, scale);
        *largest = fmax(*largest, scale);
    }
}

// Largest term, where signs cancel.
static double size_of(const alb_profile *profile, double value)
{
    return profile->form == ALB_FORM_SIGNED_EXPONENTIALS ? fmax(value, profile->parameters[0]) : value;
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

// Of every row of the table: discs against quadrature, totals as the disc of a large radius, rings as their difference.
static void discs_and_totals(void **state)
{
    (void)state;
    for (int form = ALB_FORM_NONE + 1; form < ALB_FORMS; form++)
        for (unsigned i = 0; i < 60; i++) {
            alb_random random = alb_random_at(1, (unsigned)form, i);
            const alb_profile profile = random_profile((alb_form)form, &random);
            double least, largest;
            scales_of(&least, &largest, &profile);
            const double total = alb_profile_total(&profile), a = profile.parameters[0], b = profile.parameters[1];
            // signed: to cancellation, relative to the positive term alone
            const double size = form == ALB_FORM_SIGNED_EXPONENTIALS ? a / (b * b) : total / (2 * M_PI);
            const double rho = between(&random, 1e-4 * least, 10 * largest);
            const double disc = alb_profile_disc(&profile, rho);
            check_near(disc, disc_by_quadrature(&profile, rho, fmin(least / 2000, rho / 100)), 1e-8 * fmax(size, disc));
            check_near(2 * M_PI * alb_profile_disc(&profile, 1e8 * largest), total, 1e-7 * fmax(total, size));
            const double small = 1e-7 * least;
            if (form == ALB_FORM_TWO_OVER_R || form == ALB_FORM_BURLEY) // 1/r near 0
                check_relative(alb_profile_disc(&profile, small), 2 * alb_profile_disc(&profile, small / 2), 2e-4);
            check_relative(alb_profile_ring(&profile, 0, rho), 2 * disc / (rho * rho), 1e-12);
            if (!alb_form_singular((alb_form)form))
                check_near(2 * alb_profile_disc(&profile, small) / (small * small), alb_profile_value(&profile, 0),
                           1e-4 * size_of(&profile, alb_profile_value(&profile, 0)));
        }
}

// Derivatives of value and total of every row against central differences: h^2 = 1e-10 relative, rounding 1e-16 / 1e-5.
static void gradients(void **state)
{
    (void)state;
    for (int form = ALB_FORM_NONE + 1; form < ALB_FORMS; form++)
        for (unsigned i = 0; i < 200; i++) {
            alb_random random = alb_random_at(2, (unsigned)form, i);
            const alb_profile profile = random_profile((alb_form)form, &random);
            const double r = between(&random, 1e-2, 3) / alb_profile_slowest(&profile);
            const double value = alb_profile_value(&profile, r), total = alb_profile_total(&profile);
            double gradient[ALB_PARAMETERS_MAX], total_gradient[ALB_PARAMETERS_MAX];
            assert_true(alb_profile_gradient(gradient, &profile, r) == value);
            assert_true(alb_profile_total_gradient(total_gradient, &profile) == total);
            const double top = form == ALB_FORM_SIGNED_EXPONENTIALS ? profile.parameters[0] : value;
            const double whole = form == ALB_FORM_SIGNED_EXPONENTIALS
                                     ? 2 * M_PI * profile.parameters[0] / pow(profile.parameters[1], 2)
                                     : total;
            for (int p = 0; p < alb_form_parameter_count((alb_form)form); p++) {
                alb_profile up = profile, down = profile;
                const double h = 1e-5 * fabs(profile.parameters[p]);
                up.parameters[p] += h;
                down.parameters[p] -= h;
                check_near(h * gradient[p], (alb_profile_value(&up, r) - alb_profile_value(&down, r)) / 2,
                           3e-8 * fabs(h * gradient[p]) + 1e-12 * top);
                check_near(h * total_gradient[p], (alb_profile_total(&up) - alb_profile_total(&down)) / 2,
                           3e-8 * fabs(h * total_gradient[p]) + 1e-12 * whole);
            }
        }
}

// Parameters in other units: S changes as flux / length^2 (unsound parameters would not say so).
static void units(void **state)
{
    (void)state;
    const double flux = 3e-30, length = 7e3;
    for (int form = ALB_FORM_NONE + 1; form < ALB_FORMS; form++)
        for (unsigned i = 0; alb_form_parameter((alb_form)form, 0)->flux && i < 50; i++) { // of a dipole the flux is 1
            alb_random random = alb_random_at(4, (unsigned)form, i);
            const alb_profile profile = random_profile((alb_form)form, &random);
            alb_profile other = profile;
            for (int p = 0; p < alb_form_parameter_count((alb_form)form); p++) {
                const alb_parameter *parameter = alb_form_parameter((alb_form)form, p);
                other.parameters[p] *= pow(flux, parameter->flux) * pow(length, parameter->length);
            }
            const double r = between(&random, 1e-2, 3) / alb_profile_slowest(&profile);
            check_relative(alb_profile_value(&other, length * r),
                           flux / length / length * alb_profile_value(&profile, r), 1e-9);
            check_relative(alb_profile_total(&other), flux * alb_profile_total(&profile), 1e-12);
        }
}

static void nowhere_negative(void **state)
{
    (void)state;
    for (int form = ALB_FORM_NONE + 1; form < ALB_FORMS; form++)
        for (unsigned i = 0; i < 60; i++) {
            alb_random random = alb_random_at(5, (unsigned)form, i);
            const alb_profile profile = random_profile((alb_form)form, &random);
            double before = 0;
            for (double r = 0; r < 30 / alb_profile_slowest(&profile); r += 0.1 / alb_profile_slowest(&profile)) {
                assert_true(alb_profile_value(&profile, r) >= 0);
                assert_true(alb_profile_disc(&profile, r) >= before * (1 - 1e-12));
                before = alb_profile_disc(&profile, r);
            }
        }
}

// What a file must not hold.
static void unsound_parameters(void **state)
{
    (void)state;
    for (int form = ALB_FORM_NONE + 1; form < ALB_FORMS; form++)
        for (int p = 0; p < alb_form_parameter_count((alb_form)form); p++) {
            alb_random random = alb_random_at(6, (unsigned)form, 0);
            const alb_profile profile = random_profile((alb_form)form, &random);
            const double wrong[] = {NAN, INFINITY, -INFINITY, -1e9, 0};
            for (int k = 0; k < 5; k++) {
                alb_profile broken = profile;
                broken.parameters[p] = wrong[k];
                if (form != ALB_FORM_SIGNED_EXPONENTIALS || p != 2 || k < 4) // an amplitude of 0 is allowed there
                    assert_false(alb_profile_sound(&broken));
            }
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

// Donner & Jensen 2005 by independent evaluation (mpmath) of the plane source between two planes: albedo 0.99, index
// 1.3, thickness in transport mean free paths.
static void multipole_digits(void **state)
{
    (void)state;
    static const struct {
        double thickness, reflected, transmitted;
    } rows[] = {{2, 0.464430979, 0.464430979},
                {5, 0.587359768, 0.247869117},
                {10, 0.634858641, 0.099650990},
                {20, 0.644225664, 0.017469611}};
    for (int i = 0; i < 4; i++) {
        const double medium[4] = {0.025, 2.475, 1.3, rows[i].thickness / 2.5};
        alb_profile profile = {.form = ALB_FORM_MULTIPOLE_REFLECTION};
        memcpy(profile.parameters, medium, sizeof medium);
        check_near(alb_profile_total(&profile), rows[i].reflected, 1e-9);
        profile.form = ALB_FORM_MULTIPOLE_TRANSMISSION;
        check_near(alb_profile_total(&profile), rows[i].transmitted, 1e-9);
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
    const struct CMUnitTest tests[] = {cmocka_unit_test(discs_and_totals),
                                       cmocka_unit_test(gradients),
                                       cmocka_unit_test(units),
                                       cmocka_unit_test(nowhere_negative),
                                       cmocka_unit_test(unsound_parameters),
                                       cmocka_unit_test(dipole_digits),
                                       cmocka_unit_test(multipole_digits),
                                       cmocka_unit_test(names)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
