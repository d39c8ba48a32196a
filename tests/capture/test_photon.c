// The slab Monte Carlo against tables and closed forms. Limits are 4 sd of the Monte Carlo itself (the program has
// about 100 such comparisons; one in 16 000 exceeds it by chance) plus the table's last digit.
#include "capture/photon.h"
#include "check.h"
#include <omp.h>

static alb_photon_tally traced(alb_medium medium, long photons)
{
    alb_error error = {0};
    alb_photon_tally tally;
    check_ok(alb_photon_trace(&tally, &medium, 40, photons, 7, 1, &error), &error);
    return tally;
}

// van de Hulst 1980, table 35: tau 2, albedo 0.9, g 0.75, matched index.
static void van_de_hulst_slab(void **state)
{
    (void)state;
    const alb_photon_tally t = traced((alb_medium){1, 9, 0.75, 1, 0.2}, 1000000);
    check_near(t.leaving[0], 0.09739, 4 * t.leaving_sd[0] + 5e-6);
    check_near(t.leaving[1], 0.66096, 4 * t.leaving_sd[1] + 5e-6);
    check_below(t.leaving_sd[0], 0.0004);
}

// Giovanelli 1955: half-space, n 1.5, albedo 0.9, isotropic; his total counts the light that the surface turns away.
static void giovanelli_half_space(void **state)
{
    (void)state;
    const alb_photon_tally t = traced((alb_medium){1, 9, 0, 1.5, 100}, 400000);
    check_near(t.leaving[0] + t.specular, 0.2600, 4 * t.leaving_sd[0] + 5e-5);
}

// Chandrasekhar 1960: isotropic half-space, matched index, normal incidence: R = 1 - H(1) sqrt(1 - a), with
// 1/H(m) = sqrt(1 - a) + (a/2) int_0^1 m' H(m') / (m + m') dm' solved here by iteration.
static double chandrasekhar(double albedo)
{
    enum { N = 2000 };
    static double h[N + 1];
    for (int i = 0; i <= N; i++)
        h[i] = 1;
    for (int iteration = 0; iteration < 60; iteration++)
        for (int i = 0; i <= N; i++) {
            double sum = 0;
            const double m = i < N ? (i + 0.5) / N : 1;
            for (int j = 0; j < N; j++)
                sum += (j + 0.5) / N * h[j] / (m + (j + 0.5) / N) / N;
            h[i] = 1 / (sqrt(1 - albedo) + albedo / 2 * sum);
        }
    return 1 - h[N] * sqrt(1 - albedo);
}

static void chandrasekhar_half_space(void **state)
{
    (void)state;
    const double albedos[] = {0.5, 0.95};
    for (int i = 0; i < 2; i++) {
        const alb_photon_tally t = traced((alb_medium){10 * (1 - albedos[i]), 10 * albedos[i], 0, 1, 100}, 200000);
        check_near(t.leaving[0], chandrasekhar(albedos[i]), 4 * t.leaving_sd[0] + 1e-6); // midpoint rule: 1e-7
    }
}

// A clear absorbing plate: (1-r)^2 e^-tau / (1 - r^2 e^-2tau).
static void clear_plate(void **state)
{
    (void)state;
    const alb_photon_tally t = traced((alb_medium){0.5, 0, 0.3, 1.5, 2}, 1000);
    const double r = 0.04, e = exp(-1);
    check_near(t.leaving[1], (1 - r) * (1 - r) * e / (1 - r * r * e * e), 1e-15);
    check_near(t.leaving[0] + t.specular, r + r * (1 - r) * (1 - r) * e * e / (1 - r * r * e * e), 1e-15);
}

static void energy_adds_up(void **state)
{
    (void)state;
    const alb_medium media[] = {{0.01, 2, 0, 1.5, 5},  {0, 3, 0.9, 1.33, 2},    {5, 5, -0.5, 1, 1},
                                {0.2, 40, 0.99, 2, 1}, {1e-9, 1e-9, 0, 1.5, 1}, {0, 0, 0, 1.4, 1}};
    for (size_t i = 0; i < sizeof media / sizeof *media; i++) {
        const alb_photon_tally t = traced(media[i], 20000);
        check_near(t.specular + t.absorbed + t.leaving[0] + t.leaving[1], 1, 1e-12);
        double rings = t.unscattered[1];
        for (int b = 0; b < ALB_PHOTON_BINS; b++)
            rings += t.ring[1][b];
        check_below(rings, t.leaving[1] + 1e-12);
    }
}

