// The virtual rig's optics: energy on the face, the spot's place and size, the lens, the boards.
#include "base/camera.h"
#include "capture/lit_face.h"
#include "capture/view.h"
#include "check.h"

static const double pi = 3.141592653589793;

static alb_truth rig(void)
{
    alb_truth truth = {.seed = 3,
                       .projector = {.pixel_mm = 0.25, .blur_sd_mm = 0.12, .irradiance_w_per_mm2 = {1, 2, 4}},
                       .lamp_radiance = 1};
    truth.camera.width = 320, truth.camera.height = 240;
    truth.camera.focal_px = 700, truth.camera.centre_px[0] = 161, truth.camera.centre_px[1] = 118;
    const double distortion[5] = {-0.12, 0.08, 6e-4, -4e-4, 0};
    memcpy(truth.camera.distortion, distortion, sizeof distortion);
    truth.camera.distance_mm = 120, truth.camera.tilt_deg = 15;
    return truth;
}

static const alb_pattern spot = {.kind = ALB_PATTERN_SPOT, .diameter_px = 4};
static const double white[3] = {0.5, 0.5, 0.5};

// Sums radiance * pi * dA over the plane in polar strips; for a spot, which is nearly round, 64 directions are plenty.
static void flux(double out[3], const alb_lit_face *face, double radius, double step)
{
    out[0] = out[1] = out[2] = 0;
    for (double r = step / 2; r < radius; r += step)
        for (int k = 0; k < 64; k++) {
            double radiance[3];
            alb_lit_face_radiance(radiance, face, r * cos(2 * pi * k / 64), r * sin(2 * pi * k / 64), 1);
            for (int c = 0; c < 3; c++)
                out[c] += radiance[c] * pi * r * step * 2 * pi / 64;
        }
}

// Twelve pixels of a disc of four: 0.75 mm^2 of light, of which the reference sheds half.
static void white_reference_energy(void **state)
{
    (void)state;
    const alb_truth truth = rig();
    alb_lit_face face;
    alb_error error = {0};
    double sum[3];
    check_ok(alb_lit_face_create(&face, &truth, &spot, NULL, white, &error), &error);
    flux(sum, &face, 3, 0.01);
    for (int c = 0; c < 3; c++) // the strips' own error is 1e-5
        check_relative(sum[c], 0.5 * 12 * 0.25 * 0.25 * truth.projector.irradiance_w_per_mm2[c], 1e-4);
    alb_lit_face_free(&face);
}

static void traced_energy(void **state)
{
    (void)state;
    const alb_truth truth = rig();
    const alb_medium medium = {0.05, 3, 0.3, 1.4, 2};
    alb_photon_tally tally;
    alb_error error = {0};
    check_ok(alb_photon_trace(&tally, &medium, 26, 100000, 1, 0, &error), &error);
    for (int side = 0; side < 2; side++) {
        alb_kernel kernels[3];
        alb_lit_face face;
        double sum[3];
        for (int c = 0; c < 3; c++)
            check_ok(alb_kernel_from_photons(&kernels[c], &tally, side, 0.12, 30, &error), &error);
        check_ok(alb_lit_face_create(&face, &truth, &spot, kernels, white, &error), &error);
        flux(sum, &face, 29, 0.02);
        check_relative(sum[0], tally.leaving[side] * 0.75, 1e-3); // what lies beyond 26 mm is 1e-6
        check_relative(sum[2], 4 * sum[0], 1e-12);
        alb_lit_face_free(&face);
        for (int c = 0; c < 3; c++)
            alb_kernel_free(&kernels[c]);
    }
}

// Far from a point of light of a smooth kernel, blur adds only s^2/2 times its Laplacian: a e^(-b r) (b^2 - b/r).
static void stated_kernel_blurred(void **state)
{
    (void)state;
    const double sd = 0.05, b = 1.5, a = 0.2;
    const alb_stated_profile profile = {1, {a}, {b}};
    alb_kernel kernel;
    alb_error error = {0};
    check_ok(alb_kernel_from_profile(&kernel, &profile, sd, 12, &error), &error);
    for (double r = 1; r < 8; r += 0.37) {
        const double expected = a * exp(-b * r) * (1 + sd * sd / 2 * (b * b - b / r));
        check_relative(alb_kernel_value(&kernel, r), expected, 2e-5); // the next term is s^4/8 b^4 = 4e-6; table 1e-5
    }
    check_relative(kernel.total, 2 * pi * a / (b * b), 1e-12);
    check_near(alb_kernel_value(&kernel, 50), 0, 0);
    alb_kernel_free(&kernel);
}

