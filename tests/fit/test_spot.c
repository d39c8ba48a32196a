// Spots of finite size, coarse pixels, clipped cores and centres off the middle: the pictures of glow.h.
#include "fit/centre.h"
#include "fit/measurement.h"
#include "glow.h"

static glow_picture *picture;
static glow *light;

static int set_up(void **state)
{
    (void)state;
    picture = calloc(1, sizeof *picture);
    light = calloc(1, sizeof *light);
    return !picture || !light;
}

static int tear_down(void **state)
{
    (void)state;
    alb_face_free(&picture->face);
    free(picture);
    free(light);
    return 0;
}

// Fits the picture as lit by the spot.
static void fit(alb_fitting *fitting, alb_side side, const alb_spot *spot)
{
    alb_error error = {0};
    alb_measurement *one = &fitting->sides[side][0];
    const alb_channel channel = glow_channel(picture);
    fitting->material.channels = 1;
    check_ok(alb_observe(&one->readings, &channel, &error), &error);
    check_ok(alb_operator_create(&one->forward, &one->readings, spot, &error), &error);
    check_ok(alb_fitting_run(fitting, &error), &error);
}

typedef struct bias {
    double worst_reading, worst_curve, worst_ignored; // in bands of r, from `from_mm` on
} bias;

// Readings taken back to a pencil beam by the fitted form, reading * S(r) / (forward S), against the photons; beside
// the form itself and the readings as they are. Means over bands, in which the noise of the photons averages out.
static bias against_photons(const alb_fitting *fitting, alb_side side, double from_mm, double to_mm)
{
    enum { BANDS = 6 };
    alb_error error = {0};
    const alb_measurement *one = &fitting->sides[side][0];
    const alb_profile *profile = &one->outcome.fitted.profile;
    double *forward = alb_operator_readings(&one->forward, profile, &error);
    double sums[BANDS][4] = {{0}};
    bias out = {0};
    assert_non_null(forward);
    for (int i = 0; i < one->readings.count; i++) {
        const double r = one->readings.r_mm[i], truth = glow_at(light->pencil, r), s = alb_profile_value(profile, r);
        const int band = (int)floor(BANDS * log(r / from_mm) / log(to_mm / from_mm));
        if (r < from_mm || r >= to_mm)
            continue;
        sums[band][0]++;
        sums[band][1] += one->readings.value[i] * s / forward[i] / truth - 1;
        sums[band][2] += s / truth - 1;
        sums[band][3] += one->readings.value[i] / truth - 1;
    }
    for (int b = 0; b < BANDS; b++)
        if (sums[b][0] > 0) {
            out.worst_reading = fmax(out.worst_reading, fabs(sums[b][1] / sums[b][0]));
            out.worst_curve = fmax(out.worst_curve, fabs(sums[b][2] / sums[b][0]));
            out.worst_ignored = fmax(out.worst_ignored, fabs(sums[b][3] / sums[b][0]));
        }
    free(forward);
    return out;
}

static bias one_spot(alb_side side, glow_spot kind, double pitch_mm, double from_mm, bool pixel)
{
    alb_error error = {0};
    alb_spot spot = {0};
    alb_fitting *fitting = calloc(1, sizeof *fitting);
    glow_make(light, (int)side, kind);
    glow_paint(picture, light, pitch_mm, pitch_mm * (GLOW_SIZE / 2 + 0.37), pitch_mm * (GLOW_SIZE / 2 - 0.21));
    glow_expose(picture, 0.005, 1);
    check_ok((kind.gaussian ? alb_spot_gaussian : alb_spot_disc)(&spot, kind.radius_mm, &error), &error);
    if (pixel)
        check_ok(alb_spot_see(&spot, pitch_mm, &error), &error);
    fit(fitting, side, &spot);
    const bias out = against_photons(fitting, side, from_mm, 6);
    print_message("%s %-8s radius %.2f mm, pixel %.3f mm: %.2f %% off beyond %.2f mm (form %.2f %%, spot ignored %.1f "
                  "%%); total %+.2f %%\n",
                  alb_side_names[side], kind.gaussian ? "gaussian" : "disc", kind.radius_mm, pitch_mm,
                  100 * out.worst_reading, from_mm, 100 * out.worst_curve, 100 * out.worst_ignored,
                  100 * (fitting->sides[side][0].outcome.fitted.total / light->total - 1));
    alb_spot_free(&spot);
    alb_fitting_free(fitting);
    free(fitting);
    return out;
}