// At albedo 0.001 only single scattering counts (the second is 0.1 % of it at most): what leaves at r without
// reflection is R(r) = sigma_s/(4 pi) int_0^d e^(-sigma_t (z + rho)) z / rho^3 dz, rho^2 = r^2 + z^2; for T, z becomes
// d - z on the way out.
static double single_scattering(double r, double sigma_s, double sigma_t, double d, int face)
{
    enum { N = 4000 };
    double sum = 0;
    for (int i = 0; i < N; i++) { // z = d t^2: dense where the beam enters
        const double t = (i + 0.5) / N, in = d * t * t, out = face ? d - in : in, rho = sqrt(r * r + out * out);
        sum += exp(-sigma_t * (in + rho)) * out / (rho * rho * rho) * 2 * d * t / N;
    }
    return sigma_s / (4 * 3.141592653589793) * sum;
}

static void single_scattering_by_radius(void **state)
{
    (void)state;
    const double albedo = 1e-3, sigma_t = 1, d = 1;
    const alb_photon_tally t = traced((alb_medium){sigma_t * (1 - albedo), sigma_t * albedo, 0, 1, d}, 4000000);
    for (int face = 0; face < 2; face++) {
        double chi_square = 0;
        int bins = 0;
        for (int b = 4; b < 22; b++) { // 0.16 to 4.7 mm
            enum { PARTS = 16 };
            double expected = 0;
            const double inner = t.edges_mm[b], width = (t.edges_mm[b + 1] - inner) / PARTS;
            for (int i = 0; i < PARTS; i++) {
                const double r = inner + (i + 0.5) * width;
                expected +=
                    single_scattering(r, albedo * sigma_t, sigma_t, d, face) * 2 * 3.141592653589793 * r * width;
            }
            const double sd = hypot(t.ring_sd[face][b], 1e-3 * expected), z = (t.ring[face][b] - expected) / sd;
            chi_square += z * z;
            bins++;
        }
        check_below(chi_square, bins + 4 * sqrt(2.0 * bins)); // 4 sd of chi-square
    }
}

// The error bars are honest: over repeated runs the scatter is what each run claims.
static void error_bars_are_honest(void **state)
{
    (void)state;
    enum { RUNS = 40 };
    const alb_medium medium = {0.05, 5, 0.5, 1.4, 2};
    double sum = 0, squares = 0, claimed = 0;
    alb_error error = {0};
    for (int i = 0; i < RUNS; i++) {
        alb_photon_tally t;
        check_ok(alb_photon_trace(&t, &medium, 20, 4000, 11, (uint64_t)i, &error), &error);
        sum += t.leaving[0], squares += t.leaving[0] * t.leaving[0];
        claimed += t.leaving_sd[0] * t.leaving_sd[0] / RUNS;
    }
    const double variance = (squares - sum * sum / RUNS) / (RUNS - 1);
    check_near(variance / claimed, 1, 4 * sqrt(2.0 / (RUNS - 1))); // sampling error of a variance
}

static void threads_do_not_matter(void **state)
{
    (void)state;
    const alb_medium medium = {0.01, 5, 0.6, 1.5, 3};
    omp_set_num_threads(1);
    const alb_photon_tally one = traced(medium, 20000);
    omp_set_num_threads(3);
    const alb_photon_tally three = traced(medium, 20000);
    assert_memory_equal(&one, &three, sizeof one);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(van_de_hulst_slab),        cmocka_unit_test(giovanelli_half_space),
        cmocka_unit_test(chandrasekhar_half_space), cmocka_unit_test(clear_plate),
        cmocka_unit_test(energy_adds_up),           cmocka_unit_test(single_scattering_by_radius),
        cmocka_unit_test(error_bars_are_honest),    cmocka_unit_test(threads_do_not_matter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
