// Shadow fields: the grid of nodes, pictures against closed forms, bounding spheres, samples inside and out. The number
// in a comment is that of the failure mode in the literature's list (F10 ... F24).
#include "base/random.h"
#include "check.h"
#include "render/sh_rotate.h"
#include "render/shadow_receivers.h"
#include "render/shape.h"
#include "scenes/shadow_scenes.h"
#include <omp.h>

static double uniform(alb_random *random, double low, double high)
{
    return low + (high - low) * alb_random_uniform(random);
}

static alb_vector direction(alb_random *random)
{
    const double z = uniform(random, -1, 1), turn = uniform(random, 0, 2 * M_PI), r = sqrt(1 - z * z);
    return (alb_vector){r * cos(turn), r * sin(turn), z};
}

static void sphere(alb_mesh *mesh, alb_vector centre, double radius, int subdivisions)
{
    alb_error error = {0};
    alb_mesh one = {0};
    check_ok(alb_shape_sphere(&one, &(alb_sphere){centre, radius, subdivisions, false}, &error), &error);
    check_ok(alb_mesh_append(mesh, &one, 1, (alb_vector){0}, &error), &error);
    alb_mesh_free(&one);
}

static alb_shadow_field field_of(const alb_mesh *mesh, const alb_shadow_settings *settings)
{
    alb_error error = {0};
    alb_shadow_field field;
    check_ok(alb_shadow_field_create(&field, settings, mesh, NULL, "test", &error), &error);
    check_ok(alb_shadow_field_sample(&field, mesh->vertices, &error), &error);
    return field;
}

static void nodes_are_where_they_are_found(void **state)
{
    (void)state;
    for (int cells = 1; cells <= 12; cells++) {
        const alb_shadow_grid grid = {cells};
        assert_int_equal(alb_shadow_grid_count((alb_shadow_grid){8}), 6 * 8 * 8 + 2);
        for (int n = 0; n < alb_shadow_grid_count(grid); n++) {
            const alb_vector d = alb_shadow_grid_direction(grid, n);
            const alb_shadow_place place = alb_shadow_grid_place(grid, alb_times(7.5, d));
            double here = 0, sum = 0;
            check_near(alb_length(d), 1, 1e-14);
            for (int k = 0; k < 4; k++) {
                assert_in_range(place.nodes[k], 0, alb_shadow_grid_count(grid) - 1);
                here += place.nodes[k] == n ? (double)place.weights[k] : 0;
                sum += (double)place.weights[k];
            }
            check_near(here, 1, 1e-5); // one rounding of the cell's coordinate, in single precision
            check_near(sum, 1, 1e-6);
        }
    }
}

// F19. Random values at the nodes are interpolated along great circles; a seam that jumps shows in a small step.
static void cube_face_seams(void **state)
{
    (void)state;
    const alb_shadow_grid grid = {8};
    alb_random random = alb_random_at(1, 19, 0);
    double values[6 * 8 * 8 + 2], steepest = 0;
    for (int n = 0; n < alb_shadow_grid_count(grid); n++)
        values[n] = uniform(&random, -1, 1);
    for (int walk = 0; walk < 200; walk++) {
        // every other walk passes through a corner of the cube
        const alb_vector start = walk % 2 ? direction(&random) : alb_unit((alb_vector){1, walk % 4 ? 1 : -1, 1});
        const alb_vector turn = alb_unit(alb_cross(start, direction(&random)));
        const alb_vector side = alb_cross(turn, start);
        double before = 0;
        for (int step = 0; step < 4000; step++) {
            const double angle = (step - 2000) * 1e-3;
            const alb_shadow_place place =
                alb_shadow_grid_place(grid, alb_add(alb_times(cos(angle), start), alb_times(sin(angle), side)));
            double now = 0;
            for (int k = 0; k < 4; k++)
                now += (double)place.weights[k] * values[place.nodes[k]];
            if (step)
                steepest = fmax(steepest, fabs(now - before));
            before = now;
        }
    }
    // values differ by at most 2 over a cell, whose shortest side is 0.13 rad; twice that along a diagonal
    check_below(steepest, 1e-3 * 2 * 2 / 0.13);
}