static void wide_spot(void **state)
{
    (void)state;
    static const double radii_mm[] = {0.25, 0.5, 1, 2};
    for (int side = 0; side < ALB_SIDES; side++)
        for (int gaussian = 0; gaussian < 2; gaussian++)
            for (int i = 0; i < 4; i++) {
                const bias found =
                    one_spot((alb_side)side, (glow_spot){gaussian, radii_mm[i]}, 0.08, radii_mm[i], true);
                (void)found;
            }
}

static void coarse_pixel(void **state)
{
    (void)state;
    static const double pixel_free_paths[] = {0.3, 0.6, 1};
    for (int i = 0; i < 3; i++) {
        const double pitch = pixel_free_paths[i] * glow_free_path_mm;
        const bias found = one_spot(ALB_REFLECTION, (glow_spot){false, 0.25}, pitch, 1.5 * pitch, true);
        const bias ignored = one_spot(ALB_REFLECTION, (glow_spot){false, 0.25}, pitch, 1.5 * pitch, false);
        (void)found;
        (void)ignored;
    }
}

// rms distance of the centre from the truth over noise and places within a pixel, in pixels; *ratio: against its
// Cramer-Rao bound, 1 / sd^2 = sum m'^2 cos^2 / variance; *told: against the covariance that comes with it.
static double centre_rms(double *ratio, double *told, double clipped_px, double noise, int trials)
{
    const double pitch = 0.08, middle = pitch * GLOW_SIZE / 2;
    double squares = 0, scaled = 0, by_told = 0;
    static bool glint[GLOW_SIZE * GLOW_SIZE];
    for (unsigned t = 0; t < (unsigned)trials; t++) {
        alb_error error = {0};
        alb_centre found;
        alb_random random = alb_random_at(31, 0, t);
        const double x = middle + pitch * alb_random_uniform(&random), y = middle + pitch * alb_random_uniform(&random);
        double information = 0;
        glow_paint(picture, light, pitch, x, y);
        glow_expose(picture, noise, 100 + t);
        for (int i = 0; i < GLOW_SIZE * GLOW_SIZE; i++) {
            const double dx = picture->face.x_mm[i] - x, dy = picture->face.y_mm[i] - y, r = hypot(dx, dy), h = 0.02;
            if (r < clipped_px * pitch) {
                picture->value[i] = NAN;
                continue;
            }
            const double slope = (glow_at(light->lit, r + h) - glow_at(light->lit, fabs(r - h))) / (2 * h);
            information += slope * slope * dx * dx / (r * r + 1e-12) / picture->variance[i];
        }
        const alb_channel channel = glow_channel(picture);
        check_ok(alb_centre_find(&found, glint, true, &channel, &error), &error);
        const double ex = found.x_mm - x, ey = found.y_mm - y;
        squares += (ex * ex + ey * ey) / (pitch * pitch * trials);
        scaled += (ex * ex + ey * ey) * information / (2 * trials);
        by_told += (ex * ex / found.covariance_mm2[0] + ey * ey / found.covariance_mm2[2]) / (2 * trials);
    }
    *ratio = sqrt(scaled);
    *told = sqrt(by_told);
    return sqrt(squares);
}

// Clipped out to 1, 3 and 10 pixels; a disc of radius 0.25 mm is 3 pixels wide.
static void saturated_core(void **state)
{
    (void)state;
    enum { TRIALS = 40 };
    static const double clipped_px[] = {0, 1, 3, 10}, allowed_px[] = {0.02, 0.02, 0.02, 0.05};
    static const double noises[] = {0.03, 0.01, 0.001};
    glow_make(light, 0, (glow_spot){false, 0.25});
    for (int n = 0; n < 3; n++)
        for (int i = 0; i < 4; i++) {
            double ratio, told;
            const double rms = centre_rms(&ratio, &told, clipped_px[i], noises[n], TRIALS);
            print_message(
                "noise %.1f %%, clipped out to %2.0f px: centre to %.4f px rms, %.2f of the Cramer-Rao bound, "
                "%.2f of the sd told\n",
                100 * noises[n], clipped_px[i], rms, ratio, told);
            check_below(rms, allowed_px[i]);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(wide_spot), cmocka_unit_test(coarse_pixel),
                                       cmocka_unit_test(saturated_core)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
