// View factors of polygons against Howell's closed forms, evaluated here in long double, and against laws.
#include "base/random.h"
#include "check.h"
#include "render/form_factor_exact.h"

static const double goal = 1e-9; // relative: what is promised

static alb_vector vector(double x, double y, double z) { return (alb_vector){x, y, z}; }

static void rectangle(alb_vector out[4], alb_vector at, alb_vector a, alb_vector b)
{
    out[0] = at;
    out[1] = alb_add(at, a);
    out[2] = alb_add(out[1], b);
    out[3] = alb_add(at, b);
}

static double factor(const alb_vector *p, size_t p_count, const alb_vector *q, size_t q_count)
{
    alb_error error = {0};
    double found;
    check_ok(alb_form_factor_exact(&found, p, p_count, q, q_count, &error), &error);
    return found;
}

// C-11, the logarithm by log1p: its argument is 1 + X^2 Y^2 / (1 + X^2 + Y^2).
static double opposed(long double a, long double b, long double c)
{
    const long double X = a / c, Y = b / c, x = sqrtl(1 + X * X), y = sqrtl(1 + Y * Y);
    const long double sum = 0.5L * log1pl(X * X * Y * Y / (1 + X * X + Y * Y)) + X * y * atanl(X / y) +
                            Y * x * atanl(Y / x) - X * atanl(X) - Y * atanl(Y);
    return (double)(2 * sum / (acosl(-1) * X * Y));
}

// C-14, from w x l to h x l over the shared edge l.
static double adjacent(long double w, long double h, long double l)
{
    const long double W = w / l, H = h / l, W2 = W * W, H2 = H * H, s = sqrtl(H2 + W2), all = 1 + W2 + H2;
    const long double product = logl((1 + W2) * (1 + H2) / all) + W2 * logl(W2 * all / ((1 + W2) * s * s)) +
                                H2 * logl(H2 * all / ((1 + H2) * s * s));
    return (double)((W * atanl(1 / W) + H * atanl(1 / H) - s * atanl(1 / s) + product / 4) / (acosl(-1) * W));
}

// The forms above against the digits of the catalogue's tables, then the code against the forms.
static void opposed_rectangles(void **state)
{
    (void)state;
    check_near(opposed(1, 1, 1), 0.199824895698, 1e-12);
    check_near(opposed(1, 1, 0.01L), 0.980416602926, 1e-12);
    for (int k = -3; k <= 3; k++)
        for (double side = 1; side < 5; side += 1.5) {
            const double gap = pow(10, k);
            alb_vector p[4], q[4];
            rectangle(p, vector(0, 0, 0), vector(side, 0, 0), vector(0, 1, 0));
            rectangle(q, vector(0, 0, gap), vector(0, 1, 0), vector(side, 0, 0));
            check_relative(factor(p, 4, q, 4), opposed(side, 1, gap), goal);
        }
}

static void adjacent_rectangles(void **state)
{
    (void)state;
    check_near(adjacent(1, 1, 1), 0.200043776075, 1e-12);
    check_near(adjacent(0.1L, 0.1L, 1), 0.281887806788, 1e-12);
    const double sizes[][3] = {{1, 1, 1},    {0.1, 0.1, 1}, {1, 2, 1},    {2, 1, 1},
                               {1, 0.01, 1}, {1, 1e-3, 1},  {1e-3, 1, 1}, {1, 1, 300}};
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
        const double w = sizes[k][0], h = sizes[k][1], l = sizes[k][2];
        alb_vector p[4], q[4];
        rectangle(p, vector(0, 0, 0), vector(w, 0, 0), vector(0, l, 0));
        rectangle(q, vector(0, 0, 0), vector(0, l, 0), vector(0, 0, h));
        check_relative(factor(p, 4, q, 4), adjacent(w, h, l), goal);
        rectangle(q, vector(0, 0, -h), vector(0, l, 0), vector(0, 0, 2 * h)); // as much again below the floor: unseen
        check_relative(factor(p, 4, q, 4), adjacent(w, h, l), goal);
        rectangle(p, vector(-w, 0, 0), vector(2 * w, 0, 0), vector(0, l, 0)); // half of it behind the wall
        check_relative(factor(p, 4, q, 4), 0.5 * adjacent(w, h, l), goal);
    }
}

