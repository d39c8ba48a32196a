// Many spots of a sample: alike or not, and where.
#include "base/random.h"
#include "check.h"
#include "fit/map.h"
#include <omp.h>

enum { READINGS = 60 };

// Spots of two materials: those whose index is below `first` have the one, the others the other. Relative noise.
typedef struct sample {
    alb_profile materials[2];
    int first, blind; // blind: a spot that cannot be read
    double noise;
    unsigned seed;
} sample;

static bool read_spot(alb_readings *readings, alb_operator *forward, int spot, const void *context, alb_error *error)
{
    const sample *s = context;
    const alb_profile *truth = &s->materials[spot >= s->first];
    alb_random random = alb_random_at(s->seed, 3, (unsigned)spot);
    if (spot == s->blind)
        return alb_fail(error, ALB_BAD_DATA, "nothing to see");
    if (!alb_readings_create(readings, READINGS, error))
        return false;
    for (int i = 0; i < READINGS; i++) {
        const double step = 12.0 / READINGS, r = step * (i + 0.5), value = alb_profile_value(truth, r);
        readings->r_mm[i] = r;
        readings->sd[i] = s->noise * hypot(value, 0.003 * alb_profile_value(truth, 0));
        readings->value[i] = value + readings->sd[i] * alb_random_normal(&random);
        readings->area_mm2[i] = 2 * M_PI * r * step;
    }
    readings->outer_mm = 12;
    return alb_operator_identity(forward, readings, error);
}

static const alb_profile wax = {ALB_FORM_TWO_EXPONENTIALS, {0.03, 0.5, 0.1, 1.6}};
// 3 % more of the same
static const alb_profile fat = {ALB_FORM_TWO_EXPONENTIALS, {0.0309, 0.5, 0.103, 1.6}};

static alb_map_layer fitted(const sample *s, int spots)
{
    alb_error error = {0};
    alb_map_layer layer;
    check_ok(alb_map_layer_fit(&layer, spots, 0, read_spot, s, "map", &error), &error);
    return layer;
}

// At 2.5 % for each of the two quantities a uniform sample is called so in 95 % of cases at least.
static void uniform_is_called_uniform(void **state)
{
    (void)state;
    enum { MAPS = 100, SPOTS = 16 };
    int called = 0;
    double chi_square[2] = {0};
    for (unsigned m = 0; m < MAPS; m++) {
        const sample s = {{wax, wax}, 0, -1, 0.01, m + 2000};
        alb_map_layer layer = fitted(&s, SPOTS);
        called += layer.total.tail < 0.025 || layer.half.tail < 0.025;
        chi_square[0] += layer.total.chi_square, chi_square[1] += layer.half.chi_square;
        assert_int_equal(layer.total.count, SPOTS);
        alb_map_layer_free(&layer);
    }
    print_message("uniform: called heterogeneous in %d of %d; chi-square per degree of freedom %.3f, %.3f\n", called,
                  MAPS, chi_square[0] / (MAPS * (SPOTS - 1)), chi_square[1] / (MAPS * (SPOTS - 1)));
    assert_true(called <= 13); // binomial of mean 5: above 13 in 1 of 2000 tests
    // sd of the mean of MAPS (SPOTS - 1) squares: sqrt(2 / 1500) = 0.037
    for (int k = 0; k < 2; k++)
        check_near(chi_square[k] / (MAPS * (SPOTS - 1)), 1, 4 * 0.037);
}

