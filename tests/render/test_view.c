// Which way the light of a face goes to the camera: smooth faces send no more and no less than ground ones, in the
// directions that Fresnel's law gives to what was reflected and to what crossed a slab.
#include "check.h"
#include "render/shape.h"
#include "render/view.h"
#include <omp.h>

enum { FROM_ABOVE = 1, FROM_BELOW = 2 };

static alb_surface slab_surface(bool smooth)
{
    alb_surface out = {.name = "slab", .scatters = true, .slab = true};
    for (int side = 0; side < ALB_SIDES; side++) {
        if (smooth)
            out.exits[side] = alb_exit_of((alb_side)side, ALB_FINISH_SMOOTH, 1.5);
        for (int c = 0; c < 3; c++) // totals 0.57 and 0.28 to 0.38
            out.profiles[side][c] = (alb_profile){ALB_FORM_EXPONENTIAL, {side ? 0.045 + 0.008 * c : 0.09, 1}};
    }
    return out;
}

// A slab of 40 x 40 x 5 mm lit by points 60 mm above and below it, or one of them.
static void solve_slab(alb_scene *scene, alb_solution *s, bool smooth, int lights)
{
    alb_error error = {0};
    const alb_box box = {.size_mm = {40, 40, 5}, .cells = {30, 30, 3}, .grading = 1};
    *scene = (alb_scene){.rays_per_patch = 16, .residual = 1e-9, .seed = 3, .surface_count = 1};
    check_ok(alb_shape_box(&scene->mesh, &box, &error), &error);
    scene->surfaces = calloc(1, sizeof *scene->surfaces);
    scene->surfaces[0] = slab_surface(smooth);
    scene->lights = calloc(2, sizeof *scene->lights);
    for (int sign = 1; sign >= -1; sign -= 2)
        if (lights & (sign > 0 ? FROM_ABOVE : FROM_BELOW))
            scene->lights[scene->light_count++] =
                (alb_light){.kind = ALB_LIGHT_POINT, .position_mm = {3, 0, sign * 60.0}, .flux = {1, 2, 3}};
    check_ok(alb_solution_create(s, scene, &error), &error);
}

// Radiance of the middle of the slab's upper face in the direction of this cosine to +z.
static void look(double radiance[3], alb_scene *scene, const alb_solution *s, double cosine)
{
    alb_error error = {0};
    alb_image picture = {0};
    const alb_vector middle = {0.3, 0.2, 2.5}, away = {100 * sqrt(1 - cosine * cosine), 0, 100 * cosine};
    scene->camera = alb_camera_look_at(alb_add(middle, away), middle, (alb_vector){0, 1, 0}, 0.1, 1, 1);
    check_ok(alb_view_render(&picture, scene, s, &error), &error);
    for (int c = 0; c < 3; c++)
        radiance[c] = (double)alb_image_at(&picture, 0, 0)[c];
    alb_image_free(&picture);
}

// White furnace of directions: over the hemisphere a smooth face sends what the ground one sends, lit from its own side
// or from the other. Along the normal it sends more by the digits of photons that left such slabs (fit/exit_angle.h).
static void outgoing_flux_is_unchanged(void **state)
{
    (void)state;
    enum { DIRECTIONS = 60 };
    static const double along_normal[] = {1.06, 1.09};
    for (int side = 0; side < ALB_SIDES; side++) {
        alb_scene scenes[2];
        alb_solution solved[2];
        double smooth[3], ground[3], sum[3] = {0};
        for (int k = 0; k < 2; k++)
            solve_slab(&scenes[k], &solved[k], k == 0, side ? FROM_BELOW : FROM_ABOVE);
        assert_non_null(solved[0].across);
        assert_null(solved[1].across);
        for (int i = 0; i < DIRECTIONS; i++) {
            const double cosine = (i + 0.5) / DIRECTIONS;
            look(smooth, &scenes[0], &solved[0], cosine);
            look(ground, &scenes[1], &solved[1], cosine);
            for (int c = 0; c < 3; c++)
                sum[c] += 2 * cosine / DIRECTIONS * smooth[c] / ground[c];
        }
        look(smooth, &scenes[0], &solved[0], 1);
        look(ground, &scenes[1], &solved[1], 1);
        for (int c = 0; c < 3; c++) {
            check_near(sum[c], 1, 5e-4); // the midpoint rule at the horizon, where the ratio falls to zero
            check_near(smooth[c] / ground[c], along_normal[side], 0.0051);
        }
        for (int k = 0; k < 2; k++) {
            alb_solution_free(&solved[k]);
            alb_scene_free(&scenes[k]);
        }
    }
}

