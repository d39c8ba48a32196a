// Honest error bars. A stated profile is photographed by the virtual rig many times with fresh noise, fresh hands and a
// fresh lens calibration each time; capture, calibrate and fit run as a user runs them. Over all sessions (recovered -
// true) / sd has mean 0 and variance 1 within the sampling error of those two statistics, for every parameter and every
// total.
#include "base/command.h"
#include "base/file.h"
#include "check.h"
#include "fit/material.h"
#include <unistd.h>

enum { SESSIONS = 50, CHANNELS = 3, QUANTITIES = 5, VALUES = SESSIONS * CHANNELS };

typedef struct stated {
    double a[2], b[2];
} stated;

static const stated truth[ALB_SIDES][CHANNELS] = {
    {{{0.010, 0.060}, {0.40, 1.5}}, {{0.012, 0.050}, {0.45, 1.6}}, {{0.015, 0.040}, {0.55, 1.8}}},
    {{{0.020, -0.016}, {0.60, 1.4}}, {{0.018, -0.014}, {0.65, 1.5}}, {{0.016, -0.012}, {0.70, 1.6}}},
};

static const char plan[] =
    "{\"format\": 1, \"sample\": {\"name\": \"stated\", \"thickness_mm\": 6, \"refractive_index\": 1.5, \"finish\": "
    "\"ground\"},\n"
    " \"white_reference\": {\"reflectance\": [0.99, 0.98, 0.97]},\n"
    " \"board\": {\"columns\": 7, \"rows\": 5, \"square_mm\": 3.5},\n"
    " \"shots\": [\n"
    "  {\"name\": \"dark\", \"target\": \"cap\", \"pattern\": {\"kind\": \"black\"}, \"exposures_s\": [0.02], "
    "\"repeats\": 4},\n"
    "  {\"name\": \"flat\", \"target\": \"diffuser\", \"pattern\": {\"kind\": \"white\"}, \"exposures_s\": [0.02], "
    "\"repeats\": 4},\n"
    "  {\"name\": \"hand\", \"target\": \"board\", \"pattern\": {\"kind\": \"chessboard\"}, \"in_hand\": true,\n"
    "   \"exposures_s\": [0.02], \"repeats\": 8},\n"
    "  {\"name\": \"front\", \"target\": \"board\", \"pattern\": {\"kind\": \"chessboard\"}, \"exposures_s\": "
    "[0.02]},\n"
    "  {\"name\": \"back\", \"side\": \"transmission\", \"target\": \"board\", \"pattern\": {\"kind\": "
    "\"chessboard\"},\n"
    "   \"exposures_s\": [0.02]},\n"
    "  {\"name\": \"white\", \"target\": \"white_reference\", \"pattern\": {\"kind\": \"spot\", \"diameter_px\": 4},\n"
    "   \"exposures_s\": [0.01, 0.1], \"repeats\": 2},\n"
    "  {\"name\": \"r\", \"target\": \"slab\", \"pattern\": {\"kind\": \"spot\", \"diameter_px\": 4}, \"exposures_s\": "
    "[0.02, 0.5]},\n"
    "  {\"name\": \"t\", \"side\": \"transmission\", \"target\": \"slab\", \"pattern\": {\"kind\": \"spot\", "
    "\"diameter_px\": 4},\n"
    "   \"exposures_s\": [0.05, 0.5]}]}\n";

static void write_profile(alb_text *text, alb_side side)
{
    alb_text_add(text, "\"%s\": {\"amplitude_per_mm2\": [", alb_side_names[side]);
    for (int c = 0; c < CHANNELS; c++)
        alb_text_add(text, "%s[%g, %g]", c ? ", " : "", truth[side][c].a[0], truth[side][c].a[1]);
    alb_text_add(text, "], \"decay_per_mm\": [");
    for (int c = 0; c < CHANNELS; c++)
        alb_text_add(text, "%s[%g, %g]", c ? ", " : "", truth[side][c].b[0], truth[side][c].b[1]);
    alb_text_add(text, "]}");
}

static void write_truth(const char *path, int seed)
{
    alb_text text = {0};
    alb_error error = {0};
    alb_text_add(&text, "{\"format\": 1, \"seed\": %d, \"profile\": {", seed);
    write_profile(&text, ALB_REFLECTION);
    alb_text_add(&text, ", ");
    write_profile(&text, ALB_TRANSMISSION);
    alb_text_add(&text,
                 "},\n \"projector\": {\"pixel_mm\": 0.3, \"blur_sd_mm\": 0.15, \"irradiance_w_per_mm2\": [1, 1, 1]},\n"
                 " \"lamp\": {\"radiance_w_per_mm2_sr\": 0.25},\n"
                 " \"camera\": {\"width\": 240, \"height\": 180, \"focal_px\": 1000, \"centre_px\": [121, 88],\n"
                 "  \"distortion\": [-0.1, 0.05, 0, 0, 0], \"distance_mm\": 200, \"tilt_deg\": 15},\n"
                 " \"sensor\": {\"responsivity_e\": [1e6, 1e6, 1e6], \"full_well_e\": 10000, \"read_noise_e\": 3,\n"
                 "  \"gain_dn_per_e\": 0.4, \"black_level_dn\": 64, \"bits\": 12, \"vignetting\": 0.2}}\n");
    check_ok(alb_file_write_text(path, &text, &error), &error);
    alb_text_free(&text);
}

