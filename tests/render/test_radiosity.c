// The balance of light against closed forms, conservation, refusals, and independence of the number of threads.
#include "base/random.h"
#include "check.h"
#include "render/radiosity.h"
#include "render/shape.h"
#include "render/solution.h"
#include "render/view.h"
#include <omp.h>

static void scene_of(alb_scene *scene, alb_mesh *mesh, const alb_surface *surfaces, size_t count, int rays)
{
    *scene = (alb_scene){.rays_per_patch = rays, .residual = 1e-6, .seed = 5, .surface_count = count};
    scene->mesh = *mesh;
    *mesh = (alb_mesh){0};
    scene->surfaces = calloc(count, sizeof *surfaces);
    memcpy(scene->surfaces, surfaces, count * sizeof *surfaces);
}

// Closed sphere, every patch emits M and reflects rho: B = M / (1 - rho), whatever the rays, because rows sum to 1.
static void closed_sphere_is_exact(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_mesh mesh = {0};
    alb_scene scene;
    alb_solution solution;
    const alb_sphere sphere = {.radius_mm = 50, .subdivisions = 3, .inward = true};
    const alb_surface wall = {.name = "wall", .reflectance = {0.1, 0.9, 0.99}, .exitance = {1, 2, 3}};
    check_ok(alb_shape_sphere(&mesh, &sphere, &error), &error);
    scene_of(&scene, &mesh, &wall, 1, 64);
    scene.residual = 5e-5; // products round to 1e-7, which 1 / (1 - reflectance) multiplies
    check_ok(alb_solution_create(&solution, &scene, &error), &error);
    assert_int_equal(solution.factors.sky_rays, 0);
    for (size_t p = 0; p < solution.patches.count; p++)
        for (int c = 0; c < 3; c++)
            check_relative(solution.radiosity[p][c], wall.exitance[c] / (1 - wall.reflectance[c]),
                           5e-5 / (1 - wall.reflectance[c]));
    alb_solution_free(&solution);
    alb_scene_free(&scene);
}

// On a spherical enclosure B = S'E + S'1 (w^T S'E) / (1 - w^T S'1), w the shares of area (test_solver.c); here with
// rays and a profile: a translucent shell lit by a beam. Each patch's own rays are random, so the mean of
// B is checked against the closed form with the sampling error found over seeds; the sphere's facets cost what a finer
// one shows.
static void translucent_sphere_agrees(void **state)
{
    (void)state;
    alb_surface wax = {.name = "wax", .scatters = true};
    double ratio[8];
    for (int c = 0; c < 3; c++)
        wax.profiles[0][c] = (alb_profile){ALB_FORM_EXPONENTIAL, {0.004, 0.2}};
    for (uint64_t seed = 0; seed < 8; seed++) {
        alb_error error = {0};
        alb_mesh mesh = {0};
        alb_scene scene;
        alb_solution s;
        const alb_sphere sphere = {.radius_mm = 30, .subdivisions = 3, .inward = true};
        check_ok(alb_shape_sphere(&mesh, &sphere, &error), &error);
        scene_of(&scene, &mesh, &wax, 1, 256);
        scene.seed = seed;
        alb_light beam = {.kind = ALB_LIGHT_SPOT, .direction = {0, 0, 1}, .half_angle_deg = 30, .flux = {1, 1, 1}};
        scene.light_count = 1;
        scene.lights = calloc(1, sizeof beam);
        scene.lights[0] = beam;
        check_ok(alb_solution_create(&s, &scene, &error), &error);
        double area = 0, lit = 0, kept = 0, mean = 0;
        double(*ones)[3] = calloc(s.patches.count, sizeof *ones), (*out)[3] = calloc(s.patches.count, sizeof *out);
        for (size_t p = 0; p < s.patches.count; p++)
            ones[p][0] = ones[p][1] = ones[p][2] = 1, area += s.patches.areas_mm2[p];
        alb_scatter_apply(out, &s.scatter, (const double(*)[3])s.irradiance);
        for (size_t p = 0; p < s.patches.count; p++)
            lit += s.patches.areas_mm2[p] / area * out[p][0];
        alb_scatter_apply(out, &s.scatter, (const double(*)[3])ones);
        for (size_t p = 0; p < s.patches.count; p++) {
            kept += s.patches.areas_mm2[p] / area * out[p][0];
            mean += s.patches.areas_mm2[p] / area * s.radiosity[p][0];
        }
        ratio[seed] = mean / (lit + kept * lit / (1 - kept)); // w^T of the closed form
        free(ones);
        free(out);
        alb_solution_free(&s);
        alb_scene_free(&scene);
    }
    double mean = 0, squares = 0;
    for (int k = 0; k < 8; k++)
        mean += ratio[k] / 8, squares += ratio[k] * ratio[k] / 8;
    const double error_of_mean = sqrt(fmax(0, squares - mean * mean) / 7);
    // facets: neighbours are seen a little less than on the sphere, by the share (edge / radius)^2 / 4 = 0.2 %
    check_near(mean, 1, 4 * error_of_mean + 0.002);
    check_below(error_of_mean, 0.002);
}

