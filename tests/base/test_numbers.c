// Random numbers, statistics and the camera.
#include "base/camera.h"
#include "base/morton.h"
#include "base/quadrature.h"
#include "base/random.h"
#include "base/statistics.h"
#include "check.h"

// Mean and variance of n draws against theory, in units of their own standard error.
static void check_moments(double (*draw)(alb_random *, double), double parameter, double mean, double variance,
                          double fourth, int stream)
{
    const int n = 200000;
    double sum = 0, squares = 0;
    for (int i = 0; i < n; i++) {
        alb_random random = alb_random_at(7, (uint64_t)stream, (uint64_t)i);
        const double d = draw(&random, parameter) - mean;
        sum += d;
        squares += d * d;
    }
    check_below(fabs(sum / n) / sqrt(variance / n), 4);
    check_below(fabs(squares / n - variance) / sqrt((fourth - variance * variance) / n), 4);
}

static double uniform(alb_random *random, double parameter)
{
    (void)parameter;
    return alb_random_uniform(random);
}
static double normal(alb_random *random, double parameter)
{
    (void)parameter;
    return alb_random_normal(random);
}

static void random_moments(void **state)
{
    (void)state;
    check_moments(uniform, 0, 0.5, 1.0 / 12, 1.0 / 80, 1);
    check_moments(normal, 0, 0, 1, 3, 2);
    const double means[] = {0.01, 0.7, 5, 29.9, 30.1, 1000, 1e6};
    for (int i = 0; i < 7; i++) // the fourth central moment of a Poisson variate is m (1 + 3 m)
        check_moments(alb_random_poisson, means[i], means[i], means[i], means[i] * (1 + 3 * means[i]), 3 + i);
    alb_random random = alb_random_at(1, 2, 3);
    assert_true(alb_random_poisson(&random, 0) == 0);
}

// Chi-square of a histogram of Poisson counts against the exact probabilities, on both sides of the change of method.
static void poisson_distribution(void **state)
{
    (void)state;
    const double means[] = {3, 40};
    for (int k = 0; k < 2; k++) {
        const double m = means[k];
        double seen[128] = {0}, chi_square = 0;
        const int n = 200000;
        int bins = 0;
        for (int i = 0; i < n; i++) {
            alb_random random = alb_random_at(9, (uint64_t)k, (uint64_t)i);
            const double d = alb_random_poisson(&random, m);
            seen[d < 127 ? (int)d : 127]++;
        }
        for (int i = 0; i < 127; i++) {
            const double expected = n * exp(-m + i * log(m) - lgamma(i + 1));
            if (expected < 10)
                continue;
            chi_square += (seen[i] - expected) * (seen[i] - expected) / expected;
            bins++;
        }
        assert_true(alb_chi_square_tail(chi_square, bins - 1) > 1e-4);
    }
}

static void chi_square_values(void **state)
{
    (void)state;
    check_near(alb_chi_square_tail(3.841458820694124, 1), 0.05, 1e-12); // tables
    check_near(alb_chi_square_tail(9.210340371976182, 2), 0.01, 1e-12); // exp(-x/2)
    check_relative(alb_chi_square_tail(200, 2), exp(-100), 1e-12);
    check_near(alb_chi_square_tail(100, 100), 0.4811916, 1e-6);
    assert_true(alb_chi_square_tail(0, 5) == 1 && isnan(alb_chi_square_tail(1, 0)));
    double values[] = {5, 1, 4, 2};
    check_near(alb_median(values, 4), 3, 0);
}

static void camera_inverts_its_distortion(void **state)
{
    (void)state;
    const alb_lens lenses[] = {
        {640, 480, 536.06, 536.01, 342.37, 235.53, -0.2651, -0.0466, 0.0018, -0.0003, 0.2521}, // strong barrel
        {640, 480, 900, 905, 319.5, 239.5, 0.1, -0.05, 0, 0, 0},
    };
    for (int l = 0; l < 2; l++) {
        alb_camera camera =
            alb_camera_look_at((alb_vector){30, -80, 200}, (alb_vector){1, 2, 0}, (alb_vector){0, 1, 0}, 40, 640, 480);
        camera.lens = lenses[l];
        for (int v = 0; v < 480; v += 17)
            for (int u = 0; u < 640; u += 17) {
                alb_vector o, d;
                double u2, v2;
                assert_true(alb_camera_ray(&o, &d, &camera, u, v));
                assert_true(alb_camera_project(&u2, &v2, &camera, alb_add(o, alb_times(150, d))));
                check_near(u2, u, 1e-8);
                check_near(v2, v, 1e-8);
            }
    }
    // Where the polynomial has turned over there is no direction.
    const alb_lens turned = {640, 480, 200, 200, 320, 240, -0.5, 0, 0, 0, 0};
    alb_vector d;
    assert_false(alb_lens_direction(&d, &turned, 0, 0));
}

