// Probes on an object's own surface: closed forms, connected parts, rays as the oracle on the deforming scenes.
#include "base/random.h"
#include "check.h"
#include "render/shadow_rays.h"
#include "render/shadow_stage.h"
#include "render/shape.h"
#include "scenes/shadow_scenes.h"
#include "scenes/shapes.h"
#include <omp.h>

static alb_vector *normals_of(const alb_mesh *mesh)
{
    alb_vector *normals = calloc(mesh->vertex_count, sizeof *normals);
    for (size_t f = 0; f < mesh->face_count; f++) {
        const alb_vector a = mesh->vertices[mesh->faces[f][0]], b = mesh->vertices[mesh->faces[f][1]],
                         c = mesh->vertices[mesh->faces[f][2]];
        for (int k = 0; k < 3; k++)
            normals[mesh->faces[f][k]] = alb_add(normals[mesh->faces[f][k]], alb_cross(alb_sub(b, a), alb_sub(c, a)));
    }
    for (size_t v = 0; v < mesh->vertex_count; v++)
        normals[v] = alb_unit(normals[v]);
    return normals;
}

static void sample(alb_shadow_surface *surface, const alb_mesh *mesh, size_t probes)
{
    alb_error error = {0};
    alb_vector *normals = normals_of(mesh);
    check_ok(alb_shadow_surface_create(surface, mesh, normals, probes, &error), &error);
    check_ok(alb_shadow_surface_sample(surface, mesh->vertices, normals, &error), &error);
    free(normals);
}

// The share of an even sky's irradiance that is hidden.
static double share(const alb_shadow_surface *surface, size_t vertex)
{
    return (double)surface->hidden[vertex][0] * sqrt(4 * M_PI) / M_PI;
}

// On a floor beside a wall, endless but for 0.001, that is seen up to the height angle a: (1 - cos a) / 2 of the
// irradiance is hidden. The wall stands at x = 0, its front towards +x.
static void floor_beside_a_wall(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_mesh mesh = {0};
    check_ok(
        shape_sheet(&mesh, (alb_vector){1, -1, 0}, (alb_vector){20, 0, 0}, (alb_vector){0, 2, 0}, 20, 2, 0, &error),
        &error);
    const size_t floor = mesh.vertex_count;
    check_ok(
        shape_sheet(&mesh, (alb_vector){0, -60, 0}, (alb_vector){0, 120, 0}, (alb_vector){0, 0, 5}, 1, 1, 0, &error),
        &error);
    double worst[2] = {0};
    for (int few = 0; few < 2; few++) {
        alb_shadow_surface surface;
        sample(&surface, &mesh, few ? 30 : mesh.vertex_count);
        if (!few)
            assert_int_equal(surface.probes.count, mesh.vertex_count);
        for (size_t v = 0; v < floor; v++) {
            const double x = mesh.vertices[v].x, truth = 0.5 * (1 - x / hypot(x, 5));
            // 32 rays along an edge of the hidden part: half a ray's share times the root of those on it; with few
            // probes the steepest spot, next to the wall, is between them
            worst[few] = fmax(worst[few], fabs(share(&surface, v) - truth));
            check_near(share(&surface, v), truth, few ? 0.12 : 0.05);
        }
        alb_shadow_surface_free(&surface);
    }
    print_message("a floor beside a wall: within %.3f of the irradiance, %.3f with half of the probes\n", worst[0],
                  worst[1]);
    alb_mesh_free(&mesh);
}