// The cap of half-angle a about +z: c_l0 = sqrt(pi / (2 l + 1)) (P_(l-1)(cos a) - P_(l+1)(cos a)).
static double cap(int l, double cosine)
{
    double p[10] = {1, cosine};
    for (int n = 2; n < 10; n++)
        p[n] = ((2 * n - 1) * cosine * p[n - 1] - (n - 1) * p[n - 2]) / n;
    return l ? sqrt(M_PI / (2 * l + 1)) * (p[l - 1] - p[l + 1]) : sqrt(M_PI) * (1 - cosine);
}

// rms over the sphere of sample minus the cap of that half-angle about `axis`.
static double cap_error(const float *sample, int order, alb_vector axis, double half_angle)
{
    double basis[ALB_SH_COUNT_MAX], sum = 0;
    alb_sh_evaluate(basis, order, axis);
    for (int l = 0; l < order; l++)
        for (int i = l * l; i < (l + 1) * (l + 1); i++)
            sum += pow((double)sample[i] - sqrt(4 * M_PI / (2 * l + 1)) * cap(l, cos(half_angle)) * basis[i], 2);
    return sqrt(sum / (4 * M_PI));
}

static void pictures_of_spheres_are_caps(void **state)
{
    (void)state;
    alb_random random = alb_random_at(1, 3, 0);
    for (int order = 4; order <= 8; order += 4)
        for (int pixels = 32; pixels <= 64; pixels += 32) {
            alb_mesh mesh = {0};
            sphere(&mesh, (alb_vector){3, -2, 5}, 2, 4);
            alb_shadow_settings settings = alb_shadow_defaults;
            settings.order = order, settings.pixels = pixels, settings.distance = 1.3, settings.outer = 2;
            alb_shadow_field field = field_of(&mesh, &settings);
            check_near(field.sphere.radius_mm, 2, 2e-3);
            for (int n = 0; n < 386; n += 11)
                for (int shell = 0; shell < 2; shell++) {
                    float sample[ALB_SH_COUNT_MAX];
                    const alb_vector d = alb_shadow_grid_direction((alb_shadow_grid){8}, n);
                    alb_shadow_field_at(sample, &field, shell, d);
                    // half a pixel of the circumference, of random sign along it; the sphere's facets are smaller
                    check_below(cap_error(sample, order, alb_times(-1, d), asin(1 / field.shells[shell].radius)),
                                0.3 / pixels);
                }
            // between nodes the sample changes within 11 degrees as a cap's does: second order of the half cell
            float sample[ALB_SH_COUNT_MAX];
            const alb_vector d = direction(&random);
            alb_shadow_field_at(sample, &field, 0, d);
            check_below(cap_error(sample, order, alb_times(-1, d), asin(1 / 1.3)), order == 4 ? 0.02 : 0.05);
            alb_shadow_field_free(&field);
            alb_mesh_free(&mesh);
        }
}

// A light's picture: the cap times its radiance; nothing from behind.
static void lights_shine_to_the_front(void **state)
{
    (void)state;
    alb_error error = {0};
    for (int inward = 0; inward < 2; inward++) {
        alb_mesh mesh = {0};
        check_ok(alb_shape_sphere(&mesh, &(alb_sphere){{0}, 5, 4, inward}, &error), &error);
        float(*radiance)[3] = calloc(mesh.face_count, sizeof *radiance);
        for (size_t f = 0; f < mesh.face_count; f++)
            for (int c = 0; c < 3; c++)
                radiance[f][c] = (float)(1 + c);
        alb_shadow_settings settings = alb_shadow_light_settings;
        alb_shadow_field field;
        check_ok(alb_shadow_field_create(&field, &settings, &mesh, (const float(*)[3])radiance, "lamp", &error),
                 &error);
        check_ok(alb_shadow_field_sample(&field, mesh.vertices, &error), &error);
        float sample[48];
        const alb_vector d = alb_shadow_grid_direction((alb_shadow_grid){8}, 77);
        alb_shadow_field_at(sample, &field, 1, d);
        for (int c = 0; c < 3; c++) {
            for (int i = 0; i < 16; i++)
                sample[16 * c + i] /= (float)(1 + c);
            if (inward)
                check_near((double)sample[16 * c], 0, 1e-6);
            else
                check_below(cap_error(sample + 16 * c, 4, alb_times(-1, d), asin(1 / field.shells[1].radius)),
                            0.3 / 64);
        }
        alb_shadow_field_free(&field);
        free(radiance);
        alb_mesh_free(&mesh);
    }
}

