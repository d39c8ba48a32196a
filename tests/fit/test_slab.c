// Light of a slab by harmonics: against photons (independent code), against adding and doubling, and the laws it obeys.
#include "base/random.h"
#include "base/statistics.h"
#include "capture/photon.h"
#include "check.h"
#include "fit/adding_doubling.h"
#include "fit/slab.h"
#include <omp.h>

enum { GROUP = 4 };

static double outside_reflectance(double n) { return (n - 1) * (n - 1) / ((n + 1) * (n + 1)); }

static void make(alb_slab_light *light, const alb_slab *slab, double end_mm)
{
    alb_error error = {0};
    check_ok(alb_slab_light_create(light, slab, end_mm, &error), &error);
}

// Exitance through a ring, Simpson's rule.
static double ring_share(const alb_slab_light *light, alb_side side, double from_mm, double to_mm)
{
    enum { STEPS = 16 };
    double sum = 0;
    for (int i = 0; i <= STEPS; i++) {
        const double r = from_mm + (to_mm - from_mm) * i / STEPS, weight = i % STEPS == 0 ? 1 : i % 2 ? 4 : 2;
        sum += weight * 2 * M_PI * r * alb_slab_light_value(light, side, r);
    }
    return sum * (to_mm - from_mm) / (3 * STEPS);
}

// Rings from half a transport mean free path on, four together, as far as 30 photons (18 % of themselves) reach:
// chi-square with the photons' sd and the model's accuracy, a relative sd, must not be beyond its 1e-4 tail.
static void check_rings(const alb_photon_tally *tally, const alb_slab_light *light, alb_side side, double near_mm,
                        double accuracy)
{
    double chi_square = 0, worst = 0;
    int rings = 0;
    for (int i = 0; i + GROUP <= ALB_PHOTON_BINS; i += GROUP) {
        double share = 0, variance = 0, model = 0;
        for (int k = i; k < i + GROUP; k++) {
            share += tally->ring[side][k];
            variance += tally->ring_sd[side][k] * tally->ring_sd[side][k];
            model += ring_share(light, side, tally->edges_mm[k], tally->edges_mm[k + 1]);
        }
        if (tally->edges_mm[i] < near_mm || sqrt(variance) > 0.18 * share)
            continue;
        const double sd = hypot(sqrt(variance), accuracy * share), off = (model - share) / sd;
        chi_square += off * off;
        worst = fabs(off) > fabs(worst) ? off : worst;
        rings++;
    }
    print_message("  %s: chi-square %.1f of %d rings, worst %+.2f sd\n", alb_side_names[side], chi_square, rings,
                  worst);
    assert_true(rings >= 5);
    assert_true(alb_chi_square_tail(chi_square, rings) > 1e-4);
}

static void follow(const char *name, const alb_slab *slab, double radius_mfp, long photons, double accuracy)
{
    alb_error error = {0};
    alb_photon_tally *tally = calloc(1, sizeof *tally);
    alb_slab_light light;
    const alb_medium medium = {slab->absorption_per_mm, slab->scattering_per_mm, slab->anisotropy,
                               slab->refractive_index, slab->thickness_mm};
    const double mfp = 1 / (slab->absorption_per_mm + slab->scattering_per_mm * (1 - slab->anisotropy));
    print_message("%s\n", name);
    check_ok(alb_photon_trace(tally, &medium, radius_mfp * mfp, photons, 11, 0, &error), &error);
    make(&light, slab, radius_mfp * mfp);
    for (int side = 0; side < ALB_SIDES; side++) {
        check_rings(tally, &light, (alb_side)side, 0.5 * mfp, accuracy);
        // 3e-4 of the flux: the harmonics' own
        check_near(light.total[side] + light.unscattered[side], tally->leaving[side],
                   4 * tally->leaving_sd[side] + 3e-4);
    }
    free(tally);
}

static void follows_photons(void **state)
{
    (void)state;
    const alb_slab marble = {0.0041, 2.62, 0, 1.5, 7.6}, wax = {0.02, 1, 0, 1.44, 10}, thin = {0.0041, 2.62, 0, 1.5, 2},
                   forward = {0.0041, 26.2, 0.9, 1.5, 2}, dark = {0.25, 1, 0, 1.4, 6};
    follow("marble, 20 mfp'", &marble, 30, 600000, 0.003);
    follow("wax, 10 mfp'", &wax, 25, 600000, 0.003);
    follow("marble, 5 mfp'", &thin, 25, 1000000, 0.003);
    follow("marble, 5 mfp', g 0.9", &forward, 25, 200000, 0.01);
    follow("albedo 0.8", &dark, 12, 1000000, 0.015);
}

// Another solution of the same equation. 8e-4 of the flux: what the orders 9 and 11 together leave.
static void totals_are_those_of_adding_and_doubling(void **state)
{
    (void)state;
    alb_streams *streams = calloc(1, sizeof *streams);
    double worst = 0;
    for (int i = 0; i < 40; i++) {
        alb_random random = alb_random_at(3, 0, (uint64_t)i);
        const double reduced = exp(3 * alb_random_uniform(&random) - 1), n = 1.3 + 0.3 * alb_random_uniform(&random);
        const double g = i % 2 ? 0 : 0.9, albedo = 1 - pow(10, -0.7 - 3 * alb_random_uniform(&random));
        const double absorption = reduced * (1 - albedo) / albedo, tau = 2 * exp(3 * alb_random_uniform(&random));
        const alb_slab slab = {absorption, reduced / (1 - g), g, n, tau / reduced};
        alb_slab_light light;
        make(&light, &slab, 10 / reduced);
        alb_streams_create(streams, 32, n, g);
        const alb_totals totals = alb_adding_doubling(streams, absorption, reduced, slab.thickness_mm);
        worst = fmax(worst, fabs(light.total[0] + light.unscattered[0] - totals.reflection));
        worst = fmax(worst, fabs(light.total[1] + light.unscattered[1] - totals.transmission));
    }
    print_message("worst difference from adding and doubling: %.2g of the flux\n", worst);
    assert_true(worst < 8e-4);
    free(streams);
}

