// What every profile form leaves of reflection and transmission of slabs by photons (tests/fit/slabs.h), spot radius
// 0.5 mm, range 3000:1, 1 % a reading: relative rms over the readings whose photon noise is below 1 %, and the error of
// the total, against the number of parameters.
//   bench.fit_forms [CHART.svg]
#include "../fit/slabs.h"
#include "base/plot.h"
#include "fit/form_search.h"
#include <stdio.h>
#include <stdlib.h>

enum { MORE = 4 };
static const alb_candidate candidates[] = {{ALB_FORM_EXPONENTIAL, false},        {ALB_FORM_BURLEY, false},
                                           {ALB_FORM_SIGNED_EXPONENTIALS, true}, {ALB_FORM_BURIED_SOURCE, false},
                                           {ALB_FORM_TWO_EXPONENTIALS, false},   {ALB_FORM_SIGNED_EXPONENTIALS, false},
                                           {ALB_FORM_TWO_OVER_R, false},         {ALB_FORM_BURIED_AND_OVER_R, false},
                                           {ALB_FORM_THREE_EXPONENTIALS, false}, {ALB_FORM_TWO_BURIED_SOURCES, false}};
enum { CANDIDATES = sizeof candidates / sizeof candidates[0] };

typedef struct tried {
    double rms[SLABS], total[SLABS]; // percent
    int count, slabs;                // fitted; tried
} tried;

static double rms_of(const alb_weighing *weighing, const alb_profile *profile, alb_error *error)
{
    const alb_readings *readings = weighing->readings;
    double *model = alb_operator_readings(weighing->forward, profile, error), squares = 0;
    int counted = 0;
    for (int i = 0; model && i < readings->count; i++)
        if (slabs_noise(readings, i) <= 0.01) {
            squares += pow(readings->value[i] / model[i] - 1, 2);
            counted++;
        }
    free(model);
    return 100 * sqrt(squares / fmax(counted, 1));
}

static bool try_all(tried all[CANDIDATES], const alb_photon_tally *tally, alb_side side, alb_error *error)
{
    bool ok = false;
    alb_readings readings = {0};
    alb_spot spot = {0};
    alb_operator forward = {0};
    alb_bases bases = {0};
    if (!slabs_readings(&readings, tally, side, false) || !alb_spot_disc(&spot, slabs_spot_mm, error) ||
        !alb_operator_create(&forward, &readings, &spot, error) ||
        !alb_basis_create(&bases.exponentials, &readings, &forward, error))
        goto done;
    const alb_weighing weighing = {&readings, &forward, readings.sd, 0};
    const double truth = tally->leaving[side] - tally->unscattered[side];
    for (int f = 0; f < CANDIDATES; f++) {
        alb_profile profile;
        double chi_square;
        bool found;
        if (!alb_form_search(&profile, &chi_square, &found, candidates[f], &bases, &weighing, error))
            goto done;
        all[f].slabs++;
        if (!found)
            continue;
        all[f].rms[all[f].count] = rms_of(&weighing, &profile, error);
        all[f].total[all[f].count++] = 100 * fabs(alb_profile_total(&profile) / truth - 1);
    }
    ok = true;
done:
    alb_bases_free(&bases);
    alb_operator_free(&forward);
    alb_spot_free(&spot);
    alb_readings_free(&readings);
    return ok;
}

// Median and largest, each form a bar between them.
static void chart_side(alb_curve curves[CANDIDATES], double (*x)[2], double (*y)[2], tried all[CANDIDATES])
{
    static char labels[CANDIDATES][64];
    for (int f = 0; f < CANDIDATES; f++) {
        const alb_candidate c = candidates[f];
        const double shift = 0.09 * (f % 3 - 1);
        snprintf(labels[f], sizeof labels[f], "%s%s", alb_form_name(c.form), c.tied ? ", tied" : "");
        x[f][0] = x[f][1] = alb_candidate_parameters(c) + shift;
        y[f][0] = alb_median(all[f].rms, (size_t)all[f].count);
        y[f][1] = all[f].count ? all[f].rms[all[f].count - 1] : (double)NAN; // sorted by the median
        curves[f] = (alb_curve){.label = labels[f], .x = x[f], .y = y[f], .count = 2, .mark = ALB_MARK_LINE_AND_POINTS};
    }
}

static bool write_chart(const char *path, tried all[ALB_SIDES][CANDIDATES], alb_error *error)
{
    alb_curve curves[ALB_SIDES][CANDIDATES];
    double x[ALB_SIDES][CANDIDATES][2], y[ALB_SIDES][CANDIDATES][2];
    alb_panel panels[ALB_SIDES];
    static const char *const titles[] = {"Reflection of slabs by photons: what a form leaves (median and worst slab)",
                                         "Transmission"};
    for (int side = 0; side < ALB_SIDES; side++) {
        chart_side(curves[side], x[side], y[side], all[side]);
        panels[side] = (alb_panel){.title = titles[side],
                                   .x_label = "parameters",
                                   .y_label = "rms, %",
                                   .log_y = true,
                                   .curves = curves[side],
                                   .curve_count = CANDIDATES,
                                   .height = 1};
    }
    return alb_plot_write(path, panels, ALB_SIDES, 900, 1000, error);
}

int main(int argc, char **argv)
{
    static tried all[ALB_SIDES][CANDIDATES];
    alb_error error = {0};
    bool ok = true;
    for (int s = 0; ok && s < SLABS; s++) {
        alb_photon_tally tally;
        ok = slabs_trace(&tally, &slabs[s], MORE);
        for (int side = 0; ok && side < ALB_SIDES; side++)
            if (slabs_seen(&tally, &slabs[s], MORE, (alb_side)side))
                ok = try_all(all[side], &tally, (alb_side)side, &error);
    }
    printf("%-13s %-26s %10s %8s %22s %26s\n", "side", "form", "parameters", "fitted", "rms median, worst, %",
           "|total| median, worst, %");
    for (int side = 0; ok && side < ALB_SIDES; side++)
        for (int f = 0; f < CANDIDATES; f++) {
            tried *t = &all[side][f];
            const double rms = alb_median(t->rms, (size_t)t->count), total = alb_median(t->total, (size_t)t->count);
            const int last = t->count ? t->count - 1 : 0;
            printf("%-13s %-20s%-6s %10d %4d/%-3d %12.2f %9.2f %13.2f %12.2f\n", alb_side_names[side],
                   alb_form_name(candidates[f].form), candidates[f].tied ? " tied" : "",
                   alb_candidate_parameters(candidates[f]), t->count, t->slabs, rms, t->rms[last], total,
                   t->total[last]);
        }
    if (ok && argc > 1)
        ok = write_chart(argv[1], all, &error);
    if (!ok)
        fprintf(stderr, "bench.fit_forms: %s\n", error.text);
    return ok ? 0 : 1;
}
