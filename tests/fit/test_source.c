// From a calibrated session and from images to totals: cameras look obliquely, the spot is a blurred disc, pixels are
// noisy. The pictures are summed over a square lattice of the spot's power, which the fit never does.
#include "base/exr.h"
#include "base/random.h"
#include "calibrate/calibration_file.h"
#include "check.h"
#include "fit/source.h"
#include <unistd.h>

enum { WIDTH = 150, HEIGHT = 120, LATTICE = 25 };

static const alb_profile truth[ALB_SIDES] = {{ALB_FORM_TWO_EXPONENTIALS, {0.01, 0.6, 0.2, 3}},
                                             {ALB_FORM_SIGNED_EXPONENTIALS, {0.03, 0.5, -0.02, 1.0}}};
static const double spot_x = 0.3, spot_y = -0.2;
static const char *const files[] = {"s/calibration/white_spot.exr",
                                    "s/calibration/reflection.exr",
                                    "s/calibration/transmission.exr",
                                    "s/calibration.json",
                                    "s/calibration",
                                    "s",
                                    "image.exr",
                                    "white.exr"};

static int in_own_folder(void **state)
{
    static char folder[] = "/tmp/alabaster_source_XXXXXX";
    *state = mkdtemp(folder);
    return *state == NULL || chdir(folder) != 0 || !alb_file_make_directory("s/calibration", NULL);
}

static int leave(void **state)
{
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++)
        remove(files[i]);
    return chdir("/") != 0 || rmdir(*state) != 0;
}

// Irradiance of the spot, not yet divided by its power: a disc of radius 0.5 mm with a soft rim.
static double light(double r_mm) { return erfc((r_mm - 0.5) / 0.15); }

typedef struct lattice {
    double x_mm[LATTICE * LATTICE], y_mm[LATTICE * LATTICE], share[LATTICE * LATTICE], power_mm2;
} lattice;

static void fill(lattice *out)
{
    double sum = 0;
    const double step = 2.0 / LATTICE;
    for (int k = 0; k < LATTICE * LATTICE; k++) {
        out->x_mm[k] = (k % LATTICE + 0.5) * step - 1;
        out->y_mm[k] = (k / LATTICE + 0.5) * step - 1;
        out->share[k] = light(hypot(out->x_mm[k], out->y_mm[k]));
        sum += out->share[k];
    }
    for (int k = 0; k < LATTICE * LATTICE; k++)
        out->share[k] /= sum;
    out->power_mm2 = sum * step * step;
}

// One product: the white reference's irradiance (profile NULL) or the radiance M / pi of a side.
static void paint(const char *path, const alb_profile *profile, const alb_camera *camera, double noise, unsigned stream)
{
    static lattice spot;
    alb_error error = {0};
    alb_image image = {0};
    fill(&spot);
    check_ok(alb_image_create(&image, WIDTH, HEIGHT, "Y,variance.Y", &error), &error);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            double x_mm, y_mm, value = 0;
            assert_true(alb_camera_on_plane(&x_mm, &y_mm, NULL, camera, 0, x, y));
            if (profile)
                for (int k = 0; k < LATTICE * LATTICE; k++)
                    value +=
                        spot.share[k] / M_PI *
                        alb_profile_value(profile, hypot(x_mm - spot_x - spot.x_mm[k], y_mm - spot_y - spot.y_mm[k]));
            else
                value = light(hypot(x_mm - spot_x, y_mm - spot_y)) / spot.power_mm2;
            alb_random random = alb_random_at(1, stream, (unsigned)(y * WIDTH + x));
            const double variance = noise * noise * (value * value + 1e-3 * value);
            alb_image_at(&image, x, y)[0] = (float)(value + sqrt(variance) * alb_random_normal(&random));
            alb_image_at(&image, x, y)[1] = (float)(variance + 1e-14);
        }
    check_ok(alb_exr_write(&image, NULL, path, &error), &error);
    alb_image_free(&image);
}

