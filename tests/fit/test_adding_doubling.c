// Adding-doubling against tables, closed forms, laws, discrete ordinates solved in eigenvectors, and photons.
#include "base/random.h"
#include "check.h"
#include "discrete_ordinates.h"
#include "fit/adding_doubling.h"

static double between(alb_random *random, double low, double high)
{
    return low * pow(high / low, alb_random_uniform(random));
}

static alb_totals totals(int count, double a, double s, double d, double n, double g)
{
    alb_streams streams;
    alb_streams_create(&streams, count, n, g);
    return alb_adding_doubling(&streams, a, s, d);
}

static void quadrature(void **state)
{
    (void)state;
    for (int n = 2; n <= 64; n += 1 + n / 4)
        for (int degree = 0; degree < 2 * n; degree++) {
            double x[64], w[64], gauss = 0, radau = 0;
            alb_quadrature_gauss(x, w, n, 0.5, 1);
            for (int i = 0; i < n; i++)
                gauss += w[i] * pow(x[i], degree);
            alb_quadrature_radau(x, w, n, 0.5, 1);
            for (int i = 0; i < n; i++)
                radau += w[i] * pow(x[i], degree);
            const double exact = (1 - pow(0.5, degree + 1)) / (degree + 1);
            check_near(gauss, exact, 1e-14);
            if (degree < 2 * n - 1)
                check_near(radau, exact, 1e-14);
        }
}

// van de Hulst 1980, table 35: tau 2, albedo 0.9, g 0.75, matched index; Giovanelli 1955: half-space, n 1.5, albedo
// 0.9, isotropic, total with what the face turns away.
static void tables(void **state)
{
    (void)state;
    const alb_totals slab = totals(16, 1, 9 * 0.25, 0.2, 1, 0.75), body = totals(16, 1, 9, 0, 1.5, 0);
    check_near(slab.reflection, 0.09739, 5e-6);
    check_near(slab.transmission, 0.66096, 5e-6);
    check_near(body.reflection + 0.04, 0.2600, 5e-5 + 5e-5); // the table's last digit, rounded from four
}

// Chandrasekhar 1960: isotropic half-space, matched index, normal incidence: R = 1 - H(1) sqrt(1 - a), with
// 1/H(m) = sqrt(1 - a) + (a/2) int_0^1 m' H(m') / (m + m') dm' solved by iteration on 64 Gauss nodes.
static void chandrasekhar_half_space(void **state)
{
    (void)state;
    enum { N = 64 };
    double x[N + 1], w[N], h[N + 1];
    alb_quadrature_gauss(x, w, N, 0, 1);
    x[N] = 1;
    for (int e = 1; e <= 3; e++) {
        const double albedo = 1 - pow(10, -e);
        for (int i = 0; i <= N; i++)
            h[i] = 1;
        for (int iteration = 0; iteration < 400; iteration++)
            for (int i = 0; i <= N; i++) {
                double sum = 0;
                for (int j = 0; j < N; j++)
                    sum += w[j] * x[j] * h[j] / (x[i] + x[j]);
                h[i] = 1 / (sqrt(1 - albedo) + albedo / 2 * sum);
            }
        check_near(totals(16, 1 - albedo, albedo, 0, 1, 0).reflection, 1 - h[N] * sqrt(1 - albedo), 2e-7);
    }
}

static void nothing_absorbed_is_nothing_lost(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 60; i++) {
        alb_random random = alb_random_at(1, 0, i);
        const double n = i % 3 ? 1 + alb_random_uniform(&random) : 1, g = 0.95 * alb_random_uniform(&random);
        const int count = 4 + 2 * (int)(i % 8);
        const alb_totals t = totals(count, 0, between(&random, 0.01, 50), 1, n, g);
        check_near(t.reflection + t.transmission, 1 - pow((n - 1) / (n + 1), 2), 1e-10);
    }
    assert_true(totals(8, 0, 1, 0, 1.5, 0).reflection == 1 - pow(0.5 / 2.5, 2));
}

