// Images by hand and tables to fitted sides.
//
// Images keep their unit; what saturates (integers at full scale) and what is not finite counts as not measured. They
// hold exitance: a photograph of radiance times pi is 1.06 (reflection) or 1.09 (transmission) times too high at the
// normal of a smooth face of index 1.5 (exit_angle.c). A pixel is a square that averages the light it covers.
#include "base/memory.h"
#include "fit/centre.h"
#include "fit/photo.h"
#include "fit/product.h"
#include "fit/source.h"
#include "fit/table.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// The channels to fit of an image: those of R, G, B that are there, else Y.
static bool take_channels(alb_material *material, const alb_image *image, const char *path, alb_error *error)
{
    static const char *const names[] = {"R", "G", "B", "Y"};
    alb_material found = {0};
    for (int i = 0; i < 4; i++)
        if (alb_image_channel(image, names[i]) >= 0 && (i < 3 || found.channels == 0))
            snprintf(found.channel_names[found.channels++], sizeof found.channel_names[0], "%s", names[i]);
    if (found.channels == 0)
        return alb_fail(error, ALB_BAD_DATA, "%s: none of the channels R, G, B, Y", path);
    if (material->channels && (material->channels != found.channels ||
                               memcmp(material->channel_names, found.channel_names, sizeof found.channel_names) != 0))
        return alb_fail(error, ALB_BAD_DATA, "%s: other channels than the image of the other side", path);
    material->channels = found.channels;
    memcpy(material->channel_names, found.channel_names, sizeof found.channel_names);
    return true;
}

// Reads an image; what its integers hold at full scale is not measured.
static bool read_image(alb_image *image, double *saturation, alb_provenance *provenance, alb_text *notes,
                       const char *path, alb_error *error)
{
    int bits = 0;
    if (!alb_provenance_add(provenance, path, error) || !alb_image_read(image, &bits, path, error))
        return false;
    *saturation = bits == 8 ? 255 : bits == 16 ? 65535 : (double)INFINITY;
    if (bits)
        alb_text_add(notes, "%s: %d-bit values are taken as linear; those at full scale as not measured.\n",
                     alb_path_name(path), bits);
    return true;
}

// The spot of every channel from its photograph on an opaque white face.
static bool measure_spots(alb_spot spots[3], alb_provenance *provenance, alb_text *notes, const alb_material *material,
                          const alb_image_setting *setting, alb_error *error)
{
    alb_image image = {0};
    alb_face face = {0};
    double saturation = INFINITY;
    alb_material same = *material;
    bool ok = read_image(&image, &saturation, provenance, notes, setting->spot_image, error) &&
              take_channels(&same, &image, setting->spot_image, error) &&
              alb_face_flat(&face, image.width, image.height, setting->mm_per_pixel, error);
    for (int c = 0; ok && c < material->channels; c++) {
        alb_plane pixels = {0};
        const alb_channel white = {&face, NULL, NULL, setting->spot_image};
        ok = alb_plane_take(&pixels, &image, material->channel_names[c], NULL, saturation, error);
        alb_channel seen = white;
        seen.value = pixels.value, seen.variance = pixels.variance;
        ok = ok && alb_spot_measure(&spots[c], &seen, error);
        alb_plane_free(&pixels);
    }
    alb_face_free(&face);
    alb_image_free(&image);
    return ok;
}

// As stated: a flat disc, a Gaussian or a pencil beam, seen by square pixels.
static bool state_spot(alb_spot *spot, const alb_image_setting *setting, alb_error *error)
{
    return (setting->spot_gaussian_mm > 0 ? alb_spot_gaussian(spot, setting->spot_gaussian_mm, error)
                                          : alb_spot_disc(spot, setting->spot_radius_mm, error)) &&
           alb_spot_see(spot, setting->mm_per_pixel, error);
}

static bool bend_face(alb_face *face, const alb_image *image, const alb_material *material,
                      const alb_image_setting *setting, const char *path, double saturation, alb_error *error)
{
    alb_centre centre;
    alb_plane pixels = {0};
    bool *glint = alb_allocate((size_t)face->width * (size_t)face->height, sizeof *glint, error);
    bool ok = glint && alb_plane_take(&pixels, image, material->channel_names[0], NULL, saturation, error);
    const alb_channel channel = {face, pixels.value, pixels.variance, path};
    if ((ok = ok && alb_centre_find(&centre, glint, true, &channel, error)))
        alb_face_curve(face, centre.x_mm, centre.y_mm, setting->curvature_radius_mm, setting->distance);
    alb_plane_free(&pixels);
    free(glint);
    return ok;
}

