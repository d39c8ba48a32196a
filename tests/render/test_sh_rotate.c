// Rotations against the basis itself: the coefficients of f(R^-1 d) are those whose sum at d is f's sum at R^-1 d.
#include "render/sh_rotate.h"
#include "sh_truth.h"
#include <omp.h>

typedef double matrix[3][3];

static alb_vector turned(const matrix r, alb_vector d)
{
    return (alb_vector){r[0][0] * d.x + r[0][1] * d.y + r[0][2] * d.z, r[1][0] * d.x + r[1][1] * d.y + r[1][2] * d.z,
                        r[2][0] * d.x + r[2][1] * d.y + r[2][2] * d.z};
}

static void from_quaternion(matrix r, const double q[4])
{
    const double n = 2 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), x = q[0], y = q[1], z = q[2],
                 w = q[3];
    const matrix made = {{1 - n * (y * y + z * z), n * (x * y - z * w), n * (x * z + y * w)},
                         {n * (x * y + z * w), 1 - n * (x * x + z * z), n * (y * z - x * w)},
                         {n * (x * z - y * w), n * (y * z + x * w), 1 - n * (x * x + y * y)}};
    memcpy(r, made, sizeof made);
}

static void transpose(matrix t, const matrix r)
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            t[i][j] = r[j][i];
}

// The largest difference over directions of two sums, one read at R d: unit coefficients, so of their norm.
static double difference(const double *after, const double *before, int order, const matrix r)
{
    double worst = 0;
    for (uint64_t k = 0; k < 40; k++) {
        alb_random random = alb_random_at(5, 1, k);
        const alb_vector d = random_direction(&random);
        worst = fmax(worst, fabs(truth_sum(after, order, turned(r, d)) - truth_sum(before, order, d)));
    }
    return worst;
}

static void any_rotation(void **state)
{
    (void)state;
    for (int order = 1; order <= 10; order++)
        for (uint64_t k = 0; k < 20; k++) {
            alb_random random = alb_random_at(6, (uint64_t)order, k);
            double q[4], c[100], out[100];
            for (int i = 0; i < 4; i++)
                q[i] = alb_random_normal(&random) * (i < 2 && k % 3 == 0 ? 1e-5 : 1) * (i > 1 && k % 3 == 1 ? 1e-5 : 1);
            matrix r;
            from_quaternion(r, q);
            random_coefficients(c, order, &random);
            alb_sh_rotate(out, c, order, (const double(*)[3])r);
            // values reach order / sqrt(4 pi) times the norm
            assert_true(difference(out, c, order, (const double(*)[3])r) < 1e-12);
            alb_sh_rotate(c, c, order, (const double(*)[3])r);
            assert_memory_equal(c, out, (size_t)(order * order) * sizeof *c);
        }
}

// R S, one after the other, and lengths kept, at the highest order.
static void composition(void **state)
{
    (void)state;
    enum { ORDER = ALB_SH_ROTATE_MAX };
    static double c[ORDER * ORDER], one[ORDER * ORDER], both[ORDER * ORDER];
    for (uint64_t k = 0; k < 5; k++) {
        alb_random random = alb_random_at(7, 1, k);
        double p[4], q[4];
        for (int i = 0; i < 4; i++)
            p[i] = alb_random_normal(&random), q[i] = alb_random_normal(&random);
        matrix r, s, rs = {{0}};
        from_quaternion(r, p);
        from_quaternion(s, q);
        for (int i = 0; i < 27; i++)
            rs[i / 9][i / 3 % 3] += r[i / 9][i % 3] * s[i % 3][i / 3 % 3];
        random_coefficients(c, ORDER, &random);
        alb_sh_rotate(one, c, ORDER, (const double(*)[3])s);
        alb_sh_rotate(one, one, ORDER, (const double(*)[3])r);
        alb_sh_rotate(both, c, ORDER, (const double(*)[3])rs);
        for (int l = 0; l < ORDER; l++) {
            double before = 0, after = 0;
            for (int i = l * l; i < (l + 1) * (l + 1); i++) {
                check_near(one[i], both[i], 1e-13);
                before += c[i] * c[i], after += both[i] * both[i];
            }
            check_near(after, before, 1e-13);
        }
    }
}

enum { COUNT = 160 };

// A block of every tilt: 0, 1e-7 .. 1, pi less those, pi.
static alb_vector axis_of(int k)
{
    alb_random random = alb_random_at(8, 1, (uint64_t)k);
    const double phi = 2 * M_PI * alb_random_uniform(&random), tilt = k % 10 == 9 ? 0 : pow(10, -(k % 10));
    const double t = k % 3 == 2 ? M_PI * alb_random_uniform(&random) : tilt;
    return (alb_vector){sin(t) * cos(phi), sin(t) * sin(phi), k % 3 == 1 ? -cos(t) : cos(t)};
}

// In single precision as the batch gets it, and then the unit axis of what it gets.
static void make_axes(float *axes, alb_vector *exact)
{
    for (int k = 0; k < COUNT; k++) {
        const alb_vector a = axis_of(k);
        axes[k] = (float)a.x, axes[COUNT + k] = (float)a.y, axes[2 * COUNT + k] = (float)a.z;
        exact[k] = alb_unit((alb_vector){(double)axes[k], (double)axes[COUNT + k], (double)axes[2 * COUNT + k]});
    }
}

static void take_item(double *c, const float *batch, int order, int k)
{
    for (int i = 0; i < order * order; i++)
        c[i] = (double)batch[i * COUNT + k];
}

