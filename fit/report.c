// The page, picture and table of a fit.
#include "base/memory.h"
#include "base/plot.h"
#include "base/text.h"
#include "fit/report_tables.h"
#include "fit/uncertainty.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CURVES = 4 }; // of a channel: measured, fitted, and the ends of the band

static const char *const channel_colours[3] = {"#c8402f", "#2f8f4e", "#3465c0"};

// What is drawn of one side: per channel the readings, the fitted profile and its band, and the same in sd of the
// readings about the profile. `sd` is that of the fitted readings: that of S, relative, where they lie.
typedef struct side_plot {
    alb_curve curves[3 * CURVES], residuals[3 * (CURVES - 1)];
    double *fitted[3], *sd[3], *low[3], *high[3], *whitened[3], *whitened_low[3], *whitened_high[3];
    int channel_count;
} side_plot;

static void side_plot_free(side_plot *plot)
{
    for (int c = 0; c < 3; c++) {
        double *const all[] = {plot->fitted[c],   plot->sd[c],           plot->low[c],          plot->high[c],
                               plot->whitened[c], plot->whitened_low[c], plot->whitened_high[c]};
        for (size_t i = 0; i < sizeof all / sizeof all[0]; i++)
            free(all[i]);
    }
    *plot = (side_plot){.channel_count = 0};
}

static bool allocate_channel(side_plot *plot, int k, size_t n, alb_error *error)
{
    double **const all[] = {&plot->sd[k],       &plot->low[k],          &plot->high[k],
                            &plot->whitened[k], &plot->whitened_low[k], &plot->whitened_high[k]};
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++)
        if (!(*all[i] = alb_allocate(n, sizeof(double), error)))
            return false;
    return true;
}

static void fill_channel(side_plot *plot, int k, const alb_measurement *measurement)
{
    const alb_readings *readings = &measurement->readings;
    const alb_fitted *known = &measurement->outcome.fitted;
    for (int i = 0; i < readings->count; i++) {
        const double value = plot->fitted[k][i];
        const double relative =
            alb_profile_sd(known, readings->r_mm[i]) / fabs(alb_profile_value(&known->profile, readings->r_mm[i]));
        const double sd = known->identifiable && isfinite(relative) ? relative * fabs(value) : (double)NAN;
        plot->sd[k][i] = sd;
        plot->low[k][i] = value - 1.96 * sd;
        plot->high[k][i] = value + 1.96 * sd;
        plot->whitened[k][i] = (readings->value[i] - value) / readings->sd[i];
        plot->whitened_low[k][i] = -1.96 * sd / readings->sd[i];
        plot->whitened_high[k][i] = 1.96 * sd / readings->sd[i];
    }
}

static bool side_plot_create(side_plot *plot, const alb_fitting *fitting, alb_side side, alb_error *error)
{
    *plot = (side_plot){.channel_count = 0};
    for (int c = 0; c < fitting->material.channels; c++) {
        const alb_measurement *measurement = &fitting->sides[side][c];
        if (!measurement->measured)
            continue;
        const alb_readings *readings = &measurement->readings;
        const size_t n = (size_t)readings->count;
        const int k = plot->channel_count++;
        plot->fitted[k] = alb_operator_readings(&measurement->forward, &measurement->outcome.fitted.profile, error);
        if (!plot->fitted[k] || !allocate_channel(plot, k, n, error)) {
            side_plot_free(plot);
            return false;
        }
        fill_channel(plot, k, measurement);
        const char *name = fitting->material.channel_names[c], *colour = channel_colours[c];
        const double *r = readings->r_mm;
        const alb_curve curves[CURVES] = {{name, colour, r, readings->value, readings->sd, n, ALB_MARK_POINTS},
                                          {NULL, colour, r, plot->fitted[k], NULL, n, ALB_MARK_LINE},
                                          {NULL, colour, r, plot->low[k], NULL, n, ALB_MARK_DASHES},
                                          {NULL, colour, r, plot->high[k], NULL, n, ALB_MARK_DASHES}};
        const alb_curve residuals[CURVES - 1] = {{NULL, colour, r, plot->whitened[k], NULL, n, ALB_MARK_POINTS},
                                                 {NULL, colour, r, plot->whitened_low[k], NULL, n, ALB_MARK_DASHES},
                                                 {NULL, colour, r, plot->whitened_high[k], NULL, n, ALB_MARK_DASHES}};
        memcpy(plot->curves + CURVES * k, curves, sizeof curves);
        memcpy(plot->residuals + (CURVES - 1) * k, residuals, sizeof residuals);
    }
    return true;
}

static void put_csv(alb_text *csv, const alb_fitting *fitting, alb_side side, const side_plot *plot)
{
    int k = 0;
    for (int c = 0; c < fitting->material.channels; c++) {
        const alb_measurement *measurement = &fitting->sides[side][c];
        if (!measurement->measured)
            continue;
        for (int i = 0; i < measurement->readings.count; i++)
            alb_text_add(csv, "%s,%s,%.9g,%.9g,%.9g,%.9g\n", alb_side_names[side], fitting->material.channel_names[c],
                         measurement->readings.r_mm[i], measurement->readings.value[i], measurement->readings.sd[i],
                         plot->fitted[k][i]);
        k++;
    }
}

