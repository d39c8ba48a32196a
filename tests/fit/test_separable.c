// The separable search: its exponential, its derivatives by their meaning, its minimum against an exhaustive search,
// and the laws that it keeps.
#include "check.h"
#include "exhaustive.h"
#include "fit/reduced.h"
#include "fit/separable.h"

static void the_exponential_is_exact(void **state)
{
    (void)state;
    double worst = 0;
    for (int k = 0; k < 200000; k++) {
        alb_random random = alb_random_at(1, 0, (unsigned)k);
        double x[3], y[3];
        for (int i = 0; i < 3; i++)
            y[i] = x[i] = k % 2 ? 600 * (alb_random_uniform(&random) - 0.5) : 2 * (alb_random_uniform(&random) - 0.5);
        alb_columns_exp(y, 3);
        for (int i = 0; i < 3; i++)
            worst = fmax(worst, fabs((double)((long double)y[i] / expl(x[i]) - 1)));
    }
    print_message("e^x: largest relative error %.2g\n", worst);
    check_below(worst, 1e-15);
    double ends[] = {0, -300, -1000, (double)-INFINITY};
    alb_columns_exp(ends, 4);
    assert_true(ends[0] == 1);
    check_relative(ends[1], exp(-300), 1e-15);
    assert_true(ends[2] == ends[1] && ends[3] == ends[1]);
}

typedef struct rig {
    alb_readings readings;
    alb_operator forward;
    alb_basis basis;
    double *scratch;
} rig;

static void rig_create(rig *r)
{
    alb_error error = {0};
    check_ok(exhaustive_readings(&r->readings, &error), &error);
    check_ok(alb_operator_identity(&r->forward, &r->readings, &error), &error);
    check_ok(alb_basis_create(&r->basis, &r->readings, &r->forward, &error), &error);
    r->scratch = malloc(alb_separable_scratch(&r->basis) * sizeof(double));
    assert_non_null(r->scratch);
}

static void rig_free(rig *r)
{
    free(r->scratch);
    alb_basis_free(&r->basis);
    alb_operator_free(&r->forward);
    alb_readings_free(&r->readings);
}

// Readings under a spot: the columns interpolated in ln b are those of the operator.
static void columns_under_a_spot(void **state)
{
    (void)state;
    enum { RINGS = 60 };
    static const double radius_mm = 0.5;
    alb_error error = {0};
    alb_readings readings = {0};
    alb_spot spot = {0};
    alb_operator forward = {0};
    alb_basis basis = {0};
    check_ok(alb_readings_create(&readings, RINGS, &error), &error);
    for (int i = 0; i < RINGS; i++) {
        readings.r_mm[i] = 0.1 + 0.15 * i;
        for (int k = 0; k < ALB_RING_SAMPLES; k++) {
            readings.sample_r_mm[i][k] = readings.r_mm[i] + 0.1 * (k / (ALB_RING_SAMPLES - 1.0) - 0.5);
            readings.sample_share[i][k] = 1.0 / ALB_RING_SAMPLES;
        }
    }
    readings.outer_mm = 9;
    check_ok(alb_spot_disc(&spot, radius_mm, &error), &error);
    check_ok(alb_operator_create(&forward, &readings, &spot, &error), &error);
    check_ok(alb_basis_create(&basis, &readings, &forward, &error), &error);
    const size_t rows = (size_t)basis.rows;
    double *room = calloc(9 * rows, sizeof *room), worst = 0;
    double(*grid)[ALB_OPERATOR_COLUMNS] = calloc((size_t)forward.grid_count, sizeof *grid);
    double(*exact)[ALB_OPERATOR_COLUMNS] = calloc(RINGS, sizeof *exact);
    assert_true(room && grid && exact);
    for (int i = 0; i < RINGS; i++)
        room[i] = basis.share[i];
    const alb_whitened whitened = {&basis, room, NULL, room + rows};
    for (double b = 0.02; b < 20; b *= 1.23) {
        alb_term term = {.column = room + 2 * rows, .first = room + 3 * rows, .second = room + 4 * rows};
        alb_term_evaluate(&term, &whitened, log(b), room + 5 * rows);
        for (int k = 0; k < forward.grid_count; k++) {
            grid[k][0] = exp(-b * forward.grid_mm[k]);
            grid[k][1] = -b * forward.grid_mm[k] * grid[k][0];
        }
        alb_operator_apply(exact, &forward, (const double(*)[ALB_OPERATOR_COLUMNS])grid);
        for (int i = 0; i < RINGS; i++) { // h^4 / 384 of an effective distance that bends by the spot's size
            worst = fmax(worst, fabs(term.column[i] / exact[i][0] - 1) / (b * radius_mm));
            check_near(term.column[i], exact[i][0], 1e-6 * b * radius_mm * exact[i][0]);
            check_near(term.first[i], exact[i][1], 1e-4 * b * radius_mm * exact[i][0]); // h^3
        }
    }
    print_message("columns under a spot: relative error at most %.2g b P\n", worst);
    free(exact);
    free(grid);
    free(room);
    alb_basis_free(&basis);
    alb_operator_free(&forward);
    alb_spot_free(&spot);
    alb_readings_free(&readings);
}

