// The page, picture and table of a fit.
#include "base/memory.h"
#include "base/page.h"
#include "base/plot.h"
#include "base/text.h"
#include "fit/measurement.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CURVES_MAX = 3 * 2 };

static const char *const channel_colours[3] = {"#c8402f", "#2f8f4e", "#3465c0"};

// What is drawn of one side: per channel measured and fitted, and the residuals in sd.
typedef struct side_plot {
    alb_curve curves[CURVES_MAX], residuals[3];
    double *fitted[3], *whitened[3];
    int channel_count;
} side_plot;

static void side_plot_free(side_plot *plot)
{
    for (int c = 0; c < 3; c++) {
        free(plot->fitted[c]);
        free(plot->whitened[c]);
    }
    *plot = (side_plot){0};
}

static bool side_plot_create(side_plot *plot, const alb_fitting *fitting, alb_side side, alb_error *error)
{
    *plot = (side_plot){0};
    for (int c = 0; c < fitting->material.channels; c++) {
        const alb_measurement *measurement = &fitting->sides[side][c];
        if (!measurement->measured)
            continue;
        const alb_readings *readings = &measurement->readings;
        const size_t n = (size_t)readings->count;
        const int k = plot->channel_count++;
        plot->fitted[k] = alb_operator_readings(&measurement->forward, &measurement->outcome.fitted.profile, error);
        plot->whitened[k] = alb_allocate(n, sizeof(double), error);
        if (!plot->fitted[k] || !plot->whitened[k]) {
            side_plot_free(plot);
            return false;
        }
        for (size_t i = 0; i < n; i++)
            plot->whitened[k][i] = (readings->value[i] - plot->fitted[k][i]) / readings->sd[i];
        const char *name = fitting->material.channel_names[c], *colour = channel_colours[c];
        plot->curves[2 * k] =
            (alb_curve){name, colour, readings->r_mm, readings->value, readings->sd, n, ALB_MARK_POINTS};
        plot->curves[2 * k + 1] = (alb_curve){NULL, colour, readings->r_mm, plot->fitted[k], NULL, n, ALB_MARK_LINE};
        plot->residuals[k] =
            (alb_curve){NULL, colour, readings->r_mm, plot->whitened[k], NULL, n, ALB_MARK_LINE_AND_POINTS};
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

static void put_row(alb_page *page, const alb_fitting *fitting, alb_side side, int c)
{
    const alb_outcome *outcome = &fitting->sides[side][c].outcome;
    const alb_fitted *fitted = &outcome->fitted;
    char parameters[256] = "";
    for (int p = 0; p < alb_form_parameter_count(fitted->profile.form); p++) {
        const size_t used = strlen(parameters);
        snprintf(parameters + used, sizeof parameters - used, "%s%.4g ± %.2g", p ? ", " : "",
                 fitted->profile.parameters[p], fitted->sd[p]);
    }
    alb_page_row(page, "%s|%s|%s|%s|%.5g|%.2g|%.4g / %d|%.2f|%.1f|%s", alb_side_names[side],
                 fitting->material.channel_names[c], alb_form_name(fitted->profile.form), parameters, fitted->total,
                 fitted->total_sd, fitted->chi_square, fitted->degrees_of_freedom, 100 * outcome->rms_relative,
                 100 * outcome->measured_share, outcome->undecided);
}

static void put_attempts(alb_page *page, const alb_fitting *fitting, alb_side side, int c)
{
    const alb_outcome *outcome = &fitting->sides[side][c].outcome;
    for (int i = 0; i < outcome->attempt_count; i++) {
        const alb_attempt *attempt = &outcome->attempts[i];
        alb_page_row(page, "%s|%s|%s%s|%.5g|%.5g|%s", alb_side_names[side], fitting->material.channel_names[c],
                     alb_form_name(attempt->form), attempt->tied ? ", b2 = 1.1 b1" : "", attempt->chi_square,
                     attempt->bic, *attempt->rejected ? attempt->rejected : "chosen");
    }
}

static void put_tables(alb_page *page, const alb_fitting *fitting, const char *notes)
{
    alb_page_heading(page, "Profiles");
    alb_page_table(page,
                   "side|channel|form|a1, b1, a2, b2, a3, b3 (1/mm², 1/mm)|total|sd|chi-square / dof|rms %|measured %|"
                   "not decided because");
    for (int side = 0; side < ALB_SIDES; side++)
        for (int c = 0; c < fitting->material.channels; c++)
            if (fitting->sides[side][c].measured)
                put_row(page, fitting, (alb_side)side, c);
    alb_page_end_table(page);
    alb_page_lines(page, notes);
    alb_page_heading(page, "Forms tried");
    alb_page_table(page, "side|channel|form|chi-square|BIC|rejected because");
    for (int side = 0; side < ALB_SIDES; side++)
        for (int c = 0; c < fitting->material.channels; c++)
            if (fitting->sides[side][c].measured)
                put_attempts(page, fitting, (alb_side)side, c);
    alb_page_end_table(page);
}

bool alb_fitting_report(const alb_fitting *fitting, const char *notes, const char *folder, alb_error *error)
{
    bool ok = false;
    char report[ALB_PATH_SIZE], path[ALB_PATH_SIZE];
    side_plot plots[ALB_SIDES] = {{.channel_count = 0}};
    alb_panel panels[2 * ALB_SIDES];
    size_t panel_count = 0;
    alb_text csv = {0}, svg = {0};
    alb_page page = {{0}};
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
            (alb_panel){alb_side_names[side], NULL, "per mm²", false, true, 0, 0, plots[side].curves, 2 * n, 2};
        panels[panel_count++] =
            (alb_panel){NULL, "distance (mm)", "residual (sd)", false, false, 0, 0, plots[side].residuals, n, 1};
    }
    alb_plot_add(&svg, panels, panel_count, 760, 300 * (int)panel_count);
    alb_page_begin(&page, "Fit", fitting->material.name);
    put_tables(&page, fitting, notes);
    alb_page_begin_pictures(&page);
    alb_page_svg(&page, svg.bytes ? svg.bytes : "",
                 "Readings with one sd, fitted profile seen through the spot, residuals");
    alb_page_end_pictures(&page);
    ok = alb_path_join(path, report, "fit.csv", error) && alb_file_write_text(path, &csv, error) &&
         alb_path_join(path, report, "fit.svg", error) && alb_file_write_text(path, &svg, error) &&
         alb_path_join(path, report, "fit.html", error) && alb_page_write(&page, path, error);
done:
    for (int side = 0; side < ALB_SIDES; side++)
        side_plot_free(&plots[side]);
    alb_text_free(&csv);
    alb_text_free(&svg);
    alb_page_free(&page);
    return ok;
}