// A ball from the far shell is a cap about its axis, of order 8, at nodes and between them alike; settings that leave
// no room for that shell are refused, as are lights that ask for it.
static void far_shell_sees_caps(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_random random = alb_random_at(1, 29, 0);
    alb_mesh mesh = {0};
    sphere(&mesh, (alb_vector){1, 2, 3}, 2, 4);
    alb_shadow_settings settings = alb_shadow_defaults;
    settings.inner = 2, settings.far = true;
    alb_shadow_field field = field_of(&mesh, &settings);
    assert_int_equal(field.shell_count, 4);
    const alb_shadow_shell *far = &field.shells[3];
    assert_int_equal(far->order, 8);
    for (int n = -200; n < alb_shadow_grid_count((alb_shadow_grid){far->cells}); n++) {
        float sample[ALB_SH_COUNT_MAX];
        const alb_vector d = n < 0 ? direction(&random) : alb_shadow_grid_direction((alb_shadow_grid){far->cells}, n);
        alb_shadow_field_at(sample, &field, 3, d);
        check_below(cap_error(sample, 8, (alb_vector){0, 0, 1}, asin(1 / far->radius)), 0.1 / settings.pixels);
    }
    // a quarter of 16 shells of 386 nodes, order 4
    assert_true(4 * alb_shadow_field_bytes(&field) < 16 * 386 * 16 * sizeof(float));
    alb_shadow_field_free(&field);
    settings.outer = 4;
    check_fails(alb_shadow_field_create(&field, &settings, &mesh, NULL, "ball", &error), &error, ALB_BAD_DATA, "far");
    settings.outer = 1, settings.inner = 0;
    float(*radiance)[3] = calloc(mesh.face_count, sizeof *radiance);
    error = (alb_error){0};
    check_fails(alb_shadow_field_create(&field, &settings, &mesh, (const float(*)[3])radiance, "lamp", &error), &error,
                ALB_BAD_DATA, "lamp");
    settings.far = false, settings.outer = 7;
    error = (alb_error){0};
    check_fails(alb_shadow_field_create(&field, &settings, &mesh, NULL, "ball", &error), &error, ALB_BAD_DATA, "7");
    free(radiance);
    alb_mesh_free(&mesh);
}

// F10: the surface touches the bounding sphere everywhere. From 1.1 radii the cap has 65 degrees, on the surface it
// would have 90.
static void sample_on_the_surface(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_mesh mesh = {0};
    sphere(&mesh, (alb_vector){0}, 1, 5);
    alb_shadow_settings settings = alb_shadow_defaults;
    alb_shadow_field field = field_of(&mesh, &settings);
    float sample[16];
    const alb_vector d = alb_shadow_grid_direction((alb_shadow_grid){8}, 123);
    alb_shadow_field_at(sample, &field, 0, d);
    check_below(cap_error(sample, 4, alb_times(-1, d), asin(1 / 1.1)), 0.01);
    assert_true(cap_error(sample, 4, alb_times(-1, d), M_PI / 2) > 0.2);
    alb_shadow_field_free(&field);
    settings.distance = 1.0;
    check_fails(alb_shadow_field_create(&field, &settings, &mesh, NULL, "ball", &error), &error, ALB_BAD_DATA, "1.05");
    alb_mesh_free(&mesh);
}

