// Receivers among shadow fields: closed forms of lights, the furnace, rules of depth, continuity, rays as the oracle.
// The number in a comment is that of the failure mode in the literature's list (F16, F17, F22).
#include "base/random.h"
#include "check.h"
#include "render/shadow_advisor.h"
#include "render/shadow_rays.h"
#include "render/shadow_receivers.h"
#include "render/shape.h"
#include "scenes/sphere_cluster.h"
#include <omp.h>

enum { AT_MOST = 4 };

// Fields made by hand.
typedef struct stage {
    alb_shadow_field fields[2][AT_MOST]; // occluders, lights
    size_t counts[2];
    alb_shadow_laws laws;
    alb_shadow_sky sky;
    bool has_sky;
} stage;

static stage *new_stage(int order)
{
    alb_error error = {0};
    stage *s = calloc(1, sizeof *s);
    check_ok(alb_shadow_laws_create(&s->laws, order, false, &error), &error);
    return s;
}

static void free_stage(stage *s)
{
    for (int kind = 0; kind < 2; kind++)
        for (size_t i = 0; i < s->counts[kind]; i++)
            alb_shadow_field_free(&s->fields[kind][i]);
    alb_shadow_laws_free(&s->laws);
    free(s);
}

static void add_ball(stage *s, int light, alb_vector centre, double radius, alb_shadow_settings settings)
{
    alb_error error = {0};
    alb_mesh mesh = {0};
    check_ok(alb_shape_sphere(&mesh, &(alb_sphere){centre, radius, 4, false}, &error), &error);
    float(*radiance)[3] = calloc(mesh.face_count, sizeof *radiance);
    for (size_t f = 0; f < mesh.face_count; f++)
        radiance[f][0] = radiance[f][1] = radiance[f][2] = 1;
    alb_shadow_field *field = &s->fields[light][s->counts[light]++];
    check_ok(
        alb_shadow_field_create(field, &settings, &mesh, light ? (const float(*)[3])radiance : NULL, "ball", &error),
        &error);
    check_ok(alb_shadow_field_sample(field, mesh.vertices, &error), &error);
    free(radiance);
    alb_mesh_free(&mesh);
}

static alb_shadow_world world_of(const stage *s)
{
    return (alb_shadow_world){.occluders = s->fields[0],
                              .lights = s->fields[1],
                              .skies = &s->sky,
                              .occluder_count = s->counts[0],
                              .light_count = s->counts[1],
                              .sky_count = s->has_sky,
                              .laws = &s->laws};
}

static double irradiance(const stage *s, alb_vector point, alb_vector normal)
{
    alb_error error = {0};
    float found[3];
    const alb_shadow_world world = world_of(s);
    check_ok(alb_shadow_irradiance(&found, &world, &point, &normal, 1, NULL, &error), &error);
    return (double)found[0];
}

static void even_sky(stage *s, double radius_mm)
{
    alb_error error = {0};
    const alb_light light = {.kind = ALB_LIGHT_ENVIRONMENT, .radiance = {1, 1, 1}, .radius_mm = radius_mm};
    check_ok(alb_shadow_sky_create(&s->sky, &light, &error), &error);
    s->has_sky = true;
}

static alb_vector direction(alb_random *random)
{
    const double z = 2 * alb_random_uniform(random) - 1, turn = 2 * M_PI * alb_random_uniform(random);
    return (alb_vector){sqrt(1 - z * z) * cos(turn), sqrt(1 - z * z) * sin(turn), z};
}

