// Lens and pose: thirteen real photographs, and boards drawn here with a known camera.
#include "base/camera.h"
#include "base/random.h"
#include "calibrate/geometry.h"
#include "check.h"

// The shared data's README: OpenCV 4.6 with cornerSubPix 11 x 11 reaches 0.408 px on these photographs.
static void thirteen_photographs(void **state)
{
    (void)state;
    const char *folder = ALB_SHARED_DATA "/camera/opencv_left";
    if (!alb_file_is_directory(folder)) {
        print_message("skipped: %s is not here\n", folder);
        skip();
    }
    alb_error error = {0};
    alb_board_views views = {0};
    alb_lens_estimate estimate;
    const alb_board board = {9, 6, 25};
    check_ok(alb_geometry_photographs(&estimate, &views, folder, &board, &error), &error);
    for (int v = 0; v < views.count; v++)
        print_message("  %s %.3f px\n", views.name[v], views.rms_px[v]);
    print_message("rms %.4f px, fx %.2f +- %.2f\n", estimate.rms_px, estimate.lens.fx, estimate.sd[0]);
    assert_int_equal(views.found_count, 13);
    assert_true(estimate.rms_px <= 0.408);
    check_near(estimate.lens.fx, 535.9, 5 * estimate.sd[0]); // published: 535.916, whose own sd is larger (view 02)
    alb_board_views_free(&views);
}

static double square(double x_mm, double y_mm, const alb_board *board)
{
    const double half_x = 0.5 * (board->columns + 1) * board->square_mm,
                 half_y = 0.5 * (board->rows + 1) * board->square_mm;
    if (fabs(x_mm) > half_x || fabs(y_mm) > half_y)
        return 220;
    const long i = lrint(floor((x_mm + half_x) / board->square_mm)),
               j = lrint(floor((y_mm + half_y) / board->square_mm));
    return (i + j) % 2 ? 220 : 40;
}

static void draw(alb_image *image, const alb_camera *camera, const alb_board *board, uint64_t index)
{
    alb_error error = {0};
    check_ok(alb_image_create(image, camera->lens.width, camera->lens.height, "Y", &error), &error);
    for (int v = 0; v < image->height; v++)
        for (int u = 0; u < image->width; u++) {
            alb_random random = alb_random_at(5, index, (uint64_t)(v * image->width + u));
            double sum = 0;
            for (int k = 0; k < 36; k++) {
                double x, y;
                if (alb_camera_on_plane(&x, &y, NULL, camera, 0, u + (k % 6 - 2.5) / 6, v + (k / 6 - 2.5) / 6))
                    sum += square(x, y, board) / 36;
            }
            *alb_image_at(image, u, v) = (float)(sum + 2 * alb_random_normal(&random));
        }
}

// The lens comes back within its own standard deviations (5 of them: nine correlated numbers), the pose within 0.02 mm.
static void drawn_boards(void **state)
{
    (void)state;
    const alb_board board = {9, 6, 5};
    const alb_lens truth = {480, 360, 700, 702, 243, 176, -0.12, 0.05, 0.0005, -0.0004, 0};
    alb_board_views views = {0};
    alb_error error = {0};
    for (int i = 0; i < 10; i++) {
        alb_random random = alb_random_at(11, 0, (uint64_t)i);
        const alb_vector from = {120 * (alb_random_uniform(&random) - 0.5), 120 * (alb_random_uniform(&random) - 0.5),
                                 100};
        const alb_vector at = {10 * (alb_random_uniform(&random) - 0.5), 10 * (alb_random_uniform(&random) - 0.5), 0};
        alb_camera camera = alb_camera_look_at(from, at, (alb_vector){0, 1, 0}, 30, 480, 360);
        camera.lens = truth;
        alb_image image;
        draw(&image, &camera, &board, (uint64_t)i);
        check_ok(alb_board_look(&views, &image, "drawn", &board, &error), &error);
        alb_image_free(&image);
    }
    alb_lens_estimate estimate;
    int terms;
    check_ok(alb_board_lens(&estimate, &terms, &views, &board, 480, 360, &error), &error);
    print_message("drawn boards: found %d, rms %.4f px, f %.3f +- %.3f (700)\n", views.found_count, estimate.rms_px,
                  estimate.lens.fx, estimate.sd[0]);
    check_near(estimate.lens.fx, truth.fx, 5 * estimate.sd[0] + 0.05);
    check_near(estimate.lens.cx, truth.cx, 5 * estimate.sd[2] + 0.05);
    assert_true(estimate.rms_px < 0.1);
    alb_board_views_free(&views);

    alb_camera camera =
        alb_camera_look_at((alb_vector){0, -40, 95}, (alb_vector){2, 1, 0}, (alb_vector){0, 1, 0}, 30, 480, 360);
    camera.lens = truth;
    alb_image image;
    draw(&image, &camera, &board, 99);
    check_ok(alb_board_look(&views, &image, "flat", &board, &error), &error);
    alb_camera found = {.lens = truth};
    double rms;
    check_ok(alb_board_pose(&found.camera_from_world, &rms, &views, 0, &board, &truth, &error), &error);
    for (int k = 0; k < 9; k++) { // positions in the face's plane, z towards the camera
        double x0, y0, x1, y1;
        const double u = 60 + 180 * (k % 3), v = 40 + 140 * (k / 3);
        assert_true(alb_camera_on_plane(&x0, &y0, NULL, &camera, 0, u, v));
        assert_true(alb_camera_on_plane(&x1, &y1, NULL, &found, 0, u, v));
        check_near(x1, x0, 0.02);
        check_near(y1, y0, 0.02);
    }
    check_near(alb_inverse(&found.camera_from_world).translation.z, 95, 0.2);
    alb_image_free(&image);
    alb_board_views_free(&views);
}

static void no_board(void **state)
{
    (void)state;
    const alb_board board = {9, 6, 5};
    alb_board_views views = {0};
    alb_error error = {0};
    alb_image image;
    check_ok(alb_image_create(&image, 200, 150, "Y", &error), &error);
    check_ok(alb_board_look(&views, &image, "flat", &board, &error), &error);
    for (int i = 0; i < 200 * 150; i++) {
        alb_random random = alb_random_at(1, 1, (uint64_t)i);
        image.pixels[i] = (float)alb_random_uniform(&random);
    }
    check_ok(alb_board_look(&views, &image, "noise", &board, &error), &error);
    assert_int_equal(views.found_count, 0);
    alb_lens_estimate estimate;
    int terms;
    check_fails(alb_board_lens(&estimate, &terms, &views, &board, 200, 150, &error), &error, ALB_BAD_DATA,
                "found in 0 of 2");
    alb_image_free(&image);
    alb_board_views_free(&views);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(thirteen_photographs),
        cmocka_unit_test(drawn_boards),
        cmocka_unit_test(no_board),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