static void make_session(void)
{
    alb_error error = {0};
    alb_provenance provenance = {.command = "calibrate"};
    alb_calibration *c = calloc(1, sizeof *c);
    *c = (alb_calibration){.folder = "s",
                           .sample = "wax",
                           .thickness_mm = 5,
                           .refractive_index = 1.4,
                           .finish = ALB_FINISH_GROUND,
                           .channels = 1,
                           .channel_names = {"Y"},
                           .white_level_dn = 4095,
                           .product_count = 3};
    const alb_vector up = {0, 1, 0}, target = {0, 0, 0};
    for (int side = 0; side < ALB_SIDES; side++) {
        const alb_vector eye = {side ? 0 : 40, 10, 90};
        c->views[side] = (alb_view){true, alb_camera_look_at(eye, target, up, 7, WIDTH, HEIGHT), 0.1, 0};
    }
    const alb_pattern pattern = {.kind = ALB_PATTERN_SPOT, .diameter_px = 10};
    c->products[0] = (alb_product){"white_spot", ALB_REFLECTION, ALB_TARGET_WHITE, pattern, {0}};
    c->products[1] = (alb_product){"reflection", ALB_REFLECTION, ALB_TARGET_SLAB, pattern, {0.003, 0, 0}};
    c->products[2] = (alb_product){"transmission", ALB_TRANSMISSION, ALB_TARGET_SLAB, pattern, {0.003, 0, 0}};
    paint(files[0], NULL, &c->views[0].camera, 0.01, 0);
    paint(files[1], &truth[0], &c->views[0].camera, 0.02, 1);
    paint(files[2], &truth[1], &c->views[1].camera, 0.02, 2);
    check_ok(alb_calibration_write(c, &provenance, &error), &error);
    free(c);
}

static void session_gives_totals(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_provenance provenance = {.command = "fit"};
    alb_text notes = {0};
    alb_fitting *fitting = calloc(1, sizeof *fitting);
    alb_map map = {0};
    make_session();
    check_ok(alb_fitting_from_session(fitting, &map, &provenance, &notes, "s", &error), &error);
    for (int side = 0; side < ALB_SIDES; side++) {
        const alb_fitted *fitted = &fitting->material.fitted[side][0];
        const double total = alb_profile_total(&truth[side]);
        print_message("%s: %s, total %.5f +- %.5f, truth %.5f (%+.2f %%), chi-square %.0f / %d\n", alb_side_names[side],
                      alb_form_name(fitted->profile.form), fitted->total, fitted->total_sd, total,
                      100 * (fitted->total / total - 1), fitted->chi_square, fitted->degrees_of_freedom);
        assert_int_equal(fitted->profile.form, truth[side].form);
        assert_true(fitted->identifiable);
        check_near(fitted->total, total, 4 * fitted->total_sd);
        check_relative(fitted->total, total, 0.02);
        assert_true(fitted->total_sd > 0.003 * total); // the scale's share is in it
        check_near(fitting->sides[side][0].readings.x_mm, spot_x, 0.02);
        check_near(fitting->sides[side][0].readings.y_mm, spot_y, 0.02);
    }
    alb_fitting_free(fitting);
    alb_text_free(&notes);
    free(fitting);
}

static void images_by_hand(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_image image = {0};
    const alb_profile profile = {ALB_FORM_EXPONENTIAL, {0.1, 1.2}};
    const double mm_per_pixel = 0.08;
    check_ok(alb_image_create(&image, WIDTH, HEIGHT, "R,G,B", &error), &error);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            alb_random random = alb_random_at(3, 0, (unsigned)(y * WIDTH + x));
            const double value = alb_profile_value(&profile, mm_per_pixel * hypot(x - 70.3, y - 61.7));
            for (int c = 0; c < 3; c++)
                alb_image_at(&image, x, y)[c] = (float)((c + 1) * value * (1 + 0.02 * alb_random_normal(&random)));
        }
    alb_image_at(&image, 71, 62)[1] = INFINITY;
    check_ok(alb_exr_write(&image, NULL, "image.exr", &error), &error);
    alb_image_free(&image);

    alb_provenance provenance = {.command = "fit"};
    alb_text notes = {0};
    alb_fitting *fitting = calloc(1, sizeof *fitting);
    const char *const paths[ALB_SIDES] = {"image.exr", NULL};
    check_ok(alb_fitting_from_images(fitting, &provenance, &notes, paths,
                                     &(alb_image_setting){.mm_per_pixel = mm_per_pixel}, &error),
             &error);
    assert_int_equal(fitting->material.channels, 3);
    for (int c = 0; c < 3; c++) {
        const alb_fitted *fitted = &fitting->material.fitted[ALB_REFLECTION][c];
        assert_int_equal(fitted->profile.form, ALB_FORM_EXPONENTIAL);
        check_near(fitted->profile.parameters[1], 1.2, 4 * fitted->sd[1]);
        check_near(fitted->total, (c + 1) * alb_profile_total(&profile), 4 * fitted->total_sd);
    }
    assert_non_null(strstr(notes.bytes, "reflection G: pixels out to"));
    alb_fitting_free(fitting);
    alb_text_free(&notes);
    free(fitting);
}