// A strip along a shared edge, then a gap, then the wall's rest: algebra on C-14 (C-13 with an offset).
static void offset_rectangles(void **state)
{
    (void)state;
    for (double gap = 1e-3; gap < 2; gap *= 10) {
        alb_vector p[4], q[4];
        rectangle(p, vector(gap, 0, 0), vector(1, 0, 0), vector(0, 1, 0));
        rectangle(q, vector(0, 0, gap), vector(0, 1, 0), vector(0, 0, 1));
        const double both =
            (1 + gap) * (adjacent(1 + gap, 1 + gap, 1) - adjacent(1 + gap, gap, 1)); // A F from 0..1+gap
        const double near = gap * (adjacent(gap, 1 + gap, 1) - adjacent(gap, gap, 1));
        check_relative(factor(p, 4, q, 4), both - near, goal);
    }
}

// Discs as the limit of polygons, whose error is a series in 1/corners^2 (Richardson).
static void coaxial_discs(void **state)
{
    (void)state;
    const double discs[][4] = {{1, 1, 1, 0.381966011250105}, {1, 1, 3, 0.091673086803985}, {1, 0.5, 1, 0.117217781463}};
    for (size_t d = 0; d < 3; d++) {
        double table[4];
        for (int level = 0; level < 4; level++) {
            alb_vector p[ALB_POLYGON_MAX], q[ALB_POLYGON_MAX];
            const size_t corners = (size_t)12 << level;
            for (size_t k = 0; k < corners; k++) {
                const double angle = 2 * M_PI * (double)k / (double)corners;
                p[k] = vector(discs[d][0] * cos(angle), discs[d][0] * sin(angle), 0);
                q[k] = vector(discs[d][1] * cos(angle), -discs[d][1] * sin(angle), discs[d][2]);
            }
            table[level] = factor(p, corners, q, corners);
        }
        for (int order = 1; order < 4; order++)
            for (int level = 3; level >= order; level--)
                table[level] += (table[level] - table[level - 1]) / (pow(4, order) - 1);
        check_relative(table[3], discs[d][3], 1e-7); // what extrapolation from 96 corners leaves
    }
}

// dA under a rectangle's corner (Howell B-3), and behind it, and from far away.
static void points_match_closed_form(void **state)
{
    (void)state;
    for (int k = -3; k <= 3; k++) {
        const double h = pow(10, k), X = 1 / h, Y = 2 / h;
        alb_vector q[4];
        rectangle(q, vector(0, 0, h), vector(0, 2, 0), vector(1, 0, 0));
        const double truth =
            (X / sqrt(1 + X * X) * atan(Y / sqrt(1 + X * X)) + Y / sqrt(1 + Y * Y) * atan(X / sqrt(1 + Y * Y))) /
            (2 * M_PI);
        check_relative(alb_form_factor_point(vector(0, 0, 0), vector(0, 0, 1), q, 4), truth, goal);
        check_near(alb_form_factor_point(vector(0, 0, 2 * h), vector(0, 0, -1), q, 4), 0, 0);
        check_near(alb_form_factor_point(vector(0, 0, 0), vector(0, 0, -1), q, 4), 0, 0);
    }
    alb_vector q[4];
    rectangle(q, vector(0, 0, 1), vector(0, 1, 0), vector(1, 0, 0));
    check_near(alb_form_factor_point(vector(0, 0, 0), vector(0, 0, 1), q, 4), 0.138531605995, 1e-12);
}

static double uniform(uint64_t stream, uint64_t index)
{
    alb_random random = alb_random_at(31, stream, index);
    return alb_random_uniform(&random);
}

static alb_vector random_point(uint64_t stream, uint64_t index)
{
    return vector(uniform(stream, 3 * index), uniform(stream, 3 * index + 1), uniform(stream, 3 * index + 2));
}

