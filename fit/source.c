// From files to fitted sides.
//
// A session's products hold radiance per flux, L / Phi; every pixel is turned into exitance by the direction that it
// sees the face from (exit_angle.c), which is 1 % uncertain for a smooth face and common to a side's readings, and less
// where both sides say what the slab is made of (exit_correct.c). The
// image of the spot on the white reference serves both sides: it is the light that enters the front. Images given by
// hand keep their unit; what saturates (integers at full scale) and what is not finite, or has no variance of zero or
// more beside it where there is a channel of them, counts as not measured.
#include "fit/source.h"
#include "base/image.h"
#include "base/memory.h"
#include "calibrate/calibration.h"
#include "fit/exit_angle.h"
#include "fit/exit_correct.h"
#include "fit/photo.h"
#include "fit/product.h"
#include "fit/table.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void alb_plane_free(alb_plane *out)
{
    free(out->value);
    free(out->variance);
    *out = (alb_plane){0};
}

bool alb_plane_take(alb_plane *out, const alb_image *image, const char *channel, const double *factor,
                    double saturation, alb_error *error)
{
    char variance_name[ALB_CHANNEL_NAME + 16];
    snprintf(variance_name, sizeof variance_name, "variance.%s", channel);
    const int c = alb_image_channel(image, channel), v = alb_image_channel(image, variance_name);
    const size_t count = (size_t)image->width * (size_t)image->height;
    *out = (alb_plane){.value = alb_allocate(count, sizeof(double), error)};
    if (v >= 0)
        out->variance = alb_allocate(count, sizeof(double), error);
    if (!out->value || (v >= 0 && !out->variance)) {
        alb_plane_free(out);
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        const float *pixel = image->pixels + i * (size_t)image->channels;
        const double value = (double)pixel[c];
        const double f = factor ? factor[i] : 1;
        const bool known = v < 0 || (pixel[v] >= 0 && isfinite(pixel[v]));
        out->value[i] = isfinite(value) && value < saturation && known ? f * value : (double)NAN;
        if (v >= 0)
            out->variance[i] = known ? f * f * (double)pixel[v] : 0;
    }
    return true;
}

bool alb_product_read(alb_image *image, alb_provenance *provenance, const alb_calibration *calibration,
                      const alb_product *product, alb_error *error)
{
    char path[ALB_PATH_SIZE];
    if (!alb_calibration_image(path, calibration, product, error) || !alb_provenance_add(provenance, path, error) ||
        !alb_image_read(image, NULL, path, error))
        return false;
    const alb_view *view = &calibration->views[product->side];
    if (!view->known)
        return alb_fail(error, ALB_BAD_DATA,
                        "%s: where the camera stands is not known on this side (no board lay there)", path);
    if (image->width != view->camera.lens.width || image->height != view->camera.lens.height)
        return alb_fail(error, ALB_BAD_DATA, "%s: %d x %d pixels, but the calibrated camera has %d x %d", path,
                        image->width, image->height, view->camera.lens.width, view->camera.lens.height);
    for (int c = 0; c < calibration->channels; c++)
        if (alb_image_channel(image, calibration->channel_names[c]) < 0)
            return alb_fail(error, ALB_BAD_DATA, "%s: no channel %s", path, calibration->channel_names[c]);
    return true;
}

// The spot on the white reference, as it lights the slab: measured once for all sides that it serves.
typedef struct white_spot {
    const alb_product *product;
    alb_spot spots[3];
} white_spot;

static void white_spot_free(white_spot *white)
{
    for (int c = 0; c < 3; c++)
        alb_spot_free(&white->spots[c]);
    *white = (white_spot){0};
}