// The readings with what is known of how they were read, side by side with material.json's content.
static void put_json_readings(alb_json *json, const alb_measurement *measurement, const double *fitted,
                              const double *fitted_sd)
{
    const alb_readings *r = &measurement->readings;
    const size_t n = (size_t)r->count;
    alb_json_numbers(json, "r_mm", r->r_mm, n);
    alb_json_numbers(json, "measured_per_mm2", r->value, n);
    alb_json_numbers(json, "sd_per_mm2", r->sd, n);
    alb_json_numbers(json, "fitted_per_mm2", fitted, n);
    alb_json_numbers(json, "fitted_sd_per_mm2", fitted_sd, n);
    if (r->pixels == 0) // a table
        return;
    alb_json_numbers(json, "centre_mm", (double[2]){r->x_mm, r->y_mm}, 2);
    alb_json_numbers(json, "centre_covariance_mm2", r->centre_covariance_mm2, 3);
    alb_json_integer(json, "pixels", r->pixels);
    alb_json_integer(json, "pixels_not_measured", r->missing);
    alb_json_integer(json, "glints", r->glints);
    alb_json_number(json, "saturated_out_to_mm", r->core_mm);
    alb_json_number(json, "complete_out_to_mm", r->complete_mm);
    alb_json_list(json, "anisotropy");
    for (int k = 0; k < 2; k++) {
        alb_json_object(json, NULL);
        alb_json_integer(json, "times_round", k + 1);
        alb_json_number(json, "largest_relative", r->anisotropy[k].most);
        alb_json_number(json, "at_mm", r->anisotropy[k].most_r_mm);
        alb_json_number(json, "by_chance", r->anisotropy[k].chance);
        alb_json_end_object(json);
    }
    alb_json_end_list(json);
}

static bool write_json(const alb_fitting *fitting, const side_plot plots[ALB_SIDES], const char *notes,
                       const alb_provenance *provenance, const char *path, alb_error *error)
{
    alb_json json;
    alb_json_begin(&json, provenance);
    alb_material_put(&json, fitting);
    alb_json_object(&json, "readings");
    for (int side = 0; side < ALB_SIDES; side++) {
        if (!plots[side].channel_count)
            continue;
        alb_json_object(&json, alb_side_names[side]);
        for (int c = 0, k = 0; c < fitting->material.channels; c++)
            if (fitting->sides[side][c].measured) {
                alb_json_object(&json, fitting->material.channel_names[c]);
                put_json_readings(&json, &fitting->sides[side][c], plots[side].fitted[k], plots[side].sd[k]);
                alb_json_end_object(&json);
                k++;
            }
        alb_json_end_object(&json);
    }
    alb_json_end_object(&json);
    alb_json_string(&json, "notes", notes);
    return alb_json_write(&json, path, error);
}

static void put_page(alb_page *page, const alb_fitting *fitting, const char *svg, const char *notes)
{
    alb_page_begin(page, "Fit", fitting->material.name);
    alb_page_begin_pictures(page);
    alb_page_svg(page, svg,
                 "Readings with one sd; the fitted profile seen through the spot, with its 95 % band; residuals in sd, "
                 "with the band");
    alb_page_end_pictures(page);
    alb_report_profiles(page, fitting);
    alb_report_energy(page, fitting);
    alb_report_properties(page, fitting);
    alb_report_parameters(page, fitting);
    alb_report_attempts(page, fitting);
    alb_report_correlations(page, fitting);
    alb_report_readings(page, fitting);
    if (*notes)
        alb_page_heading(page, "Notes");
    alb_page_lines(page, notes);
}

bool alb_fitting_report(const alb_fitting *fitting, const alb_provenance *provenance, const char *notes,
                        const char *folder, alb_error *error)
{
    bool ok = false;
    char report[ALB_PATH_SIZE], path[ALB_PATH_SIZE];
    side_plot plots[ALB_SIDES] = {{.channel_count = 0}};
    alb_panel panels[2 * ALB_SIDES];
    size_t panel_count = 0;
    alb_text csv = {0}, svg = {0};
    alb_page page = {.html = {0}};
    if (!alb_path_join(report, folder, "report", error) || !alb_file_make_directory(report, error))
        return false;
    alb_text_add(&csv, "side,channel,r_mm,measured_per_mm2,sd_per_mm2,fitted_per_mm2\n");
    for (int side = 0; side < ALB_SIDES; side++) {
        if (!side_plot_create(&plots[side], fitting, (alb_side)side, error))
            goto done;
        const size_t n = (size_t)plots[side].channel_count;
        if (n == 0)
            continue;
        put_csv(&csv, fitting, (alb_side)side, &plots[side]);
        panels[panel_count++] =
            (alb_panel){alb_side_names[side], NULL, "per mm²", false, true, 0, 0, plots[side].curves, CURVES * n, 2};
        panels[panel_count++] = (alb_panel){NULL, "distance (mm)",       "residual (sd)",  false, false, 0,
                                            0,    plots[side].residuals, (CURVES - 1) * n, 1};
    }
    alb_plot_add(&svg, panels, panel_count, 760, 300 * (int)panel_count);
    put_page(&page, fitting, svg.bytes ? svg.bytes : "", notes);
    ok = alb_path_join(path, report, "fit.csv", error) && alb_file_write_text(path, &csv, error) &&
         alb_path_join(path, report, "fit.svg", error) && alb_file_write_text(path, &svg, error) &&
         alb_path_join(path, report, "fit.json", error) && write_json(fitting, plots, notes, provenance, path, error) &&
         alb_path_join(path, report, "fit.html", error) && alb_page_write(&page, path, error);
done:
    for (int side = 0; side < ALB_SIDES; side++)
        side_plot_free(&plots[side]);
    alb_text_free(&csv);
    alb_text_free(&svg);
    alb_page_free(&page);
    return ok;
}
