// Tables of angular scaling, their ends and their knots, and the batch of receivers: against the law itself, and
// schemes against the errors that the theory's note measured for them.
#include "base/random.h"
#include "check.h"
#include "render/sh_scale_batch.h"
#include "render/sh_table.h"

#include <omp.h>

static const alb_sh_law cone = {ALB_SH_LAW_VISIBILITY, ALB_SH_MAP_CONE, 45, 4, 4};
static const alb_sh_law midrange = {ALB_SH_LAW_VISIBILITY, ALB_SH_MAP_MIDRANGE, 0, 4, 4};

static double uniform(alb_random *random, double from, double to)
{
    return from + (to - from) * alb_random_uniform(random);
}

static double difference(const alb_sh_scaling *a, const alb_sh_scaling *b)
{
    double largest = 0;
    for (int i = 0; i < alb_sh_scaling_count(a->order_out, a->order_in); i++)
        largest = fmax(largest, fabs(a->value[i] - b->value[i]));
    return largest;
}

static void cone_tables(void **state)
{
    (void)state;
    enum { COUNT = 21 };
    static float visibility[COUNT * 204], energy[COUNT * 204];
    alb_error error = {0};
    for (int order = 1; order <= 8; order++) {
        alb_random random = alb_random_at(3, 0, (uint64_t)order);
        const double alpha_deg = order == 4 ? 45 : order == 8 ? 10 : order == 7 ? 80 : uniform(&random, 10, 80);
        const int values = alb_sh_scaling_count(order, order);
        double k[COUNT];
        for (int i = 0; i < COUNT; i++)
            k[i] = pow(16, 2. * i / (COUNT - 1) - 1);
        check_ok(alb_sh_table_cone(visibility, energy, k, COUNT, alpha_deg, order, &error), &error);
        for (int i = 0; i < COUNT; i++)
            for (int measure = 0; measure < 2; measure++) {
                alb_sh_map map;
                alb_sh_scaling m;
                check_ok(alb_sh_map_cone(&map, k[i], alpha_deg, &error), &error);
                check_ok(alb_sh_scaling_compute(&m, &map, measure, order, order, &error), &error);
                for (int v = 0; v < values; v++) // 1e-6: what was asked
                    check_near((double)(measure ? energy : visibility)[i * values + v], m.value[v], 1e-6);
            }
    }
    const double wrong[] = {0.5, 20};
    check_fails(alb_sh_table_cone(visibility, energy, wrong, 2, 45, 4, &error), &error, ALB_USAGE, "k[1] = 20");
    check_fails(alb_sh_table_cone(visibility, energy, wrong, 1, 5, 4, &error), &error, ALB_USAGE, "alpha 5");
    check_fails(alb_sh_table_cone(visibility, energy, wrong, 1, 45, 9, &error), &error, ALB_USAGE, "order 9");
}

// Largest error over 400 ratios between the ends.
static double table_error(const alb_sh_law *law, alb_sh_scheme scheme, int knots, double from, double to)
{
    alb_error error = {0};
    alb_sh_table table;
    double largest = 0;
    check_ok(alb_sh_table_create(&table, law, scheme, knots, from, to, &error), &error);
    for (int i = 0; i < 400; i++) {
        const double t = (i + 0.5) / 400, k = from > 0 ? from * pow(to / from, t) : from + t * (to - from);
        alb_sh_scaling exact, stored;
        check_ok(alb_sh_law_at(&exact, law, k, &error), &error);
        check_ok(alb_sh_table_at(&stored, &table, k, &error), &error);
        largest = fmax(largest, difference(&exact, &stored));
    }
    alb_sh_table_free(&table);
    assert_null(table.values);
    return largest;
}