static void run(const alb_command *command, int argc, const char *const *argv)
{
    alb_error error = {0};
    char *copies[8];
    for (int i = 0; i < argc; i++)
        copies[i] = strdup(argv[i]);
    check_ok(command->run(argc, copies, &error), &error);
    for (int i = 0; i < argc; i++)
        free(copies[i]);
}

static void one_session(alb_material *material, int seed)
{
    alb_error error = {0};
    (void)!system("rm -rf statistics");
    write_truth("statistics_truth.json", seed);
    check_ok(alb_file_write("statistics_plan.json", plan, sizeof plan - 1, &error), &error);
    run(&alb_capture_command, 5,
        (const char *const[]){"statistics_plan.json", "-o", "statistics", "--rig", "virtual:statistics_truth.json"});
    run(&alb_calibrate_command, 1, (const char *const[]){"statistics"});
    run(&alb_fit_command, 1, (const char *const[]){"statistics"});
    check_ok(alb_material_read(material, "statistics/material.json", &error), &error);
}

static double true_value(const stated *s, int quantity)
{
    const double total = 2 * 3.141592653589793 * (s->a[0] / (s->b[0] * s->b[0]) + s->a[1] / (s->b[1] * s->b[1]));
    return quantity == 4 ? total : quantity % 2 ? s->b[quantity / 2] : s->a[quantity / 2];
}

static void error_bars_are_honest(void **state)
{
    (void)state;
    static double z[ALB_SIDES][QUANTITIES][VALUES];
    static const char *const names[QUANTITIES] = {"a1", "b1", "a2", "b2", "total"};
    static const alb_form expected[ALB_SIDES] = {ALB_FORM_TWO_EXPONENTIALS, ALB_FORM_SIGNED_EXPONENTIALS};
    double relative[ALB_SIDES] = {0};
    int wrong_form = 0;
    FILE *narration = stdout;
    fflush(stdout);
    const int kept = dup(STDOUT_FILENO), kept_narration = dup(STDERR_FILENO);
    (void)!freopen("statistics.log", "w", stdout);
    dup2(STDOUT_FILENO, STDERR_FILENO);
    for (int k = 0; k < SESSIONS; k++) {
        alb_material material;
        one_session(&material, k + 1);
        for (int side = 0; side < ALB_SIDES; side++)
            for (int c = 0; c < CHANNELS; c++) {
                const alb_fitted *f = &material.fitted[side][c];
                wrong_form += f->profile.form != expected[side];
                for (int q = 0; q < QUANTITIES; q++) {
                    const double value = q == 4 ? f->total : f->profile.parameters[q],
                                 sd = q == 4 ? f->total_sd : f->sd[q];
                    z[side][q][k * CHANNELS + c] = (value - true_value(&truth[side][c], q)) / sd;
                }
                relative[side] += f->total_sd / f->total / VALUES;
            }
    }
    fflush(narration);
    dup2(kept, STDOUT_FILENO);
    dup2(kept_narration, STDERR_FILENO);
    close(kept);
    close(kept_narration);
    print_message("%d sessions, %d channels; mean and variance of (recovered - true) / sd\n", SESSIONS, CHANNELS);
    double worst_mean = 0, worst_variance = 0;
    for (int side = 0; side < ALB_SIDES; side++)
        for (int q = 0; q < QUANTITIES; q++) {
            double mean = 0, variance = 0;
            for (int i = 0; i < VALUES; i++)
                mean += z[side][q][i] / VALUES;
            for (int i = 0; i < VALUES; i++)
                variance += pow(z[side][q][i] - mean, 2) / (VALUES - 1);
            print_message("  %-12s %-6s %+.3f +- %.3f   %.3f +- %.3f\n", alb_side_names[side], names[q], mean,
                          sqrt(1.0 / VALUES), variance, sqrt(2.0 / VALUES));
            worst_mean = fmax(worst_mean, fabs(mean) * sqrt(VALUES));
            worst_variance = fmax(worst_variance, fabs(variance - 1) / sqrt(2.0 / VALUES));
        }
    print_message("worst mean %.2f, worst variance %.2f of their sampling errors; wrong form in %d of %d; total known "
                  "to %.3f %% and "
                  "%.3f %%\n",
                  worst_mean, worst_variance, wrong_form, 2 * VALUES, 100 * relative[0], 100 * relative[1]);
    // Ten statistics of each kind: 3.5 sampling errors are passed by chance once in 200 runs.
    assert_true(worst_mean < 3.5);
    assert_true(worst_variance < 3.5);
    assert_true(wrong_form <= 6); // 1 % level of the choice: 3 expected at most
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(error_bars_are_honest)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
