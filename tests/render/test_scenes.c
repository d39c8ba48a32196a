// The measured scenes are what they say: size, closed bodies, one topology over an animation, no face seen from behind,
// and light that adds up.
#include "check.h"
#include "render/solution.h"
#include "scenes/scenes.h"

// Bodies by material; opaque boxes and rooms among them.
static void find_bodies(alb_bodies *bodies, alb_patches *patches, const alb_scene *scene)
{
    alb_error error = {0};
    check_ok(alb_patches_create(patches, &scene->mesh, &error), &error);
    int *labels = malloc(patches->count * sizeof *labels);
    for (size_t p = 0; p < patches->count; p++)
        labels[p] = scene->surfaces[scene->mesh.groups[p]].scatters ? scene->mesh.groups[p] : -1;
    check_ok(alb_bodies_find(bodies, patches, labels, &error), &error);
    free(labels);
}

static double volume_of(const alb_body *body, const alb_patches *patches)
{
    double volume = 0; // Gauss
    for (size_t i = 0; i < body->count; i++) {
        const size_t p = body->patches[i];
        volume += patches->areas_mm2[p] * alb_dot(patches->normals[p], patches->centroids[p]) / 3;
    }
    return volume;
}

static void have_their_size_and_closed_bodies(void **state)
{
    (void)state;
    static const size_t bodies_of[TEST_SCENES] = {1, 4, 11, 26, 2};
    for (int i = 0; i < TEST_SCENES; i++) {
        alb_error error = {0};
        alb_scene scene, again;
        alb_patches patches;
        alb_bodies bodies;
        check_ok(test_scenes[i].create(&scene, 1, 0, &error), &error);
        // cells are whole numbers: a part's count moves by a few percent
        check_near((double)scene.mesh.face_count, (double)test_scenes[i].patches,
                   0.025 * (double)test_scenes[i].patches);
        assert_int_equal(scene.mesh.dropped, 0);
        find_bodies(&bodies, &patches, &scene);
        assert_int_equal(bodies.count, bodies_of[i]);
        for (size_t b = 0; b < bodies.count; b++) {
            assert_true(bodies.bodies[b].closed);
            assert_true(volume_of(&bodies.bodies[b], &patches) > 0);
        }
        check_ok(test_scenes[i].create(&again, 1, 0, &error), &error);
        assert_memory_equal(scene.mesh.vertices, again.mesh.vertices, scene.mesh.vertex_count * sizeof(alb_vector));
        assert_memory_equal(scene.mesh.faces, again.mesh.faces, scene.mesh.face_count * sizeof *scene.mesh.faces);
        alb_bodies_free(&bodies);
        alb_patches_free(&patches);
        alb_scene_free(&scene);
        alb_scene_free(&again);
    }
}

static void coarse_ones_are_closed_too(void **state)
{
    (void)state;
    static const size_t sizes[3] = {1500, 5000, 20000};
    for (int i = 0; i < TEST_SCENES; i++)
        for (int k = 0; k < 3; k++) {
            alb_error error = {0};
            alb_scene scene;
            alb_patches patches;
            alb_bodies bodies;
            check_ok(test_scenes[i].create(&scene, test_scene_detail(&test_scenes[i], sizes[k]), 0, &error), &error);
            assert_in_range(scene.mesh.face_count, sizes[k] / 2, 3 * sizes[k]);
            find_bodies(&bodies, &patches, &scene);
            for (size_t b = 0; b < bodies.count; b++)
                assert_true(bodies.bodies[b].closed);
            alb_bodies_free(&bodies);
            alb_patches_free(&patches);
            alb_scene_free(&scene);
        }
}

static void animation_keeps_its_faces(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene first, scene;
    alb_patches patches;
    alb_bodies bodies;
    double standing = 0;
    check_ok(scene_gallop(&first, 0.3, 0, &error), &error);
    for (int frame = 0; frame < 48; frame += 7) {
        check_ok(scene_gallop(&scene, 0.3, frame, &error), &error);
        assert_int_equal(scene.mesh.face_count, first.mesh.face_count);
        assert_memory_equal(scene.mesh.faces, first.mesh.faces, scene.mesh.face_count * sizeof *scene.mesh.faces);
        find_bodies(&bodies, &patches, &scene);
        const double volume = volume_of(&bodies.bodies[0], &patches);
        standing = frame ? standing : volume;
        check_near(volume / standing, 1, 0.1); // bent skins do not keep their volume exactly
        alb_bodies_free(&bodies);
        alb_patches_free(&patches);
        alb_scene_free(&scene);
    }
    alb_scene_free(&first);
}

// Faces that pass through one another, or turned the wrong way, would show their backs.
static void no_back_is_seen(void **state)
{
    (void)state;
    for (int i = 0; i < TEST_SCENES; i++) {
        alb_error error = {0};
        alb_scene scene;
        alb_patches patches;
        alb_tracer tracer;
        alb_form_factors factors;
        check_ok(test_scenes[i].create(&scene, 1, 0, &error), &error);
        check_ok(alb_patches_create(&patches, &scene.mesh, &error), &error);
        check_ok(alb_tracer_create(&tracer, &scene.mesh, &error), &error);
        check_ok(alb_form_factors_create(&factors, &patches, &tracer, 4, 1, ALB_SAMPLING_LATTICE, &error), &error);
        print_message("%s: %zu of %zu rays meet a back, %zu the sky\n", test_scenes[i].name, factors.back_rays,
                      4 * patches.count, factors.sky_rays);
        assert_int_equal(factors.back_rays, 0);
        if (!strcmp(test_scenes[i].name, "chess"))
            assert_int_equal(factors.sky_rays, 0);
        alb_form_factors_free(&factors);
        alb_tracer_free(&tracer);
        alb_patches_free(&patches);
        alb_scene_free(&scene);
    }
}

static void light_adds_up(void **state)
{
    (void)state;
    for (int i = 0; i < TEST_SCENES; i++) {
        alb_error error = {0};
        alb_scene scene;
        alb_solution s;
        check_ok(test_scenes[i].create(&scene, test_scene_detail(&test_scenes[i], 2500), 0, &error), &error);
        scene.rays_per_patch = 64;
        check_ok(alb_solution_create(&s, &scene, &error), &error);
        for (int c = 0; c < 3; c++) {
            const alb_balance *b = &s.balance;
            assert_true(b->in[c] > 0);
            // form factors by 64 rays are reciprocal to a few percent a pair, far less in the sum
            check_near((b->absorbed[c] + b->escaped[c] + b->lost[c]) / b->in[c], 1, 0.03);
        }
        for (size_t p = 0; p < s.patches.count; p++)
            for (int c = 0; c < 3; c++)
                assert_true(isfinite(s.radiosity[p][c]) && s.radiosity[p][c] > -1e-3);
        alb_solution_free(&s);
        alb_scene_free(&scene);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(have_their_size_and_closed_bodies),
        cmocka_unit_test(coarse_ones_are_closed_too),
        cmocka_unit_test(animation_keeps_its_faces),
        cmocka_unit_test(no_back_is_seen),
        cmocka_unit_test(light_adds_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