// F12: wherever the sphere's points lie, the nearest allowed picture holds all of them: nothing is cut off at its rim.
static void views_reach_far_enough(void **state)
{
    (void)state;
    alb_mesh mesh = {0};
    sphere(&mesh, (alb_vector){0}, 1, 5);
    for (int pixels = 32; pixels <= 64; pixels += 32) {
        alb_shadow_settings settings = alb_shadow_defaults;
        settings.distance = ALB_SHADOW_NEAREST, settings.pixels = pixels, settings.cluster = 0;
        alb_shadow_field field = field_of(&mesh, &settings);
        for (int n = 0; n < 386; n += 7) {
            float sample[16];
            const alb_vector d = alb_shadow_grid_direction((alb_shadow_grid){8}, n);
            alb_shadow_field_at(sample, &field, 0, d);
            // 72 degrees: a flat picture's outermost pixels are wide
            check_below(cap_error(sample, 4, alb_times(-1, d), asin(1 / ALB_SHADOW_NEAREST)), 0.6 / pixels);
        }
        alb_shadow_field_free(&field);
    }
    alb_mesh_free(&mesh);
}

// F11: of two balls far apart the inner shells cut both. Nodes inside a ball must not be all dark.
static void sample_inside_the_object(void **state)
{
    (void)state;
    alb_mesh mesh = {0};
    sphere(&mesh, (alb_vector){-7, 0, 0}, 3, 3);
    sphere(&mesh, (alb_vector){7, 0, 0}, 3, 3);
    alb_shadow_settings settings = alb_shadow_defaults;
    settings.inner = 2;
    alb_shadow_field field = field_of(&mesh, &settings);
    size_t inside = 0;
    for (int shell = 0; shell < 2; shell++)
        for (int n = 0; n < alb_shadow_grid_count((alb_shadow_grid){field.shells[shell].cells}); n++) {
            float sample[16];
            const alb_vector d = alb_shadow_grid_direction((alb_shadow_grid){field.shells[shell].cells}, n),
                             at = alb_times(field.shells[shell].radius * field.sphere.radius_mm, d);
            const double left = alb_length(alb_sub(at, (alb_vector){-7, 0, 0})),
                         right = alb_length(alb_sub(at, (alb_vector){7, 0, 0}));
            alb_shadow_field_at(sample, &field, shell, d);
            inside += left < 2.98 || right < 2.98;
            // the two balls' solid angles, which do not overlap from points off the axis through both; the innermost
            // wall would give all of the sphere, sqrt(4 pi)
            const double both =
                (1 - sqrt(1 - fmin(9 / (left * left), 1))) + (1 - sqrt(1 - fmin(9 / (right * right), 1)));
            if (left > 3.3 && right > 3.3 && fabs(d.x) < 0.6)
                check_near((double)sample[0], sqrt(M_PI) * both, 0.05 * sqrt(4 * M_PI));
            check_below((double)sample[0], 0.9 * sqrt(4 * M_PI));
        }
    assert_true(inside > 10);
    assert_in_range(field.moved, inside, inside + inside / 5 + 4); // nodes within the facets' sag may be either
    alb_shadow_field_free(&field);
    alb_mesh_free(&mesh);
}

// truth += the cap that hides a ball from a place, as order^2 coefficients.
static void add_cap(double *truth, int order, alb_vector to_centre, double radius)
{
    double basis[ALB_SH_COUNT_MAX];
    const double cosine = sqrt(1 - pow(radius / alb_length(to_centre), 2));
    alb_sh_evaluate(basis, order, alb_unit(to_centre));
    for (int l = 0; l < order; l++)
        for (int i = l * l; i < (l + 1) * (l + 1); i++)
            truth[i] += sqrt(4 * M_PI / (2 * l + 1)) * cap(l, cosine) * basis[i];
}

// Angle between two balls' rims as seen from a place; negative where they cover one another. Inside a ball: -1.
static double gap(alb_vector at, const alb_vector centres[2], double radius)
{
    const alb_vector a = alb_sub(centres[0], at), b = alb_sub(centres[1], at);
    const double sines[2] = {radius / alb_length(a), radius / alb_length(b)};
    if (sines[0] > 0.9999 || sines[1] > 0.9999)
        return -1;
    return acos(alb_dot(alb_unit(a), alb_unit(b))) - asin(sines[0]) - asin(sines[1]);
}

