// Optical properties from exact totals: error against time per inversion, by transport with 4 to 32 streams and by
// diffusion. Prints a table and draws the chart: bench.optical_properties CHART.svg
//
// Slabs: marble-, wax- and skim-milk-like (6 media), 2, 5, 10 and 20 mm, n = 1.5, g = 0 and 0.9 (known): 48.
// Half-spaces: the same media, 12, of which reflection gives sigma_a / sigma_s'. Totals by discrete ordinates in
// eigenvectors.
#include "../fit/discrete_ordinates.h"
#include "base/plot.h"
#include "base/progress.h"
#include "fit/optical.h"
#include <stdio.h>

enum { MEDIA = 6, SLABS = 48, BODIES = 12, SETTINGS = 6, METHODS = SETTINGS + 2, REPEATS = 5 };
static const int streams_of[SETTINGS] = {4, 8, 12, 16, 24, 32};
static const double media[MEDIA][2] = {{0.0021, 2.19}, {0.0071, 3.0}, {0.006, 1.35},
                                       {0.03, 1.7},    {0.0014, 0.7}, {0.0142, 1.9}};

typedef struct bench {
    alb_medium slabs[SLABS], bodies[BODIES];
    double slab_totals[SLABS][2], body_totals[BODIES][2];
    double median[METHODS][2], worst[METHODS][2], milliseconds[METHODS]; // sigma_a, sigma_s'
    double solved_percent[METHODS];
    double ratio_worst[METHODS], ratio_milliseconds[METHODS];
} bench;