// Flux in = absorbed + escaped. A lone convex body: to 1e-6. Two bodies that light each other: the imbalance is the
// sampling error of F, and falls as rays are added.
static double imbalance(int rays, bool two_bodies)
{
    alb_error error = {0};
    alb_mesh mesh = {0}, other = {0};
    alb_scene scene;
    alb_solution s;
    alb_surface surfaces[2] = {{.name = "wax", .scatters = true, .slab = true},
                               {.name = "wall", .reflectance = {0.5, 0.7, 0.9}}};
    for (int side = 0; side < ALB_SIDES; side++)
        for (int c = 0; c < 3; c++)
            surfaces[0].profiles[side][c] = (alb_profile){ALB_FORM_EXPONENTIAL, {0.004 + 0.001 * c, 0.3}};
    const alb_box slab = {.size_mm = {60, 60, 10}, .centre_mm = {0, 0, -5}, .cells = {16, 16, 3}, .grading = 4};
    const alb_box screen = {.size_mm = {60, 10, 60}, .centre_mm = {0, 40, 20}, .cells = {12, 2, 12}, .grading = 1};
    check_ok(alb_shape_box(&mesh, &slab, &error), &error);
    check_ok(alb_shape_box(&other, &screen, &error), &error);
    for (size_t i = 0; i < other.face_count; i++)
        other.groups[i] = 1;
    if (two_bodies)
        check_ok(alb_mesh_append(&mesh, &other, 1, (alb_vector){0}, &error), &error);
    alb_mesh_free(&other);
    scene_of(&scene, &mesh, surfaces, 2, rays);
    scene.lights = calloc(1, sizeof *scene.lights);
    scene.light_count = 1;
    scene.lights[0] = (alb_light){.kind = ALB_LIGHT_PROJECTOR,
                                  .direction = {0, 0, -1},
                                  .pixel_mm = 1,
                                  .diameter_px = 8,
                                  .blur_sd_mm = 0.5,
                                  .flux = {1, 1, 1}};
    check_ok(alb_solution_create(&s, &scene, &error), &error);
    double worst = 0;
    for (int c = 0; c < 3; c++) {
        check_near(s.balance.in[c], 1, 1e-12); // the beam falls on the slab: all of it, exactly
        worst = fmax(worst, fabs(s.balance.in[c] - s.balance.absorbed[c] - s.balance.escaped[c] - s.balance.lost[c]));
    }
    alb_solution_free(&s);
    alb_scene_free(&scene);
    return worst;
}

static void energy_is_conserved(void **state)
{
    (void)state;
    check_below(imbalance(16, false), 1e-6);
    const double few = imbalance(64, true), many = imbalance(4096, true);
    check_below(many, 1e-3); // 1e-3 of the flux at 4096 rays; the patches' random errors average over some 1000 of them
    check_below(many, 0.5 * few + 1e-4);
}

static void refuses_scattering_that_creates_light(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_mesh mesh = {0};
    alb_scene scene;
    alb_solution s;
    alb_surface bright = {.name = "bright", .scatters = true};
    for (int c = 0; c < 3; c++)
        bright.profiles[0][c] = (alb_profile){ALB_FORM_EXPONENTIAL, {c == 1 ? 0.02 : 0.001, 0.3}}; // total 1.396 in G
    const alb_box box = {.size_mm = {60, 60, 60}, .cells = {6, 6, 6}, .grading = 1};
    check_ok(alb_shape_box(&mesh, &box, &error), &error);
    scene_of(&scene, &mesh, &bright, 1, 16);
    check_fails(alb_solution_create(&s, &scene, &error), &error, ALB_BAD_DATA, "'bright' creates light");
    check_fails(alb_solution_create(&s, &scene, &error), &error, ALB_BAD_DATA, "channel G");
    alb_scene_free(&scene);
    // a reflectance of 1 is fine where light can escape and refused where it cannot
    for (int inward = 0; inward < 2; inward++) {
        const alb_surface mirror = {.name = "white", .reflectance = {1, 1, 1}};
        alb_box room = box;
        room.inward = inward;
        check_ok(alb_shape_box(&mesh, &room, &error), &error);
        scene_of(&scene, &mesh, &mirror, 1, 16);
        if (inward)
            check_fails(alb_solution_create(&s, &scene, &error), &error, ALB_BAD_DATA, "closed scene");
        else {
            check_ok(alb_solution_create(&s, &scene, &error), &error);
            alb_solution_free(&s);
        }
        alb_scene_free(&scene);
    }
}

