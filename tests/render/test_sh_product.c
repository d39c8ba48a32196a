// Products against the product of the functions, projected by another rule, and what cutting after each one costs.
#include "render/sh_product.h"
#include "sh_truth.h"
#include <omp.h>

typedef struct factors {
    const double *coefficients; // one function after the other
    int order, count;
} factors;

static double multiplied(const void *context, alb_vector d)
{
    const factors *f = context;
    double product = 1;
    for (int k = 0; k < f->count; k++)
        product *= truth_sum(f->coefficients + k * f->order * f->order, f->order, d);
    return product;
}

static void product_of(double *out, int out_order, const double *c, int order, int count)
{
    alb_error error = {0};
    check_ok(alb_sh_product(out, out_order, c, order, (size_t)count, &error), &error);
}

static void exact_products(void **state)
{
    (void)state;
    for (int order = 1; order <= ALB_SH_ORDER_MAX; order++)
        for (int count = 0; count < 4; count++) {
            double c[3 * 64], expected[100], found[100];
            const int out_order = count == 2 ? order : order + count % 3;
            alb_random random = alb_random_at(1, (uint64_t)order, (uint64_t)count);
            for (int k = 0; k < count; k++)
                random_coefficients(c + k * order * order, order, &random);
            const factors f = {c, order, count};
            truth_project(expected, out_order, count * (order - 1) + out_order, multiplied, &f);
            product_of(found, out_order, c, order, count);
            for (int i = 0; i < out_order * out_order; i++)
                check_near(found[i], expected[i], 1e-12);
        }
}

static void too_many_factors(void **state)
{
    (void)state;
    static double c[200 * 16];
    double out[16] = {7};
    alb_error error = {0};
    check_fails(alb_sh_product(out, 4, c, 4, 200, &error), &error, ALB_BAD_DATA, "200 functions");
    check_near(out[0], 7, 0);
    check_fails(alb_sh_product(out, 4, c, 4, SIZE_MAX, &error), &error, ALB_BAD_DATA, "at most 126");
    check_fails(alb_sh_product(out, 4, c, 4, 42, &error), &error, ALB_BAD_DATA, "at most degree 123");
    // what just fits: the constant one, 41 times
    for (int k = 0; k < 41; k++)
        c[16 * k] = sqrt(4 * M_PI);
    product_of(out, 4, c, 4, 41);
    for (int i = 0; i < 16; i++)
        check_near(out[i], i ? 0 : sqrt(4 * M_PI), 1e-12);
}

enum { COUNT = 69 };

static void fill(float *batch, int order, uint64_t seed)
{
    double c[64];
    for (int k = 0; k < COUNT; k++) {
        alb_random random = alb_random_at(seed, (uint64_t)order, (uint64_t)k);
        random_coefficients(c, order, &random);
        for (int i = 0; i < order * order; i++)
            batch[i * COUNT + k] = (float)c[i];
    }
}

static void products_of_two(void **state)
{
    (void)state;
    for (int order = 1; order <= ALB_SH_ORDER_MAX; order++) {
        static float a[64 * COUNT], b[64 * COUNT], out[64 * COUNT], turned[64 * COUNT], dots[COUNT];
        fill(a, order, 2);
        fill(b, order, 3);
        alb_sh_product_batch(out, a, b, order, COUNT, COUNT);
        alb_sh_dot_batch(dots, a, b, order, COUNT, COUNT);
        for (int k = 0; k < COUNT; k += 17) {
            double c[128], expected[64];
            for (int i = 0; i < order * order; i++) {
                c[i] = (double)a[i * COUNT + k];
                c[order * order + i] = (double)b[i * COUNT + k];
            }
            const factors f = {c, order, 2};
            truth_project(expected, order, 3 * order - 2, multiplied, &f);
            for (int i = 0; i < order * order; i++)
                check_near((double)out[i * COUNT + k], expected[i], 3e-6);
            // the integral of the product is sqrt(4 pi) times its first coefficient
            check_near((double)dots[k], sqrt(4 * M_PI) * expected[0], 3e-6);
            check_near(alb_sh_dot(c, c + order * order, order), sqrt(4 * M_PI) * expected[0], 1e-12);
        }
        alb_sh_product_batch(turned, b, a, order, COUNT, COUNT);
        assert_memory_equal(turned, out, (size_t)(order * order * COUNT) * sizeof *out);
        alb_sh_product_batch(a, a, b, order, COUNT, COUNT);
        assert_memory_equal(a, out, (size_t)(order * order * COUNT) * sizeof *out);
    }
}

