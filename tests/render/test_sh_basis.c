// The basis against Rodrigues' formula in long double, its laws, and other people's conventions.
#include "sh_truth.h"
#include <omp.h>

static alb_vector direction_of(uint64_t k)
{
    static const alb_vector axes[] = {{0, 0, 1}, {0, 0, -1}, {1, 0, 0}, {0, -1, 0}, {1e-6, 0, 1}, {0, 1e-3, -1}};
    alb_random random = alb_random_at(1, 2, k);
    return k < sizeof axes / sizeof *axes ? alb_unit(axes[k]) : random_direction(&random);
}

static void values_and_sums(void **state)
{
    (void)state;
    for (int order = 1; order <= 12; order++)
        for (uint64_t k = 0; k < 40; k++) {
            const alb_vector d = direction_of(k);
            double values[144], c[144];
            alb_random random = alb_random_at(3, (uint64_t)order, k);
            alb_sh_evaluate(values, order, d);
            random_coefficients(c, order, &random);
            for (int l = 0; l < order; l++)
                for (int m = -l; m <= l; m++)
                    check_near(values[alb_sh_index(l, m)],
                               (double)truth_y(l, m, (long double)d.x, (long double)d.y, (long double)d.z), 1e-13);
            check_near(alb_sh_value(c, order, d), truth_sum(c, order, d), 1e-13);
        }
}

// In single precision; the directions are rounded first.
static void values_in_batches(void **state)
{
    (void)state;
    enum { COUNT = 200 };
    for (int order = 1; order <= ALB_SH_ORDER_MAX; order++) {
        float directions[3 * COUNT], values[ALB_SH_COUNT_MAX * COUNT];
        for (int k = 0; k < COUNT; k++) {
            const alb_vector d = direction_of((uint64_t)k);
            directions[k] = (float)d.x, directions[COUNT + k] = (float)d.y, directions[2 * COUNT + k] = (float)d.z;
        }
        alb_sh_evaluate_batch(values, order, directions, COUNT, COUNT);
        for (int k = 0; k < COUNT; k++)
            for (int l = 0; l < order; l++)
                for (int m = -l; m <= l; m++)
                    check_near((double)values[alb_sh_index(l, m) * COUNT + k],
                               (double)truth_y(l, m, (long double)directions[k], (long double)directions[COUNT + k],
                                               (long double)directions[2 * COUNT + k]),
                               3e-6);
    }
}

static double value_of(const void *context, alb_vector d)
{
    double values[81];
    alb_sh_evaluate(values, 9, d);
    return values[*(const int *)context];
}

static void orthonormal(void **state)
{
    (void)state;
    for (int i = 0; i < 81; i++) {
        double c[81];
        truth_project(c, 9, 18, value_of, &i);
        for (int j = 0; j < 81; j++)
            check_near(c[j], i == j, 1e-12);
    }
}

// sum over m of Y_lm(a) Y_lm(b) = (2l + 1) / 4 pi P_l(a . b): far beyond the orders in use.
static void addition_theorem(void **state)
{
    (void)state;
    enum { ORDER = 200 };
    static double a[ORDER * ORDER], b[ORDER * ORDER];
    for (uint64_t k = 0; k < 8; k++) {
        const alb_vector u = direction_of(k), v = direction_of(k + 50);
        alb_sh_evaluate(a, ORDER, u);
        alb_sh_evaluate(b, ORDER, v);
        double last = 0, p = 1;
        for (int l = 0; l < ORDER; l++) {
            double product = 0, square = 0;
            for (int m = -l; m <= l; m++) {
                product += a[alb_sh_index(l, m)] * b[alb_sh_index(l, m)];
                square += a[alb_sh_index(l, m)] * a[alb_sh_index(l, m)];
            }
            check_near(product, (2 * l + 1) / (4 * M_PI) * p, 1e-11);
            check_relative(square, (2 * l + 1) / (4 * M_PI), 1e-11);
            const double after = ((2 * l + 1) * alb_dot(u, v) * p - l * last) / (l + 1);
            last = p, p = after;
        }
    }
}

// K P_l^m of the note: Y at phi = 0, without the sqrt(2).
static void legendre_functions(void **state)
{
    (void)state;
    double p[36];
    for (uint64_t k = 0; k < 30; k++) {
        alb_random random = alb_random_at(4, 4, k);
        const double theta = M_PI * alb_random_uniform(&random);
        alb_sh_legendre(p, 8, cos(theta), sin(theta));
        for (int l = 0; l < 8; l++)
            for (int m = 0; m <= l; m++)
                check_near(p[l * (l + 1) / 2 + m],
                           (double)truth_y(l, m, sinl((long double)theta), 0, cosl((long double)theta)) /
                               (m ? M_SQRT2 : 1),
                           1e-13);
    }
}