// At the middle, k(0) = a (1 - sqrt(pi/2) t e^(t^2/2) erfc(t/sqrt 2)), t = b s; and blur moves light, but loses none.
static void stated_kernel_near_the_middle(void **state)
{
    (void)state;
    const double sd = 0.12, a = 30, b[] = {3, 20};
    for (int i = 0; i < 2; i++) {
        const alb_stated_profile profile = {1, {a}, {b[i]}};
        const double t = b[i] * sd;
        alb_kernel kernel;
        alb_error error = {0};
        check_ok(alb_kernel_from_profile(&kernel, &profile, sd, 8, &error), &error);
        check_relative(kernel.value_per_mm2[0], a * (1 - sqrt(pi / 2) * t * exp(t * t / 2) * erfc(t / sqrt(2))),
                       2e-3); // rings of s/16 at their mean radius
        double sum = 2 * pi * kernel.value_per_mm2[0] * kernel.step_mm * kernel.step_mm / 12; // Euler-Maclaurin
        for (int j = 0; j < kernel.count; j++)
            sum += kernel.value_per_mm2[j] * 2 * pi * j * kernel.step_mm * kernel.step_mm;
        check_relative(sum, kernel.total, 1e-6); // the polynomials of I0 are right to 2e-7
        alb_kernel_free(&kernel);
    }
}

// A straight edge along the pixels moves evenly: the share of light in a column follows its place to 1/34.
static double edge_mm;

static void edge(double out[3], const void *scene, double x, double y, double cosine)
{
    (void)scene, (void)y, (void)cosine;
    out[0] = out[1] = out[2] = x < edge_mm;
}

static void edges_are_fine(void **state)
{
    (void)state;
    alb_truth truth = rig();
    alb_sight sight;
    alb_image picture = {0};
    alb_error error = {0};
    memset(truth.camera.distortion, 0, sizeof truth.camera.distortion);
    truth.camera.tilt_deg = 0;
    check_ok(alb_sight_open(&sight, &truth, &error), &error);
    check_ok(alb_image_create(&picture, 320, 240, "R,G,B", &error), &error);
    for (int i = 0; i < 10; i++) {
        edge_mm = (7.5 + 0.1 * i) * 120 / 700; // 0.1 i into pixel 161 + 8
        const alb_flat_scene scene = {edge, NULL, 34};
        alb_sight_picture(&picture, &sight, &sight.camera.camera_from_world, &scene);
        check_near((double)alb_image_at(&picture, 169, 100)[0], 0.1 * i, 0.5 / 34 + 1e-6);
    }
    alb_image_free(&picture);
    alb_sight_free(&sight);
}

// The photograph of the lit reference has its centre of light where the camera model puts the origin, and the second
// moment of the disc along x: p^2 (that of the pixels' middles + 1/12) + blur^2.
static void spot_in_the_picture(void **state)
{
    (void)state;
    const alb_truth truth = rig();
    alb_sight sight;
    alb_lit_face face;
    alb_image picture = {0};
    alb_error error = {0};
    check_ok(alb_sight_open(&sight, &truth, &error), &error);
    check_ok(alb_lit_face_create(&face, &truth, &spot, NULL, white, &error), &error);
    check_ok(alb_image_create(&picture, 320, 240, "R,G,B", &error), &error);
    const alb_flat_scene scene = {alb_lit_face_radiance, &face, 34};
    alb_sight_picture(&picture, &sight, &sight.camera.camera_from_world, &scene);
    double sum = 0, sx = 0, sy = 0, sxx = 0;
    for (int y = 0; y < 240; y++)
        for (int x = 0; x < 320; x++) {
            double x_mm, y_mm, area;
            assert_true(alb_camera_on_plane(&x_mm, &y_mm, &area, &sight.camera, 0, x, y));
            const double light = (double)alb_image_at(&picture, x, y)[0] * area;
            sum += light, sx += light * x_mm, sy += light * y_mm, sxx += light * x_mm * x_mm;
        }
    check_relative(sum * pi, 0.5 * 0.75, 2e-3); // sampling of a spot of 6 pixels
    check_near(sx / sum, 0, 2e-3);
    check_near(sy / sum, 0, 2e-3);
    const double pixel_mm = 120.0 / 700;            // across the tilt; the pixel's own width adds its moment
    const double disc = (8 * 0.25 + 4 * 2.25) / 12; // of the pixels' middles: eight at +-1/2, four at +-3/2
    check_relative(sxx / sum, 0.0625 * disc + 0.0625 / 12 + 0.0144 + pixel_mm * pixel_mm / 12, 0.01);
    alb_image_free(&picture);
    alb_lit_face_free(&face);
    alb_sight_free(&sight);
}