// Visibility beside a cap of the angular radius about the axis: 1 less its coefficients, by the closed form of zonal
// integrals in the polynomials of Rodrigues.
static void visible_beside_cap(double *c, int order, alb_vector axis, double radius)
{
    double legendre[10];
    for (int l = 0; l < 10; l++)
        legendre[l] = (double)truth_legendre(l, 0, cosl((long double)radius));
    for (int l = 0; l < order; l++) {
        const double band = 2 * M_PI * (l ? (legendre[l - 1] - legendre[l + 1]) / (2 * l + 1) : 1 - cos(radius));
        for (int m = -l; m <= l; m++)
            c[alb_sh_index(l, m)] =
                (l ? 0 : sqrt(4 * M_PI)) -
                band * (double)truth_y(l, m, (long double)axis.x, (long double)axis.y, (long double)axis.z);
    }
}

static double rms(const double *a, const double *b, int count)
{
    double sum = 0;
    for (int i = 0; i < count; i++)
        sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sqrt(sum / (4 * M_PI));
}

enum { CAPS = 8 };

// Caps as the chain is measured with: a mean of 0.73 to 0.83 left visible by each.
static void random_caps(double *c, int order, alb_vector *axes, double *radii, uint64_t scene)
{
    alb_random random = alb_random_at(4, 4, scene);
    for (int k = 0; k < CAPS; k++) {
        axes[k] = random_direction(&random);
        radii[k] = acos(2 * (0.73 + 0.1 * alb_random_uniform(&random)) - 1);
        visible_beside_cap(c + k * order * order, order, axes[k], radii[k]);
    }
}

// Cut after each, in the given order, as a renderer does.
static void chain(double *out, const double *c, int order, const int *in_order)
{
    float a[64], b[64];
    for (int i = 0; i < order * order; i++)
        a[i] = (float)c[in_order[0] * order * order + i];
    for (int k = 1; k < CAPS; k++) {
        for (int i = 0; i < order * order; i++)
            b[i] = (float)c[in_order[k] * order * order + i];
        alb_sh_product_batch(a, a, b, order, 1, 1);
    }
    for (int i = 0; i < order * order; i++)
        out[i] = (double)a[i];
}

typedef struct caps {
    const alb_vector *axes;
    const double *radii;
} caps;

static double visible(const void *context, alb_vector d)
{
    const caps *c = context;
    for (int k = 0; k < CAPS; k++)
        if (alb_dot(d, c->axes[k]) > cos(c->radii[k]))
            return 0;
    return 1;
}

static void mean_errors(double *chained_rms, double *exact_rms, int order)
{
    static const int forwards[CAPS] = {0, 1, 2, 3, 4, 5, 6, 7};
    enum { SCENES = 12 };
    double cut = 0, whole = 0;
    for (uint64_t scene = 0; scene < SCENES; scene++) {
        double c[64 * CAPS], radii[CAPS], chained[64], exact[16], truth[16];
        alb_vector axes[CAPS];
        random_caps(c, order, axes, radii, scene);
        chain(chained, c, order, forwards);
        product_of(exact, 4, c, order, CAPS);
        const caps context = {axes, radii};
        truth_project(truth, 4, 128, visible, &context);
        cut += pow(rms(chained, truth, 16), 2) / SCENES, whole += pow(rms(exact, truth, 16), 2) / SCENES;
    }
    *chained_rms = sqrt(cut), *exact_rms = sqrt(whole);
}

