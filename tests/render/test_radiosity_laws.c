// Laws of the balance of light, on whole scenes: linearity, limits, closed forms, and how few products it takes.
#include "base/random.h"
#include "room_with_ball.h"

// B of both lights is the sum of their own, and of a light seven times as bright seven times.
static void lights_superpose(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene scene;
    alb_solution s[3];
    begin(&scene, 2, 64, 1e-6);
    room_with_ball(&scene, 6);
    scene.surfaces[0] = diffuse(0.5, 0.6, 0.8), scene.surfaces[1] = wax(0.8, 0.3);
    const alb_light lights[2] = {scene.lights[0], scene.lights[1]};
    scene.light_count = 2; // each keeps its place, and with it its random numbers
    for (int k = 0; k < 3; k++) {
        for (int c = 0; c < 3; c++) {
            scene.lights[0].flux[c] = k == 0 ? lights[0].flux[c] : k == 1 ? 0 : 7 * lights[0].flux[c];
            scene.lights[1].flux[c] = k == 0 ? 0 : lights[1].flux[c];
        }
        check_ok(alb_solution_create(&s[k], &scene, &error), &error);
    }
    for (size_t p = 0; p < s[0].patches.count; p++)
        for (int c = 0; c < 3; c++) // the residual, 1e-6 of |b|, where it is dark
            check_relative(s[2].radiosity[p][c], 7 * s[0].radiosity[p][c] + s[1].radiosity[p][c], 1e-4);
    for (int k = 0; k < 3; k++)
        alb_solution_free(&s[k]);
    alb_scene_free(&scene);
}

// Without translucency it is plain radiosity: B = E rho + rho F B, solved here from its rows in double precision.
static void opaque_scenes_are_plain_radiosity(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene scene;
    alb_solution s;
    begin(&scene, 2, 64, 1e-6);
    room_with_ball(&scene, 6);
    scene.light_count = 2;
    scene.surfaces[0] = diffuse(0.5, 0.6, 0.8), scene.surfaces[1] = diffuse(0.9, 0.1, 0.95);
    check_ok(alb_solution_create(&s, &scene, &error), &error);
    const size_t n = s.patches.count;
    alb_rgb *b = calloc(n, sizeof *b), *gathered = calloc(n, sizeof *gathered);
    uint32_t row[64];
    for (int step = 0; step < 400; step++) {
        for (size_t p = 0; p < n; p++) {
            double sum[3] = {0};
            alb_form_factors_row(row, &s.factors, p);
            for (int q = 0; q < 64; q++)
                for (int c = 0; c < 3 && row[q] < n; c++)
                    sum[c] += b[row[q]][c];
            for (int c = 0; c < 3; c++)
                gathered[p][c] = sum[c] / 64;
        }
        alb_form_factors_share(gathered, &s.factors);
        for (size_t p = 0; p < n; p++)
            for (int c = 0; c < 3; c++)
                b[p][c] = scene.surfaces[scene.mesh.groups[p]].reflectance[c] * (s.irradiance[p][c] + gathered[p][c]);
    }
    for (size_t p = 0; p < n; p++)
        for (int c = 0; c < 3; c++)
            check_relative(s.radiosity[p][c], b[p][c], 1e-4); // the residual, 1e-6 of |b|, where it is dark
    free(b);
    free(gathered);
    alb_solution_free(&s);
    alb_scene_free(&scene);
}

