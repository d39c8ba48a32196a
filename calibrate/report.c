// The page of a calibration: sensor, vignetting, lens and pose, and a picture of every product.
#include "calibrate/report.h"
#include "base/memory.h"
#include "base/page.h"
#include "base/plot.h"
#include "calibrate/flat.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { SAMPLES = 64 };

static void add_vignetting(alb_page *page, const alb_calibration *c)
{
    static const char *const colours[3] = {"#c0392b", "#27864a", "#2c5fa8"};
    const alb_lens *lens = &c->views[0].camera.lens;
    double x[SAMPLES], y[3][SAMPLES];
    alb_curve curves[3];
    for (int i = 0; i < c->channels; i++) {
        for (int k = 0; k < SAMPLES; k++) {
            x[k] = 0.5 * hypot(lens->width, lens->height) * k / (SAMPLES - 1);
            y[i][k] = alb_flat_value(c->flat[i], lens, 0.5 * lens->width + x[k], 0.5 * lens->height);
        }
        curves[i] = (alb_curve){.label = c->channel_names[i],
                                .colour = colours[c->channels == 3 ? i : 2],
                                .x = x,
                                .y = y[i],
                                .count = SAMPLES};
    }
    const alb_panel panel = {.title = "Vignetting",
                             .x_label = "distance from the middle of the picture, px",
                             .y_label = "relative response",
                             .curves = curves,
                             .curve_count = (size_t)c->channels,
                             .height = 1};
    alb_text svg = {0};
    alb_plot_add(&svg, &panel, 1, 560, 320);
    alb_page_svg(page, svg.failed ? "" : svg.bytes, "Vignetting, fitted to the photograph of the diffuser.");
    alb_text_free(&svg);
}

// The pictures span four decades: shown as the fourth root, so that the tail is to be seen beside the core.
static bool add_product(alb_page *page, const alb_calibration *c, int index, const alb_image *image, alb_error *error)
{
    char path[ALB_PATH_SIZE], name[ALB_NAME_SIZE + 32];
    alb_image shown = {0};
    if (!alb_image_create(&shown, image->width, image->height, c->channels == 3 ? "R,G,B" : "Y", error))
        return false;
    double peak = 0;
    const size_t count = (size_t)image->width * (size_t)image->height;
    for (size_t i = 0; i < count; i++)
        for (int k = 0; k < c->channels; k++) {
            const double v = (double)image->pixels[i * (size_t)image->channels + (size_t)k];
            shown.pixels[i * (size_t)c->channels + (size_t)k] = (float)sqrt(v > 0 ? v : 0);
            peak = v > peak ? v : peak;
        }
    snprintf(name, sizeof name, "report/%s.png", c->products[index].shot);
    const bool ok = alb_path_join(path, c->folder, name, error) &&
                    alb_image_write_png(&shown, peak > 0 ? 1 / sqrt(peak) : 1, path, error) &&
                    alb_page_picture(page, path, c->products[index].shot, error);
    alb_image_free(&shown);
    return ok;
}

static void add_sensor(alb_page *page, const alb_calibration *c, double linearity, double flat_rms)
{
    alb_page_heading(page, "Sensor");
    alb_page_table(page, "channel|black, DN|sd|read noise, DN|gain, DN per electron|sd");
    for (int i = 0; i < c->channels; i++)
        alb_page_row(page, "%s|%.3f|%.4f|%.3f|%.5f|%.5f", c->channel_names[i], c->black_dn[i].value, c->black_dn[i].sd,
                     c->read_noise_dn[i].value, c->gain_dn_per_electron[i].value, c->gain_dn_per_electron[i].sd);
    alb_page_end_table(page);
    alb_page_paragraph(page, "Linearity over the exposures of the diffuser: %.3f %%. Vignetting fits to %.2f %% rms.",
                       100 * linearity, 100 * flat_rms);
}

static void add_lens(alb_page *page, const alb_calibration *c, const alb_board_views *boards)
{
    static const char *const names[9] = {"fx, px", "fy, px", "cx, px", "cy, px", "k1", "k2", "p1", "p2", "k3"};
    const alb_lens *l = &c->views[0].camera.lens;
    const double values[9] = {l->fx, l->fy, l->cx, l->cy, l->k1, l->k2, l->p1, l->p2, l->k3};
    alb_page_heading(page, "Lens and pose");
    alb_page_table(page, "parameter|value|sd");
    for (int i = 0; i < 9; i++)
        alb_page_row(page, "%s|%.6g|%.2g", names[i], values[i], c->lens_sd[i]);
    alb_page_end_table(page);
    alb_page_paragraph(page, "RMS %.3f px over %d photographs of the board, as sqrt(mean(du^2 + dv^2)).",
                       c->lens_rms_px, boards->found_count);
    alb_page_table(page, "photograph|rms, px");
    for (int v = 0; v < boards->count; v++)
        alb_page_row(page, boards->found[v] ? "%s|%.3f" : "%s|not found", boards->name[v], boards->rms_px[v]);
    for (int s = 0; s < ALB_SIDES; s++)
        if (c->views[s].known)
            alb_page_row(page, "pose, %s (lengths known to %.3f %%)|%.3f", alb_side_names[s],
                         100 * c->views[s].relative_length_sd, c->views[s].rms_px);
    alb_page_end_table(page);
}

bool alb_calibration_report(const alb_calibration *calibration, const alb_board_views *boards, double linearity,
                            double flat_rms, const alb_image *images, alb_error *error)
{
    char path[ALB_PATH_SIZE];
    alb_page page = {0};
    if (!alb_path_join(path, calibration->folder, "report", error) || !alb_file_make_directory(path, error))
        return false;
    alb_page_begin(&page, "Calibration", calibration->sample);
    add_sensor(&page, calibration, linearity, flat_rms);
    add_lens(&page, calibration, boards);
    alb_page_heading(&page, "Pictures");
    alb_page_paragraph(&page, "Shown as the fourth root of the light, so that the tail is to be seen beside the core.");
    alb_page_begin_pictures(&page);
    add_vignetting(&page, calibration);
    bool ok = true;
    for (int i = 0; ok && i < calibration->product_count; i++)
        ok = add_product(&page, calibration, i, &images[i], error);
    alb_page_end_pictures(&page);
    ok = ok && alb_path_join(path, calibration->folder, "report/calibrate.html", error) &&
         alb_page_write(&page, path, error);
    alb_page_free(&page);
    return ok;
}