// Nothing is lost where nothing absorbs: the equations keep the flux to rounding.
static void energy_is_kept(void **state)
{
    (void)state;
    static const double g[] = {0, 0.5, 0.9};
    for (int i = 0; i < 3; i++) {
        const alb_slab slab = {1e-9, 1 / (1 - g[i]), g[i], 1.4, 8};
        alb_slab_light light;
        make(&light, &slab, 10);
        check_near(light.total[0] + light.total[1] + light.unscattered[0] + light.unscattered[1],
                   1 - outside_reflectance(1.4), 1e-6);
    }
}

// 0.3 % of the total: between knots near the beam, and beyond the end.
static void profiles_integrate_to_the_totals(void **state)
{
    (void)state;
    const alb_slab slab = {0.02, 1, 0, 1.44, 10};
    alb_slab_light light;
    make(&light, &slab, 80);
    for (int side = 0; side < ALB_SIDES; side++) {
        double sum = 0;
        for (int i = 0; i < 400; i++)
            sum += ring_share(&light, (alb_side)side, 80 * pow(i / 400.0, 3), 80 * pow((i + 1) / 400.0, 3));
        check_relative(sum, light.total[side], 0.003);
    }
}

// A slab twice as large with half the coefficients: S is a quarter at twice the distance.
static void lengths_scale(void **state)
{
    (void)state;
    const alb_slab slab = {0.02, 1, 0.5, 1.44, 10}, large = {0.02 * 1e-3, 1e-3, 0.5, 1.44, 1e4};
    alb_slab_light light, scaled;
    make(&light, &slab, 20);
    make(&scaled, &large, 2e4);
    for (int side = 0; side < ALB_SIDES; side++)
        for (double r = 0.3; r < 20; r *= 1.3) // 1e-4: rounding, amplified by the harmonics at high frequencies
            check_relative(1e6 * alb_slab_light_value(&scaled, (alb_side)side, 1e3 * r),
                           alb_slab_light_value(&light, (alb_side)side, r), 1e-4);
}

// What a fit needs: differences over 4 % and 1 % of either coefficient agree.
static void changes_smoothly(void **state)
{
    (void)state;
    const double steps[2] = {0.04, 0.01};
    for (int which = 0; which < 2; which++) {
        double slope[2][ALB_SIDES][3];
        for (int i = 0; i < 2; i++) {
            alb_slab_light light[2];
            for (int sign = 0; sign < 2; sign++) {
                alb_slab slab = {0.004, 2.6, 0, 1.5, 5};
                *(which ? &slab.scattering_per_mm : &slab.absorption_per_mm) *= exp(sign ? -steps[i] : steps[i]);
                make(&light[sign], &slab, 9);
            }
            for (int side = 0; side < ALB_SIDES; side++)
                for (int k = 0; k < 3; k++)
                    slope[i][side][k] = log(alb_slab_light_value(&light[0], (alb_side)side, 1 + 3 * k) /
                                            alb_slab_light_value(&light[1], (alb_side)side, 1 + 3 * k)) /
                                        (2 * steps[i]);
        }
        for (int side = 0; side < ALB_SIDES; side++)
            for (int k = 0; k < 3; k++) // rounding of 1e-5 over 2 %, and the third derivative over 4 %
                check_near(slope[0][side][k], slope[1][side][k], 2e-3 + 2e-3 * fabs(slope[1][side][k]));
    }
}

static void any_number_of_threads_gives_the_same_bytes(void **state)
{
    (void)state;
    const alb_slab slab = {0.02, 2, 0.5, 1.44, 5};
    alb_slab_light one, many;
    omp_set_num_threads(1);
    make(&one, &slab, 20);
    omp_set_num_threads(5);
    make(&many, &slab, 20);
    omp_set_num_threads(omp_get_num_procs());
    assert_memory_equal(&one, &many, sizeof one);
}

static void refuses_what_is_no_slab(void **state)
{
    (void)state;
    static const alb_slab bad[] = {{0, 1, 0, 1.5, 5},    {1, 0, 0, 1.5, 5},        {1, 1, 1, 1.5, 5},
                                   {1, 1, -0.1, 1.5, 5}, {1, 1, 0, 0.9, 5},        {1, 1, 0, 1.5, 0},
                                   {NAN, 1, 0, 1.5, 5},  {1, INFINITY, 0, 1.5, 5}, {1, 1, 0, 1.5, INFINITY},
                                   {1, 1, NAN, 1.5, 5}};
    alb_error error = {0};
    alb_slab_light light;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        check_fails(alb_slab_light_create(&light, &bad[i], 10, &error), &error, ALB_BAD_DATA, "not a slab");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(follows_photons),
                                       cmocka_unit_test(totals_are_those_of_adding_and_doubling),
                                       cmocka_unit_test(energy_is_kept),
                                       cmocka_unit_test(profiles_integrate_to_the_totals),
                                       cmocka_unit_test(lengths_scale),
                                       cmocka_unit_test(changes_smoothly),
                                       cmocka_unit_test(any_number_of_threads_gives_the_same_bytes),
                                       cmocka_unit_test(refuses_what_is_no_slab)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