// As the mean free path goes to nothing, wax becomes a diffuse surface of its albedo.
static void short_paths_become_diffuse(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_solution s;
    alb_rgb *matt = NULL;
    double before = INFINITY;
    for (int k = 0; k < 4; k++) {
        alb_scene scene;
        begin(&scene, 2, 64, 1e-6);
        room_with_ball(&scene, 6);
        scene.light_count = 1;
        scene.surfaces[0] = diffuse(0.5, 0.5, 0.5);
        const double rates[4] = {0, 0.5, 5, 50}; // patches of the ball have edges of 3.5 mm
        scene.surfaces[1] = k ? wax(0.8, rates[k]) : diffuse(0.8, 0.8, 0.8);
        check_ok(alb_solution_create(&s, &scene, &error), &error);
        double off = 0, all = 0;
        if (!k) {
            matt = calloc(s.patches.count, sizeof *matt);
            memcpy(matt, s.radiosity, s.patches.count * sizeof *matt);
        }
        for (size_t p = 0; p < s.patches.count; p++)
            for (int c = 0; c < 3 && scene.mesh.groups[p]; c++) {
                off += s.patches.areas_mm2[p] * pow(s.radiosity[p][c] - matt[p][c], 2);
                all += s.patches.areas_mm2[p] * pow(matt[p][c], 2);
            }
        if (k)
            check_below(sqrt(off / all), k == 3 ? 0.03 : 0.5 * before); // k 3: light crosses 1/50 mm of 3.5
        before = k ? sqrt(off / all) : before;
        alb_solution_free(&s);
        alb_scene_free(&scene);
    }
    free(matt);
}

// Concentric spheres: F_12 = 1, F_21 = (r1/r2)^2, F_22 = 1 - F_21, two equations with two unknowns.
static void two_concentric_spheres(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene scene;
    alb_solution s;
    alb_mesh inner = {0}, outer = {0};
    const alb_sphere small = {.radius_mm = 10, .subdivisions = 3},
                     large = {.radius_mm = 25, .subdivisions = 3, .inward = true};
    begin(&scene, 2, 256, 1e-6);
    check_ok(alb_shape_sphere(&inner, &small, &error), &error);
    check_ok(alb_shape_sphere(&outer, &large, &error), &error);
    add_mesh(&scene, &outer, 0);
    add_mesh(&scene, &inner, 1);
    scene.surfaces[0] = diffuse(0.9, 0.5, 0.2), scene.surfaces[1] = diffuse(0.3, 0.7, 0.95);
    for (int c = 0; c < 3; c++)
        scene.surfaces[0].exitance[c] = 1 + c, scene.surfaces[1].exitance[c] = 5 - c;
    check_ok(alb_solution_create(&s, &scene, &error), &error);
    double area[2] = {0}, mean[2][3] = {{0}};
    for (size_t p = 0; p < s.patches.count; p++) {
        area[scene.mesh.groups[p]] += s.patches.areas_mm2[p];
        for (int c = 0; c < 3; c++)
            mean[scene.mesh.groups[p]][c] += s.patches.areas_mm2[p] * s.radiosity[p][c];
    }
    const double f = area[1] / area[0]; // of the facets
    for (int c = 0; c < 3; c++) {
        const double r0 = scene.surfaces[0].reflectance[c], r1 = scene.surfaces[1].reflectance[c];
        const double m0 = scene.surfaces[0].exitance[c], m1 = scene.surfaces[1].exitance[c];
        // B0 = m0 + r0 (f B1 + (1 - f) B0), B1 = m1 + r1 B0
        const double b0 = (m0 + r0 * f * m1) / (1 - r0 * (1 - f) - r0 * f * r1), b1 = m1 + r1 * b0;
        // sampling: 1280 rows of 256 rays share the small sphere's 1/6 of the view, 0.1 % of it in the mean
        check_relative(mean[0][c] / area[0], b0, 2e-3);
        check_relative(mean[1][c] / area[1], b1, 2e-3);
    }
    alb_solution_free(&s);
    alb_scene_free(&scene);
}