// F18, F19: two balls seen from between the far shell's nodes, near the poles of the frames too, where the frames of
// neighbouring nodes differ by any angle. Turned the wrong way they
// would be off by .0043, .0215 at most.
static void samples_turn_along(void **state)
{
    (void)state;
    enum { RECEIVERS = 400 };
    const alb_vector centres[2] = {{-0.5, 0.3, 0.38}, {0.5, -0.3, -0.38}};
    alb_random random = alb_random_at(1, 18, 0);
    alb_mesh mesh = {0};
    sphere(&mesh, centres[0], 0.3, 4);
    sphere(&mesh, centres[1], 0.3, 4);
    alb_shadow_settings settings = alb_shadow_defaults;
    settings.far = true, settings.cluster = 0;
    alb_shadow_field field = field_of(&mesh, &settings);
    const double away = field.shells[1].radius * field.sphere.radius_mm;
    double sum = 0, worst = 0;
    for (int n = 0; n < RECEIVERS;) {
        alb_vector d = direction(&random);
        if (n % 4 == 0) // 1 to 1e-9 off a pole
            d = alb_unit((alb_vector){d.x * pow(10, -9 * (n / (double)RECEIVERS)), d.y * 1e-9, d.z});
        const alb_vector at = alb_add(field.sphere.centre_mm, alb_times(away, d));
        const float axis[3] = {(float)-d.x, (float)-d.y, (float)-d.z};
        float sample[ALB_SH_COUNT_MAX];
        double truth[ALB_SH_COUNT_MAX] = {0}, error = 0;
        if (gap(at, centres, 0.3) < 0)
            continue;
        for (int b = 0; b < 2; b++)
            add_cap(truth, 8, alb_sub(centres[b], at), 0.3);
        alb_shadow_field_at(sample, &field, 1, d);
        alb_sh_from_axis_batch(sample, sample, 8, axis, 1, 1);
        for (int i = 0; i < 64; i++)
            error += pow((double)sample[i] - truth[i], 2) / (4 * M_PI);
        sum += error / RECEIVERS;
        worst = fmax(worst, sqrt(error));
        n++;
    }
    print_message("two balls from between the far nodes: off by %.4f rms, %.4f at most\n", sqrt(sum), worst);
    check_below(sqrt(sum), 0.0015);
    check_below(worst, 0.006);
    alb_shadow_field_free(&field);
    alb_mesh_free(&mesh);
}

// From the far shell out a ball that fills its sphere is a cap, its error at most .0048 and fading as
// k^-2; with a cone of 45 degrees .0069, of 80 .0080.
static void far_balls_are_caps(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_random random = alb_random_at(1, 20, 0);
    alb_mesh mesh = {0};
    sphere(&mesh, (alb_vector){0}, 1, 4);
    alb_shadow_settings settings = alb_shadow_defaults;
    settings.far = true;
    alb_shadow_field field = field_of(&mesh, &settings);
    alb_shadow_laws laws;
    check_ok(alb_shadow_laws_create(&laws, settings.order, false, &error), &error);
    for (double away = 2.9; away < 100; away *= 1.1) {
        const alb_vector at = alb_times(away, direction(&random));
        float found[ALB_SHADOW_VALUES * ALB_SHADOW_BLOCK], one[ALB_SHADOW_VALUES];
        alb_shadow_receivers receivers;
        alb_shadow_receivers_at(&receivers, &field, &at, 1);
        alb_shadow_receivers_occlusion(found, &receivers, &field, &laws);
        for (int i = 0; i < ALB_SHADOW_VALUES; i++)
            one[i] = found[i * ALB_SHADOW_BLOCK];
        const double off = cap_error(one, 4, alb_unit(alb_times(-1, at)), asin(1 / away));
        check_below(off, 0.0055 * fmin(1, 100 / (away * away)));
    }
    alb_shadow_laws_free(&laws);
    alb_shadow_field_free(&field);
    alb_mesh_free(&mesh);
}

