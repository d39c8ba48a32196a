// Relighting by narrow matrices, and solutions under other lights and materials, against solutions from nothing.
#include "base/random.h"
#include "render/relight.h"
#include "room_with_ball.h"
#include <omp.h>

// The room with the ball of wax, and a small lamp.
static void room(alb_scene *scene)
{
    alb_error error = {0};
    alb_mesh lamp = {0};
    const alb_sphere small = {.radius_mm = 2, .centre_mm = {-15, 10, 5}, .subdivisions = 0};
    begin(scene, 3, 256, 1e-5);
    room_with_ball(scene, 8);
    scene->light_count = 2;
    check_ok(alb_shape_sphere(&lamp, &small, &error), &error);
    add_mesh(scene, &lamp, 2);
    scene->surfaces[0] = diffuse(0.5, 0.7, 0.8);
    scene->surfaces[1] = wax(0.85, 0.3);
    scene->surfaces[2] = (alb_surface){.name = "lamp", .reflectance = {0.5, 0.5, 0.5}, .exitance = {0.1, 0.1, 0.2}};
}

// After other lights and other materials, the solution is that of a scene that never had others.
static void solutions_can_change(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene scene;
    alb_solution s, fresh;
    room(&scene);
    check_ok(alb_solution_create(&s, &scene, &error), &error);
    for (int change = 0; change < 6; change++) {
        if (change == 0) // by little: the last solution is a start
            scene.lights[0].flux[0] = 1.001;
        else if (change == 1) // by much
            scene.lights[1].position_mm.x = -20, scene.lights[0].flux[1] = 0;
        else if (change == 2) // a wall that glows
            scene.surfaces[0].exitance[2] = 1e-5;
        else // less of it and wider, more of it, as much of it and narrower
            for (int c = 0; c < 3; c++) {
                scene.surfaces[1].profiles[0][c].parameters[0] *= change == 3 ? 0.5 : change == 4 ? 1.2 : 1.25 * 1.25;
                scene.surfaces[1].profiles[0][c].parameters[1] *= change == 3 ? 0.8 : change == 4 ? 1 : 1.25;
                scene.surfaces[0].reflectance[c] = 0.3 + 0.1 * c;
            }
        check_ok(change < 3 ? alb_solution_relight(&s, &scene, &error) : alb_solution_rematerial(&s, &scene, &error),
                 &error);
        const int products = s.report.iterations;
        check_ok(alb_solution_create(&fresh, &scene, &error), &error);
        // both to a residual of 1e-5; an error is at most 1 / (1 - 0.8) times that. Links stay those of the first
        // materials, within 0.5 % of exact as the fresh ones are
        check_below(difference(&s, (const alb_rgb *)s.radiosity, (const alb_rgb *)fresh.radiosity),
                    change < 3 ? 1e-4 : 2e-3);
        for (int c = 0; c < 3; c++) {
            check_near(s.balance.in[c], fresh.balance.in[c], 1e-12 + 1e-9 * fresh.balance.in[c]);
            check_near(s.balance.absorbed[c], fresh.balance.absorbed[c],
                       (change < 3 ? 1e-4 : 2e-3) * fresh.balance.in[c]);
        }
        if (change == 0)
            assert_true(products < fresh.report.iterations);
        if (change >= 3)
            check_near(s.scatter.change, change == 3 ? 3.0 / 7 : change == 4 ? 0.2 : 0, 1e-9);
        alb_solution_free(&fresh);
    }
    // refused, and then taken again
    scene.surfaces[0].reflectance[0] = 1;
    check_fails(alb_solution_rematerial(&s, &scene, &error), &error, ALB_BAD_DATA, "creates light");
    scene.surfaces[0].reflectance[0] = 0.5;
    check_ok(alb_solution_rematerial(&s, &scene, &error), &error);
    alb_solution_free(&s);
    alb_scene_free(&scene);
}