// Two materials in one sample: the spread says so, and each spot is its own material's.
static void heterogeneous(void **state)
{
    (void)state;
    enum { SPOTS = 32 };
    const sample s = {{wax, fat}, SPOTS / 2, -1, 0.01, 1};
    alb_map_layer layer = fitted(&s, SPOTS);
    assert_int_equal(layer.candidate.form, ALB_FORM_TWO_EXPONENTIALS);
    check_below(layer.total.tail, 1e-6);
    check_relative(layer.total.between, 0.5 * (alb_profile_total(&fat) - alb_profile_total(&wax)), 0.3);
    assert_true(layer.half.tail > 1e-4); // the same shape
    for (int i = 0; i < SPOTS; i++) {
        const double own = alb_profile_total(i < SPOTS / 2 ? &wax : &fat);
        check_near(layer.spots[i].total, own, 4.5 * layer.spots[i].total_sd);
    }
    print_message("two materials 3 %% apart: chi-square of the totals %.1f / %d\n", layer.total.chi_square, SPOTS - 1);
    alb_map_layer_free(&layer);
}

// The distance of half the light, of one exponential: 1 - (1 + b h) e^(-b h) = 1/2 at b h = 1.678347; its sd is that of
// b.
static void half_light_and_its_sd(void **state)
{
    (void)state;
    const alb_profile one = {ALB_FORM_EXPONENTIAL, {0.05, 0.8}};
    const sample s = {{one, one}, 0, -1, 0.02, 5};
    alb_map_layer layer = fitted(&s, 4);
    assert_int_equal(layer.candidate.form, ALB_FORM_EXPONENTIAL);
    for (int i = 0; i < 4; i++) {
        const double b = layer.spots[i].profile.parameters[1];
        check_relative(layer.half_mm[i], 1.678346990 / b, 1e-9);
        check_relative(layer.half_sd_mm[i], 1.678346990 / (b * b) * layer.spots[i].sd[1], 1e-6);
    }
    alb_map_layer_free(&layer);
}

static void same_bytes_with_any_threads(void **state)
{
    (void)state;
    enum { SPOTS = 24 };
    const sample s = {{wax, fat}, 5, 7, 0.01, 2};
    const int before = omp_get_max_threads();
    omp_set_num_threads(1);
    alb_map_layer one = fitted(&s, SPOTS);
    omp_set_num_threads(4);
    alb_map_layer four = fitted(&s, SPOTS);
    omp_set_num_threads(before);
    assert_memory_equal(one.spots, four.spots, SPOTS * sizeof *one.spots);
    assert_memory_equal(one.half_mm, four.half_mm, SPOTS * sizeof(double));
    assert_memory_equal(&one.total, &four.total, sizeof one.total);
    // the blind spot is left out, and the others are not
    assert_int_equal(one.total.count, SPOTS - 1);
    assert_int_equal(one.spots[7].profile.form, ALB_FORM_NONE);
    assert_true(isnan(one.half_mm[7]));
    alb_map_layer_free(&one);
    alb_map_layer_free(&four);
}

static void nothing_decides(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_map_layer layer;
    const sample s = {{wax, wax}, 0, 0, 0.01, 2};
    check_fails(alb_map_layer_fit(&layer, 1, 0, read_spot, &s, "map", &error), &error, ALB_UNDECIDED, "nothing to see");
    assert_null(layer.spots);
}

static void spreads(void **state)
{
    (void)state;
    const double values[] = {1, 2, 3, NAN, 9}, sd[] = {1, 1, 1, 1, 0};
    const alb_spread spread = alb_spread_of(values, sd, 5);
    assert_int_equal(spread.count, 3);
    check_near(spread.mean, 2, 1e-15);
    check_near(spread.mean_sd, sqrt(1 / 3.0), 1e-15);
    check_near(spread.chi_square, 2, 1e-15);
    check_near(spread.tail, exp(-1), 1e-12); // of two degrees of freedom
    check_near(spread.between, 0, 1e-15);
    assert_true(isnan(alb_spread_of(values + 3, sd + 3, 2).mean));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(spreads),         cmocka_unit_test(half_light_and_its_sd),
        cmocka_unit_test(heterogeneous),   cmocka_unit_test(same_bytes_with_any_threads),
        cmocka_unit_test(nothing_decides), cmocka_unit_test(uniform_is_called_uniform),
    };
    return cmocka_run_group_tests_name("map", tests, NULL, NULL);
}