// An even ball of radiance 1 and radius a, at distance d straight ahead: E = pi (a / d)^2.
static void light_falls_off(void **state)
{
    (void)state;
    stage *s = new_stage(4);
    alb_random random = alb_random_at(1, 5, 0);
    const alb_vector centre = {7, -3, 2};
    double worst = 0, before = 0;
    add_ball(s, 1, centre, 2, alb_shadow_light_settings);
    for (double x = 1.1; x < 16; x *= 1.07) {
        const alb_vector d = direction(&random);
        const double found = irradiance(s, alb_add(centre, alb_times(2 * x, d)), alb_times(-1, d));
        worst = fmax(worst, fabs(found * x * x / M_PI - 1));
    }
    print_message("an even ball from 1.1 to 16 radii: within %.2f %% of the closed form\n", 100 * worst);
    for (double x = 0; x < 1.1; x += 0.01) { // inside its sphere: finite, twice that at 1.1 radii
        const double found = irradiance(s, alb_add(centre, (alb_vector){0, 2 * x, 0}), (alb_vector){0, -1, 0});
        assert_true(found >= 0 && found <= 1.7 * M_PI);
        before = x > 0.015 ? before : found;          // the middle has an axis of its own
        check_below(fabs(found - before), 0.01 * 15); // and without a step: it rises as k^-2, 14 a radius
        before = found;
    }
    // straight beside it the clamped cosine of order 4 is 3/32, not 0: a ball that is small takes that share
    for (double x = 3; x < 16; x *= 1.2) {
        const double found = irradiance(s, alb_add(centre, (alb_vector){2 * x, 0, 0}), (alb_vector){0, 0.6, 0.8});
        check_near(found * x * x / M_PI, 3.0 / 32, 0.04); // by its width at 3 radii, and by M
    }
    check_below(worst, 0.03); // the goal; 2 % of it is scaling, the rest facets and pixels
    free_stage(s);
}

// Nothing hides anything in an even environment, whatever its size: E = pi.
static void white_furnace(void **state)
{
    (void)state;
    stage *s = new_stage(4);
    alb_random random = alb_random_at(1, 6, 0);
    for (int finite = 0; finite < 2; finite++) {
        even_sky(s, finite ? 100 : 0);
        for (int n = 0; n < 300; n++) {
            const alb_vector at = alb_times(98 * alb_random_uniform(&random), direction(&random));
            // every step leaves the mean alone: what remains are two roundings of it, and of 63 zeros
            check_relative(irradiance(s, at, direction(&random)), M_PI, 1e-6);
        }
    }
    alb_error error = {0};
    const alb_shadow_world world = world_of(s);
    const alb_vector outside = {0, 0, 100}, up = {0, 0, 1};
    float found[3];
    check_fails(alb_shadow_irradiance(&found, &world, &outside, &up, 1, NULL, &error), &error, ALB_BAD_DATA,
                "radius_mm");
    free_stage(s);
}

// One probe in the middle of a sphere of light; truth by quadrature along the lines of sight.
static void mid_range_environment(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_light light = {.kind = ALB_LIGHT_ENVIRONMENT, .radius_mm = 100};
    check_ok(alb_image_create(&light.map, 128, 64, "R,G,B", &error), &error);
    for (int y = 0; y < 64; y++)
        for (int x = 0; x < 128; x++) {
            const double theta = M_PI * (y + 0.5) / 64, phi = 2 * M_PI * ((x + 0.5) / 128 - 0.5);
            const double into = sin(theta) * sin(phi) * 0.48 + cos(theta) * 0.8 - sin(theta) * cos(phi) * 0.36;
            for (int c = 0; c < 3; c++)
                alb_image_at(&light.map, x, y)[c] = (float)(0.2 + fmin(fmax(8 * (into - 0.8), 0), 1));
        }
    stage *s = new_stage(4);
    check_ok(alb_shadow_sky_create(&s->sky, &light, &error), &error);
    s->has_sky = true;
    alb_mesh nothing = {0};
    alb_tracer tracer;
    check_ok(alb_tracer_create(&tracer, &nothing, &error), &error);
    alb_random random = alb_random_at(1, 7, 0);
    double sum = 0, mean = 0;
    enum { POINTS = 150 };
    for (int n = 0; n < POINTS; n++) {
        const alb_vector at = alb_times(50 * cbrt(alb_random_uniform(&random)), direction(&random)),
                         normal = direction(&random);
        float truth[3];
        alb_shadow_cast(&truth, &tracer, NULL, &light, 1, &at, &normal, 1, 64, 0, (uint64_t)n);
        sum += pow(irradiance(s, at, normal) - (double)truth[0], 2) / POINTS;
        mean += (double)truth[0] / POINTS;
    }
    print_message("mid-range, k to 0.5: irradiance within %.4f rms of a mean of %.3f\n", sqrt(sum), mean);
    check_below(sqrt(sum), 0.005); // the goal; what is left: the cosine and the cap beyond order 8
    alb_tracer_free(&tracer);
    alb_light_free(&light);
    free_stage(s);
}

