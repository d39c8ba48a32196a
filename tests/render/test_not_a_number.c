// What cannot be computed is refused or said, and never a picture: fmax and comparisons pass over numbers that are
// none.
#include "base/random.h"
#include "check.h"
#include "render/scatter_kernel.h"
#include "render/shape.h"
#include "render/solution.h"

static void create_ball(alb_scene *scene, alb_surface *surface, alb_light *light, int rays)
{
    alb_error error = {0};
    const alb_sphere sphere = {.radius_mm = 20, .subdivisions = 2};
    *light = (alb_light){.kind = ALB_LIGHT_POINT, .position_mm = {0, 0, 60}, .flux = {1, 1, 1}};
    *scene = (alb_scene){.rays_per_patch = rays,
                         .residual = 1e-4,
                         .seed = 1,
                         .surfaces = surface,
                         .surface_count = 1,
                         .lights = light,
                         .light_count = 1};
    check_ok(alb_shape_sphere(&scene->mesh, &sphere, &error), &error);
}

// Of steep profiles some values are denormal numbers, where a quotient of two of them may be infinite: what a link
// takes from the tables, value times slope, stays finite.
static void faint_scattering_stays_finite(void **state)
{
    (void)state;
    for (int k = 0; k < 200; k++) {
        alb_error error = {0};
        alb_scatter_kernel kernel = {.largest_spread_mm2 = 2};
        alb_profile profiles[3];
        for (int c = 0; c < 3; c++) {
            const double b = 5 * pow(1.01, 3 * k + c); // 5 to 2000 per mm: to 1e5 decay lengths of reach
            profiles[c] = (alb_profile){ALB_FORM_EXPONENTIAL, {0.4 * b * b / (2 * M_PI), b}};
        }
        alb_scatter_kernel_span(&kernel, 60, 1);
        check_ok(alb_scatter_kernel_create(&kernel, 0, &error), &error);
        alb_scatter_kernel_write(&kernel, profiles);
        for (int q = 0; q < kernel.octave_count * ALB_CODES; q++)
            for (int c = 0; c < 3; c++) {
                assert_true(isfinite(kernel.values[q][c] * kernel.bends[q][c]));
                assert_true(isfinite(kernel.values[q][c] * kernel.bends[q][4 + c]));
            }
        alb_scatter_kernel_free(&kernel);
    }
}

// Wherever it stands.
static void a_row_sum_that_is_no_number_is_refused(void **state)
{
    (void)state;
    const alb_surface wall = {.name = "wall"};
    const uint16_t materials[3] = {0};
    for (int at = 0; at < 9; at++) {
        alb_error error = {0};
        double sums[3][3] = {{0.5, 0.1, 0.2}, {0.3, 0.6, 0.2}, {0.1, 0.1, 0.1}}, largest;
        const alb_scatter scatter = {.patch_count = 3, .row_sums = sums};
        assert_true(alb_radiosity_check(&largest, &scatter, true, materials, &wall, &error));
        sums[at / 3][at % 3] = (double)NAN;
        check_fails(alb_radiosity_check(&largest, &scatter, true, materials, &wall, &error), &error, ALB_BAD_DATA,
                    "'wall'");
    }
}

// Light on one patch, or emitted by one, in one channel: no solver takes it for a solution.
static void light_that_is_no_number_is_refused(void **state)
{
    (void)state;
    alb_scene scene;
    alb_light light;
    alb_solution s;
    alb_error error = {0};
    alb_surface wall = {.name = "wall", .reflectance = {0.5, 0.5, 0.5}};
    create_ball(&scene, &wall, &light, 16);
    check_ok(alb_solution_create(&s, &scene, &error), &error);
    const double values[3] = {(double)NAN, (double)INFINITY, 1e200}; // the last has no square
    for (int trial = 0; trial < 60; trial++) {
        alb_random random = alb_random_at(5, 0, (uint64_t)trial);
        alb_radiosity_report report;
        const size_t p = (size_t)(alb_random_uniform(&random) * (double)s.patches.count);
        const int c = (int)(3 * alb_random_uniform(&random));
        const bool emitted = trial & 1;
        double *at = emitted ? &s.exitance[p][c] : &s.irradiance[p][c], kept = *at;
        char named[64] = "no number";
        *at = values[trial / 2 % 3];
        if (!emitted && !isfinite(*at))
            snprintf(named, sizeof named, "patch %zu, channel %c", p, "RGB"[c]);
        error = (alb_error){0};
        check_fails(alb_radiosity_solve(s.radiosity, &report, &s.equations, (alb_solver)(trial % ALB_SOLVERS),
                                        (const alb_rgb *)s.irradiance, (const alb_rgb *)s.exitance, NULL, 1e-3, &error),
                    &error, ALB_BAD_DATA, trial % ALB_SOLVERS == ALB_SOLVER_TWO_LEVEL ? named : "");
        assert_in_range(report.iterations, 0, 5);
        *at = kept;
    }
    alb_solution_free(&s);
    alb_mesh_free(&scene.mesh);
}

// A single ray a patch has no halves that could differ: its error is unknown, not zero.
static void one_ray_states_no_error(void **state)
{
    (void)state;
    for (int rays = 1; rays <= 2; rays++) {
        alb_error error = {0};
        alb_scene scene;
        alb_light light;
        alb_solution s;
        alb_surface wall = {.name = "wall", .reflectance = {0.5, 0.5, 0.5}};
        create_ball(&scene, &wall, &light, rays);
        const alb_box box = {.size_mm = {40, 40, 40}, .cells = {4, 4, 4}, .grading = 1, .inward = true};
        light.position_mm = (alb_vector){3, 2, 1};
        alb_mesh_free(&scene.mesh);
        check_ok(alb_shape_box(&scene.mesh, &box, &error), &error);
        check_ok(alb_solution_create(&s, &scene, &error), &error);
        assert_true(rays == 1 ? isnan(s.rays_error_percent) && isnan(s.stated_error_percent)
                              : s.rays_error_percent > 5); // a fifth of the light comes by two rays
        alb_solution_free(&s);
        alb_mesh_free(&scene.mesh);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(faint_scattering_stays_finite),
        cmocka_unit_test(a_row_sum_that_is_no_number_is_refused),
        cmocka_unit_test(light_that_is_no_number_is_refused),
        cmocka_unit_test(one_ray_states_no_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
