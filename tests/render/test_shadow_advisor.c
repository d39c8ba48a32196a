// The error that the advisor states, on scenes at random: at least 95 of 100 keep it.
#include "base/memory.h"
#include "base/random.h"
#include "check.h"
#include "render/shadow_advisor.h"
#include "render/shadow_rays.h"
#include "render/shape.h"
#include "scenes/parts.h"
#include "scenes/shapes.h"

static int scenes = 20, first_scene = 0;

static double uniform(alb_random *random, double low, double high)
{
    return low + (high - low) * alb_random_uniform(random);
}

static void close_object(alb_scene *scene, size_t first, bool receives_only)
{
    scene->objects[scene->object_count++] = (alb_object){first, scene->mesh.vertex_count - first, receives_only, false};
}

// A ground, one to three balls or blocks above it, an uneven sky and, in half of the scenes, a ball that shines.
static void create(alb_scene *scene, int number)
{
    alb_error error = {0};
    alb_random random = alb_random_at(11, 5, (uint64_t)number);
    const alb_surface surfaces[3] = {surface_opaque("ground", 0.5, 0.5, 0.5),
                                     surface_opaque("thing", 0.6, 0.5, 0.4),
                                     {.name = "lamp", .exitance = {9, 8, 7}}};
    alb_light sky = {.kind = ALB_LIGHT_ENVIRONMENT};
    check_ok(alb_image_create(&sky.map, 16, 8, "R,G,B", &error), &error);
    for (int i = 0; i < 16 * 8 * 3; i++)
        sky.map.pixels[i] = (float)uniform(&random, 0.2, 1);
    *scene = (alb_scene){.seed = 1, .frames = 1};
    check_ok(scene_furnish(scene, surfaces, 3, &sky, 1, &error), &error);
    scene->objects = calloc(8, sizeof *scene->objects);
    check_ok(shape_sheet(&scene->mesh, (alb_vector){-80, -80, 0}, (alb_vector){160, 0, 0}, (alb_vector){0, 160, 0}, 24,
                         24, 0, &error),
             &error);
    close_object(scene, 0, true);
    const int things = 1 + (int)uniform(&random, 0, 3), lamps = number % 2;
    for (int k = 0; k < things + lamps; k++) {
        const bool lamp = k == things, ball = lamp || uniform(&random, 0, 1) < 0.5;
        const double size = lamp ? uniform(&random, 20, 45) : uniform(&random, 8, 25), turn = 2.1 * k + number;
        const alb_vector at = {40 * cos(turn), 40 * sin(turn), lamp ? size + 110 : size * 1.8 + 3};
        alb_mesh mesh = {0};
        const size_t first = scene->mesh.vertex_count;
        if (ball)
            check_ok(alb_shape_sphere(&mesh, &(alb_sphere){at, size, 3, false}, &error), &error);
        else
            check_ok(alb_shape_box(&mesh,
                                   &(alb_box){.centre_mm = at,
                                              .size_mm = {size * uniform(&random, 0.5, 1.5), size, size * 1.5},
                                              .cells = {6, 6, 8},
                                              .grading = 1},
                                   &error),
                     &error);
        for (size_t f = 0; f < mesh.face_count; f++)
            mesh.groups[f] = lamp ? 2 : 1;
        check_ok(alb_mesh_append(&scene->mesh, &mesh, 1, (alb_vector){0}, &error), &error);
        close_object(scene, first, false);
        alb_mesh_free(&mesh);
    }
}

// rms over all vertices that are seen, of the worst channel, percent of its mean.
static double true_error(const alb_shadow_stage *stage, const alb_scene *scene)
{
    alb_error error = {0};
    const alb_mesh *all = &scene->mesh;
    alb_mesh casters = {0};
    const size_t ground = scene->objects[0].vertex_count, n = all->vertex_count;
    float(*radiance)[3] = calloc(all->face_count, sizeof *radiance), (*halves[2])[3];
    for (size_t v = 0; v < n; v++)
        check_ok(alb_mesh_add_vertex(&casters, all->vertices[v], &error), &error);
    for (size_t f = 0; f < all->face_count; f++) {
        const uint32_t *v = all->faces[f];
        if (v[0] < ground)
            continue;
        for (int c = 0; c < 3; c++)
            radiance[casters.face_count][c] = (float)(scene->surfaces[all->groups[f]].exitance[c] / M_PI);
        check_ok(alb_mesh_add_face(&casters, v[0], v[1], v[2], 0, &error), &error);
    }
    alb_tracer tracer;
    check_ok(alb_tracer_create(&tracer, &casters, &error), &error);
    for (int k = 0; k < 2; k++) {
        halves[k] = calloc(n, sizeof **halves);
        alb_shadow_cast(halves[k], &tracer, (const float(*)[3])radiance, scene->lights, scene->light_count,
                        all->vertices, stage->normals, n, 12, 1e-3, 99 + (uint64_t)k);
    }
    const alb_object *last = &scene->objects[scene->object_count - 1];
    const size_t lamp = stage->light_count ? last->first_vertex : n;
    double worst = 0;
    for (int c = 0; c < 3; c++) {
        double sum = 0, mean = 0;
        for (size_t v = 0; v < lamp; v++) {
            const double found = (double)stage->irradiance[v][c], a = (double)halves[0][v][c],
                         b = (double)halves[1][v][c];
            sum += (found - a) * (found - b) / (double)lamp; // the rays' own errors are independent
            mean += 0.5 * (a + b) / (double)lamp;
        }
        worst = fmax(worst, 100 * sqrt(fmax(sum, 0)) / mean);
    }
    alb_tracer_free(&tracer);
    alb_mesh_free(&casters);
    free(radiance);
    free(halves[0]);
    free(halves[1]);
    return worst;
}

static void keeps_the_error_it_states(void **state)
{
    (void)state;
    int kept = 0, given_up = 0, within = 0;
    double steepest = 0;
    for (int number = 0; number < scenes; number++) {
        alb_error error = {0};
        alb_scene scene;
        alb_shadow_verdict verdict;
        create(&scene, first_scene + number);
        alb_shadow_stage stage = {.settings = alb_shadow_defaults};
        const double wanted = (first_scene + number) % 3 ? 10 : 5;
        if (alb_shadow_advise(&stage, &verdict, &scene, wanted, (uint64_t)(first_scene + number), &error)) {
            const double found = true_error(&stage, &scene);
            kept += found <= verdict.upper_percent;
            within += found <= wanted;
            steepest = fmax(steepest, found / verdict.upper_percent);
        } else {
            assert_int_equal(error.status, ALB_UNDECIDED);
            given_up++;
        }
        alb_shadow_stage_free(&stage);
        alb_scene_free(&scene);
    }
    print_message(
        "%d of %d scenes keep the error stated, %d the one wanted, at worst %.2f times; %d were left to rays\n", kept,
        scenes - given_up, within, steepest, given_up);
    assert_true(kept >= 0.95 * (scenes - given_up));
    assert_true(given_up < scenes / 2);
}

// A number of scenes may be given, and which is the first.
int main(int argc, char **argv)
{
    scenes = argc > 1 ? atoi(argv[1]) : scenes;
    first_scene = argc > 2 ? atoi(argv[2]) : 0;
    const struct CMUnitTest tests[] = {cmocka_unit_test(keeps_the_error_it_states)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