// F18: DirectXMath loses 3.5e-4 at a tilt of 2e-4 (order 4).
static void axis_at_the_poles(void **state)
{
    (void)state;
    for (int order = 1; order <= ALB_SH_ORDER_MAX; order++) {
        static float axes[3 * COUNT], in[64 * COUNT], to[64 * COUNT], from[64 * COUNT];
        alb_vector exact[COUNT];
        double before[64], after[64];
        make_axes(axes, exact);
        for (int k = 0; k < COUNT; k++) {
            alb_random random = alb_random_at(9, (uint64_t)order, (uint64_t)k);
            random_coefficients(before, order, &random);
            for (int i = 0; i < order * order; i++)
                in[i * COUNT + k] = (float)before[i];
        }
        alb_sh_to_axis_batch(to, in, order, axes, COUNT, COUNT);
        alb_sh_from_axis_batch(from, in, order, axes, COUNT, COUNT);
        for (int k = 0; k < COUNT; k++) {
            matrix world_from_axis, axis_from_world;
            alb_sh_axis_rotation(world_from_axis, exact[k]);
            // a rotation, its third column the axis, its second without z
            check_near(
                alb_length(alb_sub(turned((const double(*)[3])world_from_axis, (alb_vector){0, 0, 1}), exact[k])), 0,
                1e-15);
            check_near(world_from_axis[2][1], 0, 0);
            transpose(axis_from_world, (const double(*)[3])world_from_axis);
            take_item(before, in, order, k);
            take_item(after, to, order, k);
            // of coefficients below 2e-6; sums over a random direction's basis are order / sqrt(4 pi) times that
            const double goal = 2e-6 * fmax(1, order / sqrt(4 * M_PI));
            check_below(difference(after, before, order, (const double(*)[3])axis_from_world), goal);
            take_item(after, from, order, k);
            check_below(difference(after, before, order, (const double(*)[3])world_from_axis), goal);
            double exact_to[64];
            alb_sh_rotate(exact_to, before, order, (const double(*)[3])world_from_axis);
            for (int i = 0; i < order * order; i++)
                check_near(after[i], exact_to[i], 2e-6);
        }
    }
}

// The length of an axis does not matter; one without a direction turns nothing.
static void lengths_of_axes(void **state)
{
    (void)state;
    enum { ITEMS = 3 };
    float axes[3 * ITEMS] = {0.36F, 360, 0, 0.48F, 480, 0, -0.8F, -800, 0}, in[64 * ITEMS], to[64 * ITEMS];
    for (int i = 0; i < 64 * ITEMS; i++)
        in[i] = cosf((float)(i / ITEMS));
    alb_sh_to_axis_batch(to, in, 8, axes, ITEMS, ITEMS);
    for (int i = 0; i < 64; i++) {
        check_near((double)to[ITEMS * i], (double)to[ITEMS * i + 1], 2e-6 * sqrt(32)); // norm of 64 cosines
        check_near((double)to[ITEMS * i + 2], (double)in[ITEMS * i], 2e-6 * sqrt(32));
    }
}

static void quaternions(void **state)
{
    (void)state;
    for (int order = 1; order <= ALB_SH_ORDER_MAX; order++) {
        static float by[4 * COUNT], in[64 * COUNT], out[64 * COUNT];
        double before[64], after[64], exact[64];
        for (int k = 0; k < COUNT; k++) {
            alb_random random = alb_random_at(10, (uint64_t)order, (uint64_t)k);
            random_coefficients(before, order, &random);
            for (int i = 0; i < order * order; i++)
                in[i * COUNT + k] = (float)before[i];
            const double small = pow(10, -(k % 7)); // tilts down to 1e-6 and up to pi less that
            for (int i = 0; i < 4; i++)
                by[i * COUNT + k] = (float)(alb_random_normal(&random) * (i < 2 && k % 3 == 0 ? small : 1) *
                                            (i > 1 && k % 3 == 1 ? small : 1));
            if (k < 2)
                by[k * COUNT + k] = 3, by[(1 - k) * COUNT + k] = by[2 * COUNT + k] = by[3 * COUNT + k] = 0;
        }
        alb_sh_rotate_batch(out, in, order, by, COUNT, COUNT);
        for (int k = 0; k < COUNT; k++) {
            double q[4];
            for (int i = 0; i < 4; i++)
                q[i] = (double)by[i * COUNT + k];
            matrix r;
            from_quaternion(r, q);
            take_item(before, in, order, k);
            take_item(after, out, order, k);
            alb_sh_rotate(exact, before, order, (const double(*)[3])r);
            for (int i = 0; i < order * order; i++)
                check_near(after[i], exact[i], 2e-6);
        }
    }
}

// F26 of rotations, in place too.
static void batches_and_threads(void **state)
{
    (void)state;
    enum { ORDER = 8 };
    static float axes[3 * COUNT], in[64 * COUNT], whole[64 * COUNT], cut[64 * COUNT];
    alb_vector exact[COUNT];
    make_axes(axes, exact);
    for (int i = 0; i < 64 * COUNT; i++)
        in[i] = sinf((float)i);
    for (int order = 1; order <= ORDER; order++) {
        memcpy(whole, in, sizeof in);
        alb_sh_to_axis_batch(whole, in, order, axes, COUNT, COUNT);
        for (int size = 1; size <= 33; size += 4)
            for (int threads = 1; threads <= 3; threads++) {
                memcpy(cut, in, sizeof in);
#pragma omp parallel for num_threads(threads)
                for (int k = 0; k < COUNT; k += size)
                    alb_sh_to_axis_batch(cut + k, cut + k, order, axes + k, COUNT,
                                         (size_t)(k + size < COUNT ? size : COUNT - k));
                assert_memory_equal(cut, whole, sizeof whole);
            }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_rotation),    cmocka_unit_test(composition), cmocka_unit_test(axis_at_the_poles),
        cmocka_unit_test(lengths_of_axes), cmocka_unit_test(quaternions), cmocka_unit_test(batches_and_threads),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