// F17: between two balls, inside their bounding sphere and up to the very surfaces, receivers see both as caps. Nodes
// inside a ball that saw its inner wall would make it .036.
static void receivers_inside_the_sphere(void **state)
{
    (void)state;
    enum { RECEIVERS = 400 };
    const alb_vector centres[2] = {{-0.7, 0, 0}, {0.7, 0, 0}};
    alb_error error = {0};
    alb_random random = alb_random_at(1, 17, 0);
    alb_mesh mesh = {0};
    sphere(&mesh, centres[0], 0.3, 4);
    sphere(&mesh, centres[1], 0.3, 4);
    alb_shadow_settings settings = alb_shadow_defaults;
    settings.inner = 6, settings.far = true;
    alb_shadow_field field = field_of(&mesh, &settings);
    alb_shadow_laws laws;
    check_ok(alb_shadow_laws_create(&laws, settings.order, false, &error), &error);
    double sum = 0;
    for (int n = 0; n < RECEIVERS;) {
        const alb_vector at = alb_times(uniform(&random, 0.5, 0.9), direction(&random));
        float found[ALB_SHADOW_VALUES * ALB_SHADOW_BLOCK];
        double truth[ALB_SHADOW_VALUES] = {0};
        if (gap(at, centres, 0.3) < 0)
            continue;
        for (int b = 0; b < 2; b++)
            add_cap(truth, 4, alb_sub(centres[b], at), 0.3);
        alb_shadow_receivers receivers;
        alb_shadow_receivers_at(&receivers, &field, &at, 1);
        alb_shadow_receivers_occlusion(found, &receivers, &field, &laws);
        for (int i = 0; i < ALB_SHADOW_VALUES; i++)
            sum += pow((double)found[i * ALB_SHADOW_BLOCK] - truth[i], 2) / (4 * M_PI) / RECEIVERS;
        n++;
    }
    print_message("two balls from .5 to .9 radii: occlusion off by %.4f rms\n", sqrt(sum));
    check_below(sqrt(sum), 0.03);
    alb_shadow_laws_free(&laws);
    alb_shadow_field_free(&field);
    alb_mesh_free(&mesh);
}

// F23
static void degenerate_meshes(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_shadow_field field;
    alb_shadow_sphere found = {0};
    const alb_vector nan[2] = {{0}, {0, NAN, 0}}, huge[2] = {{1e300, 0, 0}, {-1e300, 1e300, 0}};
    const alb_vector point[3] = {{4, 5, 6}, {4, 5, 6}, {4, 5, 6}}, far[2] = {{1e8, 1e8, 0}, {1e8, 1e8, 1e-3}};
    check_fails(alb_shadow_sphere_follow(&found, nan, 0, "cat", &error), &error, ALB_BAD_DATA, "without faces");
    check_fails(alb_shadow_sphere_follow(&found, nan, 2, "cat", &error), &error, ALB_BAD_DATA, "vertex 1");
    check_fails(alb_shadow_sphere_follow(&found, huge, 2, "cat", &error), &error, ALB_BAD_DATA, "vertex 0");
    check_fails(alb_shadow_sphere_follow(&found, point, 3, "cat", &error), &error, ALB_BAD_DATA, "cat: all 3 vertices");
    check_fails(alb_shadow_sphere_follow(&found, far, 2, "cat", &error), &error, ALB_BAD_DATA, "all 2 vertices");
    const alb_mesh empty = {0};
    check_fails(alb_shadow_field_create(&field, &alb_shadow_defaults, &empty, NULL, "cat", &error), &error,
                ALB_BAD_DATA, "without faces");
    alb_mesh mesh = {0};
    sphere(&mesh, (alb_vector){0}, 1, 2);
    alb_shadow_field near = field_of(&mesh, &alb_shadow_defaults);
    for (size_t v = 0; v < mesh.vertex_count; v++) // as large as the earth, and as far away
        mesh.vertices[v] = alb_add((alb_vector){1e8, -1e8, 1e8}, alb_times(1e8, mesh.vertices[v]));
    field = field_of(&mesh, &alb_shadow_defaults);
    for (int n = 0; n < 386; n++)
        for (int i = 0; i < 16; i++) // a corner's rounding may move a pixel
            check_near((double)field.samples[16 * n + i], (double)near.samples[16 * n + i], 5e-3);
    // a frame that goes wrong leaves the samples of the one before
    float *kept = malloc(386 * 16 * sizeof *kept);
    memcpy(kept, field.samples, 386 * 16 * sizeof *kept);
    mesh.vertices[3].x = NAN;
    check_fails(alb_shadow_field_sample(&field, mesh.vertices, &error), &error, ALB_BAD_DATA, "vertex 3");
    assert_memory_equal(kept, field.samples, 386 * 16 * sizeof *kept);
    free(kept);
    alb_shadow_field_free(&field);
    alb_shadow_field_free(&near);
    alb_mesh_free(&mesh);
}