static void make_truth(bench *b)
{
    for (int i = 0; i < SLABS; i++) {
        const double g = i % 2 ? 0.9 : 0, *m = media[i / 8], thickness = (double[]){2, 5, 10, 20}[i / 2 % 4];
        b->slabs[i] = (alb_medium){m[0], m[1] / (1 - g), g, 1.5, thickness};
        discrete_ordinates(b->slab_totals[i], &b->slabs[i]);
    }
    for (int i = 0; i < BODIES; i++) {
        const double g = i % 2 ? 0.9 : 0, *m = media[i / 2], deep = 30 / sqrt(3 * m[0] * (m[0] + m[1]));
        b->bodies[i] = (alb_medium){m[0], m[1] / (1 - g), g, 1.5, deep};
        discrete_ordinates(b->body_totals[i], &b->bodies[i]);
    }
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// One inversion of slab i by method k; the fastest of a few in *ms.
static bool invert(double found[2], double *ms, const bench *b, const alb_optical_model *model, int k, int i)
{
    const alb_medium *slab = &b->slabs[i];
    const double *t = b->slab_totals[i];
    const alb_diffusion_face face =
        alb_diffusion_face_at(k == SETTINGS ? ALB_DIFFUSION_CLASSIC : ALB_DIFFUSION_GROSJEAN, slab->refractive_index);
    bool ok = false;
    *ms = HUGE_VAL;
    for (int repeat = 0; repeat < REPEATS; repeat++) {
        const double start_s = alb_clock_s();
        if (k < SETTINGS) {
            const alb_measured_totals totals = {
                .reflection = t[0], .transmission = t[1], .thickness_mm = slab->thickness_mm};
            alb_optical out;
            ok = alb_optical_from_totals(&out, model, &totals, NULL);
            found[0] = out.absorption_per_mm, found[1] = out.reduced_scattering_per_mm;
        } else {
            ok = alb_optical_from_diffusion(found, &face, slab->refractive_index, t[0], t[1], slab->thickness_mm);
        }
        *ms = fmin(*ms, 1000 * (alb_clock_s() - start_s));
    }
    return ok;
}

static void measure_slabs(bench *b, int k)
{
    alb_optical_model models[2];
    double error[2][SLABS], times[SLABS];
    int solved = 0;
    for (int forward = 0; k < SETTINGS && forward < 2; forward++)
        alb_optical_model_create(&models[forward], streams_of[k], 1.5, forward ? 0.9 : 0);
    for (int i = 0; i < SLABS; i++) {
        double found[2], ms;
        if (!invert(found, &ms, b, &models[i % 2], k, i))
            continue;
        times[solved] = ms;
        for (int p = 0; p < 2; p++)
            error[p][solved] = 100 * fabs(found[p] / media[i / 8][p] - 1);
        solved++;
    }
    b->solved_percent[k] = 100.0 * solved / SLABS;
    qsort(times, (size_t)solved, sizeof *times, by_value);
    b->milliseconds[k] = times[solved / 2];
    for (int p = 0; p < 2; p++) {
        qsort(error[p], (size_t)solved, sizeof **error, by_value);
        b->median[k][p] = error[p][solved / 2];
        b->worst[k][p] = error[p][solved - 1];
    }
}

// sigma_a / sigma_s' of a half-space by a dipole: the total falls with it.
static double ratio_by_dipole(const alb_diffusion_face *face, double reflection_of_entered)
{
    double low = -40, high = 10;
    for (int i = 0; i < 60; i++) {
        const double middle = (low + high) / 2;
        const alb_diffusion body = alb_diffusion_at(face, exp(middle), 1, 0);
        *(alb_diffusion_total(NULL, &body, ALB_REFLECTION) > reflection_of_entered ? &low : &high) = middle;
    }
    return exp(low);
}

static void measure_bodies(bench *b, int k)
{
    alb_optical_model models[2];
    double ms = 0;
    const alb_diffusion_face face =
        alb_diffusion_face_at(k == SETTINGS ? ALB_DIFFUSION_CLASSIC : ALB_DIFFUSION_GROSJEAN, 1.5);
    for (int forward = 0; k < SETTINGS && forward < 2; forward++)
        alb_optical_model_create(&models[forward], streams_of[k], 1.5, forward ? 0.9 : 0);
    for (int i = 0; i < BODIES; i++) {
        const alb_measured_totals totals = {.reflection = b->body_totals[i][0]};
        double ratio = 0, fastest = HUGE_VAL;
        for (int repeat = 0; repeat < REPEATS; repeat++) {
            const double start_s = alb_clock_s();
            alb_optical out;
            if (k >= SETTINGS)
                ratio = ratio_by_dipole(&face, totals.reflection / 0.96);
            else if (alb_optical_from_totals(&out, &models[i % 2], &totals, NULL))
                ratio = 1 / out.reduced_albedo - 1;
            fastest = fmin(fastest, 1000 * (alb_clock_s() - start_s));
        }
        ms += fastest / BODIES;
        const double truth = media[i / 2][0] / media[i / 2][1];
        b->ratio_worst[k] = fmax(b->ratio_worst[k], 100 * fabs(ratio / truth - 1));
    }
    b->ratio_milliseconds[k] = ms;
}

static bool chart(const bench *b, const char *path, alb_error *error)
{
    double series[2][METHODS];
    for (int k = 0; k < METHODS; k++)
        for (int p = 0; p < 2; p++)
            series[p][k] = b->worst[k][p];
    alb_curve slabs[6] = {{0}}, bodies[3] = {{0}};
    static const char *const names[] = {"transport, sigma_a",          "transport, sigma_s'",
                                        "classic multipole, sigma_a",  "classic multipole, sigma_s'",
                                        "Grosjean multipole, sigma_a", "Grosjean multipole, sigma_s'"};
    for (int c = 0; c < 6; c++) {
        const int first = c < 2 ? 0 : SETTINGS + (c - 2) / 2;
        slabs[c] = (alb_curve){.label = names[c],
                               .x = b->milliseconds + first,
                               .y = series[c % 2] + first,
                               .count = c < 2 ? SETTINGS : 1,
                               .mark = c < 2 ? ALB_MARK_LINE_AND_POINTS : ALB_MARK_POINTS};
    }
    for (int c = 0; c < 3; c++)
        bodies[c] = (alb_curve){.label = (const char *[]){"transport", "classic dipole", "better dipole"}[c],
                                .x = b->ratio_milliseconds + (c ? SETTINGS + c - 1 : 0),
                                .y = b->ratio_worst + (c ? SETTINGS + c - 1 : 0),
                                .count = c ? 1 : SETTINGS,
                                .mark = c ? ALB_MARK_POINTS : ALB_MARK_LINE_AND_POINTS};
    const alb_panel panels[2] = {
        {.title = "48 slabs, exact totals: worst error of sigma_a, sigma_s' (4, 8, 12, 16, 24, 32 streams; diffusion)",
         .x_label = "milliseconds an inversion",
         .y_label = "worst error, %",
         .log_x = true,
         .log_y = true,
         .curves = slabs,
         .curve_count = 6,
         .height = 1.3},
        {.title = "12 half-spaces, exact reflection: worst error of sigma_a / sigma_s'",
         .x_label = "milliseconds an inversion",
         .y_label = "worst error, %",
         .log_x = true,
         .log_y = true,
         .curves = bodies,
         .curve_count = 3,
         .height = 1}};
    return alb_plot_write(path, panels, 2, 800, 800, error);
}

int main(int argc, char **argv)
{
    static bench b;
    alb_error error = {0};
    make_truth(&b);
    printf("%-20s %8s  %21s  %21s %10s   %s\n", "method", "solved", "sigma_a median, worst", "sigma_s' median, worst",
           "ms", "half-space ratio worst, ms");
    for (int k = 0; k < METHODS; k++) {
        char name[32] = "classic multipole";
        if (k < SETTINGS)
            snprintf(name, sizeof name, "transport %d", streams_of[k]);
        else if (k > SETTINGS)
            snprintf(name, sizeof name, "Grosjean multipole");
        measure_slabs(&b, k);
        measure_bodies(&b, k);
        printf("%-20s %6.0f %%  %8.4f %% %8.4f %%  %8.4f %% %8.4f %% %10.3f   %.4f %% %.3f\n", name,
               b.solved_percent[k], b.median[k][0], b.worst[k][0], b.median[k][1], b.worst[k][1], b.milliseconds[k],
               b.ratio_worst[k], b.ratio_milliseconds[k]);
    }
    if (argc > 1 && !chart(&b, argv[1], &error)) {
        fprintf(stderr, "bench.optical_properties: %s\n", error.text);
        return (int)error.status;
    }
    return 0;
}