// A clear plate that absorbs: (1-r)^2 e^-tau / (1 - r^2 e^-2tau).
static void clear_plate(void **state)
{
    (void)state;
    const alb_totals t = totals(8, 0.5, 0, 2, 1.5, 0.3), empty = totals(8, 0, 0, 2, 1.5, 0);
    const double r = 0.04, e = exp(-1);
    check_near(t.transmission, (1 - r) * (1 - r) * e / (1 - r * r * e * e), 1e-7); // first layer, to the 4th order
    check_near(t.reflection, (1 - r) * (1 - r) * r * e * e / (1 - r * r * e * e), 1e-7);
    assert_true(empty.transmission == 1 - r && empty.reflection == 0);
}

// Coefficients times the length, and any unit of it; symmetric matrices are reciprocity.
static void units_and_reciprocity(void **state)
{
    (void)state;
    const alb_totals mm = totals(12, 0.01, 2, 5, 1.5, 0.5), m = totals(12, 10, 2000, 0.005, 1.5, 0.5);
    check_relative(m.reflection, mm.reflection, 1e-12);
    check_relative(m.transmission, mm.transmission, 1e-12);
    alb_streams streams;
    alb_layer layer;
    alb_streams_create(&streams, 12, 1.5, 0.9);
    alb_layer_create(&layer, &streams, 0.01, 2, 5);
    for (int i = 0; i < 12; i++)
        for (int j = 0; j < i; j++) {
            check_near(layer.lost[i][j], layer.lost[j][i], 1e-12);
            check_near(layer.odd[i][j], layer.odd[j][i], 1e-12);
        }
}

// out = (1 - a b)^-1 c, by elimination; the textbook's adding of unequal layers stands on it.
static void solve_one_minus(double *out, const double *a, const double *b, const double *c, int n)
{
    static double m[32][64];
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            m[i][j] = i == j;
            for (int k = 0; k < n; k++)
                m[i][j] -= a[i * n + k] * b[k * n + j];
            m[i][n + j] = c[i * n + j];
        }
    for (int k = 0; k < n; k++)
        for (int i = 0; i < n; i++)
            for (int j = 2 * n - 1; i != k && j >= k; j--)
                m[i][j] -= m[i][k] / m[k][k] * m[k][j];
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            out[i * n + j] = m[i][n + j] / m[i][i];
}

static void multiply_add(double *out, const double *start, const double *a, const double *b, int n)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            double sum = start ? start[i * n + j] : 0;
            for (int k = 0; k < n; k++)
                sum += a[i * n + k] * b[k * n + j];
            out[i * n + j] = sum;
        }
}

// A layer is 0.3 of it upon 0.7 of it: T = T2 (1 - R1 R2)^-1 T1, R = R1 + T1 R2 (1 - R1 R2)^-1 T1.
static void a_layer_is_its_parts_added(void **state)
{
    (void)state;
    enum { N = 12 };
    alb_streams streams;
    alb_streams_create(&streams, N, 1.5, 0.9);
    static alb_layer whole, part[2];
    alb_layer_create(&whole, &streams, 0.05, 1.5, 3);
    static double r[2][N * N], t[2][N * N], between_parts[N * N], r2_between[N * N], added[2][N * N];
    for (int k = 0; k < 2; k++) {
        alb_layer_create(&part[k], &streams, 0.05, 1.5, k ? 2.1 : 0.9);
        for (int i = 0; i < N; i++)
            for (int j = 0; j < N; j++) {
                r[k][i * N + j] = ((i == j) - part[k].lost[i][j] - part[k].odd[i][j]) / 2;
                t[k][i * N + j] = ((i == j) - part[k].lost[i][j] + part[k].odd[i][j]) / 2;
            }
    }
    solve_one_minus(between_parts, r[0], r[1], t[0], N);
    multiply_add(added[1], NULL, t[1], between_parts, N);
    multiply_add(r2_between, NULL, r[1], between_parts, N);
    multiply_add(added[0], r[0], t[0], r2_between, N);
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) { // first layers differ: 4th order, worst in the most grazing stream
            check_near(added[0][i * N + j], ((i == j) - whole.lost[i][j] - whole.odd[i][j]) / 2, 2e-5);
            check_near(added[1][i * N + j], ((i == j) - whole.lost[i][j] + whole.odd[i][j]) / 2, 2e-5);
        }
}