// |S'(E + F B) - B| / |S'E|, worst channel.
static double residual_of(const alb_solution *s)
{
    const size_t n = s->patches.count;
    alb_rgb *light = calloc(n, sizeof *light), *sent = calloc(n, sizeof *sent), *first = calloc(n, sizeof *first);
    double worst = 0;
    alb_form_factors_apply(light, &s->factors, (const alb_rgb *)s->radiosity);
    for (size_t p = 0; p < n; p++)
        for (int c = 0; c < 3; c++)
            light[p][c] += s->irradiance[p][c];
    alb_scatter_apply(sent, &s->scatter, (const alb_rgb *)light);
    alb_scatter_apply(first, &s->scatter, (const alb_rgb *)s->irradiance);
    for (int c = 0; c < 3; c++) {
        double off = 0, all = 0;
        for (size_t p = 0; p < n; p++) {
            off += s->patches.areas_mm2[p] * pow(sent[p][c] - s->radiosity[p][c], 2);
            all += s->patches.areas_mm2[p] * pow(first[p][c], 2);
        }
        worst = fmax(worst, sqrt(off / all));
    }
    free(light);
    free(sent);
    free(first);
    return worst;
}

// Two levels: at most 12 products to 1e-3 at any albedo, where bounce after bounce takes hundreds; and what is stated
// of the residual and of the error holds, the latter against a solution a thousand times as exact.
static void products_are_few_at_any_albedo(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene scene;
    alb_solution s, exact;
    begin(&scene, 2, 256, 1e-3);
    room_with_ball(&scene, 10);
    scene.light_count = 1;
    const double albedos[4] = {0.5, 0.8, 0.95, 0.99};
    for (int k = 0; k < 4; k++) {
        const double albedo = albedos[k];
        scene.surfaces[0] = diffuse(albedo, albedo, albedo), scene.surfaces[1] = wax(albedo, 0.3);
        scene.residual = 1e-3;
        check_ok(alb_solution_create(&s, &scene, &error), &error);
        scene.residual = 1e-6;
        check_ok(alb_solution_create(&exact, &scene, &error), &error);
        assert_in_range(s.report.iterations, 1, 12);
        assert_in_range(exact.report.iterations, 1, 20);
        check_below(residual_of(&s), s.report.residual);
        check_below(0.1 * s.report.residual, residual_of(&s)); // a bound, but not a wild one
        alb_radiosity_report one_level;
        check_ok(alb_radiosity_solve(exact.irradiance, &one_level, &s.equations, ALB_SOLVER_GMRES,
                                     (const alb_rgb *)s.irradiance, NULL, NULL, 1e-3, &error),
                 &error);
        assert_true(s.report.iterations <= one_level.iterations - (k >= 2 ? 3 : 0)); // clusters pay where light lasts
        for (int c = 0; c < 3; c++) {
            double off = 0, all = 0;
            for (size_t p = 0; p < s.patches.count; p++) {
                off += s.patches.areas_mm2[p] * fabs(s.radiosity[p][c] - exact.radiosity[p][c]);
                all += s.patches.areas_mm2[p] * s.radiosity[p][c];
            }
            check_below(off / all, s.bound);
        }
        check_near(s.stated_error_percent, hypot(s.irradiance_error_percent, 0.5) + 100 * s.bound, 1e-12);
        alb_solution_free(&s);
        alb_solution_free(&exact);
    }
    alb_scene_free(&scene);
}

