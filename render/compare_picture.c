// What a comparison of two pictures looks like: both at one exposure, both on a logarithmic scale, their signed
// difference, and scan lines through the brightest place.
//   at one exposure:  value / peak, sRGB-encoded, clipped at 1
//   logarithmic:      1 + log10(value / peak) / 4 as display value: 4 decades from black to white
//   difference:       mean over channels of photo - render, blue (render brighter) - white - red (photo brighter); full
//                     colour at the 99th percentile of its size, rounded up to 1, 2 or 5 times a power of ten
#include "render/compare.h"

#include "base/memory.h"
#include "base/plot.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { DECADES = 4, BAR_PX = 14, BAR_GAP_PX = 6 };

// Linear value that alb_image_write_png shows as display value v in 0..1.
static float shown(double v)
{
    v = fmin(fmax(v, 0), 1);
    return (float)(v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4));
}

static bool picture_path(char path[ALB_PATH_SIZE], const char *folder, const char *stem, const char *what,
                         alb_error *error)
{
    char name[128];
    snprintf(name, sizeof name, "%s_%s", stem, what);
    return alb_path_join(path, folder, name, error);
}

static bool add_plain(alb_page *page, const alb_image *image, double peak, const char *path, const char *caption,
                      alb_error *error)
{
    return alb_image_write_png(image, 1 / peak, path, error) && alb_page_picture(page, path, caption, error);
}

static bool add_logarithmic(alb_page *page, const alb_image *image, double peak, const char *path, const char *caption,
                            alb_error *error)
{
    alb_image picture = {0};
    if (!alb_image_create(&picture, image->width, image->height, image->channels == 3 ? "R,G,B" : "Y", error))
        return false;
    const size_t count = (size_t)image->width * (size_t)image->height * (size_t)image->channels;
    for (size_t i = 0; i < count; i++) {
        const double share = (double)image->pixels[i] / peak;
        picture.pixels[i] = share > 0 ? shown(1 + log10(share) / DECADES) : 0;
    }
    const bool ok = alb_image_write_png(&picture, 1, path, error) && alb_page_picture(page, path, caption, error);
    alb_image_free(&picture);
    return ok;
}

static double difference_at(const alb_comparison *c, size_t pixel)
{
    double sum = 0;
    for (int k = 0; k < c->channels; k++) {
        const size_t i = pixel * (size_t)c->channels + (size_t)k;
        sum += (double)c->photo.pixels[i] - (double)c->render.pixels[i];
    }
    return sum / c->channels;
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// The 99th percentile of the size of the difference, rounded up; the peak's millionth where nothing differs.
static bool difference_range(double *range, const alb_comparison *c, alb_error *error)
{
    double *sizes = alb_allocate((size_t)c->compared, sizeof *sizes, error);
    if (!sizes)
        return false;
    size_t count = 0;
    for (size_t i = 0; i < (size_t)c->photo.width * (size_t)c->photo.height; i++)
        if (c->used[i])
            sizes[count++] = fabs(difference_at(c, i)) / c->peak;
    qsort(sizes, count, sizeof *sizes, by_value);
    const double size = fmax(sizes[(size_t)ceil(0.99 * (double)count) - 1], 1e-6);
    free(sizes);
    const double power = pow(10, floor(log10(size)));
    *range = size <= power ? power : size <= 2 * power ? 2 * power : size <= 5 * power ? 5 * power : 10 * power;
    return true;
}

static void diverge(float *pixel, double t)
{
    static const double ends[2][3] = {{0x21, 0x66, 0xac}, {0xb2, 0x18, 0x2b}}; // display values of blue and red
    t = fmin(fmax(t, -1), 1);
    for (int k = 0; k < 3; k++)
        pixel[k] = shown(1 + fabs(t) * (ends[t > 0][k] / 255 - 1));
}

// The difference and, to its right, the colour bar: +range on top, -range at the bottom.
static bool add_difference(alb_page *page, const alb_comparison *c, const char *path, alb_error *error)
{
    alb_image picture = {0};
    double range;
    char caption[400];
    const int width = c->photo.width, height = c->photo.height;
    if (!difference_range(&range, c, error) ||
        !alb_image_create(&picture, width + BAR_GAP_PX + BAR_PX, height, "R,G,B", error))
        return false;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < picture.width; x++) {
            float *pixel = alb_image_at(&picture, x, y);
            const size_t i = (size_t)y * (size_t)width + (size_t)x;
            if (x >= width + BAR_GAP_PX)
                diverge(pixel, 1 - 2 * (y + 0.5) / height);
            else if (x >= width)
                diverge(pixel, 0);
            else if (c->used[i])
                diverge(pixel, difference_at(c, i) / (range * c->peak));
            else
                pixel[0] = pixel[1] = pixel[2] = shown(0.6);
        }
    }
    snprintf(
        caption, sizeof caption,
        "Photo minus render, mean of the channels. Red: photo brighter; blue: render brighter; white: equal; grey: not "
        "compared. The bar runs from +%g %% (top) to \u2212%g %% (bottom) of the peak.",
        100 * range, 100 * range);
    const bool ok = alb_image_write_png(&picture, 1, path, error) && alb_page_picture(page, path, caption, error);
    alb_image_free(&picture);
    return ok;
}

// Fills x and the values of one channel along a row or a column; pixels that are not compared are NaN.
static void scan(double *at, double *photo, double *render, const alb_comparison *c, bool row, int channel)
{
    const int count = row ? c->photo.width : c->photo.height;
    for (int i = 0; i < count; i++) {
        const int x = row ? i : c->spot_x, y = row ? c->spot_y : i;
        const bool used = c->used[(size_t)y * (size_t)c->photo.width + (size_t)x];
        at[i] = i;
        photo[i] = used ? (double)alb_image_at(&c->photo, x, y)[channel] : (double)NAN;
        render[i] = used ? (double)alb_image_at(&c->render, x, y)[channel] : (double)NAN;
    }
}

