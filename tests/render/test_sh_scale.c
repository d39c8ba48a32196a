// The matrix of angular scaling against brute-force integrals over the sphere that share no formula with it, its
// identities, and the note's failure modes of M.
#include "check.h"
#include "render/sh_scale.h"
#include "sh_sphere.h"

#include "base/random.h"

static alb_sh_scaling matrix(alb_sh_map_kind kind, double k, double alpha_deg, bool windowed, alb_sh_measure measure,
                             int order_out, int order_in)
{
    alb_error error = {0};
    alb_sh_map map;
    alb_sh_scaling m;
    check_ok(kind == ALB_SH_MAP_CONE       ? alb_sh_map_cone(&map, k, alpha_deg, &error)
             : kind == ALB_SH_MAP_MIDRANGE ? alb_sh_map_midrange(&map, k, &error)
                                           : alb_sh_map_sphere(&map, k, &error),
             &error);
    map.windowed |= windowed;
    check_ok(alb_sh_scaling_compute(&m, &map, measure, order_out, order_in, &error), &error);
    return m;
}

static double value(const alb_sh_scaling *m, int am, int l, int j)
{
    return m->value[alb_sh_scaling_index(m->order_out, m->order_in, am, l, j)];
}

static double largest_difference(const alb_sh_scaling *a, const alb_sh_scaling *b)
{
    double largest = 0;
    assert_int_equal(a->order_out, b->order_out);
    assert_int_equal(a->order_in, b->order_in);
    for (int i = 0; i < alb_sh_scaling_count(a->order_out, a->order_in); i++)
        largest = fmax(largest, fabs(a->value[i] - b->value[i]));
    return largest;
}

static long double drawn(alb_sh_map_kind kind, long double theta, long double k, long double alpha)
{
    return kind == ALB_SH_MAP_CONE       ? sphere_cone(theta, k, alpha)
           : kind == ALB_SH_MAP_MIDRANGE ? sphere_midrange(theta, k)
                                         : asinl(fminl(k * sinl(theta), 1));
}

enum { ORDER = 8, COUNT = ORDER * ORDER, NODES = 300, TURNS = 16 };

// int Y_j(tau, phi) Y_i(theta, phi) dtheta dphi eta over the whole sphere or up to `end`; no symmetry is used but that
// the trapezoid rule with 16 points is exact up to m + m' = 15.
static void integrate(double out[COUNT][COUNT], alb_sh_map_kind kind, double k, double alpha_deg, long double end,
                      alb_sh_measure measure)
{
    const long double alpha = (long double)alpha_deg * (long double)M_PI / 180;
    static long double sum[COUNT][COUNT], outer[COUNT][TURNS], inner[COUNT][TURNS];
    memset(sum, 0, sizeof sum);
    for (int n = -NODES; n <= NODES; n++) {
        long double theta;
        const long double weight = sphere_node(&theta, n, NODES, 0, end) * 2 * (long double)M_PI / TURNS;
        const long double tau = drawn(kind, theta, k, alpha), step = 1e-4L * fminl(theta, end - theta);
        const long double slope =
            step > 0 ? (8 * (drawn(kind, theta + step, k, alpha) - drawn(kind, theta - step, k, alpha)) -
                        (drawn(kind, theta + 2 * step, k, alpha) - drawn(kind, theta - 2 * step, k, alpha))) /
                           (12 * step)
                     : 0;
        const long double eta = measure == ALB_SH_ENERGY ? sinl(tau) * slope : sinl(theta);
        for (int i = 0; i < COUNT; i++) {
            const int l = (int)sqrt(i), m = i - l * (l + 1);
            const long double at_theta = sphere_legendre(l, abs(m), theta) * eta * weight;
            const long double at_tau = sphere_legendre(l, abs(m), tau);
            for (int t = 0; t < TURNS; t++) {
                const long double turn = sphere_azimuth(m, 2 * (long double)M_PI * t / TURNS);
                outer[i][t] = at_theta * turn, inner[i][t] = at_tau * turn;
            }
        }
        for (int i = 0; i < COUNT; i++)
            for (int j = 0; j < COUNT; j++)
                for (int t = 0; t < TURNS; t++)
                    sum[i][j] += outer[i][t] * inner[j][t];
    }
    for (int i = 0; i < COUNT; i++)
        for (int j = 0; j < COUNT; j++)
            out[i][j] = (double)sum[i][j];
}