// Five points along the great circle, h = 1e-3: their error is h^4 l^5 / 30 times the value, 4e-9 of it at l = 10.
static void derivatives(void **state)
{
    (void)state;
    const int order = 11;
    for (uint64_t k = 0; k < 60; k++) {
        const alb_vector d = direction_of(k);
        const double length = 0.5 + (double)(k % 3);
        const alb_vector t = alb_times(length, alb_unit(alb_cross(d, direction_of(k + 77))));
        double slope[121];
        alb_sh_differentiate(slope, order, d, t);
        for (int l = 0; l < order; l++)
            for (int m = -l; m <= l; m++) {
                long double y[5];
                for (int i = 0; i < 5; i++) {
                    const long double a = 1e-3L * (i - 2), c = cosl(a), s = sinl(a) / (long double)length;
                    y[i] = truth_y(l, m, c * (long double)d.x + s * (long double)t.x,
                                   c * (long double)d.y + s * (long double)t.y,
                                   c * (long double)d.z + s * (long double)t.z);
                }
                const double found = (double)((y[0] - 8 * y[1] + 8 * y[3] - y[4]) / 12e-3L) * length;
                check_near(slope[alb_sh_index(l, m)], found, 2e-8);
            }
    }
}

// F25: order and degree, the phase, phi and theta, visibility and occlusion, by values a reader can check by hand.
static void names_and_conventions(void **state)
{
    (void)state;
    const double x = 0.36, y = 0.48, z = 0.8, unit = sqrt(1 / (4 * M_PI));
    const double first_nine[9] = {1,
                                  sqrt(3) * y,
                                  sqrt(3) * z,
                                  sqrt(3) * x,
                                  sqrt(15) * x * y,
                                  sqrt(15) * y * z,
                                  sqrt(5) / 2 * (3 * z * z - 1),
                                  sqrt(15) * x * z,
                                  sqrt(15) / 2 * (x * x - y * y)};
    double values[9], turned[9];
    alb_sh_evaluate(values, 3, (alb_vector){x, y, z}); // order 3: highest l is 2
    for (int i = 0; i < 9; i++)
        check_near(values[i], unit * first_nine[i], 1e-15);
    // DirectXMath and google print -.4886 y, .4886 z, -.4886 x, 1.0925 xy, -1.0925 yz
    memcpy(turned, values, sizeof turned);
    alb_sh_condon_shortley(turned, 3);
    const double theirs[5] = {-0.488603 * y, 0.488603 * z, -0.488603 * x, 1.092548 * x * y, -1.092548 * y * z};
    for (int i = 0; i < 5; i++)
        check_near(turned[i + 1], theirs[i], 1e-6);
    alb_sh_condon_shortley(turned, 3);
    assert_memory_equal(turned, values, sizeof values);
    // fully visible is no occlusion, and back
    double seen[9] = {sqrt(4 * M_PI)};
    check_near(alb_sh_value(seen, 3, (alb_vector){x, y, z}), 1, 1e-15);
    alb_sh_complement(seen, 3);
    for (int i = 0; i < 9; i++)
        check_near(seen[i], 0, 1e-15);
    alb_sh_complement(values, 3);
    alb_sh_complement(values, 3);
    for (int i = 0; i < 9; i++)
        check_near(values[i], unit * first_nine[i], 1e-15);
}

// F26: one after the other, in batches of any size, by any number of threads: the same bytes.
static void batches_and_threads(void **state)
{
    (void)state;
    enum { COUNT = 101, ORDER = 8 };
    float directions[3 * COUNT], whole[64 * COUNT], cut[64 * COUNT];
    for (int k = 0; k < COUNT; k++) {
        const alb_vector d = direction_of((uint64_t)k);
        directions[k] = (float)d.x, directions[COUNT + k] = (float)d.y, directions[2 * COUNT + k] = (float)d.z;
    }
    alb_sh_evaluate_batch(whole, ORDER, directions, COUNT, COUNT);
    for (int size = 1; size <= 33; size++)
        for (int threads = 1; threads <= 3; threads++) {
            memset(cut, 0, sizeof cut);
#pragma omp parallel for num_threads(threads)
            for (int k = 0; k < COUNT; k += size)
                alb_sh_evaluate_batch(cut + k, ORDER, directions + k, COUNT,
                                      (size_t)(k + size < COUNT ? size : COUNT - k));
            assert_memory_equal(cut, whole, sizeof whole);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_and_sums),       cmocka_unit_test(values_in_batches),   cmocka_unit_test(orthonormal),
        cmocka_unit_test(addition_theorem),      cmocka_unit_test(legendre_functions),  cmocka_unit_test(derivatives),
        cmocka_unit_test(names_and_conventions), cmocka_unit_test(batches_and_threads),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