// Any opaque closed room: at most 12 products to 1e-3. Plates lie above the floor, most closer
// than a patch is wide: light stays long in such gaps.
static void products_are_few_in_random_rooms(void **state)
{
    (void)state;
    enum { ROOMS = 12, PLATES = 4 };
    for (uint64_t trial = 0; trial < ROOMS; trial++) {
        alb_error error = {0};
        alb_random random = alb_random_at(41, 0, trial);
        alb_scene scene;
        alb_solution s;
        alb_mesh part = {0};
        begin(&scene, 2, 256, 1e-3);
        const double side[3] = {20 + 60 * alb_random_uniform(&random), 20 + 60 * alb_random_uniform(&random), 40};
        const alb_box walls = {
            .size_mm = {side[0], side[1], side[2]}, .cells = {8, 8, 8}, .grading = 1, .inward = true};
        check_ok(alb_shape_box(&part, &walls, &error), &error);
        add_mesh(&scene, &part, 0);
        for (int k = 0; k < PLATES; k++) {
            const double width = 4 + 6 * alb_random_uniform(&random), gap = pow(10, -2 * alb_random_uniform(&random));
            const alb_box plate = {
                .centre_mm = {(0.25 - 0.5 * (k & 1)) * side[0], (0.12 - 0.25 * (k & 2)) * side[1], gap + 0.5 - 20},
                .size_mm = {width, width, 1},
                .cells = {4, 4, 1},
                .grading = 1};
            check_ok(alb_shape_box(&part, &plate, &error), &error);
            add_mesh(&scene, &part, 1);
        }
        const double albedo = trial & 1 ? 0.99 : 0.99 * alb_random_uniform(&random);
        scene.surfaces[0] = diffuse(albedo, 0.9 * albedo, 0.5), scene.surfaces[1] = diffuse(albedo, albedo, 0.99);
        scene.light_count = 1;
        scene.lights[0] = (alb_light){.kind = ALB_LIGHT_POINT,
                                      .position_mm = {(alb_random_uniform(&random) - 0.5) * side[0],
                                                      (alb_random_uniform(&random) - 0.5) * side[1], 15},
                                      .flux = {1, 2, 3}};
        check_ok(alb_solution_create(&s, &scene, &error), &error);
        assert_in_range(s.report.iterations, 1, 12);
        check_below(residual_of(&s), s.report.residual);
        alb_solution_free(&s);
        alb_scene_free(&scene);
    }
}

// Row sums found beside the first product are those found apart (both sum weights in single precision), after any
// change: other widths and totals, none at all, and back. The residual that is stated stays a bound.
static void materials_change_beside_a_product(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene scene;
    alb_solution s;
    begin(&scene, 2, 64, 1e-4);
    room_with_ball(&scene, 8);
    scene.light_count = 2;
    const alb_surface changes[] = {wax(0.8, 0.3), wax(0.8, 0.6), wax(0.5, 0.2), wax(0, 0.2), wax(0.9, 0.25)};
    scene.surfaces[0] = diffuse(0.5, 0.6, 0.8), scene.surfaces[1] = wax(0.7, 0.4);
    check_ok(alb_solution_create(&s, &scene, &error), &error);
    const size_t n = s.patches.count;
    alb_rgb *sums = calloc(n, sizeof *sums);
    for (size_t k = 0; k < sizeof changes / sizeof *changes; k++) {
        scene.surfaces[1] = changes[k];
        scene.surfaces[0].reflectance[1] = 0.1 * (double)k;
        check_ok(alb_solution_rematerial(&s, &scene, &error), &error);
        check_below(residual_of(&s), s.report.residual);
        memcpy(sums, s.scatter.row_sums, n * sizeof *sums);
        check_ok(alb_scatter_rewrite(&s.scatter, scene.surfaces, &error), &error);
        for (size_t p = 0; p < n; p++)
            for (int c = 0; c < 3; c++)
                check_near(sums[p][c], s.scatter.row_sums[p][c], 2e-6);
    }
    // refused by its name, and the light stays what it was
    memcpy(sums, s.radiosity, n * sizeof *sums);
    scene.surfaces[1] = wax(1.3, 0.25);
    snprintf(scene.surfaces[1].name, sizeof scene.surfaces[1].name, "glow-worm");
    check_fails(alb_solution_rematerial(&s, &scene, &error), &error, ALB_BAD_DATA, "glow-worm");
    assert_memory_equal(sums, s.radiosity, n * sizeof *sums);
    scene.surfaces[1] = changes[0];
    check_ok(alb_solution_rematerial(&s, &scene, &error), &error);
    free(sums);
    alb_solution_free(&s);
    alb_scene_free(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lights_superpose),
        cmocka_unit_test(opaque_scenes_are_plain_radiosity),
        cmocka_unit_test(short_paths_become_diffuse),
        cmocka_unit_test(two_concentric_spheres),
        cmocka_unit_test(products_are_few_at_any_albedo),
        cmocka_unit_test(products_are_few_in_random_rooms),
        cmocka_unit_test(materials_change_beside_a_product),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