// What is convex hides nothing of itself; each connected part has a probe whatever the limit, and takes from no other.
static void parts_have_probes_of_their_own(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_mesh ball = {0}, two = {0};
    check_ok(alb_shape_sphere(&ball, &(alb_sphere){{0}, 1, 3, false}, &error), &error);
    alb_shadow_surface surface;
    sample(&surface, &ball, 50);
    assert_int_equal(surface.probes.count, 50);
    for (size_t v = 0; v < ball.vertex_count; v++)
        check_near(share(&surface, v), 0, 1e-12);
    alb_shadow_surface_free(&surface);
    for (int k = 0; k < 2; k++)
        check_ok(alb_mesh_append(&two, &ball, 1 + k, (alb_vector){5 * k, 0, 0}, &error), &error);
    for (size_t probes = 1; probes < 200; probes += 60) {
        sample(&surface, &two, probes);
        assert_int_equal(surface.probes.count, probes < 2 ? 2 : probes);
        for (size_t v = 0; v < two.vertex_count; v++) {
            double sum = 0;
            for (int k = 0; k < ALB_SHADOW_PROBE_NEIGHBOURS; k++) {
                const size_t probe = surface.probes.vertices[surface.probes.neighbours[v][k]];
                assert_true(surface.probes.weights[v][k] >= 0);
                sum += (double)surface.probes.weights[v][k];
                if (surface.probes.weights[v][k] > 0)
                    assert_true((probe < ball.vertex_count) == (v < ball.vertex_count));
            }
            check_near(sum, 1, 1e-6);
        }
        alb_shadow_surface_free(&surface);
    }
    alb_mesh_free(&ball);
    alb_mesh_free(&two);
}

// F11 on the surface: a small ball half sunk in a large one. Its probes inside see only that; the vertices outside,
// which lie between those and others, do not take it for what they see.
static void buried_probes_are_left_out(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_mesh ball = {0}, two = {0};
    check_ok(alb_shape_sphere(&ball, &(alb_sphere){{0}, 1, 3, false}, &error), &error);
    check_ok(alb_mesh_append(&two, &ball, 1, (alb_vector){0}, &error), &error);
    check_ok(alb_mesh_append(&two, &ball, 3, (alb_vector){3, 0, 0}, &error), &error);
    alb_shadow_surface surface;
    sample(&surface, &two, 300);
    size_t buried = 0;
    for (size_t p = 0; p < surface.probes.count; p++)
        buried += surface.buried[p];
    assert_in_range(buried, 20, 150);
    for (size_t v = 0; v < ball.vertex_count; v++)
        if (alb_length(alb_sub(two.vertices[v], (alb_vector){3, 0, 0})) > 3.02) // in the crease half and more is hidden
            check_below(share(&surface, v), 0.8);
    alb_shadow_surface_free(&surface);
    alb_mesh_free(&ball);
    alb_mesh_free(&two);
}

// Irradiance on the model against 1024 rays, rms in percent of its mean.
static double model_error(const alb_shadow_stage *stage, const alb_scene *scene)
{
    enum { POINTS = 150 };
    static alb_vector points[POINTS], normals[POINTS];
    static float truth[POINTS][3];
    alb_error error = {0};
    alb_mesh model = {0};
    alb_tracer tracer;
    const alb_object *o = &scene->objects[1];
    size_t vertices[POINTS];
    for (size_t v = 0; v < scene->mesh.vertex_count; v++)
        check_ok(alb_mesh_add_vertex(&model, scene->mesh.vertices[v], &error), &error);
    for (size_t f = 0; f < scene->mesh.face_count; f++) {
        const uint32_t *v = scene->mesh.faces[f];
        if (v[0] >= o->first_vertex && v[0] - o->first_vertex < o->vertex_count)
            check_ok(alb_mesh_add_face(&model, v[0], v[1], v[2], 0, &error), &error);
    }
    check_ok(alb_tracer_create(&tracer, &model, &error), &error);
    alb_random random = alb_random_at(1, 12, 0);
    for (size_t n = 0; n < POINTS;) {
        const size_t v = o->first_vertex + (size_t)(alb_random_uniform(&random) * (double)o->vertex_count);
        points[n] = scene->mesh.vertices[v];
        normals[n] = stage->normals[v];
        vertices[n] = v;
        n += !alb_shadow_buried(&tracer, points[n], normals[n], 256 * tracer.slack_mm);
    }
    float(*black)[3] = calloc(model.face_count, sizeof *black);
    alb_shadow_cast(truth, &tracer, (const float(*)[3])black, scene->lights, scene->light_count, points, normals,
                    POINTS, 32, 256 * tracer.slack_mm, 1);
    double sum = 0, mean = 0;
    for (int n = 0; n < POINTS; n++)
        for (int c = 0; c < 3; c++) {
            sum += pow((double)(stage->irradiance[vertices[n]][c] - truth[n][c]), 2) / (3 * POINTS);
            mean += (double)truth[n][c] / (3 * POINTS);
        }
    free(black);
    alb_tracer_free(&tracer);
    alb_mesh_free(&model);
    return 100 * sqrt(sum) / mean;
}