// A Gaussian spot, stated or photographed on white: the same total from both, the true one.
static void images_of_a_gaussian_spot(void **state)
{
    (void)state;
    enum { FINE = 15 };
    const alb_profile profile = {ALB_FORM_EXPONENTIAL, {0.1, 1.2}};
    const double pitch = 0.08, waist = 0.4, x0 = 70.3 * pitch, y0 = 61.7 * pitch;
    for (int white = 0; white < 2; white++) {
        alb_error error = {0};
        alb_image image = {0};
        check_ok(alb_image_create(&image, WIDTH, HEIGHT, "Y", &error), &error);
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            const double x = i % WIDTH * pitch - x0, y = i / WIDTH * pitch - y0;
            double sum = 0, weight = 0;
            for (int k = 0; k < (white ? 1 : FINE * FINE); k++) {
                const double u = waist * 4 * ((k % FINE + 0.5) / FINE - 0.5),
                             v = waist * 4 * ((k / FINE + 0.5) / FINE - 0.5);
                const double e = exp(-2 * (white ? x * x + y * y : u * u + v * v) / (waist * waist));
                sum += white ? e : e * alb_profile_value(&profile, hypot(x - u, y - v));
                weight += white ? 1 : e;
            }
            alb_random random = alb_random_at(5, (unsigned)white, (unsigned)i);
            alb_image_at(&image, i % WIDTH, i / WIDTH)[0] =
                (float)(sum / weight * (1 + 0.01 * alb_random_normal(&random)) +
                        (white ? 1e-4 : 0) * alb_random_normal(&random));
        }
        check_ok(alb_exr_write(&image, NULL, white ? "white.exr" : "image.exr", &error), &error);
        alb_image_free(&image);
    }
    for (int measured = 0; measured < 2; measured++) {
        alb_error error = {0};
        alb_provenance provenance = {.command = "fit"};
        alb_text notes = {0};
        alb_fitting *fitting = calloc(1, sizeof *fitting);
        const char *const paths[ALB_SIDES] = {"image.exr", NULL};
        const alb_image_setting setting = {.mm_per_pixel = pitch,
                                           .spot_gaussian_mm = measured ? 0 : waist,
                                           .spot_image = measured ? "white.exr" : NULL};
        check_ok(alb_fitting_from_images(fitting, &provenance, &notes, paths, &setting, &error), &error);
        const alb_fitted *fitted = &fitting->material.fitted[ALB_REFLECTION][0];
        print_message("gaussian spot, %s: decay %.4f, total %+.2f %%\n", measured ? "photographed" : "stated",
                      fitted->profile.parameters[1], 100 * (fitted->total / alb_profile_total(&profile) - 1));
        assert_int_equal(fitted->profile.form, ALB_FORM_EXPONENTIAL);
        check_relative(fitted->profile.parameters[1], 1.2, 0.003);
        check_relative(fitted->total, alb_profile_total(&profile), 0.005);
        alb_fitting_free(fitting);
        alb_text_free(&notes);
        free(fitting);
    }
}

static void what_is_missing_is_named(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_provenance provenance = {.command = "fit"};
    alb_text notes = {0};
    alb_fitting *fitting = calloc(1, sizeof *fitting);
    alb_map map = {0};
    make_session();
    remove(files[2]);
    check_fails(alb_fitting_from_session(fitting, &map, &provenance, &notes, "s", &error), &error, ALB_ACCESS,
                "transmission.exr");
    alb_fitting_free(fitting);
    check_fails(alb_fitting_from_session(fitting, &map, &provenance, &notes, "nowhere", &error), &error, ALB_ACCESS,
                "nowhere");
    const char *const paths[ALB_SIDES] = {NULL, "nowhere.exr"};
    check_fails(
        alb_fitting_from_images(fitting, &provenance, &notes, paths, &(alb_image_setting){.mm_per_pixel = 1}, &error),
        &error, ALB_ACCESS, "nowhere.exr");
    alb_fitting_free(fitting);
    alb_text_free(&notes);
    free(fitting);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(session_gives_totals), cmocka_unit_test(images_by_hand),
                                       cmocka_unit_test(images_of_a_gaussian_spot),
                                       cmocka_unit_test(what_is_missing_is_named)};
    return cmocka_run_group_tests(tests, in_own_folder, leave);
}
