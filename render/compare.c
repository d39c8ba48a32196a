// Measures of two pictures p (photo) and r (render) over the pixels that both know.
//   scale s = sum p r / sum r^2            least squares of p ~ s r over all channels and compared pixels
//   RMSE    = sqrt(mean (p - s r)^2)       relative: over sqrt(mean p^2)
//   PSNR    = 20 log10(peak / RMSE)        peak: 99.9th percentile of p, so that one hot pixel does not set it
//   SSIM    of Wang, Bovik, Sheikh & Simoncelli 2004 (OpenCV's quality module) on linear values over the peak. Pixels
//   that
//           are not compared are set equal in both and so have SSIM 1; the shortfall from 1 is charged to the compared
//           ones: SSIM = 1 - (1 - SSIM over all pixels) * all / compared.
// Stops being true: least squares weights bright pixels most, so in a picture of a spot s is the spot's; RMSE and PSNR
// say little of what is four decades darker (the scan lines show it), and linear SSIM is nearly 1 wherever both are
// dark.
#include "render/compare.h"

#include "base/memory.h"
#include "base/vision.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double peak_share = 0.999;

static double linear_from_srgb(double v) { return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4); }

bool alb_compare_read(alb_image *image, const char **how, const char *path, alb_error *error)
{
    int bits = 0;
    if (!alb_image_read(image, &bits, path, error))
        return false;
    *how = bits == 8 ? "8 bit, decoded from sRGB" : bits == 16 ? "16 bit, taken as linear" : "floating point, linear";
    const size_t count = (size_t)image->width * (size_t)image->height * (size_t)image->channels;
    const float full = bits == 8 ? 255 : 65535;
    for (size_t i = 0; bits && i < count; i++) {
        const double share = (double)(image->pixels[i] / full);
        image->pixels[i] = image->pixels[i] >= full ? NAN : (float)(bits == 8 ? linear_from_srgb(share) : share);
    }
    return true;
}

// Indices of the channels to compare in both pictures: R,G,B, or Y, or the only one.
static int find_channels(int index[2][3], char names[3][8], const alb_image *const images[2])
{
    const char *const sets[2][3] = {{"R", "G", "B"}, {"Y"}};
    for (int set = 0; set < 2; set++) {
        int count = 0;
        for (; count < 3 && sets[set][count]; count++) {
            snprintf(names[count], sizeof names[count], "%s", sets[set][count]);
            for (int i = 0; i < 2; i++)
                index[i][count] = alb_image_channel(images[i], sets[set][count]);
            if (index[0][count] < 0 || index[1][count] < 0)
                break;
        }
        if (count == (set == 0 ? 3 : 1))
            return count;
    }
    return 0;
}

static bool finite_at(const float *pixel, const int *index, int channels)
{
    for (int c = 0; c < channels; c++)
        if (!isfinite(pixel[index[c]]))
            return false;
    return true;
}

// Copies the compared channels; pixels that are not compared become 0 in both and are counted by their first reason.
static void gather(alb_comparison *out, const alb_image *const images[2], int index[2][3], const alb_image *mask)
{
    for (int y = 0; y < out->photo.height; y++)
        for (int x = 0; x < out->photo.width; x++) {
            const float *p = alb_image_at(images[0], x, y), *r = alb_image_at(images[1], x, y);
            const size_t pixel = (size_t)y * (size_t)out->photo.width + (size_t)x;
            if (mask && !(*alb_image_at(mask, x, y) > 0.5f))
                out->outside_mask++;
            else if (!finite_at(p, index[0], out->channels))
                out->bad_photo++;
            else if (!finite_at(r, index[1], out->channels))
                out->bad_render++;
            else {
                out->used[pixel] = 1;
                out->compared++;
                for (int c = 0; c < out->channels; c++) {
                    alb_image_at(&out->photo, x, y)[c] = p[index[0][c]];
                    alb_image_at(&out->render, x, y)[c] = r[index[1][c]];
                }
            }
        }
}

// Sums over one channel: p p, p r, r r. Zeros of pixels that are not compared add nothing.
static void products(double sums[3], const alb_comparison *c, int channel)
{
    memset(sums, 0, 3 * sizeof *sums);
    for (int y = 0; y < c->photo.height; y++) {
        double row[3] = {0};
        for (int x = 0; x < c->photo.width; x++) {
            const double p = (double)alb_image_at(&c->photo, x, y)[channel];
            const double r = (double)alb_image_at(&c->render, x, y)[channel];
            row[0] += p * p, row[1] += p * r, row[2] += r * r;
        }
        for (int i = 0; i < 3; i++)
            sums[i] += row[i];
    }
}