// F16: what is behind the light leaves it alone, what is before it shadows it, what surrounds it does; and no step
// between.
static void light_inside_the_occluders_sphere(void **state)
{
    (void)state;
    const alb_vector up = {0, 0, 1}, here = {0};
    stage *s = new_stage(4);
    add_ball(s, 1, (alb_vector){0, 0, 50}, 20, alb_shadow_light_settings);
    const double open = irradiance(s, here, up);
    add_ball(s, 0, (alb_vector){0, 0, 100}, 10, alb_shadow_defaults);
    check_relative(irradiance(s, here, up), open, 1e-6); // behind
    alb_shadow_field_free(&s->fields[0][0]);
    s->counts[0] = 0;
    add_ball(s, 0, (alb_vector){0, 0, 20}, 12, alb_shadow_defaults);
    check_below(irradiance(s, here, up), 0.4 * open); // before: all of it is hidden, order 4 leaves some
    double before = -1, steepest = 0;
    for (double z = 20; z < 90; z += 0.5) { // the occluder passes through the light to its far side
        alb_shadow_field_free(&s->fields[0][0]);
        s->counts[0] = 0;
        alb_shadow_settings settings = alb_shadow_defaults;
        settings.pixels = 16, settings.cells = 2;
        add_ball(s, 0, (alb_vector){0, 0, z}, 12, settings);
        const double now = irradiance(s, here, up) / open;
        if (before >= 0)
            steepest = fmax(steepest, fabs(now - before));
        before = now;
    }
    check_near(before, 1, 1e-5);
    check_below(steepest, 0.5 / 6 * 1.5); // the share rises over half of the smaller radius
    free_stage(s);
}

// F17: on the way in, through the sampled shell and the sphere down to the middle, nothing jumps.
static void receiver_crosses_the_bounding_sphere(void **state)
{
    (void)state;
    alb_random random = alb_random_at(1, 8, 0);
    for (int inner = 0; inner <= 3; inner += 3) {
        alb_shadow_settings settings = alb_shadow_defaults;
        settings.inner = inner, settings.far = inner > 0, settings.rays = 128;
        stage *s = new_stage(4);
        even_sky(s, 0);
        add_ball(s, 0, (alb_vector){-5, 0, 0}, 3, settings);
        for (int walk = 0; walk < 10; walk++) {
            enum { STEPS = 2800 }; // down to 0.2 radii: nearer, all of it turns within a step
            static alb_vector points[STEPS], normals[STEPS];
            static float found[STEPS][3];
            alb_error error = {0};
            const alb_vector d = direction(&random), normal = direction(&random);
            const alb_shadow_world world = world_of(s);
            for (int step = 0; step < STEPS; step++) {
                points[step] = alb_add((alb_vector){-5, 0, 0}, alb_times(3 * (3 - step * 1e-3), d));
                normals[step] = normal;
            }
            check_ok(alb_shadow_irradiance(found, &world, points, normals, STEPS, NULL, &error), &error);
            for (int step = 1; step < STEPS; step++) // 0.001 radii a step; irradiance changes within 10 a radius
                check_below(fabs((double)(found[step][0] - found[step - 1][0])), 0.001 * 10);
        }
        free_stage(s);
    }
}