// Random media: the error by number of streams, and what the header promises of it.
static void discrete_ordinates_agree(void **state)
{
    (void)state;
    const int counts[] = {8, 12, 16, 32};
    const double limit[] = {1e-3, 3e-4, 1e-4, 3e-6}; // of the flux; what adding_doubling.h promises
    double worst[4] = {0};
    for (unsigned i = 0; i < 40; i++) {
        alb_random random = alb_random_at(4, 0, i);
        const double g = i % 2 ? 0.9 : 0, n = 1.3 + 0.3 * alb_random_uniform(&random);
        const double reduced = between(&random, 0.2, 5), d = between(&random, 0.5, 40) / reduced;
        const alb_medium medium = {reduced * between(&random, 1e-4, 1), reduced / (1 - g), g, n, d};
        double truth[2];
        discrete_ordinates(truth, &medium);
        for (int k = 0; k < 4; k++) {
            const alb_totals t = totals(counts[k], medium.absorption_per_mm, reduced, d, n, g);
            worst[k] = fmax(worst[k], fmax(fabs(t.reflection - truth[0]), fabs(t.transmission - truth[1])));
        }
    }
    for (int k = 0; k < 4; k++) {
        print_message("%2d streams: worst error %.1e of the flux\n", counts[k], worst[k]);
        check_below(worst[k], limit[k]);
    }
}

// 4 sd of the Monte Carlo itself.
static void photons_agree(void **state)
{
    (void)state;
    const alb_medium media[] = {{0.0021, 2.19, 0, 1.5, 5}, {0.0071, 30, 0.9, 1.5, 2}, {0.03, 17, 0.9, 1.45, 2},
                                {0.05, 5, 0.9, 1.5, 1},    {1, 1, 0, 1.3, 1},         {0.2, 3, -0.5, 1.5, 2}};
    for (size_t i = 0; i < sizeof media / sizeof *media; i++) {
        const alb_medium *m = &media[i];
        alb_photon_tally tally;
        alb_error error = {0};
        check_ok(alb_photon_trace(&tally, m, 40, 60000, 5, i, &error), &error);
        const alb_totals t = totals(16, m->absorption_per_mm, m->scattering_per_mm * (1 - m->anisotropy),
                                    m->thickness_mm, m->refractive_index, m->anisotropy);
        check_near(t.reflection, tally.leaving[0], 4 * tally.leaving_sd[0]);
        check_near(t.transmission, tally.leaving[1], 4 * tally.leaving_sd[1]);
    }
}

// Anything finite gives shares of the flux.
static void extremes_stay_finite(void **state)
{
    (void)state;
    for (int i = 0; i < 5 * 5 * 4; i++) {
        const double a = (double[]){0, 1e-12, 1e-3, 1, 1e9}[i % 5], s = (double[]){0, 1e-9, 1, 1e3, 1e9}[i / 5 % 5],
                     d = (double[]){0, 1e-6, 1, 1e6}[i / 25];
        const alb_totals t = totals(8, a, s, d, 1.5, 0.9);
        assert_true(t.reflection >= -1e-5 && t.transmission >= -1e-5 && t.reflection + t.transmission < 0.96 + 1e-4);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(quadrature),
        cmocka_unit_test(tables),
        cmocka_unit_test(chandrasekhar_half_space),
        cmocka_unit_test(nothing_absorbed_is_nothing_lost),
        cmocka_unit_test(clear_plate),
        cmocka_unit_test(units_and_reciprocity),
        cmocka_unit_test(a_layer_is_its_parts_added),
        cmocka_unit_test(discrete_ordinates_agree),
        cmocka_unit_test(photons_agree),
        cmocka_unit_test(extremes_stay_finite),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