static void relighting_states_its_error(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene scene;
    alb_solution s;
    alb_relight narrow[3] = {{0}}, none;
    room(&scene);
    check_ok(alb_solution_create(&s, &scene, &error), &error);
    alb_rgb *found = calloc(s.patches.count, sizeof *found);
    const int ranks[3] = {0, 8, 64};
    for (int k = 0; k < 3; k++) {
        check_ok(alb_relight_create(&narrow[k], &s.equations, &s.patches, ranks[k], 7, &error), &error);
        alb_relight_apply(found, &narrow[k], (const alb_rgb *)s.irradiance);
        for (size_t p = 0; p < s.patches.count; p++)
            for (int c = 0; c < 3; c++) // lamps that light directly are no part of it
                found[p][c] += s.lamps_direct ? s.exitance[p][c] : 0;
        const double percent = 100 * difference(&s, (const alb_rgb *)found, (const alb_rgb *)s.radiosity);
        check_below(percent, 2 * narrow[k].worst_percent); // lights of its own are no harder than these
        if (k)                                             // more columns, less error
            check_below(narrow[k].error_percent, 0.8 * narrow[k - 1].error_percent);
    }
    // rays hold reciprocity to about 1 % on a mesh of 1,000, and most receivers are patches with fewer of them: 2.4
    check_below(narrow[2].error_percent, 3);
    // linear, to the step of 16 bits
    alb_relight_apply(found, &narrow[2], (const alb_rgb *)s.irradiance);
    alb_rgb *light = calloc(s.patches.count, sizeof *light), *both = calloc(s.patches.count, sizeof *both);
    for (size_t p = 0; p < s.patches.count; p++)
        for (int c = 0; c < 3; c++)
            light[p][c] = 3 * s.irradiance[p][c];
    alb_relight_apply(both, &narrow[2], (const alb_rgb *)light);
    for (size_t p = 0; p < s.patches.count; p++)
        check_relative(both[p][1], 3 * found[p][1], 1e-5);
    // the same bytes with one thread
    const int threads = omp_get_max_threads();
    omp_set_num_threads(threads > 1 ? 1 : 2);
    alb_relight_apply(light, &narrow[2], (const alb_rgb *)s.irradiance);
    omp_set_num_threads(threads);
    assert_memory_equal(light, found, s.patches.count * sizeof *found);
    // of light on a single patch nothing comes to less than none anywhere
    for (size_t lit = 0; lit < s.patches.count; lit += 97) {
        memset(light, 0, s.patches.count * sizeof *light);
        light[lit][1] = 1;
        alb_relight_apply(both, &narrow[1], (const alb_rgb *)light);
        for (size_t p = 0; p < s.patches.count; p++)
            assert_true(both[p][1] >= 0);
    }
    check_fails(alb_relight_create(&none, &s.equations, &s.patches, -1, 7, &error), &error, ALB_BAD_DATA, "-1 columns");
    check_fails(alb_relight_create(&none, &s.equations, &s.patches, 513, 7, &error), &error, ALB_BAD_DATA, "at most");
    for (int k = 0; k < 3; k++)
        alb_relight_free(&narrow[k]);
    free(found);
    free(light);
    free(both);
    alb_solution_free(&s);
    alb_scene_free(&scene);
}

// Every patch is in one receiver, rows hold, and with nothing to be missed receivers are patches with their own rays.
static void receivers_hold_energy(void **state)
{
    (void)state;
    enum { LIGHTS = 3 };
    alb_error error = {0};
    alb_scene scene;
    alb_solution s;
    room(&scene);
    scene.rays_per_patch = ALB_RECEIVER_RAYS / 2;
    check_ok(alb_solution_create(&s, &scene, &error), &error);
    const size_t n = s.patches.count;
    alb_rgb *lights[LIGHTS], *out = calloc(n, sizeof *out);
    const double lengths[LIGHTS][3] = {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}};
    for (int k = 0; k < LIGHTS; k++) {
        alb_random random = alb_random_at(11, 0, (uint64_t)k);
        lights[k] = calloc(n, sizeof *lights[k]);
        for (size_t p = 0; p < n; p++)
            for (int c = 0; c < 3; c++)
                lights[k][p][c] = alb_random_uniform(&random);
    }
    const double wanted[2] = {INFINITY, 0};
    for (int fine = 0; fine < 2; fine++) {
        alb_receivers receivers;
        check_ok(alb_receivers_create(&receivers, &s.equations, lights, lengths, LIGHTS, wanted[fine], &error), &error);
        int *seen = calloc(n, sizeof *seen);
        for (size_t i = 0; i < receivers.first[receivers.count]; i++)
            seen[receivers.members[i]]++;
        for (size_t p = 0; p < n; p++) {
            assert_int_equal(seen[p], 1);
            for (int c = 0; c < 3; c++)
                receivers.values[p][c] = fine ? (float)lights[0][p][c] : 1;
        }
        alb_receivers_gather(&receivers);
        if (fine)
            alb_form_factors_apply_rows(out, &s.factors, (const alb_rgb *)lights[0]);
        for (size_t r = 0; r < receivers.count; r++) {
            check_near(receivers.gathered[r][1], fine ? out[receivers.members[receivers.first[r]]][1] : 1, 1e-6);
            assert_in_range(receivers.first[r + 1] - receivers.first[r], 1, fine ? 1 : ALB_RECEIVER_PATCHES);
        }
        free(seen);
        alb_receivers_free(&receivers);
    }
    for (int k = 0; k < LIGHTS; k++)
        free(lights[k]);
    free(out);
    alb_solution_free(&s);
    alb_scene_free(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(solutions_can_change),
        cmocka_unit_test(relighting_states_its_error),
        cmocka_unit_test(receivers_hold_energy),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