// White furnace: reflectance 1 under an even sky of radiance 1 is lit as if nothing were there: B = pi everywhere.
static void white_furnace(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_mesh mesh = {0}, other = {0};
    alb_scene scene;
    alb_solution s;
    const alb_surface white = {.name = "white", .reflectance = {1, 1, 1}};
    const alb_sphere a = {.radius_mm = 10, .subdivisions = 2},
                     b = {.radius_mm = 7, .centre_mm = {18, 0, 4}, .subdivisions = 2};
    check_ok(alb_shape_sphere(&mesh, &a, &error), &error);
    check_ok(alb_shape_sphere(&other, &b, &error), &error);
    check_ok(alb_mesh_append(&mesh, &other, 1, (alb_vector){0}, &error), &error);
    alb_mesh_free(&other);
    scene_of(&scene, &mesh, &white, 1, 64);
    scene.lights = calloc(1, sizeof *scene.lights);
    scene.light_count = 1;
    scene.lights[0] = (alb_light){.kind = ALB_LIGHT_ENVIRONMENT, .radiance = {1, 1, 1}};
    check_ok(alb_solution_create(&s, &scene, &error), &error);
    for (size_t p = 0; p < s.patches.count; p++)
        check_relative(s.radiosity[p][p % 3], M_PI, 1e-5); // the residual over the smallest share of sky
    alb_solution_free(&s);
    alb_scene_free(&scene);
}

// A point light over a large plate, a spot that hits it and a shadow: E = Phi cos / (4 pi d^2); flux by the solid
// angle.
static void lights_send_their_flux(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_mesh mesh = {0};
    alb_scene scene;
    alb_solution s;
    const alb_surface wall = {.name = "wall", .reflectance = {0.5, 0.5, 0.5}};
    const alb_sphere room = {.radius_mm = 20, .subdivisions = 3, .inward = true};
    const alb_vector at = {5, -3, 2};
    check_ok(alb_shape_sphere(&mesh, &room, &error), &error);
    scene_of(&scene, &mesh, &wall, 1, 16);
    scene.lights = calloc(1, sizeof *scene.lights);
    scene.light_count = 1;
    scene.lights[0] = (alb_light){.kind = ALB_LIGHT_POINT, .position_mm = at, .flux = {1, 2, 3}};
    check_ok(alb_solution_create(&s, &scene, &error), &error);
    // a closed room catches the whole flux; 16 stratified points on each of 1280 patches leave far less than 1e-3
    for (int c = 0; c < 3; c++)
        check_relative(s.balance.in[c], c + 1.0, 1e-3);
    for (size_t p = 0; p < s.patches.count; p += 37) {
        const alb_vector to = alb_sub(at, s.patches.centroids[p]);
        const double expected = alb_dot(alb_unit(to), s.patches.normals[p]) / (4 * M_PI * alb_dot(to, to));
        check_relative(s.irradiance[p][0], expected, 0.03); // within a patch: (edge / distance)^2
    }
    alb_solution_free(&s);
    alb_scene_free(&scene);
}