// F17: receivers in the bounding sphere, on the dragon and the sponge, under their skies, in two frames of one
// sequence.
static void receivers_in_the_bounding_sphere(void **state)
{
    (void)state;
    for (int which = 0; which <= 2; which += 2) {
        alb_shadow_stage with = {.settings = alb_shadow_defaults}, without = with;
        without.settings.probes = 0;
        for (int frame = 4; frame < 12; frame += 7) {
            alb_error error = {0};
            alb_scene scene;
            check_ok(shadow_scenes[which].create(&scene, frame, &error), &error);
            check_ok(alb_shadow_stage_light(&with, &scene, &error), &error);
            check_ok(alb_shadow_stage_light(&without, &scene, &error), &error);
            const double error_with = model_error(&with, &scene), error_without = model_error(&without, &scene);
            print_message("%s, frame %d: %.1f %% with probes, %.1f %% by fields alone\n", shadow_scenes[which].name,
                          frame, error_with, error_without);
            check_below(error_with, 4); // 32 rays: .05 of the hidden part; the truth's 1024 rays add 0.5
            assert_true(error_without > error_with);
            alb_scene_free(&scene);
        }
        alb_shadow_stage_free(&with);
        alb_shadow_stage_free(&without);
    }
}

// There and back: the samples are those of the first time, with any number of threads; a surface that stays keeps them.
static void same_bytes_there_and_back(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_mesh mesh = {0}, ball = {0};
    check_ok(alb_shape_sphere(&ball, &(alb_sphere){{0}, 1, 3, false}, &error), &error);
    check_ok(alb_mesh_append(&mesh, &ball, 1, (alb_vector){0}, &error), &error);
    check_ok(alb_mesh_append(&mesh, &ball, 1, (alb_vector){2.2, 0, 0}, &error), &error);
    alb_vector *normals = normals_of(&mesh), *moved = calloc(mesh.vertex_count, sizeof *moved);
    for (size_t v = 0; v < mesh.vertex_count; v++)
        moved[v] = alb_add(mesh.vertices[v], (alb_vector){v < ball.vertex_count ? 0 : 4, 0, 0});
    alb_shadow_surface surface;
    const int threads = omp_get_max_threads();
    omp_set_num_threads(1);
    sample(&surface, &mesh, 100);
    const size_t bytes = mesh.vertex_count * sizeof *surface.hidden;
    float *kept = malloc(bytes);
    memcpy(kept, surface.hidden, bytes);
    omp_set_num_threads(3);
    check_ok(alb_shadow_surface_sample(&surface, moved, normals, &error), &error);
    assert_true(memcmp(kept, surface.hidden, bytes) != 0);
    check_ok(alb_shadow_surface_sample(&surface, mesh.vertices, normals, &error), &error);
    assert_memory_equal(kept, surface.hidden, bytes);
    omp_set_num_threads(threads);
    alb_shadow_surface_free(&surface);
    free(kept);
    free(normals);
    free(moved);
    alb_mesh_free(&mesh);
    alb_mesh_free(&ball);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(floor_beside_a_wall),        cmocka_unit_test(parts_have_probes_of_their_own),
        cmocka_unit_test(buried_probes_are_left_out), cmocka_unit_test(receivers_in_the_bounding_sphere),
        cmocka_unit_test(same_bytes_there_and_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