static int by_value(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static bool find_peak(alb_comparison *out, alb_error *error)
{
    const size_t channels = (size_t)out->channels, pixels = (size_t)out->photo.width * (size_t)out->photo.height;
    float *values = alb_allocate((size_t)out->compared * channels, sizeof *values, error);
    if (!values)
        return false;
    size_t count = 0;
    for (size_t i = 0; i < pixels * channels; i++)
        if (out->used[i / channels])
            values[count++] = out->photo.pixels[i];
    qsort(values, count, sizeof *values, by_value);
    out->peak = (double)values[(size_t)ceil(peak_share * (double)count) - 1];
    free(values);
    return true;
}

// The scale of each channel and of all; refuses what no scale can match.
static bool solve_scale(alb_comparison *out, const char *photo_name, const char *render_name, alb_error *error)
{
    double all[3] = {0};
    for (int c = 0; c < out->channels; c++) {
        double sums[3];
        products(sums, out, c);
        out->channel[c].scale = sums[2] > 0 ? sums[1] / sums[2] : (double)NAN;
        for (int i = 0; i < 3; i++)
            all[i] += sums[i];
    }
    if (!(all[2] > 0))
        return alb_fail(error, ALB_BAD_DATA, "%s: zero in all %ld compared pixels; check the scene's lights and camera",
                        render_name, out->compared);
    if (!(out->peak > 0))
        return alb_fail(error, ALB_BAD_DATA, "%s: dark: the 99.9th percentile of %ld compared pixels is %.6g",
                        photo_name, out->compared, out->peak);
    out->scale = out->all.scale = all[1] / all[2];
    if (!(out->scale > 0) || !isfinite(out->scale))
        return alb_fail(error, ALB_BAD_DATA, "%s: the best factor to %s is %.6g: they do not show the same thing",
                        render_name, photo_name, out->scale);
    return true;
}

static void fill_measure(alb_measure *m, double squares, double photo_squares, double count, double peak)
{
    m->rmse = sqrt(squares / count);
    m->relative_rmse = photo_squares > 0 ? sqrt(squares / photo_squares) : (double)NAN;
    m->psnr_db = squares > 0 ? 20 * log10(peak / m->rmse) : (double)INFINITY;
}

static bool measure(alb_comparison *out, alb_error *error)
{
    double ssim[ALB_CHANNELS_MAX], squares_all = 0, photo_all = 0, ssim_all = 0;
    const double pixels = (double)out->photo.width * (double)out->photo.height, compared = (double)out->compared;
    if (!alb_vision_ssim(ssim, &out->photo, &out->render, out->peak, error))
        return false;
    for (int c = 0; c < out->channels; c++) {
        double squares = 0, sums[3];
        for (int y = 0; y < out->photo.height; y++) {
            double row = 0;
            for (int x = 0; x < out->photo.width; x++) {
                const double d =
                    (double)alb_image_at(&out->photo, x, y)[c] - (double)alb_image_at(&out->render, x, y)[c];
                row += d * d;
            }
            squares += row;
        }
        products(sums, out, c);
        fill_measure(&out->channel[c], squares, sums[0], compared, out->peak);
        out->channel[c].ssim = 1 - (1 - ssim[c]) * pixels / compared;
        squares_all += squares, photo_all += sums[0], ssim_all += out->channel[c].ssim;
    }
    fill_measure(&out->all, squares_all, photo_all, compared * out->channels, out->peak);
    out->all.ssim = ssim_all / out->channels;
    return true;
}

// The compared pixel with the brightest 5 x 5 mean over compared pixels and channels about it.
static void find_spot(alb_comparison *out)
{
    double brightest = -INFINITY;
    for (int y = 0; y < out->photo.height; y++)
        for (int x = 0; x < out->photo.width; x++) {
            double sum = 0;
            int count = 0;
            for (int v = y - 2; v <= y + 2; v++)
                for (int u = x - 2; u <= x + 2; u++) {
                    if (u < 0 || v < 0 || u >= out->photo.width || v >= out->photo.height ||
                        !out->used[(size_t)v * (size_t)out->photo.width + (size_t)u])
                        continue;
                    count++;
                    for (int c = 0; c < out->channels; c++)
                        sum += (double)alb_image_at(&out->photo, u, v)[c];
                }
            if (out->used[(size_t)y * (size_t)out->photo.width + (size_t)x] && sum / count > brightest)
                brightest = sum / count, out->spot_x = x, out->spot_y = y;
        }
}

static bool check_sizes(const alb_image *photo, const char *photo_name, const alb_image *render,
                        const char *render_name, const alb_image *mask, alb_error *error)
{
    if (photo->width != render->width || photo->height != render->height)
        return alb_fail(error, ALB_BAD_DATA, "%s: %d x %d pixels, but %s has %d x %d; render with the photo's camera",
                        render_name, render->width, render->height, photo_name, photo->width, photo->height);
    if (mask && (mask->width != photo->width || mask->height != photo->height))
        return alb_fail(error, ALB_BAD_DATA, "the mask has %d x %d pixels, but %s has %d x %d", mask->width,
                        mask->height, photo_name, photo->width, photo->height);
    return true;
}

bool alb_compare_images(alb_comparison *comparison, const alb_image *photo, const char *photo_name,
                        const alb_image *render, const char *render_name, const alb_image *mask, alb_error *error)
{
    alb_comparison out = {0};
    int index[2][3];
    const alb_image *const images[2] = {photo, render};
    bool ok = check_sizes(photo, photo_name, render, render_name, mask, error);
    if (!ok)
        goto done;
    out.channels = find_channels(index, out.names, images);
    ok = out.channels > 0 ||
         alb_fail(error, ALB_BAD_DATA, "%s and %s: neither both have R, G, B nor both have Y", photo_name, render_name);
    ok = ok && alb_image_create(&out.photo, photo->width, photo->height, out.channels == 3 ? "R,G,B" : "Y", error) &&
         alb_image_create(&out.render, photo->width, photo->height, out.channels == 3 ? "R,G,B" : "Y", error) &&
         (out.used = alb_allocate((size_t)photo->width, (size_t)photo->height, error));
    if (!ok)
        goto done;
    gather(&out, images, index, mask);
    ok =
        out.compared > 0 ||
        alb_fail(
            error, ALB_BAD_DATA,
            "%s and %s: no pixel left to compare: %ld outside the mask, %ld not finite in the photo, %ld in the render",
            photo_name, render_name, out.outside_mask, out.bad_photo, out.bad_render);
    ok = ok && find_peak(&out, error) && solve_scale(&out, photo_name, render_name, error);
    if (!ok)
        goto done;
    for (size_t i = 0; i < (size_t)photo->width * (size_t)photo->height * (size_t)out.channels; i++)
        out.render.pixels[i] = (float)(out.scale * (double)out.render.pixels[i]);
    find_spot(&out);
    ok = measure(&out, error);
done:
    if (ok)
        *comparison = out;
    else
        alb_comparison_free(&out);
    return ok;
}

void alb_comparison_free(alb_comparison *comparison)
{
    alb_image_free(&comparison->photo);
    alb_image_free(&comparison->render);
    free(comparison->used);
    *comparison = (alb_comparison){0};
}

static void put_measure(alb_json *json, const char *key, const alb_measure *m)
{
    alb_json_object(json, key);
    alb_json_number(json, "scale", m->scale);
    alb_json_number(json, "rmse", m->rmse);
    alb_json_number(json, "relative_rmse", m->relative_rmse);
    alb_json_number(json, "psnr_db", m->psnr_db); // null where identical
    alb_json_boolean(json, "identical", m->rmse == 0);
    alb_json_number(json, "ssim", m->ssim);
    alb_json_end_object(json);
}

void alb_comparison_put(alb_json *json, const alb_comparison *c)
{
    alb_json_integer(json, "width", c->photo.width);
    alb_json_integer(json, "height", c->photo.height);
    alb_json_integer(json, "compared_pixels", c->compared);
    alb_json_integer(json, "outside_mask_pixels", c->outside_mask);
    alb_json_integer(json, "not_finite_photo_pixels", c->bad_photo);
    alb_json_integer(json, "not_finite_render_pixels", c->bad_render);
    alb_json_number(json, "exposure_scale", c->scale);
    alb_json_number(json, "peak", c->peak);
    alb_json_integer(json, "spot_x_px", c->spot_x);
    alb_json_integer(json, "spot_y_px", c->spot_y);
    put_measure(json, "all", &c->all);
    alb_json_object(json, "channels");
    for (int i = 0; i < c->channels; i++)
        put_measure(json, c->names[i], &c->channel[i]);
    alb_json_end_object(json);
}
