// Tables that hold too little or nothing: what the program says, and with which exit code.
#include "base/random.h"
#include "fit/choose.h"
#include "program.h"

static void write_table(const char *path, int count, double (*value)(double r_mm), bool with_sd)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, with_sd ? "r_mm,value_per_mm2,sd_per_mm2\n" : "r_mm,value_per_mm2\n");
    for (int i = 0; i < count; i++) {
        const double r = 0.25 + 6.0 * i / count, v = value(r);
        fprintf(file, with_sd ? "%.9g,%.9g,%.9g\n" : "%.9g,%.9g\n", r, v, 0.01 * (fabs(v) + 1e-3));
    }
    assert_int_equal(fclose(file), 0);
}

static int fit_table(const char *path)
{
    char arguments[256];
    shell("rm -rf edge_out && mkdir edge_out");
    snprintf(arguments, sizeof arguments, "fit --table %s --side reflection -o edge_out", path);
    return run(arguments);
}

static int lines_of(const char *text)
{
    int lines = 0;
    for (; *text; text++)
        lines += *text == '\n';
    return lines;
}

static double zero(double r_mm) { return 0 * r_mm; }
static double constant(double r_mm) { return 1 + 0 * r_mm; }
static double rising(double r_mm) { return exp(r_mm); }
static double negative(double r_mm) { return -exp(-r_mm); }
static double growing_oscillation(double r_mm) { return sin(9 * r_mm) * exp(r_mm); }
static double overflowing(double r_mm) { return 1e308 * exp(-r_mm); }
static double underflowing(double r_mm) { return 1e-308 * exp(-r_mm); }

// A refusal is one line; a fit of nonsense is marked as not decided, or follows it. Nothing floods the screen.
static void garbage(void **state)
{
    (void)state;
    static double (*const kinds[])(double) = {zero,        constant,    rising, negative, growing_oscillation,
                                              overflowing, underflowing};
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++)
        for (int with_sd = 0; with_sd < 2; with_sd++) {
            write_table("edge.csv", 40, kinds[k], with_sd);
            const int code = fit_table("edge.csv");
            print_message("garbage %zu%s: exit %d: %s", k, with_sd ? " with sd" : "", code,
                          *complaint ? complaint : "\n");
            assert_true(code == ALB_BAD_DATA || code == ALB_UNDECIDED || (code == ALB_OK && k >= 5));
            assert_true(lines_of(complaint) <= 5); // narration, and the reason in one
            const char *reason = strstr(complaint, "alabaster: ");
            assert_true(code == ALB_OK || (reason && lines_of(reason) == 1));
        }
    save_text("edge.csv", "r_mm,value_per_mm2\n1,nan\n2,1\n3,0.5\n4,0.2\n");
    assert_int_equal(fit_table("edge.csv"), ALB_BAD_DATA);
    assert_int_equal(lines_of(complaint), 1);
    save_text("edge.csv", "r_mm,value_per_mm2\n1,inf\n2,1\n3,0.5\n4,0.2\n");
    assert_int_equal(fit_table("edge.csv"), ALB_BAD_DATA);
    assert_int_equal(lines_of(complaint), 1);
}

// Fewer readings than a form has parameters: a smaller model, with an sd or none where it is not identifiable.
static void few_bins(void **state)
{
    (void)state;
    static const int counts[] = {4, 5, 6, 8};
    for (int k = 0; k < 4; k++)
        for (unsigned t = 0; t < 20; t++) {
            alb_error error = {0};
            alb_readings readings = {0};
            alb_operator forward = {0};
            alb_outcome outcome;
            alb_random random = alb_random_at(1, (unsigned)k, t);
            const int n = counts[k];
            check_ok(alb_readings_create(&readings, n, &error), &error);
            for (int i = 0; i < n; i++) {
                const double step = 6.0 / n, r = step * (i + 0.5), value = exp(-0.7 * r) + 0.5 * exp(-3 * r);
                readings.r_mm[i] = r;
                readings.sd[i] = 0.02 * value;
                readings.value[i] = value + readings.sd[i] * alb_random_normal(&random);
                readings.area_mm2[i] = 2 * M_PI * r * step;
            }
            readings.outer_mm = 6;
            check_ok(alb_operator_identity(&forward, &readings, &error), &error);
            if (alb_choose(&outcome, &readings, &forward, (alb_common_sd){0, 0}, &error)) {
                const int parameters = alb_form_parameter_count(outcome.fitted.profile.form) - outcome.tied;
                assert_true(parameters < n);
                assert_true(isfinite(outcome.fitted.total) && isfinite(outcome.fitted.chi_square));
                for (int p = 0; p < parameters; p++) {
                    assert_true(isfinite(outcome.fitted.profile.parameters[p]));
                    assert_true(isfinite(outcome.fitted.sd[p]) || !outcome.fitted.identifiable);
                }
            } else {
                assert_int_equal(error.status, ALB_UNDECIDED);
            }
            alb_operator_free(&forward);
            alb_readings_free(&readings);
        }
    write_table("edge.csv", 2, constant, true);
    assert_int_equal(fit_table("edge.csv"), ALB_UNDECIDED);
    assert_int_equal(lines_of(complaint), 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(garbage),
        cmocka_unit_test(few_bins),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