// Bilinear lines of sight land where the camera model puts them.
static void ramp(double out[3], const void *scene, double x, double y, double cosine)
{
    (void)scene, (void)cosine;
    out[0] = 100 + x, out[1] = 100 + y, out[2] = 1;
}

static void lens_is_the_lens(void **state)
{
    (void)state;
    const alb_truth truth = rig();
    alb_sight sight;
    alb_image picture = {0};
    alb_error error = {0};
    check_ok(alb_sight_open(&sight, &truth, &error), &error);
    check_ok(alb_image_create(&picture, 320, 240, "R,G,B", &error), &error);
    const alb_flat_scene scene = {ramp, NULL, 5};
    alb_sight_picture(&picture, &sight, &sight.camera.camera_from_world, &scene);
    for (int y = 0; y < 240; y += 17)
        for (int x = 0; x < 320; x += 13) {
            double x_mm, y_mm;
            assert_true(alb_camera_on_plane(&x_mm, &y_mm, NULL, &sight.camera, 0, x, y));
            check_near((double)alb_image_at(&picture, x, y)[0], 100 + x_mm, 1e-4); // float and curvature over a pixel
            check_near((double)alb_image_at(&picture, x, y)[1], 100 + y_mm, 1e-4);
        }
    alb_image_free(&picture);
    alb_sight_free(&sight);
}

static void hand_poses(void **state)
{
    (void)state;
    const alb_truth truth = rig();
    alb_sight sight;
    alb_error error = {0};
    double steepest = 0;
    check_ok(alb_sight_open(&sight, &truth, &error), &error);
    for (uint64_t i = 0; i < 40; i++) {
        alb_transform pose, again;
        check_ok(alb_sight_hand_pose(&pose, &sight, 19, 14, 3, i, &error), &error);
        check_ok(alb_sight_hand_pose(&again, &sight, 19, 14, 3, i, &error), &error);
        assert_memory_equal(&pose, &again, sizeof pose);
        assert_true(alb_sight_sees(&sight, &pose, 19, 14));
        const alb_vector z = alb_rotate(&pose, (alb_vector){0, 0, 1}), x = alb_rotate(&pose, (alb_vector){1, 0, 0});
        const alb_vector y = alb_rotate(&pose, (alb_vector){0, 1, 0}), cross = alb_cross(x, y);
        check_near(alb_dot(cross, z), 1, 1e-12);
        check_near(alb_dot(x, y), 0, 1e-12);
        assert_true(z.z < 0); // faces the camera
        steepest = fmax(steepest, acos(-z.z) * 180 / pi);
    }
    check_below(25, steepest); // they do vary
    alb_transform pose;
    check_fails(alb_sight_hand_pose(&pose, &sight, 300, 200, 3, 0, &error), &error, ALB_BAD_DATA, "does not fit");
    alb_sight_free(&sight);
}

static void refusals(void **state)
{
    (void)state;
    alb_truth truth = rig();
    alb_sight sight;
    alb_lit_face face;
    alb_error error = {0};
    const alb_pattern huge = {.kind = ALB_PATTERN_GRID, .diameter_px = 500, .columns = 90, .rows = 90, .pitch_px = 600};
    check_fails(alb_lit_face_create(&face, &truth, &huge, NULL, white, &error), &error, ALB_BAD_DATA, "lit pixels");
    truth.camera.distortion[0] = -9;
    check_fails(alb_sight_open(&sight, &truth, &error), &error, ALB_BAD_DATA, "folds");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(white_reference_energy),
        cmocka_unit_test(traced_energy),
        cmocka_unit_test(stated_kernel_blurred),
        cmocka_unit_test(stated_kernel_near_the_middle),
        cmocka_unit_test(edges_are_fine),
        cmocka_unit_test(spot_in_the_picture),
        cmocka_unit_test(lens_is_the_lens),
        cmocka_unit_test(hand_poses),
        cmocka_unit_test(refusals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