// Every entry, those that must be 0 as well.
static void check_against_sphere(const alb_sh_scaling *m, double truth[COUNT][COUNT], double tolerance)
{
    for (int i = 0; i < COUNT; i++) {
        double unit[COUNT] = {0}, column[COUNT];
        unit[i] = 1;
        alb_sh_scaling_apply(column, m, unit);
        for (int j = 0; j < COUNT; j++)
            check_near(column[j], truth[j][i], tolerance);
    }
}

// 1e-12: what was asked; the oracle's slopes by differences of fourth order in long double are good to 1e-14.
static void brute_force(void **state)
{
    (void)state;
    static double truth[COUNT][COUNT];
    const struct {
        alb_sh_map_kind kind;
        double k, alpha_deg;
        alb_sh_measure measure;
    } cases[] = {{ALB_SH_MAP_CONE, 0.3, 45, ALB_SH_VISIBILITY},    {ALB_SH_MAP_CONE, 2, 45, ALB_SH_VISIBILITY},
                 {ALB_SH_MAP_CONE, 1.7, 70, ALB_SH_ENERGY},        {ALB_SH_MAP_CONE, 0.6, 30, ALB_SH_ENERGY},
                 {ALB_SH_MAP_MIDRANGE, 0.7, 0, ALB_SH_VISIBILITY}, {ALB_SH_MAP_MIDRANGE, -0.4, 0, ALB_SH_ENERGY}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const alb_sh_scaling m =
            matrix(cases[i].kind, cases[i].k, cases[i].alpha_deg, false, cases[i].measure, ORDER, ORDER);
        integrate(truth, cases[i].kind, cases[i].k, cases[i].alpha_deg, M_PI, cases[i].measure);
        check_against_sphere(&m, truth, 1e-12);
    }
}

// The windows end where tau reaches 90 degrees: at acot((k - 1) cot alpha), at asin(1/k).
static void brute_force_windows(void **state)
{
    (void)state;
    static double truth[COUNT][COUNT];
    const double cot = 1 / tan(50 * M_PI / 180);
    alb_sh_scaling m = matrix(ALB_SH_MAP_CONE, 2.5, 50, true, ALB_SH_VISIBILITY, ORDER, ORDER);
    integrate(truth, ALB_SH_MAP_CONE, 2.5, 50, atan2l(1, 1.5L * (long double)cot), ALB_SH_VISIBILITY);
    check_against_sphere(&m, truth, 1e-12);
    m = matrix(ALB_SH_MAP_SPHERE, 1.3, 0, false, ALB_SH_VISIBILITY, ORDER, ORDER);
    integrate(truth, ALB_SH_MAP_SPHERE, 1.3, 0, asinl(1 / 1.3L), ALB_SH_VISIBILITY);
    check_against_sphere(&m, truth, 1e-9); // the oracle's own k rounds 1/k: the map's root at the end magnifies it
    m = matrix(ALB_SH_MAP_SPHERE, 0.5, 0, false, ALB_SH_VISIBILITY, ORDER, ORDER);
    integrate(truth, ALB_SH_MAP_SPHERE, 0.5, 0, M_PI_2, ALB_SH_VISIBILITY);
    check_against_sphere(&m, truth, 1e-12);
}