// Within 15 % of the figures of the note, section 5.2, which other people's ratios and float storage may move.
static void scheme_errors(void **state)
{
    (void)state;
    check_relative(table_error(&cone, ALB_SH_SCHEME_LINEAR, 40, 0.25, 8), 5.8e-3, 0.15);
    check_relative(table_error(&cone, ALB_SH_SCHEME_LINEAR, 80, 0.25, 8), 1.4e-3, 0.15);
    check_relative(table_error(&midrange, ALB_SH_SCHEME_LINEAR, 40, -0.95, 0.95), 1e-2, 0.15);
    check_relative(table_error(&cone, ALB_SH_SCHEME_CHEBYSHEV, 16, 0.25, 8), 7.1e-4, 0.3);
    check_below(table_error(&cone, ALB_SH_SCHEME_SPLINE, 40, 0.25, 8), 2.5e-5);
    check_below(table_error(&cone, ALB_SH_SCHEME_CHEBYSHEV, 24, 0.25, 8), 3e-6);
    check_below(table_error(&midrange, ALB_SH_SCHEME_CHEBYSHEV, 24, -0.95, 0.95), 1e-5);
    check_below(table_error(&cone, ALB_SH_SCHEME_DIRECT, 0, 0.25, 8), 1e-300);
}

// F9: k outside the table, at its ends and at its knots: never extrapolated, the law itself.
static void table_ends(void **state)
{
    (void)state;
    alb_error error = {0};
    for (int scheme = 0; scheme < ALB_SH_SCHEMES; scheme++) {
        alb_sh_table table;
        alb_sh_scaling stored, exact, beside;
        check_ok(alb_sh_table_create(&table, &cone, scheme, 40, 0.25, 8, &error), &error);
        const double far[] = {0, 1e-6, 0.2499, 8.001, 100, 1e9, INFINITY};
        for (size_t i = 0; i < sizeof far / sizeof *far; i++) {
            check_ok(alb_sh_table_at(&stored, &table, far[i], &error), &error);
            check_ok(alb_sh_law_at(&exact, &cone, far[i], &error), &error);
            check_near(difference(&stored, &exact), 0, 0);
        }
        for (int knot = 0; knot < 40; knot++) { // continuous, and exact at the knots of two schemes
            const double k = fmin(0.25 * pow(32, knot / 39.), 8);
            check_ok(alb_sh_law_at(&exact, &cone, k, &error), &error);
            check_ok(alb_sh_table_at(&stored, &table, k, &error), &error);
            check_near(difference(&stored, &exact), 0, 3e-7); // stored in single precision, Chebyshev's 40 terms summed
            check_ok(alb_sh_table_at(&beside, &table, k * (1 + 1e-9), &error), &error);
            check_near(difference(&stored, &beside), 0, 4e-7);
        }
        check_fails(alb_sh_table_at(&stored, &table, -1, &error), &error, ALB_USAGE, "k = -1");
        check_fails(alb_sh_table_at(&stored, &table, NAN, &error), &error, ALB_USAGE, "k = nan");
        alb_sh_table_free(&table);
    }
    alb_sh_table table;
    check_fails(alb_sh_table_create(&table, &cone, ALB_SH_SCHEME_SPLINE, 3, 0.25, 8, &error), &error, ALB_USAGE,
                "3 knots");
    check_fails(alb_sh_table_create(&table, &cone, ALB_SH_SCHEME_LINEAR, 40, 8, 0.25, &error), &error, ALB_USAGE,
                "rising");
    check_fails(alb_sh_table_create(&table, &midrange, ALB_SH_SCHEME_LINEAR, 40, -1, 0.5, &error), &error, ALB_USAGE,
                "between -1 and 1");
}

enum { RECEIVERS = 203, STRIDE = 208 };

typedef struct receivers {
    float k[RECEIVERS], in[64 * STRIDE], out[64 * STRIDE];
} receivers;

static receivers random_receivers(bool inside)
{
    receivers all = {0};
    const float special[] = {0, 1, 1e-6f, 0.999999f, 1.000001f, 1.3f, 1e6f, INFINITY, 4, 0.25f};
    for (int r = 0; r < RECEIVERS; r++) {
        alb_random random = alb_random_at(9, 0, (uint64_t)r);
        all.k[r] = inside   ? (float)uniform(&random, -0.95, 0.95)
                   : r < 10 ? special[r]
                            : (float)exp(uniform(&random, -4, 6));
        for (int i = 0; i < 64; i++)
            all.in[i * STRIDE + r] = (float)uniform(&random, -1, 1);
    }
    return all;
}