// F22
static void small_lights(void **state)
{
    (void)state;
    stage *s = new_stage(4);
    add_ball(s, 1, (alb_vector){0, 0, 100}, 20, alb_shadow_light_settings);
    const alb_shadow_world world = world_of(s);
    // 20 degrees: 58.5 mm away. The last one faces away.
    const alb_vector points[4] = {{0, 0, 60}, {0, 0, 41}, {0, 0, 42}, {0, 0, 0}};
    const alb_vector normals[4] = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, -1}};
    check_near(alb_shadow_small_lights(&world, points, normals, 4), 1 / 3.0, 1e-12);
    check_near(alb_shadow_small_lights(&world, points, normals, 1), 0, 0);
    free_stage(s);
}

// Far away an occluder no longer matters: never worse than leaving it out.
static void far_occluders_fade(void **state)
{
    (void)state;
    stage *s = new_stage(4);
    even_sky(s, 0);
    add_ball(s, 0, (alb_vector){0, 0, 0}, 1, alb_shadow_defaults);
    for (double d = 2; d < 1000; d *= 1.3) {
        const double truth = M_PI * (1 - 1 / (d * d)),
                     found = irradiance(s, (alb_vector){0, 0, -d}, (alb_vector){0, 0, 1});
        check_below(fabs(found - truth), fmax(M_PI / (d * d), 2e-6 * M_PI));
    }
    free_stage(s);
}

// Each cluster of balls alone, at any distance from the first shell on: nearer to the truth than if it were left out.
// The worst is a small ball just before a node, which looks like a large one farther away; a far shell tells them
// apart.
static void never_worse_than_left_out(void **state)
{
    (void)state;
    enum { CLUSTERS = 25, PLACES = 40 };
    double worst[2] = {0};
    for (int far = 0; far < 2; far++) {
        stage *s = new_stage(4);
        for (uint64_t c = 0; c < CLUSTERS; c++) {
            alb_error error = {0};
            const sphere_cluster cluster = sphere_cluster_random(17, c);
            alb_mesh mesh = {0};
            for (int b = 0; b < cluster.count; b++) {
                const double *o = cluster.centre[b];
                alb_mesh ball = {0};
                check_ok(
                    alb_shape_sphere(&ball, &(alb_sphere){{o[0], o[1], o[2]}, cluster.radius[b], 3, false}, &error),
                    &error);
                check_ok(alb_mesh_append(&mesh, &ball, 1, (alb_vector){0}, &error), &error);
                alb_mesh_free(&ball);
            }
            alb_shadow_settings settings = alb_shadow_defaults;
            settings.far = far, settings.cluster = 0;
            alb_shadow_field field;
            check_ok(alb_shadow_field_create(&field, &settings, &mesh, NULL, "balls", &error), &error);
            check_ok(alb_shadow_field_sample(&field, mesh.vertices, &error), &error);
            for (int p = 0; p < PLACES; p++) {
                const double distance = 1.1 * pow(1000, (p + 0.5) / PLACES);
                const alb_vector at = {0, 0, -distance};
                alb_shadow_receivers receivers;
                float found[ALB_SHADOW_VALUES * ALB_SHADOW_BLOCK];
                double truth[ALB_SHADOW_VALUES], off = 0, signal = 0;
                sphere_cluster_occlusion(truth, ALB_SHADOW_ORDER, &cluster, distance);
                alb_shadow_receivers_at(&receivers, &field, &at, 1);
                alb_shadow_receivers_occlusion(found, &receivers, &field, &s->laws);
                for (int i = 0; i < ALB_SHADOW_VALUES; i++) {
                    off += pow((double)found[i * ALB_SHADOW_BLOCK] - truth[i], 2);
                    signal += truth[i] * truth[i];
                }
                worst[far] = fmax(worst[far], sqrt(off / signal));
            }
            alb_shadow_field_free(&field);
            alb_mesh_free(&mesh);
        }
        free_stage(s);
    }
    print_message("%d clusters: off by at most %.2f of the signal by one shell, %.2f with the far one\n", CLUSTERS,
                  worst[0], worst[1]);
    check_below(worst[1], 0.8); // of 300 clusters at most 0.68, by one shell 1.43
}