static int profiles = 600; // fit.separable 100000: the long run, seven minutes of two cores

// As low as an exhaustive search gets, in every one of the profiles, wherever that is below the single exponential.
static void global_minimum(void **state)
{
    (void)state;
    rig r;
    rig_create(&r);
    for (int form = ALB_FORM_TWO_EXPONENTIALS; form <= ALB_FORM_SIGNED_EXPONENTIALS; form++) {
        int missed = 0;
#pragma omp parallel for schedule(dynamic) reduction(+ : missed)
        for (int t = 0; t < profiles; t++) {
            double value[EXHAUSTIVE_READINGS], sd[EXHAUSTIVE_READINGS];
            double *scratch = malloc(alb_separable_scratch(&r.basis) * sizeof *scratch);
            exhaustive_profile(value, sd, (alb_form)form, 77, (unsigned)t);
            alb_readings readings = r.readings;
            readings.value = value;
            readings.sd = sd;
            const alb_weighing weighing = {&readings, &r.forward, sd, 0};
            alb_separable fit, one;
            alb_separable_fit(&fit, (alb_candidate){(alb_form)form, false}, &r.basis, value, sd, 0, scratch);
            alb_separable_fit(&one, (alb_candidate){ALB_FORM_EXPONENTIAL, false}, &r.basis, value, sd, 0, scratch);
            alb_profile at, known = fit.found ? fit.profile : (alb_profile){.form = ALB_FORM_NONE};
            const double least = exhaustive_minimum(&at, (alb_form)form, &one.profile, &known, &weighing, &r.basis);
            const bool higher = fit.found ? fit.chi_square > least * (1 + 1e-6) : least < one.chi_square * (1 - 1e-6);
            if (higher)
                print_message("profile %d: %.9g, least %.9g, one term %.9g\n", t,
                              fit.found ? fit.chi_square : (double)NAN, least, one.chi_square);
            missed += higher;
            free(scratch);
        }
        print_message("%s: the least chi-square missed in %d of %d\n", alb_form_name((alb_form)form), missed, profiles);
        assert_int_equal(missed, 0);
    }
    rig_free(&r);
}

// What the descent believes of chi-square is what differences of chi-square say.
static void derivatives_are_derivatives(void **state)
{
    (void)state;
    rig r;
    rig_create(&r);
    for (unsigned t = 0; t < 50; t++) {
        double value[EXHAUSTIVE_READINGS], sd[EXHAUSTIVE_READINGS], w[3][128] = {{0}}, room[16][128];
        exhaustive_profile(value, sd, ALB_FORM_TWO_EXPONENTIALS, 3, t);
        for (int i = 0; i < EXHAUSTIVE_READINGS; i++) {
            w[0][i] = 1 / sd[i];
            w[1][i] = value[i] / sd[i];
            w[2][i] = sd[i] * r.readings.r_mm[i] / 3;
        }
        w[1][EXHAUSTIVE_READINGS] = alb_columns_dot(w[1], w[2], r.basis.rows);
        alb_reduced problem = {.data = {&r.basis, w[0], t % 2 ? w[2] : NULL, w[1]},
                               .term = {{room[0], room[1], room[2]}, {room[3], room[4], room[5]}},
                               .residual = room[6],
                               .work = room[7]};
        alb_random random = alb_random_at(4, 0, t);
        const double x[2] = {log(0.2) + alb_random_uniform(&random), log(1.2) + alb_random_uniform(&random)};
        const double h = 1e-4;
        alb_place centre = {.x = {x[0], x[1]}}, side[2][2];
        alb_reduced_evaluate(&centre, &problem, 2, ALB_POSITIVE);
        if (!isfinite(centre.chi_square))
            continue;
        for (int v = 0; v < 2; v++)
            for (int s = 0; s < 2; s++) {
                side[v][s] =
                    (alb_place){.x = {x[0] + (v == 0 ? (2 * s - 1) * h : 0), x[1] + (v ? (2 * s - 1) * h : 0)}};
                alb_reduced_evaluate(&side[v][s], &problem, 2, ALB_POSITIVE);
            }
        for (int v = 0; v < 2; v++) { // errors of the differences: h^2 of themselves
            const double slope = (side[v][1].chi_square - side[v][0].chi_square) / 4 / h;
            check_near(centre.gradient[v], slope, 1e-5 * (fabs(slope) + fabs(centre.newton[v][v])));
            for (int u = 0; u < 2; u++)
                check_near(centre.newton[u][v], (side[v][1].gradient[u] - side[v][0].gradient[u]) / 2 / h,
                           1e-5 * (fabs(centre.newton[u][u]) + fabs(centre.newton[v][v])));
        }
    }
    rig_free(&r);
}