// max |out - M in| over the receivers, M of the law.
static double batch_error(const alb_sh_law *law, int cells)
{
    alb_error error = {0};
    alb_sh_batch batch;
    static receivers all;
    double largest = 0;
    all = random_receivers(law->map == ALB_SH_MAP_MIDRANGE);
    check_ok(alb_sh_batch_create(&batch, law, cells, &error), &error);
    alb_sh_batch_apply(all.out, &batch, false, all.k, all.in, STRIDE, RECEIVERS);
    for (int r = 0; r < RECEIVERS; r++) {
        alb_sh_scaling m;
        double in[64], out[64];
        check_ok(alb_sh_law_at(&m, law, (double)all.k[r], &error), &error);
        for (int i = 0; i < law->order_in * law->order_in; i++)
            in[i] = (double)all.in[i * STRIDE + r];
        alb_sh_scaling_apply(out, &m, in);
        for (int i = 0; i < law->order_out * law->order_out; i++)
            largest = fmax(largest, fabs(out[i] - (double)all.out[i * STRIDE + r]));
    }
    alb_sh_batch_free(&batch);
    return largest;
}

// Linear interpolation: four times the cells, a sixteenth of the error; in are up to 4 (8) coefficients of up to 1.
static void batches(void **state)
{
    (void)state;
    const alb_sh_law laws[] = {cone,
                               {ALB_SH_LAW_LIGHT, ALB_SH_MAP_CONE, 45, 4, 4},
                               {ALB_SH_LAW_OCCLUSION, ALB_SH_MAP_CONE, 45, 4, 8},
                               {ALB_SH_LAW_OCCLUSION, ALB_SH_MAP_SPHERE, 0, 3, 5},
                               {ALB_SH_LAW_ENERGY, ALB_SH_MAP_CONE, 60, 8, 8},
                               {ALB_SH_LAW_ENERGY, ALB_SH_MAP_CONE, 60, 5, 3},
                               {ALB_SH_LAW_REGRESSED, ALB_SH_MAP_CONE, 45, 4, 4},
                               midrange};
    for (size_t i = 0; i < sizeof laws / sizeof *laws; i++) {
        const double coarse = batch_error(&laws[i], 64), fine = batch_error(&laws[i], 256);
        check_below(coarse, 0.15);
        // the sphere's outline is at asin(1/k): a square root begins at k = 1, no interpolation is good there
        check_below(fine, laws[i].map == ALB_SH_MAP_SPHERE ? 0.05 : coarse / 5);
    }
}

// A knot of the table is the law in single precision: 3e-6 over up to 8 terms of size 1.
static void single_precision(void **state)
{
    (void)state;
    alb_error error = {0};
    const alb_sh_law law = {ALB_SH_LAW_OCCLUSION, ALB_SH_MAP_CONE, 45, 8, 8};
    alb_sh_batch batch;
    check_ok(alb_sh_batch_create(&batch, &law, 64, &error), &error);
    static float in[64 * STRIDE], out[64 * STRIDE], k[65];
    for (int r = 0; r < 64; r++)
        k[r] = (float)(1 + r / 32. - 1) / (float)(1 - (r / 32. - 1));
    for (int i = 0; i < 64; i++)
        for (int r = 0; r < 64; r++)
            in[i * STRIDE + r] = (float)sin(i + 7 * r);
    alb_sh_batch_apply(out, &batch, false, k, in, STRIDE, 64);
    for (int r = 0; r < 64; r++) {
        alb_sh_scaling m;
        double from[64], to[64];
        const double exact = fmax(r / 32. / (2 - r / 32.), 1e-5);
        check_ok(alb_sh_law_at(&m, &law, exact, &error), &error);
        for (int i = 0; i < 64; i++)
            from[i] = (double)in[i * STRIDE + r];
        alb_sh_scaling_apply(to, &m, from);
        for (int i = 0; i < 64; i++)
            check_near((double)out[i * STRIDE + r], to[i], 3e-6);
    }
    alb_sh_batch_free(&batch);
}