static bool add_scans(alb_page *page, const alb_comparison *c, const char *path, alb_error *error)
{
    static const char *const colours[] = {"#c8372d", "#2b8a3e", "#2b5fb8"};
    const size_t longest = (size_t)(c->photo.width > c->photo.height ? c->photo.width : c->photo.height);
    char titles[2][64], labels[6][48];
    alb_curve curves[2][6];
    double *values = alb_allocate(2 * 3 * 3 * longest, sizeof *values, error);
    if (!values)
        return false;
    for (int row = 0; row < 2; row++)
        for (int k = 0; k < c->channels; k++) {
            double *at = values + (size_t)(row * 3 + k) * 3 * longest, *photo = at + longest, *render = photo + longest;
            const size_t count = (size_t)(row ? c->photo.width : c->photo.height);
            const char *colour = c->channels == 3 ? colours[k] : "#333";
            scan(at, photo, render, c, row, k);
            snprintf(labels[2 * k], sizeof labels[0], "%s photo", c->names[k]);
            snprintf(labels[2 * k + 1], sizeof labels[0], "render");
            curves[row][2 * k] = (alb_curve){
                .label = labels[2 * k], .colour = colour, .x = at, .y = photo, .count = count, .mark = ALB_MARK_POINTS};
            curves[row][2 * k + 1] = (alb_curve){.label = labels[2 * k + 1],
                                                 .colour = colour,
                                                 .x = at,
                                                 .y = render,
                                                 .count = count,
                                                 .mark = ALB_MARK_LINE};
        }
    snprintf(titles[1], sizeof titles[1], "Row %d", c->spot_y);
    snprintf(titles[0], sizeof titles[0], "Column %d", c->spot_x);
    alb_panel panels[2];
    for (int i = 0; i < 2; i++)
        panels[i] = (alb_panel){.title = titles[1 - i],
                                .x_label = i ? "y (pixels)" : "x (pixels)",
                                .y_label = "value (photo's unit)",
                                .log_y = true,
                                .y_minimum = c->peak * 1e-5,
                                .y_maximum = c->peak * 3,
                                .curves = curves[1 - i],
                                .curve_count = 2 * (size_t)c->channels,
                                .height = 1};
    const bool ok = alb_plot_write(path, panels, 2, 900, 640, error) &&
                    alb_page_picture(page, path,
                                     "Scan lines through the brightest place: photo as dots, scaled render as a line; "
                                     "values of zero or less have no place on the logarithmic axis.",
                                     error);
    free(values);
    return ok;
}

static void add_row(alb_page *page, const char *name, const alb_measure *m)
{
    char psnr[32] = "infinite: identical";
    if (isfinite(m->psnr_db))
        snprintf(psnr, sizeof psnr, "%.2f", m->psnr_db);
    alb_page_row(page, "%s|%.6g|%.4g|%.3f %%|%s|%.5f", name, m->scale, m->rmse, 100 * m->relative_rmse, psnr, m->ssim);
}

static void add_numbers(alb_page *page, const alb_comparison *c)
{
    alb_page_paragraph(
        page,
        "The render was multiplied by %.6g, the least-squares factor of all channels together; everything "
        "below is after that. The column \u2018scale alone\u2019 is the factor one channel would choose.",
        c->scale);
    alb_page_table(page, "channel|scale alone|RMSE|relative RMSE|PSNR (dB)|SSIM");
    for (int k = 0; k < c->channels; k++)
        add_row(page, c->names[k], &c->channel[k]);
    add_row(page, "all", &c->all);
    alb_page_end_table(page);
    alb_page_paragraph(
        page,
        "%ld of %ld pixels compared; %ld outside the mask, %ld not finite in the photo, %ld in the render. "
        "Peak: %.6g, the photo\u2019s 99.9th percentile. Relative RMSE: over the photo\u2019s rms. SSIM on linear "
        "values over the peak.",
        c->compared, (long)c->photo.width * c->photo.height, c->outside_mask, c->bad_photo, c->bad_render, c->peak);
}

bool alb_comparison_draw(alb_page *page, const alb_comparison *c, const char *folder, const char *stem,
                         alb_error *error)
{
    char paths[6][ALB_PATH_SIZE];
    const char *const names[] = {"photo.png",      "render.png",     "photo_log.png",
                                 "render_log.png", "difference.png", "scanlines.svg"};
    for (int i = 0; i < 6; i++)
        if (!picture_path(paths[i], folder, stem, names[i], error))
            return false;
    add_numbers(page, c);
    alb_page_begin_pictures(page);
    if (!add_plain(page, &c->photo, c->peak, paths[0], "Photo, white at the peak", error) ||
        !add_plain(page, &c->render, c->peak, paths[1], "Render, scaled, same exposure", error) ||
        !add_difference(page, c, paths[4], error))
        return false;
    alb_page_end_pictures(page);
    alb_page_begin_pictures(page);
    if (!add_logarithmic(page, &c->photo, c->peak, paths[2], "Photo, logarithmic: 4 decades from black to the peak",
                         error) ||
        !add_logarithmic(page, &c->render, c->peak, paths[3], "Render, logarithmic, same scale", error))
        return false;
    alb_page_end_pictures(page);
    alb_page_begin_pictures(page);
    if (!add_scans(page, c, paths[5], error))
        return false;
    alb_page_end_pictures(page);
    return true;
}