static double area_of(const alb_vector t[3])
{
    return 0.5 * alb_length(alb_cross(alb_sub(t[1], t[0]), alb_sub(t[2], t[0])));
}

// Rows of random tetrahedra, seen from inside: every face shares an edge with every other, and they sum to 1.
static void closed_tetrahedra_sum_to_one(void **state)
{
    (void)state;
    static const int faces[4][3] = {{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}};
    for (uint64_t k = 0; k < 50; k++) {
        alb_vector corners[4], t[4][3];
        for (uint64_t i = 0; i < 4; i++)
            corners[i] = random_point(k, i);
        const alb_vector a = alb_sub(corners[1], corners[0]), b = alb_sub(corners[2], corners[0]);
        const bool turned = alb_dot(alb_cross(a, b), alb_sub(corners[3], corners[0])) < 0; // fronts must face inwards
        for (int f = 0; f < 4; f++)
            for (int i = 0; i < 3; i++)
                t[f][turned ? 2 - i : i] = corners[faces[f][i]];
        for (int f = 0; f < 4; f++) {
            double sum = 0;
            for (int g = 0; g < 4; g++)
                sum += g == f ? 0 : factor(t[f], 3, t[g], 3);
            check_near(sum, 1, goal);
        }
    }
}

// Reciprocity, additivity and invariance over random triangles, which as often as not cut each other's planes.
static void laws_hold_over_random_triangles(void **state)
{
    (void)state;
    const double s = sin(0.7), c = cos(0.7);
    const alb_transform turn = {{{c, -s, 0}, {s, c, 0}, {0, 0, 1}}, {5, -3, 2}};
    int seen = 0;
    for (uint64_t k = 0; k < 200; k++) {
        alb_vector p[3], q[3], moved[2][3];
        for (uint64_t i = 0; i < 3; i++) {
            p[i] = random_point(1000 + k, i);
            q[i] = alb_add(random_point(1000 + k, 3 + i), vector(0, 0, 1)); // above: they do not intersect
            moved[0][i] = alb_times(1e4, alb_apply(&turn, p[i]));
            moved[1][i] = alb_times(1e4, alb_apply(&turn, q[i]));
        }
        const double found = factor(p, 3, q, 3);
        const double tolerance = goal * found + 1e-14;
        seen += found > 0;
        check_near(factor(q, 3, p, 3) * area_of(q) / area_of(p), found, goal * found + 1e-13);
        check_near(factor(moved[0], 3, moved[1], 3), found, 10 * tolerance); // 1e4 and 5: three digits of cancellation
        const alb_vector middle = alb_times(0.5, alb_add(q[0], q[1]));
        const alb_vector one[3] = {q[0], middle, q[2]}, two[3] = {middle, q[1], q[2]};
        check_near(factor(p, 3, one, 3) + factor(p, 3, two, 3), found, 2 * tolerance);
        assert_true(area_of(p) * found <= fmin(area_of(p), area_of(q)));
    }
    assert_true(seen > 40); // a quarter of the pairs face each other
}

static void bad_polygons_are_refused(void **state)
{
    (void)state;
    alb_error error = {0};
    double found;
    const alb_vector flat[3] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, good[3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    check_fails(alb_form_factor_exact(&found, flat, 3, good, 3, &error), &error, ALB_BAD_DATA, "without area");
    check_fails(alb_form_factor_exact(&found, good, 2, good, 3, &error), &error, ALB_BAD_DATA, "corners");
    check_near(factor(good, 3, good, 3), 0, 0); // its own plane
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(opposed_rectangles),
        cmocka_unit_test(adjacent_rectangles),
        cmocka_unit_test(offset_rectangles),
        cmocka_unit_test(coaxial_discs),
        cmocka_unit_test(points_match_closed_form),
        cmocka_unit_test(closed_tetrahedra_sum_to_one),
        cmocka_unit_test(laws_hold_over_random_triangles),
        cmocka_unit_test(bad_polygons_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