// F14: eight caps in turn; the truth is the visibility itself at 128 x 128 directions (its own error is below 0.003).
// Not the chain loses most but the order of its factors: exact products of order 4 are little better than a chain,
// factors of order 6 bring either below a third of the 0.062 that the chain of order 4 is known for.
static void triple_product_drift(void **state)
{
    (void)state;
    double chained[9], exact[9];
    for (int order = 4; order <= 8; order++)
        mean_errors(&chained[order], &exact[order], order);
    check_near(chained[4], 0.062, 0.006); // the published figure, of other random caps
    check_below(exact[4], chained[4]);
    check_below(exact[6], 0.062 / 3);
    check_below(chained[6], 0.062 / 3);
    check_below(exact[8], exact[6]);
    check_below(chained[8], chained[6]);
}

// F15: cut products are commutative to the byte but not associative: another order of multiplication is off by as much
// as the cut itself. The exact product does not know an order.
static void order_of_multiplication(void **state)
{
    (void)state;
    static const int forwards[CAPS] = {0, 1, 2, 3, 4, 5, 6, 7}, backwards[CAPS] = {7, 6, 5, 4, 3, 2, 1, 0},
                     swapped[CAPS] = {1, 0, 2, 3, 4, 5, 6, 7};
    double spread = 0;
    for (uint64_t scene = 0; scene < 20; scene++) {
        double c[16 * CAPS], turned[16 * CAPS], radii[CAPS], one[16], other[16], exact[16], exact_turned[16];
        alb_vector axes[CAPS];
        random_caps(c, 4, axes, radii, scene);
        chain(one, c, 4, forwards);
        chain(other, c, 4, swapped);
        assert_memory_equal(one, other, sizeof one);
        chain(other, c, 4, backwards);
        spread += pow(rms(one, other, 16), 2) / 20;
        for (int k = 0; k < CAPS; k++)
            memcpy(turned + 16 * k, c + 16 * (CAPS - 1 - k), 16 * sizeof *c);
        product_of(exact, 4, c, 4, CAPS);
        product_of(exact_turned, 4, turned, 4, CAPS);
        for (int i = 0; i < 16; i++)
            check_near(exact_turned[i], exact[i], 1e-13);
    }
    check_below(sqrt(spread), 0.05); // measured: 0.040, beside errors of 0.065
    check_below(0.01, sqrt(spread));
}

// F26 of products.
static void batches_and_threads(void **state)
{
    (void)state;
    for (int order = 1; order <= ALB_SH_ORDER_MAX; order++) {
        static float a[64 * COUNT], b[64 * COUNT], whole[64 * COUNT], cut[64 * COUNT], dots[COUNT], dots_cut[COUNT];
        fill(a, order, 7);
        fill(b, order, 8);
        alb_sh_product_batch(whole, a, b, order, COUNT, COUNT);
        alb_sh_dot_batch(dots, a, b, order, COUNT, COUNT);
        for (int size = 1; size <= 41; size += 8)
            for (int threads = 1; threads <= 2; threads++) {
                memset(cut, 0, sizeof cut);
#pragma omp parallel for num_threads(threads)
                for (int k = 0; k < COUNT; k += size) {
                    const size_t items = (size_t)(k + size < COUNT ? size : COUNT - k);
                    alb_sh_product_batch(cut + k, a + k, b + k, order, COUNT, items);
                    alb_sh_dot_batch(dots_cut + k, a + k, b + k, order, COUNT, items);
                }
                assert_memory_equal(cut, whole, (size_t)(order * order * COUNT) * sizeof *whole);
                assert_memory_equal(dots_cut, dots, sizeof dots);
            }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(exact_products),          cmocka_unit_test(too_many_factors),
        cmocka_unit_test(products_of_two),         cmocka_unit_test(triple_product_drift),
        cmocka_unit_test(order_of_multiplication), cmocka_unit_test(batches_and_threads),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