static bool measure_spots(alb_spot spots[3], alb_provenance *provenance, const alb_calibration *calibration,
                          const alb_product *white, alb_error *error)
{
    alb_image image = {0};
    alb_face face = {0};
    bool ok = alb_product_read(&image, provenance, calibration, white, error) &&
              alb_face_seen(&face, &calibration->views[white->side].camera, error);
    alb_error reasons[3] = {{0}};
#pragma omp parallel for schedule(dynamic)
    for (int c = 0; c < (ok ? calibration->channels : 0); c++) {
        char name[ALB_NAME_SIZE + 16];
        alb_plane pixels = {0};
        snprintf(name, sizeof name, "%s %s", white->shot, calibration->channel_names[c]);
        if (alb_plane_take(&pixels, &image, calibration->channel_names[c], NULL, INFINITY, &reasons[c])) {
            const alb_channel channel = {&face, pixels.value, pixels.variance, name};
            alb_spot_measure(&spots[c], &channel, &reasons[c]);
        }
        alb_plane_free(&pixels);
    }
    for (int c = 0; c < 3; c++)
        if (ok && reasons[c].status != ALB_OK)
            ok = alb_fail(error, reasons[c].status, "%s", reasons[c].text);
    alb_face_free(&face);
    alb_image_free(&image);
    return ok;
}

// Makes `white` the spot with the pattern of the slab's shot.
static bool white_spot_for(white_spot *white, alb_provenance *provenance, const alb_calibration *calibration,
                           const alb_pattern *pattern, alb_error *error)
{
    if (white->product && alb_pattern_same(&white->product->pattern, pattern))
        return true;
    white_spot_free(white);
    for (int i = 0; i < calibration->product_count; i++)
        if (calibration->products[i].target == ALB_TARGET_WHITE &&
            alb_pattern_same(&calibration->products[i].pattern, pattern)) {
            white->product = &calibration->products[i];
            return measure_spots(white->spots, provenance, calibration, white->product, error);
        }
    return alb_fail(error, ALB_BAD_DATA, "%s: no shot of a spot of %g projector pixels on the white reference",
                    calibration->folder, pattern->diameter_px);
}

bool alb_exitance_factor(double **factor, alb_text *notes, const alb_calibration *calibration, alb_side side,
                         const alb_face *face, alb_error *error)
{
    const alb_exit exit = alb_exit_of(side, calibration->finish, calibration->refractive_index);
    const size_t count = (size_t)face->width * (size_t)face->height;
    const double least = cos(ALB_EXIT_MOST_DEG * M_PI / 180);
    double steepest = 0, flattest = 1;
    size_t oblique = 0;
    if (!(*factor = alb_allocate(count, sizeof **factor, error)))
        return false;
    for (size_t i = 0; i < count; i++) {
        const double cosine = face->cosine[i];
        (*factor)[i] = cosine >= least ? M_PI / alb_exit_ratio(&exit, cosine) : (double)NAN;
        oblique += cosine < least;
        if (cosine >= least)
            steepest = fmax(steepest, cosine), flattest = fmin(flattest, cosine);
    }
    if (exit.smooth && steepest >= least)
        alb_text_add(notes,
                     "%s: seen %.1f to %.1f degrees off the normal of a smooth face, which sheds %.3f to %.3f of what "
                     "Lambert's law says: corrected.\n",
                     alb_side_names[side], acos(steepest) * 180 / M_PI, acos(flattest) * 180 / M_PI,
                     alb_exit_ratio(&exit, steepest), alb_exit_ratio(&exit, flattest));
    if (oblique)
        alb_text_add(notes, "%s: %zu pixels see the face more than %d degrees off its normal and are left out.\n",
                     alb_side_names[side], oblique, ALB_EXIT_MOST_DEG);
    return true;
}

// Light that falls aslant is driven aside within the slab: the glow's centre against that of the spot that enters.
static void note_drift(alb_text *notes, const alb_fitting *fitting, const alb_spot spots[3])
{
    for (int c = 0; c < fitting->material.channels; c++) {
        const alb_readings *seen = &fitting->sides[ALB_REFLECTION][c].readings;
        const double x = seen->x_mm - spots[c].x_mm, y = seen->y_mm - spots[c].y_mm,
                     sd = sqrt(seen->centre_covariance_mm2[0] + seen->centre_covariance_mm2[2]);
        if (hypot(x, y) > 5 * sd && hypot(x, y) > 0.02)
            alb_text_add(notes,
                         "%s %s: the glow is centred %.2g +- %.1g mm from the spot on the white reference: the light "
                         "falls aslant, or one of the two was moved.\n",
                         alb_side_names[ALB_REFLECTION], fitting->material.channel_names[c], hypot(x, y), sd);
    }
}