// The areas of all pixels on the plane add up to the area of the picture's outline there.
static void pixel_areas_add_up(void **state)
{
    (void)state;
    const alb_camera camera =
        alb_camera_look_at((alb_vector){40, 10, 120}, (alb_vector){0, 0, 0}, (alb_vector){0, 1, 0}, 25, 160, 120);
    double sum = 0, x[4], y[4], shoelace = 0;
    for (int v = 0; v < 120; v++)
        for (int u = 0; u < 160; u++) {
            double px, py, area;
            assert_true(alb_camera_on_plane(&px, &py, &area, &camera, 0, u, v));
            sum += area;
        }
    const double corners[4][2] = {{-0.5, -0.5}, {159.5, -0.5}, {159.5, 119.5}, {-0.5, 119.5}};
    for (int i = 0; i < 4; i++)
        assert_true(alb_camera_on_plane(&x[i], &y[i], NULL, &camera, 0, corners[i][0], corners[i][1]));
    for (int i = 0; i < 4; i++)
        shoelace += (x[i] * y[(i + 1) % 4] - x[(i + 1) % 4] * y[i]) / 2;
    check_relative(sum, fabs(shoelace), 1e-5); // the pixel's quadrilateral is taken to second order in its size
}

// The corners of a box in the order of their bits, x highest; neighbours along x of a fine grid alike but for it.
static void morton_curve_takes_bits_in_turns(void **state)
{
    (void)state;
    alb_vector corners[8];
    for (int k = 0; k < 8; k++)
        corners[k] = (alb_vector){3 + (k >> 2), -2 + 0.5 * (k >> 1 & 1), 0.25 * (k & 1)};
    const alb_morton box = alb_morton_of(corners, 8), none = alb_morton_of(corners, 1);
    const alb_morton cube = {{0, 0, 0}, 1};
    assert_int_equal(alb_morton_place(&none, corners[0], 21), 0);
    for (int k = 0; k < 8; k++) { // the box's longest side is x's: y ends at its half, z at its quarter
        const uint64_t along = (k >> 2 ? 0444 : 0) | (k >> 1 & 1 ? 0200 : 0) | (k & 1 ? 0010 : 0);
        assert_int_equal(alb_morton_place(&box, corners[k], 3), along);
        assert_int_equal(alb_morton_place(&cube, (alb_vector){k >> 2, k >> 1 & 1, k & 1}, 1), k);
    }
    assert_int_equal(alb_morton_place(&cube, (alb_vector){1, 1, 1}, 21), (UINT64_C(1) << 63) - 1);
}

// Exact for the monomials of degree 2 n - 1 and below, asked for by many threads at once, the first time and again.
static void gauss_nodes_are_exact_for_every_thread(void **state)
{
    (void)state;
    static double worst[4][65];
#pragma omp parallel for schedule(dynamic, 1) collapse(2)
    for (int time = 0; time < 4; time++)
        for (int n = 1; n <= 64; n++) {
            double node[64], weight[64];
            alb_quadrature_gauss(node, weight, n, 0, 2);
            for (int degree = 0; degree < 2 * n; degree++) {
                double sum = 0;
                for (int i = 0; i < n; i++)
                    sum += weight[i] * pow(node[i] / 2, degree);
                worst[time][n] = fmax(worst[time][n], fabs(sum * (degree + 1) / 2 - 1));
            }
        }
    for (int time = 0; time < 4; time++)
        for (int n = 1; n <= 64; n++) {
            check_below(worst[time][n], 1e-11); // the roots round to 1e-16, and weights at the ends amplify that
            assert_true(worst[time][n] == worst[0][n]);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(morton_curve_takes_bits_in_turns),
        cmocka_unit_test(gauss_nodes_are_exact_for_every_thread),
        cmocka_unit_test(random_moments),
        cmocka_unit_test(poisson_distribution),
        cmocka_unit_test(chi_square_values),
        cmocka_unit_test(camera_inverts_its_distortion),
        cmocka_unit_test(pixel_areas_add_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