// M = I; column 0 of V; row 0 of E; M^E[tau] = (M^V[tau^-1])^T; M_-k = D M_k D. 1e-14: rounding.
static void identities(void **state)
{
    (void)state;
    for (int order = 1; order <= ORDER; order++)
        for (int measure = 0; measure < 2; measure++)
            for (int kind = 0; kind < 2; kind++) {
                const alb_sh_scaling one = matrix(kind, kind == ALB_SH_MAP_CONE, 45, false, measure, order, order);
                const alb_sh_scaling other =
                    matrix(kind, kind == ALB_SH_MAP_CONE ? 2.2 : 0.6, 45, false, measure, order, order);
                const alb_sh_scaling mirrored =
                    matrix(kind, kind == ALB_SH_MAP_CONE ? 1 / 2.2 : -0.6, 45, false, !measure, order, order);
                const alb_sh_scaling same =
                    matrix(kind, kind == ALB_SH_MAP_CONE ? 2.2 : -0.6, 45, false, measure, order, order);
                for (int m = 0; m < order; m++)
                    for (int l = m; l < order; l++)
                        for (int j = m; j < order; j++) {
                            check_near(value(&one, m, l, j), l == j, 1e-14);
                            if (kind == ALB_SH_MAP_CONE)
                                check_near(value(&other, m, l, j), value(&mirrored, m, j, l), 1e-13);
                            else
                                check_near(value(&other, m, l, j), ((l + j) % 2 ? -1 : 1) * value(&same, m, l, j),
                                           1e-14);
                        }
                for (int l = 0; l < order; l++)
                    check_near(measure == ALB_SH_ENERGY ? value(&other, 0, 0, l) : value(&other, 0, l, 0), l == 0,
                               1e-14);
            }
}

static double inverse_midrange(const void *context, double theta, double *slope)
{
    const double k = *(const double *)context, s = sin(theta), c = cos(theta);
    *slope = (1 - k * c) / (1 - 2 * k * c + k * k);
    return atan2(s, c - k);
}

static void midrange_transpose(void **state)
{
    (void)state;
    alb_error error = {0};
    for (double k = -0.95; k < 1; k += 0.19) {
        alb_sh_map map;
        alb_sh_scaling inverse, energy;
        alb_sh_map_custom(&map, inverse_midrange, &k);
        check_ok(alb_sh_scaling_compute(&inverse, &map, ALB_SH_VISIBILITY, 6, 6, &error), &error);
        check_ok(alb_sh_scaling_midrange(&energy, k, ALB_SH_ENERGY, 6, 6, &error), &error);
        for (int m = 0; m < 6; m++)
            for (int l = m; l < 6; l++)
                for (int j = m; j < 6; j++)
                    check_near(value(&energy, m, l, j), value(&inverse, m, j, l), 1e-13);
    }
}

// The closed form against quadrature, from tiny k to a hair from the sphere, and entries known by hand.
static void midrange_closed_form(void **state)
{
    (void)state;
    alb_error error = {0};
    const double ks[] = {0, 1e-300, 1e-9, -1e-5, 1e-3, 0.1, -0.3, 0.5, 0.7, 0.9, 0.95, -0.99, 0.999, 0.99999, 1 - 1e-9};
    for (size_t i = 0; i < sizeof ks / sizeof *ks; i++)
        for (int measure = 0; measure < 2; measure++)
            for (int order = 4; order <= 8; order += 4) {
                alb_sh_scaling closed;
                const alb_sh_scaling summed = matrix(ALB_SH_MAP_MIDRANGE, ks[i], 0, false, measure, 4, order);
                check_ok(alb_sh_scaling_midrange(&closed, ks[i], measure, 4, order, &error), &error);
                check_near(largest_difference(&closed, &summed), 0, 1e-13); // as both headers state
            }
    const double k = 0.6, kk = k * k;
    alb_sh_scaling m;
    check_ok(alb_sh_scaling_midrange(&m, k, ALB_SH_VISIBILITY, 4, 4, &error), &error);
    check_near(value(&m, 0, 2, 0), 0, 1e-14);
    check_near(value(&m, 0, 0, 3), 4 * k * kk / sqrt(7), 1e-14);
    check_near(value(&m, 0, 2, 2), (7 - 9 * kk) / 7, 1e-14);
    check_near(value(&m, 1, 2, 2), (7 - 8 * kk) / 7, 1e-14);
    check_near(value(&m, 2, 2, 2), (7 - 5 * kk) / 7, 1e-14);
    check_near(value(&m, 0, 2, 1), -2 * sqrt(15) * k / 15, 1e-14);
    check_near(value(&m, 1, 1, 1),
               3 * (1 + 2 * kk - 3 * kk * kk) * atanh(k) / (16 * k * kk) + 3 * (3 * kk - 1) / (16 * kk), 1e-14);
}