// Values and lengths in other units: the same fit in those units.
static void same_in_units(const double (*units)[2], int count)
{
    rig r;
    rig_create(&r);
    for (int form = ALB_FORM_EXPONENTIAL; form <= ALB_FORM_SIGNED_EXPONENTIALS; form++)
        for (unsigned t = 0; t < 40; t++) {
            double value[EXHAUSTIVE_READINGS], sd[EXHAUSTIVE_READINGS];
            const alb_candidate candidate = {(alb_form)form, false};
            alb_separable plain;
            exhaustive_profile(value, sd, (alb_form)form, 5, t);
            alb_separable_fit(&plain, candidate, &r.basis, value, sd, 0, r.scratch);
            for (int u = 0; u < count; u++) {
                rig scaled;
                alb_separable fit;
                double v[EXHAUSTIVE_READINGS], s[EXHAUSTIVE_READINGS];
                rig_create(&scaled);
                for (int i = 0; i < EXHAUSTIVE_READINGS; i++) {
                    scaled.readings.r_mm[i] *= units[u][1];
                    scaled.forward.grid_mm[i] *= units[u][1];
                    v[i] = value[i] * units[u][0];
                    s[i] = sd[i] * units[u][0];
                }
                scaled.readings.outer_mm *= units[u][1];
                alb_error error = {0};
                alb_basis_free(&scaled.basis);
                check_ok(alb_basis_create(&scaled.basis, &scaled.readings, &scaled.forward, &error), &error);
                alb_separable_fit(&fit, candidate, &scaled.basis, v, s, 0, scaled.scratch);
                check_relative(fit.chi_square, plain.chi_square, 1e-8); // rounding of the data in other units
                // a term that gains nothing may be found or not
                for (int p = 0;
                     fit.found && plain.found && fit.full_rank && p < alb_form_parameter_count((alb_form)form); p++) {
                    const double unit = p % 2 ? 1 / units[u][1] : units[u][0];
                    const double sd_p = sqrt(plain.covariance[p][p]);
                    check_near(fit.profile.parameters[p] / unit, plain.profile.parameters[p], 1e-3 * sd_p);
                    if (sd_p < 0.3 * fabs(plain.profile.parameters[p]))
                        check_relative(sqrt(fit.covariance[p][p]) / unit, sd_p, 1e-2);
                }
                rig_free(&scaled);
            }
        }
    rig_free(&r);
}

static void huge_dynamic_range(void **state)
{
    (void)state;
    static const double units[][2] = {{1e-30, 1}, {1e30, 1}};
    same_in_units(units, 2);
}

// mm read as cm or m, or taken for them.
static void units(void **state)
{
    (void)state;
    static const double lengths[][2] = {{1, 0.1}, {1, 1e-3}, {1, 1e3}, {1e6, 1e-3}};
    same_in_units(lengths, 4);
}

// What is no data is found to hold nothing, and nothing breaks.
static void garbage(void **state)
{
    (void)state;
    rig r;
    rig_create(&r);
    for (int form = ALB_FORM_EXPONENTIAL; form <= ALB_FORM_THREE_EXPONENTIALS; form++)
        for (int kind = 0; kind < 9; kind++) {
            double value[EXHAUSTIVE_READINGS], sd[EXHAUSTIVE_READINGS];
            for (int i = 0; i < EXHAUSTIVE_READINGS; i++) {
                const double r_mm = r.readings.r_mm[i];
                const double kinds[] = {0,          1,          exp(r_mm),  -exp(-r_mm), i == 60 ? 1e300 : 1,
                                        exp(-r_mm), exp(-r_mm), exp(-r_mm), exp(-r_mm)};
                value[i] = kinds[kind];
                sd[i] = kind == 6 ? 0 : kind == 7 ? -1 : kind == 8 ? (double)INFINITY : 0.01;
            }
            if (kind == 5)
                value[7] = (double)NAN;
            alb_separable fit;
            alb_separable_fit(&fit, (alb_candidate){(alb_form)form, false}, &r.basis, value, sd, 0, r.scratch);
            for (int p = 0; fit.found && p < alb_form_parameter_count((alb_form)form); p++)
                assert_true(isfinite(fit.profile.parameters[p]));
            if (kind == 0 || kind == 3 || kind >= 5)
                assert_false(fit.found);
        }
    rig_free(&r);
}

int main(int argc, char **argv)
{
    if (argc > 1)
        profiles = atoi(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_exponential_is_exact),
        cmocka_unit_test(columns_under_a_spot),
        cmocka_unit_test(derivatives_are_derivatives),
        cmocka_unit_test(global_minimum),
        cmocka_unit_test(huge_dynamic_range),
        cmocka_unit_test(units),
        cmocka_unit_test(garbage),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