// The same bytes wherever the batch is cut and whoever applies it; what is behind `count` stays.
static void batches_and_threads(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_sh_batch batch;
    static receivers all, cut;
    all = random_receivers(false), cut = all;
    check_ok(alb_sh_batch_create(&batch, &cone, 64, &error), &error);
    alb_sh_batch_apply(all.out, &batch, false, all.k, all.in, STRIDE, RECEIVERS);
    for (size_t size = 1; size <= 19; size += 3) {
        memset(cut.out, 0, sizeof cut.out);
#pragma omp parallel for num_threads(2)
        for (size_t first = 0; first < RECEIVERS; first += size)
            alb_sh_batch_apply(cut.out + first, &batch, false, cut.k + first, cut.in + first, STRIDE,
                               size < RECEIVERS - first ? size : RECEIVERS - first);
        assert_memory_equal(all.out, cut.out, sizeof all.out);
    }
    alb_sh_batch_free(&batch);
}

// <M a, b> = <a, M^T b>. 1e-5: up to 64 terms in single precision.
static void transposed_batches(void **state)
{
    (void)state;
    alb_error error = {0};
    const alb_sh_law laws[] = {
        cone, {ALB_SH_LAW_OCCLUSION, ALB_SH_MAP_CONE, 45, 4, 8}, {ALB_SH_LAW_LIGHT, ALB_SH_MAP_CONE, 30, 6, 3}};
    static receivers a, b;
    a = random_receivers(false), b = random_receivers(false);
    for (int i = 0; i < 64 * STRIDE; i++)
        b.in[i] = a.in[(i + 31) % (64 * STRIDE)];
    for (size_t n = 0; n < sizeof laws / sizeof *laws; n++) {
        alb_sh_batch batch;
        check_ok(alb_sh_batch_create(&batch, &laws[n], 64, &error), &error);
        alb_sh_batch_apply(a.out, &batch, false, a.k, a.in, STRIDE, RECEIVERS);
        alb_sh_batch_apply(b.out, &batch, true, a.k, b.in, STRIDE, RECEIVERS);
        for (int r = 0; r < RECEIVERS; r++) {
            double forth = 0, back = 0;
            for (int i = 0; i < laws[n].order_out * laws[n].order_out; i++)
                forth += (double)a.out[i * STRIDE + r] * (double)b.in[i * STRIDE + r];
            for (int i = 0; i < laws[n].order_in * laws[n].order_in; i++)
                back += (double)b.out[i * STRIDE + r] * (double)a.in[i * STRIDE + r];
            check_near(forth, back, 1e-5);
        }
        alb_sh_batch_free(&batch);
    }
}

static void batch_limits(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_sh_batch batch;
    check_fails(alb_sh_batch_create(&batch, &cone, 7, &error), &error, ALB_USAGE, "7 cells");
    assert_null(batch.rows);
    const alb_sh_law large = {ALB_SH_LAW_VISIBILITY, ALB_SH_MAP_CONE, 45, 4, 9},
                     steep = {ALB_SH_LAW_VISIBILITY, ALB_SH_MAP_CONE, 90, 4, 4};
    check_fails(alb_sh_batch_create(&batch, &large, 64, &error), &error, ALB_USAGE, "order 9");
    check_fails(alb_sh_batch_create(&batch, &steep, 64, &error), &error, ALB_USAGE, "alpha = 90");
    check_ok(alb_sh_batch_create(&batch, &cone, 64, &error), &error);
    const float k[] = {-3, 0, NAN, INFINITY};
    float in[16 * 4], out[16 * 4];
    for (int i = 0; i < 16 * 4; i++)
        in[i] = (float)cos(i / 4);
    alb_sh_batch_apply(out, &batch, false, k, in, 4, 4);
    for (int i = 0; i < 16; i++) {
        assert_true(out[4 * i] == out[4 * i + 1]); // below the centre is at the centre
        assert_true(isnan(out[4 * i + 2]));
        assert_true(isfinite(out[4 * i + 3]));
    }
    alb_sh_batch_free(&batch);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cone_tables),        cmocka_unit_test(scheme_errors),
        cmocka_unit_test(table_ends),         cmocka_unit_test(batches),
        cmocka_unit_test(single_precision),   cmocka_unit_test(batches_and_threads),
        cmocka_unit_test(transposed_batches), cmocka_unit_test(batch_limits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