// F24: over the whole animation of each scene the sphere always holds the object, and moves hardly ever.
static void moving_bounding_sphere(void **state)
{
    (void)state;
    for (int i = 0; i < SHADOW_SCENES; i++) {
        alb_shadow_sphere found = {0}, before = {0};
        int moves = 0;
        for (int frame = 0; frame < shadow_scenes[i].frames; frame += i == 2 ? 5 : 1) {
            alb_error error = {0};
            alb_scene scene;
            check_ok(shadow_scenes[i].create(&scene, frame, &error), &error);
            const alb_object *object = &scene.objects[1];
            const alb_vector *points = scene.mesh.vertices + object->first_vertex;
            check_ok(alb_shadow_sphere_follow(&found, points, object->vertex_count, "object", &error), &error);
            double reach = 0;
            for (size_t v = 0; v < object->vertex_count; v++)
                reach = fmax(reach, alb_length(alb_sub(points[v], found.centre_mm)));
            assert_true(reach <= found.radius_mm && found.radius_mm < 1.45 * reach);
            moves += frame > 0 && memcmp(&found, &before, sizeof found) != 0;
            before = found;
            alb_scene_free(&scene);
        }
        print_message("%s: the sphere moves %d times\n", shadow_scenes[i].name, moves);
        assert_in_range(moves, 0, 4);
    }
}

static void same_bytes_with_any_threads(void **state)
{
    (void)state;
    alb_mesh mesh = {0};
    sphere(&mesh, (alb_vector){-4, 1, 0}, 3, 3);
    sphere(&mesh, (alb_vector){5, 0, 1}, 2, 3);
    alb_shadow_settings settings = alb_shadow_defaults;
    settings.inner = 1, settings.rays = 64;
    const int threads = omp_get_max_threads();
    omp_set_num_threads(1);
    alb_shadow_field one = field_of(&mesh, &settings);
    omp_set_num_threads(3);
    alb_shadow_field three = field_of(&mesh, &settings);
    omp_set_num_threads(threads);
    assert_memory_equal(one.samples, three.samples, one.sample_count * sizeof *one.samples);
    alb_shadow_field_free(&one);
    alb_shadow_field_free(&three);
    alb_mesh_free(&mesh);
}