// Several balls at random over a plane under an even sky: rays are the oracle.
static void agrees_with_rays(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_random random = alb_random_at(1, 9, 0);
    stage *s = new_stage(4);
    alb_mesh mesh = {0};
    const alb_light light = {.kind = ALB_LIGHT_ENVIRONMENT, .radiance = {1, 1, 1}};
    even_sky(s, 0);
    for (int ball = 0; ball < 3; ball++) {
        const alb_vector centre = {60 * alb_random_uniform(&random), 60 * alb_random_uniform(&random),
                                   20 + 15 * alb_random_uniform(&random)};
        const double radius = 8 + 8 * alb_random_uniform(&random);
        alb_mesh one = {0};
        add_ball(s, 0, centre, radius, alb_shadow_defaults);
        check_ok(alb_shape_sphere(&one, &(alb_sphere){centre, radius, 4, false}, &error), &error);
        check_ok(alb_mesh_append(&mesh, &one, 1, (alb_vector){0}, &error), &error);
        alb_mesh_free(&one);
    }
    enum { SIDE = 16, POINTS = SIDE * SIDE };
    static alb_vector points[POINTS], normals[POINTS];
    static float truth[POINTS][3], found[POINTS][3], threaded[POINTS][3];
    for (int n = 0; n < POINTS; n++) {
        points[n] = (alb_vector){100.0 * (n % SIDE) / SIDE - 20, 100.0 * (n / SIDE) / SIDE - 20, 0};
        normals[n] = (alb_vector){0, 0, 1};
    }
    alb_tracer tracer;
    check_ok(alb_tracer_create(&tracer, &mesh, &error), &error);
    float(*black)[3] = calloc(mesh.face_count, sizeof *black);
    alb_shadow_cast(truth, &tracer, (const float(*)[3])black, &light, 1, points, normals, POINTS, 40, 1e-3, 1);
    const alb_shadow_world world = world_of(s);
    const int threads = omp_get_max_threads();
    omp_set_num_threads(1);
    check_ok(alb_shadow_irradiance(found, &world, points, normals, POINTS - 5, NULL, &error), &error);
    omp_set_num_threads(3);
    check_ok(alb_shadow_irradiance(threaded, &world, points, normals, POINTS - 5, NULL, &error), &error);
    omp_set_num_threads(threads);
    assert_memory_equal(found, threaded, (POINTS - 5) * sizeof *found);
    double sum = 0, lost = 0;
    for (int n = 0; n < POINTS - 5; n++) {
        sum += pow((double)(found[n][0] - truth[n][0]) / M_PI, 2) / POINTS;
        lost += pow(1 - (double)truth[n][0] / M_PI, 2) / POINTS;
    }
    print_message("three balls under the sky: rms %.4f of the open sky, their shadow %.3f\n", sqrt(sum), sqrt(lost));
    check_below(sqrt(sum), 0.02); // scaling .01 (balls at k 1.3 to 4), two products
    alb_tracer_free(&tracer);
    alb_mesh_free(&mesh);
    free(black);
    free_stage(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(light_falls_off),
        cmocka_unit_test(white_furnace),
        cmocka_unit_test(mid_range_environment),
        cmocka_unit_test(light_inside_the_occluders_sphere),
        cmocka_unit_test(receiver_crosses_the_bounding_sphere),
        cmocka_unit_test(small_lights),
        cmocka_unit_test(far_occluders_fade),
        cmocka_unit_test(never_worse_than_left_out),
        cmocka_unit_test(agrees_with_rays),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