static bool observe_image(alb_fitting *fitting, alb_provenance *provenance, alb_text *notes, const char *path,
                          alb_side side, const alb_image_setting *setting, alb_error *error)
{
    alb_image image = {0};
    alb_face face = {0};
    alb_spot spots[3] = {{0}};
    double saturation = INFINITY;
    alb_material *material = &fitting->material;
    bool ok =
        read_image(&image, &saturation, provenance, notes, path, error) &&
        take_channels(material, &image, path, error) &&
        alb_face_flat(&face, image.width, image.height, setting->mm_per_pixel, error) &&
        (setting->spot_image ? measure_spots(spots, provenance, notes, material, setting, error)
                             : state_spot(&spots[0], setting, error)) &&
        (!(setting->curvature_radius_mm > 0) || bend_face(&face, &image, material, setting, path, saturation, error));
    const bool each = setting->spot_image != NULL;
    const alb_photo seen = {path, side,      &image, &face, {&spots[0], &spots[each ? 1 : 0], &spots[each ? 2 : 0]},
                            NULL, saturation};
    ok = ok && alb_photo_observe(fitting, &seen, notes, error);
    for (int c = 0; c < 3; c++)
        alb_spot_free(&spots[c]);
    alb_face_free(&face);
    alb_image_free(&image);
    return ok;
}

// Which distance was taken on a curved sample, and what the other one would do to the fit at its far end.
static void note_curvature(alb_text *notes, const alb_fitting *fitting, const alb_image_setting *setting)
{
    const double radius = setting->curvature_radius_mm;
    const alb_distance taken = setting->distance,
                       other = taken == ALB_DISTANCE_ARC ? ALB_DISTANCE_CHORD : ALB_DISTANCE_ARC;
    for (int side = 0; side < ALB_SIDES; side++)
        for (int c = 0; c < fitting->material.channels; c++) {
            const alb_measurement *one = &fitting->sides[side][c];
            if (!one->measured || one->readings.count == 0)
                continue;
            const double last = one->readings.r_mm[one->readings.count - 1],
                         angle = taken == ALB_DISTANCE_ARC ? last / radius : 2 * asin(fmin(1, last / (2 * radius))),
                         instead = alb_curved_distance(radius * sin(angle), radius, other);
            alb_text_add(
                notes,
                "%s %s: distances are %ss of a sphere of radius %.4g mm; the last reading is at %.4g mm, %.4g mm "
                "by %s, which would take S there to %.3g of what it is.\n",
                alb_side_names[side], fitting->material.channel_names[c], alb_distance_names[taken], radius, last,
                instead, alb_distance_names[other], exp(one->outcome.slope_per_mm * (last - instead)));
        }
}

// "folder/wax.exr" names the material "wax".
static void name_after(alb_material *material, const char *path)
{
    const char *name = alb_path_name(path), *dot = strrchr(name, '.');
    const int length = dot && dot > name ? (int)(dot - name) : (int)strlen(name);
    snprintf(material->name, sizeof material->name, "%.*s", length < ALB_NAME_SIZE ? length : ALB_NAME_SIZE - 1, name);
}

bool alb_fitting_from_images(alb_fitting *fitting, alb_provenance *provenance, alb_text *notes,
                             const char *const paths[ALB_SIDES], const alb_image_setting *setting, alb_error *error)
{
    name_after(&fitting->material, paths[ALB_REFLECTION] ? paths[ALB_REFLECTION] : paths[ALB_TRANSMISSION]);
    for (int side = 0; side < ALB_SIDES; side++)
        if (paths[side] && !observe_image(fitting, provenance, notes, paths[side], (alb_side)side, setting, error))
            return false;
    if (!alb_fitting_run(fitting, error))
        return false;
    if (setting->curvature_radius_mm > 0)
        note_curvature(notes, fitting, setting);
    alb_photo_note_border(notes, fitting);
    return true;
}

bool alb_fitting_from_table(alb_fitting *fitting, alb_provenance *provenance, const char *path, alb_side side,
                            alb_error *error)
{
    alb_measurement *measurement = &fitting->sides[side][0];
    name_after(&fitting->material, path);
    fitting->material.channels = 1;
    snprintf(fitting->material.channel_names[0], sizeof fitting->material.channel_names[0], "Y");
    return alb_table_read(&measurement->readings, path, error) && alb_provenance_add(provenance, path, error) &&
           alb_operator_identity(&measurement->forward, &measurement->readings, error) &&
           alb_fitting_run(fitting, error);
}