// Packed or not, every node's sample is the same within half a step of its largest coefficient; a flat square, which
// nodes in its plane do not see, stays unseen from there.
static void packed_samples_stay_within_a_step(void **state)
{
    (void)state;
    for (int flat = 0; flat < 2; flat++) {
        alb_error error = {0};
        alb_mesh mesh = {0};
        if (!flat)
            sphere(&mesh, (alb_vector){-4, 1, 0}, 3, 3);
        for (int k = 0; k < 4; k++)
            check_ok(alb_mesh_add_vertex(&mesh, (alb_vector){k % 2, k / 2, 0}, &error), &error);
        const uint32_t first = (uint32_t)mesh.vertex_count - 4;
        check_ok(alb_mesh_add_face(&mesh, first, first + 1, first + 3, 0, &error), &error);
        check_ok(alb_mesh_add_face(&mesh, first, first + 3, first + 2, 0, &error), &error);
        alb_shadow_settings settings = alb_shadow_defaults;
        settings.inner = flat ? 0 : 2, settings.far = true;
        settings.order = flat ? 5 : 4; // 25 bytes do not fill floats
        alb_shadow_field plain = field_of(&mesh, &settings);
        settings.packed = true;
        alb_shadow_field packed = field_of(&mesh, &settings);
        assert_true((double)alb_shadow_field_bytes(&packed) < 0.33 * (double)alb_shadow_field_bytes(&plain));
        size_t unseen = 0;
        for (int shell = 0; shell < plain.shell_count; shell++)
            for (int n = 0; n < alb_shadow_grid_count((alb_shadow_grid){plain.shells[shell].cells}); n++) {
                const size_t values = (size_t)(plain.shells[shell].order * plain.shells[shell].order);
                const alb_vector d = alb_shadow_grid_direction((alb_shadow_grid){plain.shells[shell].cells}, n);
                float a[ALB_SH_COUNT_MAX], b[ALB_SH_COUNT_MAX], largest = 0;
                alb_shadow_field_at(a, &plain, shell, d);
                alb_shadow_field_at(b, &packed, shell, d);
                for (size_t i = 0; i < values; i++)
                    largest = fmaxf(largest, fabsf(a[i]));
                unseen += !(largest > 0);
                for (size_t i = 0; i < values; i++) // interpolation at a node leaves a trace of its neighbours
                    check_near((double)b[i], (double)a[i], (0.5 / 127 + 1e-4) * (double)largest);
            }
        assert_true((unseen > 0) == (flat > 0));
        alb_shadow_field_free(&plain);
        alb_shadow_field_free(&packed);
        alb_mesh_free(&mesh);
    }
}

// Clusters of vertices change pictures by less than the pixels do.
static void clusters_keep_the_silhouette(void **state)
{
    (void)state;
    for (int i = 0; i < SHADOW_SCENES; i++) {
        alb_error error = {0};
        alb_scene scene;
        alb_mesh mesh = {0};
        check_ok(shadow_scenes[i].create(&scene, 7, &error), &error);
        const alb_object *object = &scene.objects[1];
        for (size_t v = 0; v < object->vertex_count; v++)
            check_ok(alb_mesh_add_vertex(&mesh, scene.mesh.vertices[object->first_vertex + v], &error), &error);
        for (size_t f = 0; f < scene.mesh.face_count; f++) {
            const uint32_t first = (uint32_t)object->first_vertex, *v = scene.mesh.faces[f];
            if (v[0] >= first && v[0] - first < object->vertex_count)
                check_ok(alb_mesh_add_face(&mesh, v[0] - first, v[1] - first, v[2] - first, 0, &error), &error);
        }
        alb_shadow_settings settings = alb_shadow_defaults;
        alb_shadow_field coarse = field_of(&mesh, &settings);
        settings.cluster = 0;
        alb_shadow_field fine = field_of(&mesh, &settings);
        double sum = 0;
        for (int k = 0; k < 386 * 16; k++)
            sum += pow((double)(coarse.samples[k] - fine.samples[k]), 2) / 386 / (4 * M_PI);
        print_message("%s: clusters change occlusion by %.4f rms\n", shadow_scenes[i].name, sqrt(sum));
        check_below(sqrt(sum), 0.006); // as 32 pixels do instead of 64
        alb_shadow_field_free(&coarse);
        alb_shadow_field_free(&fine);
        alb_mesh_free(&mesh);
        alb_scene_free(&scene);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nodes_are_where_they_are_found),
        cmocka_unit_test(cube_face_seams),
        cmocka_unit_test(pictures_of_spheres_are_caps),
        cmocka_unit_test(lights_shine_to_the_front),
        cmocka_unit_test(far_shell_sees_caps),
        cmocka_unit_test(sample_on_the_surface),
        cmocka_unit_test(views_reach_far_enough),
        cmocka_unit_test(sample_inside_the_object),
        cmocka_unit_test(samples_turn_along),
        cmocka_unit_test(far_balls_are_caps),
        cmocka_unit_test(receivers_inside_the_sphere),
        cmocka_unit_test(degenerate_meshes),
        cmocka_unit_test(moving_bounding_sphere),
        cmocka_unit_test(same_bytes_with_any_threads),
        cmocka_unit_test(packed_samples_stay_within_a_step),
        cmocka_unit_test(clusters_keep_the_silhouette),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