// Light from both sides is the sum of light from each, direction by direction.
static void reflected_and_crossed_add_up(void **state)
{
    (void)state;
    alb_scene scenes[3];
    alb_solution solved[3];
    for (int k = 0; k < 3; k++)
        solve_slab(&scenes[k], &solved[k], true, k + 1);
    for (double cosine = 0.1; cosine <= 1; cosine += 0.15) {
        double above[3], below[3], both[3];
        look(above, &scenes[0], &solved[0], cosine);
        look(below, &scenes[1], &solved[1], cosine);
        look(both, &scenes[2], &solved[2], cosine);
        for (int c = 0; c < 3; c++)
            check_relative(both[c], above[c] + below[c], 1e-3); // lights draw random points by their place in the list
    }
    for (int k = 0; k < 3; k++) {
        alb_solution_free(&solved[k]);
        alb_scene_free(&scenes[k]);
    }
}

// A ball in a white furnace has B = pi everywhere: the picture is the exit ratio at the ball's own normal, without the
// facets of its mesh, and the same with any number of threads.
static void a_round_body_shows_no_facets(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene scene = {.rays_per_patch = 16, .residual = 1e-9, .seed = 3, .surface_count = 1, .light_count = 1};
    alb_solution s;
    alb_image pictures[2] = {{0}};
    const alb_sphere ball = {.radius_mm = 10, .subdivisions = 4};
    check_ok(alb_shape_sphere(&scene.mesh, &ball, &error), &error);
    scene.surfaces = calloc(1, sizeof *scene.surfaces);
    scene.surfaces[0] = (alb_surface){.name = "white", .reflectance = {1, 1, 1}};
    scene.surfaces[0].exits[ALB_REFLECTION] = alb_exit_of(ALB_REFLECTION, ALB_FINISH_SMOOTH, 1.5);
    scene.lights = calloc(1, sizeof *scene.lights);
    scene.lights[0] = (alb_light){.kind = ALB_LIGHT_ENVIRONMENT, .radiance = {1, 1, 1}};
    scene.camera = alb_camera_look_at((alb_vector){0, 0, 1000}, (alb_vector){0}, (alb_vector){0, 1, 0}, 1.2, 101, 101);
    check_ok(alb_solution_create(&s, &scene, &error), &error);
    const int threads = omp_get_max_threads();
    for (int k = 0; k < 2; k++) {
        omp_set_num_threads(k + 1);
        check_ok(alb_view_render(&pictures[k], &scene, &s, &error), &error);
    }
    omp_set_num_threads(threads);
    assert_memory_equal(pictures[0].pixels, pictures[1].pixels, 101 * 101 * 3 * sizeof(float));
    const double mm_per_px = 2 * 1000 * tan(0.6 * M_PI / 180) / 101;
    for (int y = 0; y < 101; y++)
        for (int x = 0; x < 101; x++) {
            const double off = mm_per_px * hypot(x - 50, y - 50) / 10;
            if (off < 0.93) // flatter, a pixel spans more than the ratio's slope bears
                check_relative((double)alb_image_at(&pictures[0], x, y)[1],
                               alb_exit_ratio(&scene.surfaces[0].exits[ALB_REFLECTION], sqrt(1 - off * off)), 0.005);
        }
    check_near(alb_view_brightest(&scene, &s), alb_exit_ratio(&scene.surfaces[0].exits[ALB_REFLECTION], 1), 1e-6);
    for (int k = 0; k < 2; k++)
        alb_image_free(&pictures[k]);
    alb_solution_free(&s);
    alb_scene_free(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(outgoing_flux_is_unchanged),
        cmocka_unit_test(reflected_and_crossed_add_up),
        cmocka_unit_test(a_round_body_shows_no_facets),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