// Non-zero entries of the square matrix: 1, 5, 17, 41, 81, 141; N - 1 more in the pattern, which the window fills.
static void pattern(void **state)
{
    (void)state;
    static const int nonzero[] = {0, 1, 5, 17, 41, 81, 141};
    for (int order = 1; order <= 6; order++)
        for (int windowed = 0; windowed < 2; windowed++) {
            const alb_sh_scaling m = matrix(ALB_SH_MAP_CONE, 1.9, 45, windowed, ALB_SH_VISIBILITY, order, order);
            int found = 0;
            for (int am = 0; am < order; am++)
                for (int l = am; l < order; l++)
                    for (int j = am; j < order; j++)
                        found += (am ? 2 : 1) * (fabs(value(&m, am, l, j)) > 1e-12);
            assert_int_equal(found, windowed ? order * (2 * order * order + 1) / 3 : nonzero[order]);
        }
    assert_int_equal(alb_sh_scaling_count(4, 4), 30);
    assert_int_equal(alb_sh_scaling_count(4, 8), 70);
    assert_int_equal(alb_sh_scaling_count(16, 16), ALB_SH_SCALING_VALUES_MAX);
}

static void caller_maps(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_sh_map map;
    alb_sh_scaling m, cone = matrix(ALB_SH_MAP_CONE, 1.5, 45, false, ALB_SH_VISIBILITY, 4, 4);
    enum { ROWS = 400 };
    double theta[ROWS], tau[ROWS];
    for (int i = 0; i < ROWS; i++) {
        theta[i] = M_PI * i / (ROWS - 1);
        tau[i] = (double)sphere_cone(theta[i], 1.5L, (long double)M_PI / 4);
    }
    tau[ROWS - 1] = M_PI;
    alb_sh_tau_table table = {theta, tau, ROWS};
    check_ok(alb_sh_map_table(&map, &table, &error), &error);
    check_ok(alb_sh_scaling_compute(&m, &map, ALB_SH_VISIBILITY, 4, 4, &error), &error);
    check_near(largest_difference(&m, &cone), 0,
               1e-7); // rows 8 mrad apart: third order at the knots, 5e-7 rad at worst
    check_ok(alb_sh_scaling_compute(&m, &map, ALB_SH_ENERGY, 4, 4, &error), &error);
    check_near(value(&m, 0, 0, 2), 0, 1e-11); // 398 knots with a kink in the slope, 1e-13 each at most
    tau[200] = tau[199] - 1e-3;
    check_fails(alb_sh_map_table(&map, &table, &error), &error, ALB_BAD_DATA, "row 201");
    tau[200] = NAN;
    check_fails(alb_sh_map_table(&map, &table, &error), &error, ALB_BAD_DATA, "row 201");
    table.count = 3;
    check_fails(alb_sh_map_table(&map, &table, &error), &error, ALB_BAD_DATA, "from 0 to pi");
}

static double noise_tau(const void *context, double theta, double *slope)
{
    (void)context;
    uint64_t bits;
    memcpy(&bits, &theta, sizeof bits);
    alb_random random = alb_random_at(1, 0, bits);
    *slope = 1;
    return M_PI * alb_random_uniform(&random);
}

static double nan_tau(const void *context, double theta, double *slope)
{
    (void)context, (void)theta;
    return *slope = NAN;
}

static void hostile_maps(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_sh_map map;
    alb_sh_scaling m;
    alb_sh_map_custom(&map, noise_tau, NULL);
    check_fails(alb_sh_scaling_compute(&m, &map, ALB_SH_VISIBILITY, 4, 4, &error), &error, ALB_BAD_DATA, "continuous");
    alb_sh_map_custom(&map, nan_tau, NULL);
    check_fails(alb_sh_scaling_compute(&m, &map, ALB_SH_ENERGY, 4, 4, &error), &error, ALB_BAD_DATA, "continuous");
    check_fails(alb_sh_scaling_compute(&m, &map, ALB_SH_ENERGY, 0, 4, &error), &error, ALB_USAGE, "order");
    check_fails(alb_sh_scaling_midrange(&m, 0.5, ALB_SH_ENERGY, 4, 17, &error), &error, ALB_USAGE, "order 17");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(brute_force),        cmocka_unit_test(brute_force_windows),  cmocka_unit_test(identities),
        cmocka_unit_test(midrange_transpose), cmocka_unit_test(midrange_closed_form), cmocka_unit_test(pattern),
        cmocka_unit_test(caller_maps),        cmocka_unit_test(hostile_maps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