// A small plate at (0, 0, 0) under the corner of a square lamp of side 1 at height 1: F = 0.138531605995 (element to a
// parallel rectangle over its corner). The lamp is small against the scene once a wide floor lies under both.
static void lamps_light_what_they_see(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_mesh mesh = {0};
    alb_scene scene;
    alb_solution s;
    const alb_surface surfaces[2] = {{.name = "wall", .reflectance = {0.5, 0.5, 0.5}},
                                     {.name = "lamp", .exitance = {3, 2, 1}}};
    const double side[3] = {0.01, 1, 40}, height[3] = {0, 1, -1};
    uint16_t group;
    check_ok(alb_mesh_add_group(&group, &mesh, "", &error), &error);
    for (int k = 0; k < 3; k++) {
        const uint32_t a = (uint32_t)mesh.vertex_count;
        for (int i = 0; i < 4; i++) {
            const double x = side[k] * (i == 1 || i == 2), y = side[k] * (i >= 2);
            const double shift = k == 0 ? -0.005 : k == 2 ? -20 : 0;
            check_ok(alb_mesh_add_vertex(&mesh, (alb_vector){x + shift, y + shift, height[k]}, &error), &error);
        }
        const uint32_t order[2][4] = {{0, 1, 2, 3}, {0, 3, 2, 1}}, *o = order[k == 1];
        check_ok(alb_mesh_add_face(&mesh, a + o[0], a + o[1], a + o[2], k == 1, &error), &error);
        check_ok(alb_mesh_add_face(&mesh, a + o[0], a + o[2], a + o[3], k == 1, &error), &error);
    }
    scene_of(&scene, &mesh, surfaces, 2, 16);
    double sum = 0, squares = 0;
    for (uint64_t seed = 0; seed < 20; seed++) {
        scene.seed = seed;
        check_ok(alb_solution_create(&s, &scene, &error), &error);
        assert_true(s.lamps_direct);
        const double found = s.irradiance[0][0] / 3;
        check_relative(s.irradiance[0][2], found, 1e-12);
        sum += found, squares += found * found;
        assert_true(s.radiosity[2][0] >= 3); // the lamp itself
        alb_solution_free(&s);
    }
    const double mean = sum / 20, error_of_mean = sqrt(fmax(0, squares / 20 - mean * mean) / 19);
    check_near(mean, 0.138531605995, 4 * error_of_mean);
    check_below(error_of_mean, 0.002);
    alb_scene_free(&scene);
}

static void threads_do_not_matter(void **state)
{
    (void)state;
    alb_image pictures[2] = {{0}};
    for (int k = 0; k < 2; k++) {
        alb_error error = {0};
        alb_mesh mesh = {0}, other = {0};
        alb_scene scene;
        alb_solution s;
        alb_surface surfaces[2] = {{.name = "wax", .scatters = true}, {.name = "wall", .reflectance = {0.5, 0.7, 0.9}}};
        for (int c = 0; c < 3; c++)
            surfaces[0].profiles[0][c] = (alb_profile){ALB_FORM_EXPONENTIAL, {0.004 + 0.001 * c, 0.3}};
        const alb_sphere ball = {.radius_mm = 10, .subdivisions = 3};
        const alb_box room = {.size_mm = {60, 60, 60}, .cells = {8, 8, 8}, .grading = 1, .inward = true};
        omp_set_num_threads(k + 1);
        check_ok(alb_shape_sphere(&mesh, &ball, &error), &error);
        check_ok(alb_shape_box(&other, &room, &error), &error);
        for (size_t i = 0; i < other.face_count; i++)
            other.groups[i] = 1;
        check_ok(alb_mesh_append(&mesh, &other, 1, (alb_vector){0}, &error), &error);
        alb_mesh_free(&other);
        scene_of(&scene, &mesh, surfaces, 2, 64);
        scene.lights = calloc(2, sizeof *scene.lights);
        scene.light_count = 2;
        scene.lights[0] = (alb_light){.kind = ALB_LIGHT_SPOT,
                                      .position_mm = {0, 0, 29},
                                      .direction = {0, 0, -1},
                                      .half_angle_deg = 30,
                                      .flux = {1, 1, 1}};
        scene.lights[1] = (alb_light){.kind = ALB_LIGHT_POINT, .position_mm = {20, 20, 20}, .flux = {1, 2, 1}};
        scene.camera = alb_camera_look_at((alb_vector){0, -28, 5}, (alb_vector){0}, (alb_vector){0, 0, 1}, 60, 80, 60);
        check_ok(alb_solution_create(&s, &scene, &error), &error);
        check_ok(alb_view_render(&pictures[k], &scene, &s, &error), &error);
        alb_solution_free(&s);
        alb_scene_free(&scene);
    }
    assert_memory_equal(pictures[0].pixels, pictures[1].pixels, 80 * 60 * 3 * sizeof(float));
    alb_image_free(&pictures[0]);
    alb_image_free(&pictures[1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(closed_sphere_is_exact),
        cmocka_unit_test(translucent_sphere_agrees),
        cmocka_unit_test(energy_is_conserved),
        cmocka_unit_test(refuses_scattering_that_creates_light),
        cmocka_unit_test(white_furnace),
        cmocka_unit_test(lights_send_their_flux),
        cmocka_unit_test(lamps_light_what_they_see),
        cmocka_unit_test(threads_do_not_matter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
