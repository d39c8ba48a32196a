// Vignetting and flux, from images made here with other formulas than those that recover them.
#include "base/random.h"
#include "calibrate/absolute.h"
#include "calibrate/flat.h"
#include "check.h"

static const alb_lens lens = {320, 240, 400, 400, 163, 117, 0, 0, 0, 0, 0};

// cos^4 about a point off the middle is none of the polynomials; they follow it to 1e-3 over this field.
static void cosine_vignetting(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_image image;
    double flat[3][ALB_FLAT_TERMS], rms;
    check_ok(alb_image_create(&image, 320, 240, "R,G,B,variance.R,variance.G,variance.B", &error), &error);
    for (int y = 0; y < 240; y++)
        for (int x = 0; x < 320; x++)
            for (int c = 0; c < 3; c++) {
                alb_random random = alb_random_at(2, (uint64_t)c, (uint64_t)(y * 320 + x));
                const double cosine = 1 / sqrt(1 + (pow(x - lens.cx, 2) + pow(y - lens.cy, 2)) / (400 * 400));
                alb_image_at(&image, x, y)[c] =
                    (float)(5000 * pow(cosine, 4) * (1 + 0.01 * alb_random_normal(&random)));
            }
    check_ok(alb_flat_fit(flat, &rms, &image, &lens, 3, &error), &error);
    check_near(rms, 0.01, 0.0002); // the noise that was put in
    for (int x = 0; x < 320; x += 20)
        check_near(alb_flat_value(flat[1], &lens, x, 30) / alb_flat_value(flat[1], &lens, lens.cx, lens.cy),
                   pow(1 / (1 + (pow(x - lens.cx, 2) + pow(30 - lens.cy, 2)) / (400 * 400)), 2), 1e-3);
    for (int i = 0; i < 320 * 240 * 6; i++)
        image.pixels[i] = NAN;
    check_fails(alb_flat_fit(flat, &rms, &image, &lens, 3, &error), &error, ALB_BAD_DATA, "dark or saturated");
    alb_image_free(&image);
}

static void draw_spot(alb_image *image, const alb_camera *camera, double radiance, double sd_mm, double noise)
{
    for (int y = 0; y < image->height; y++)
        for (int x = 0; x < image->width; x++) {
            double px, py;
            alb_random random = alb_random_at(4, 0, (uint64_t)(y * image->width + x));
            assert_true(alb_camera_on_plane(&px, &py, NULL, camera, 0, x, y));
            float *p = alb_image_at(image, x, y);
            p[0] = (float)(radiance * exp(-(px * px + py * py) / (2 * sd_mm * sd_mm)) +
                           noise * alb_random_normal(&random));
            p[1] = (float)(noise * noise);
        }
}

// integral of L exp(-r^2 / 2 s^2) dA = 2 pi s^2 L, whatever the camera's tilt.
static void flux_of_a_gaussian_spot(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_image image;
    alb_estimate flux[3];
    const double reflectance[3] = {0.9, 1, 1};
    alb_camera camera =
        alb_camera_look_at((alb_vector){60, 0, 100}, (alb_vector){0, 0, 0}, (alb_vector){0, 1, 0}, 30, 320, 240);
    check_ok(alb_image_create(&image, 320, 240, "Y,variance.Y", &error), &error);
    draw_spot(&image, &camera, 1000, 1.5, 0.5);
    check_ok(alb_flux_measure(flux, &image, &camera, reflectance, "white", &error), &error);
    const double truth = 3.141592653589793 / 0.9 * 1000 * 2 * 3.141592653589793 * 1.5 * 1.5;
    print_message("flux %.2f +- %.2f, truth %.2f\n", flux[0].value, flux[0].sd, truth);
    check_near(flux[0].value, truth, 4 * flux[0].sd + 1e-4 * truth);
    draw_spot(&image, &camera, 0, 1.5, 0.5);
    check_fails(alb_flux_measure(flux, &image, &camera, reflectance, "white", &error), &error, ALB_BAD_DATA,
                "no light");
    *alb_image_at(&image, 5, 5) = NAN;
    check_fails(alb_flux_measure(flux, &image, &camera, reflectance, "white", &error), &error, ALB_BAD_DATA,
                "saturated");
    draw_spot(&image, &camera, 1000, 20, 0.5);
    check_fails(alb_flux_measure(flux, &image, &camera, reflectance, "white", &error), &error, ALB_BAD_DATA, "edge");
    alb_image_free(&image);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cosine_vignetting),
        cmocka_unit_test(flux_of_a_gaussian_spot),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