static bool observe_product(alb_fitting *fitting, white_spot *white, alb_provenance *provenance, alb_text *notes,
                            const alb_calibration *calibration, const alb_product *product, alb_error *error)
{
    alb_image image = {0};
    alb_face face = {0};
    double *factor = NULL;
    bool ok = alb_product_read(&image, provenance, calibration, product, error) &&
              alb_face_seen(&face, &calibration->views[product->side].camera, error) &&
              white_spot_for(white, provenance, calibration, &product->pattern, error) &&
              alb_exitance_factor(&factor, notes, calibration, product->side, &face, error);
    if (ok) {
        const alb_spot *spots = white->spots;
        const alb_photo seen = {product->shot, product->side, &image, &face, {&spots[0], &spots[1], &spots[2]},
                                factor,        INFINITY};
        for (int c = 0; c < calibration->channels; c++)
            fitting->sides[product->side][c].common =
                (alb_common_sd){hypot(product->relative_scale_sd[c],
                                      calibration->finish == ALB_FINISH_SMOOTH ? ALB_EXIT_RELATIVE_SD : 0),
                                calibration->views[product->side].relative_length_sd};
        ok = alb_photo_observe(fitting, &seen, notes, error);
        for (int c = 0; ok && c < calibration->channels; c++) {
            alb_measurement *one = &fitting->sides[product->side][c];
            one->exit_cosine = alb_face_cosine(&face, one->readings.x_mm, one->readings.y_mm);
        }
        if (ok && product->side == ALB_REFLECTION)
            note_drift(notes, fitting, spots);
    }
    free(factor);
    alb_face_free(&face);
    alb_image_free(&image);
    return ok;
}

// Every slab spot of a calibrated session.
static bool observe_products(alb_fitting *fitting, alb_provenance *provenance, alb_text *notes,
                             const alb_calibration *calibration, alb_error *error)
{
    bool taken[ALB_SIDES] = {false}, ok = true;
    white_spot white = {0};
    for (int i = 0; ok && i < calibration->product_count; i++) {
        const alb_product *product = &calibration->products[i];
        if (product->target != ALB_TARGET_SLAB || product->pattern.kind != ALB_PATTERN_SPOT)
            continue;
        if (taken[product->side])
            ok = alb_fail(error, ALB_BAD_DATA, "%s: more than one shot of a spot on the slab in %s; a material has one",
                          calibration->folder, alb_side_names[product->side]);
        taken[product->side] = true;
        ok = ok && observe_product(fitting, &white, provenance, notes, calibration, product, error);
    }
    white_spot_free(&white);
    if (ok && !taken[ALB_REFLECTION] && !taken[ALB_TRANSMISSION])
        return alb_fail(error, ALB_BAD_DATA, "%s: no shot of a spot on the slab", calibration->folder);
    return ok;
}

bool alb_fitting_from_session(alb_fitting *fitting, alb_map *map, alb_provenance *provenance, alb_text *notes,
                              const char *folder, alb_error *error)
{
    char path[ALB_PATH_SIZE];
    alb_material *material = &fitting->material;
    alb_calibration *calibration = alb_allocate(1, sizeof *calibration, error);
    bool ok = calibration && alb_path_join(path, folder, "calibration.json", error) &&
              alb_calibration_read(calibration, folder, error) && alb_provenance_add(provenance, path, error);
    if (ok) {
        fitting->absolute = true;
        memcpy(material->name, calibration->sample, sizeof material->name);
        material->thickness_mm = calibration->thickness_mm;
        material->refractive_index = calibration->refractive_index;
        material->finish_known = true;
        material->finish = calibration->finish;
        fitting->basis.finish = calibration->finish;
        for (int i = 0; i < ALB_SIDES * 3; i++)
            fitting->basis.own_sd[i / 3][i % 3] = calibration->finish == ALB_FINISH_SMOOTH ? ALB_EXIT_RELATIVE_SD : 0;
        material->channels = calibration->channels;
        memcpy(material->channel_names, calibration->channel_names, sizeof material->channel_names);
        if (alb_map_is_wanted(calibration))
            ok = alb_map_from_session(map, fitting, provenance, notes, calibration, error);
        else if ((ok = observe_products(fitting, provenance, notes, calibration, error))) {
            alb_exit_correct(fitting, notes);
            if ((ok = alb_fitting_run(fitting, error)))
                alb_photo_note_border(notes, fitting);
        }
    }
    free(calibration);
    return ok;
}
