// Projection against integrals over the pixel, the polygon or the disc itself, in its own plane.
#include "base/quadrature.h"
#include "render/sh_project.h"
#include "render/sh_zonal.h"
#include "sh_truth.h"

enum { ORDER = ALB_SH_ORDER_MAX, COUNT = ORDER * ORDER };

static void add_point(double *c, int order, alb_vector d, double weight)
{
    for (int l = 0; l < order; l++)
        for (int m = -l; m <= l; m++)
            c[l * l + l + m] += weight * (double)truth_y(l, m, (long double)d.x, (long double)d.y, (long double)d.z);
}

static void check_coefficients(const double *found, const double *expected, int order, double tolerance)
{
    for (int i = 0; i < order * order; i++)
        check_near(found[i], expected[i], tolerance);
}

static double sum_of(const void *context, alb_vector d) { return truth_sum(context, ORDER, d); }
static double cube_of_x(const void *context, alb_vector d) { return context ? 0 : d.x * d.x * d.x; }

// What is made of harmonics gives them back; x^3 = 3/5 x + (x^3 - 3/5 x).
static void functions(void **state)
{
    (void)state;
    alb_error error = {0};
    for (int order = 1; order <= 12; order++) {
        double c[COUNT], found[144], expected[144] = {0};
        alb_random random = alb_random_at(1, 1, (uint64_t)order);
        random_coefficients(c, ORDER, &random);
        check_ok(alb_sh_project(found, order, ORDER - 1, sum_of, c, &error), &error);
        memcpy(expected, c, sizeof(double) * (size_t)(order < ORDER ? order * order : COUNT));
        check_coefficients(found, expected, order, 1e-12);
    }
    double found[16], kept = 7;
    check_ok(alb_sh_project(found, 4, 3, cube_of_x, NULL, &error), &error);
    check_near(found[3], 0.6 * sqrt(4 * M_PI / 3), 1e-14);
    check_near(alb_sh_value(found, 4, (alb_vector){0.36, 0.48, 0.8}), pow(0.36, 3), 1e-14);
    check_fails(alb_sh_project(&kept, 1, 127, sum_of, NULL, &error), &error, ALB_BAD_DATA, "at most degree 126");
    check_near(kept, 7, 0);
}

static void fill(alb_image *image, int width, int height, uint64_t seed)
{
    alb_error error = {0};
    check_ok(alb_image_create(image, width, height, "R,G,B", &error), &error);
    for (int k = 0; k < width * height * 3; k++) {
        alb_random random = alb_random_at(seed, 3, (uint64_t)k);
        image->pixels[k] = (float)alb_random_uniform(&random);
    }
}

// Pixel by pixel, 32 x 32 nodes; directions as light.h states them: the middle is -z, up is +y, right of the middle +x.
static void latitude_longitude(void **state)
{
    (void)state;
    alb_error error = {0};
    static const int sizes[][2] = {{1, 1}, {1, 3}, {4, 2}, {7, 5}, {16, 8}};
    double nodes[32], weights[32];
    alb_quadrature_gauss(nodes, weights, 32, 0, 1);
    for (int s = 0; s < 5; s++) {
        const int w = sizes[s][0], h = sizes[s][1];
        double expected[COUNT] = {0}, found[COUNT];
        alb_image map;
        fill(&map, w, h, 5);
        for (int p = 0; p < w * h; p++)
            for (int k = 0; k < 32 * 32; k++) {
                const double u = 2 * M_PI * ((p % w + nodes[k % 32]) / w - 0.5), v = M_PI * (p / w + nodes[k / 32]) / h;
                const double area = 2 * M_PI * M_PI / (w * h) * sin(v) * weights[k % 32] * weights[k / 32];
                add_point(expected, ORDER, (alb_vector){sin(v) * sin(u), cos(v), -sin(v) * cos(u)},
                          area * (double)map.pixels[3 * p + 1]);
            }
        check_ok(alb_sh_project_map(found, ORDER, &map, 1, &error), &error);
        check_coefficients(found, expected, ORDER, 1e-12);
        alb_image_free(&map);
    }
}

// The faces by what a viewer in the middle sees: looking along the axis, `up` on top.
static void cube_map(void **state)
{
    (void)state;
    alb_error error = {0};
    static const alb_vector look[6] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    static const alb_vector down[6] = {{0, -1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}, {0, -1, 0}, {0, -1, 0}};
    double nodes[32], weights[32];
    alb_quadrature_gauss(nodes, weights, 32, 0, 1);
    for (int side = 1; side <= 4; side++) {
        alb_image faces[6];
        double expected[COUNT] = {0}, found[COUNT];
        for (int f = 0; f < 6; f++)
            fill(&faces[f], side, side, (uint64_t)(10 + f));
        for (int k = 0; k < 6 * side * side * 1024; k++) {
            const int f = k / 1024 / (side * side), p = k / 1024 % (side * side), n = k % 1024;
            const double s = 2 * (p % side + nodes[n % 32]) / side - 1, t = 2 * (p / side + nodes[n / 32]) / side - 1;
            // left-handed: mirrored as seen from within
            const alb_vector left = alb_cross(look[f], down[f]);
            const alb_vector d = alb_add(look[f], alb_add(alb_times(s, left), alb_times(t, down[f])));
            const double area = 4.0 / (side * side) * weights[n % 32] * weights[n / 32] / pow(alb_length(d), 3);
            add_point(expected, ORDER, alb_unit(d), area * (double)faces[f].pixels[3 * p + 2]);
        }
        check_ok(alb_sh_project_cube(found, ORDER, faces, 2, &error), &error);
        check_coefficients(found, expected, ORDER, 1e-12);
        for (int f = 0; f < 6; f++)
            alb_image_free(&faces[f]);
    }
}

// One everywhere is sqrt(4 pi) e0, however many pixels.
static void even_pictures(void **state)
{
    (void)state;
    alb_error error = {0};
    for (int side = 1; side <= 40; side += 13) {
        alb_image map, faces[6];
        double found[COUNT], expected[COUNT] = {sqrt(4 * M_PI)};
        fill(&map, 2 * side, side, 1);
        for (int k = 0; k < 6 * side * side; k++)
            map.pixels[k] = 1;
        check_ok(alb_sh_project_map(found, ORDER, &map, 0, &error), &error);
        check_coefficients(found, expected, ORDER, 1e-12);
        for (int f = 0; f < 6; f++) {
            fill(&faces[f], side, side, 1);
            for (int k = 0; k < 3 * side * side; k++)
                faces[f].pixels[k] = 1;
        }
        check_ok(alb_sh_project_cube(found, ORDER, faces, 0, &error), &error);
        check_coefficients(found, expected, ORDER, 1e-12);
        if (side > 1) {
            faces[3].width--;
            check_fails(alb_sh_project_cube(found, ORDER, faces, 0, &error), &error, ALB_BAD_DATA, "face 3 has");
            faces[3].width++;
        }
        map.pixels[4] = NAN;
        check_fails(alb_sh_project_map(found, ORDER, &map, 1, &error), &error, ALB_BAD_DATA, "pixel (1, 0)");
        check_fails(alb_sh_project_map(found, ORDER, &map, 3, &error), &error, ALB_BAD_DATA, "no channel 3");
        alb_image_free(&map);
        for (int f = 0; f < 6; f++)
            alb_image_free(&faces[f]);
    }
}

// A triangle in its plane, cut n x n, 12 x 12 nodes each (Duffy's corner).
static void add_triangle(double *c, int order, alb_vector a, alb_vector b, alb_vector d, int cuts)
{
    double nodes[12], weights[12];
    alb_quadrature_gauss(nodes, weights, 12, 0, 1);
    const alb_vector twice_area = alb_cross(alb_sub(b, a), alb_sub(d, a));
    for (int k = 0; k < cuts * cuts * 144; k++) {
        const int cell = k / 144, n = k % 144;
        const double u = (cell % cuts + nodes[n % 12]) / cuts, v = (cell / cuts + nodes[n / 12]) / cuts;
        const alb_vector p = alb_add(alb_times(1 - u, a), alb_times(u, alb_add(alb_times(1 - v, b), alb_times(v, d))));
        const double weight = u * weights[n % 12] * weights[n / 12] / (cuts * cuts);
        add_point(c, order, alb_unit(p), weight * alb_dot(p, twice_area) / pow(alb_length(p), 3));
    }
}

static void polygons(void **state)
{
    (void)state;
    alb_error error = {0};
    for (uint64_t k = 0; k < 12; k++) {
        // a plane at 0.5 to 1.5 from the origin, vertices around its nearest point: also L-shaped
        alb_random random = alb_random_at(2, 2, k);
        const alb_vector n = random_direction(&random);
        alb_vector t, b, p[6];
        alb_tangents(&t, &b, n);
        const double height = 0.5 + alb_random_uniform(&random), turn = alb_random_uniform(&random);
        static const double outline[6][2] = {{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}};
        const size_t count = 3 + k % 4;
        for (size_t i = 0; i < count; i++) {
            const double angle = turn + 2 * M_PI * (double)i / (double)count;
            const double x = count == 6 ? outline[i][0] - turn : cos(angle),
                         y = count == 6 ? outline[i][1] : sin(angle);
            p[i] = alb_add(alb_times(height, n), alb_add(alb_times(x, t), alb_times(y, b)));
        }
        double expected[COUNT] = {0}, found[COUNT], back[COUNT];
        for (size_t i = 0; i < count; i++)
            add_triangle(expected, ORDER, p[0], p[i], p[(i + 1) % count], 6);
        check_ok(alb_sh_project_polygon(found, ORDER, p, count, &error), &error);
        check_coefficients(found, expected, ORDER, 1e-12);
        // the other way round, as large as you like
        alb_vector q[6];
        for (size_t i = 0; i < count; i++)
            q[i] = alb_times(1e8, p[count - 1 - i]);
        check_ok(alb_sh_project_polygon(back, ORDER, q, count, &error), &error);
        check_coefficients(back, expected, ORDER, 1e-12);
    }
}

// An octant, a face of the cube, one edge of a thousandth; what cannot be.
static void polygons_at_the_edge(void **state)
{
    (void)state;
    alb_error error = {0};
    double c[COUNT], parts[COUNT];
    alb_vector p[4] = {{1, 0, 0}, {0, 3, 0}, {0, 0, 2}};
    check_ok(alb_sh_project_polygon(c, ORDER, p, 3, &error), &error);
    check_near(c[0], M_PI_2 / sqrt(4 * M_PI), 1e-14);
    for (int i = 1; i < 4; i++)
        check_near(c[i], sqrt(3 / (4 * M_PI)) * M_PI / 4, 1e-14); // the octant's area seen from +x is pi / 4
    // cut in two along x = y: the sum
    const alb_vector half[2][3] = {{p[0], {1, 1, 0}, p[2]}, {{1, 1, 0}, p[1], p[2]}};
    check_ok(alb_sh_project_polygon(parts, ORDER, half[0], 3, &error), &error);
    for (int i = 0; i < COUNT; i++)
        c[i] -= parts[i];
    check_ok(alb_sh_project_polygon(parts, ORDER, half[1], 3, &error), &error);
    check_coefficients(c, parts, ORDER, 1e-13);
    // a repeated vertex changes nothing
    p[3] = p[2];
    check_ok(alb_sh_project_polygon(c, ORDER, p, 4, &error), &error);
    check_near(c[0], M_PI_2 / sqrt(4 * M_PI), 1e-14);
    check_fails(alb_sh_project_polygon(c, ORDER, p, 2, &error), &error, ALB_BAD_DATA, "2 vertices");
    p[1] = (alb_vector){-2, 0, 0};
    check_fails(alb_sh_project_polygon(c, ORDER, p, 3, &error), &error, ALB_BAD_DATA, "vertex 0");
    p[1] = (alb_vector){0, 0, 0};
    check_fails(alb_sh_project_polygon(c, ORDER, p, 3, &error), &error, ALB_BAD_DATA, "meets the origin");
    p[1].y = NAN;
    check_fails(alb_sh_project_polygon(c, ORDER, p, 3, &error), &error, ALB_BAD_DATA, "not finite");
}

static void discs(void **state)
{
    (void)state;
    alb_error error = {0};
    double nodes[60], weights[60];
    alb_quadrature_gauss(nodes, weights, 60, 0, 1);
    for (uint64_t k = 0; k < 12; k++) {
        alb_random random = alb_random_at(3, 2, k);
        const alb_vector n = random_direction(&random),
                         centre = alb_times(1 + alb_random_uniform(&random), random_direction(&random));
        const double radius = 0.2 + 0.6 * alb_random_uniform(&random);
        double expected[COUNT] = {0}, found[COUNT];
        alb_vector t, b;
        alb_tangents(&t, &b, n);
        for (int i = 0; i < 60 * 200; i++) {
            const double r = radius * nodes[i % 60], s = 2 * M_PI * (i / 60) / 200.0;
            const alb_vector p = alb_add(centre, alb_add(alb_times(r * cos(s), t), alb_times(r * sin(s), b)));
            const double area = r * radius * weights[i % 60] * 2 * M_PI / 200;
            add_point(expected, ORDER, alb_unit(p), area * fabs(alb_dot(n, p)) / pow(alb_length(p), 3));
        }
        check_ok(alb_sh_project_disc(found, ORDER, centre, n, radius, &error), &error);
        check_coefficients(found, expected, ORDER, 1e-11);
    }
    // straight ahead it is a cap; edge-on nothing; from on it no answer
    double disc[COUNT], cap[COUNT];
    const alb_vector axis = {0.48, 0.6, 0.64};
    check_ok(alb_sh_project_disc(disc, ORDER, alb_times(2, axis), alb_times(-3, axis), 2, &error), &error);
    alb_sh_project_cap(cap, ORDER, axis, M_PI / 4);
    check_coefficients(disc, cap, ORDER, 1e-13);
    check_ok(alb_sh_project_disc(disc, ORDER, (alb_vector){2, 0, 0}, (alb_vector){0, 1, 0}, 1, &error), &error);
    check_near(disc[0], 0, 1e-13);
    check_fails(alb_sh_project_disc(disc, ORDER, (alb_vector){0.5, 0, 0}, (alb_vector){0, 1, 0}, 1, &error), &error,
                ALB_BAD_DATA, "lies on the disc");
    check_fails(alb_sh_project_disc(disc, ORDER, axis, (alb_vector){0}, 1, &error), &error, ALB_BAD_DATA, "normal");
    check_fails(alb_sh_project_disc(disc, ORDER, axis, axis, NAN, &error), &error, ALB_BAD_DATA, "radius");
}

// A disc near its rim is what inscribed polygons tend to: of n and 2n vertices the error falls like n^-2, extrapolated
// like n^-4.
static void discs_near_the_rim(void **state)
{
    (void)state;
    enum { VERTICES = 8000 };
    alb_error error = {0};
    static alb_vector outline[2 * VERTICES];
    for (int k = 0; k < 6; k++) {
        const double aside = k % 2 ? 0.99 : 1.01, height = k / 2 * 0.02 + 0.005;
        const alb_vector centre = {aside, 0.02, height};
        double coarse[16], fine[16], disc[16];
        for (int i = 0; i < 2 * VERTICES; i++) {
            const double s = M_PI * i / VERTICES;
            outline[i] = alb_add(centre, (alb_vector){cos(s), sin(s), 0});
        }
        check_ok(alb_sh_project_polygon(fine, 4, outline, 2 * VERTICES, &error), &error);
        for (int i = 0; i < VERTICES; i++)
            outline[i] = outline[2 * i];
        check_ok(alb_sh_project_polygon(coarse, 4, outline, VERTICES, &error), &error);
        check_ok(alb_sh_project_disc(disc, 4, centre, (alb_vector){0, 0, -2}, 1, &error), &error);
        for (int i = 0; i < 16; i++) {
            check_near(disc[i], (4 * fine[i] - coarse[i]) / 3, 1e-9);
            assert_true(fabs(fine[i] - coarse[i]) < 1e-4);
        }
    }
}

// Polar coordinates about the axis, 40 x 40 nodes; the smallest to a part in 1e9 of itself.
static void caps_and_spheres(void **state)
{
    (void)state;
    double nodes[40], weights[40];
    static const double angles[] = {1e-4, 0.01, 0.3, M_PI_2, 2.5, M_PI};
    alb_quadrature_gauss(nodes, weights, 40, 0, 1);
    for (uint64_t k = 0; k < 6; k++) {
        alb_random random = alb_random_at(4, 2, k);
        const alb_vector axis = random_direction(&random);
        alb_vector t, b;
        alb_tangents(&t, &b, axis);
        double expected[COUNT] = {0}, found[COUNT];
        for (int i = 0; i < 1600; i++) {
            const double theta = angles[k] * nodes[i % 40], s = 2 * M_PI * (i / 40) / 40.0;
            const alb_vector d = alb_add(alb_times(cos(theta), axis),
                                         alb_add(alb_times(sin(theta) * cos(s), t), alb_times(sin(theta) * sin(s), b)));
            add_point(expected, ORDER, d, sin(theta) * angles[k] * weights[i % 40] * 2 * M_PI / 40);
        }
        alb_sh_project_cap(found, ORDER, axis, angles[k]);
        check_coefficients(found, expected, ORDER, 1e-13);
        check_relative(found[0], expected[0], 1e-12);
        if (angles[k] < M_PI_2) {
            alb_sh_project_sphere(found, ORDER, alb_times(5, axis), 5 * sin(angles[k]));
            check_coefficients(found, expected, ORDER, 1e-13);
        }
    }
    double inside[COUNT], one[COUNT] = {sqrt(4 * M_PI)};
    alb_sh_project_sphere(inside, ORDER, (alb_vector){0.1, 0.2, 0}, 0.5);
    check_coefficients(inside, one, ORDER, 1e-13);
    alb_sh_project_sphere(inside, ORDER, (alb_vector){0}, 0.5);
    check_coefficients(inside, one, ORDER, 1e-13);
}

static double lobe(const void *context, alb_vector d) { return fmax(0, alb_dot(*(const alb_vector *)context, d)); }

// Irradiance: of a cap of light the cosine's lobe over it, in closed form pi sin^2 of its angle straight below.
static void zonal_functions(void **state)
{
    (void)state;
    double cosine[12], zonal[12], c[144], irradiance[144];
    alb_sh_zonal_cosine(cosine, 12);
    const double known[7] = {M_PI, 2 * M_PI / 3, M_PI / 4, 0, -M_PI / 24, 0, M_PI / 64}; // Ramamoorthi & Hanrahan 2001
    for (int l = 0; l < 7; l++)
        check_near(cosine[l] * sqrt(4 * M_PI / (2 * l + 1)), known[l], 1e-14);
    // turned: the lobe has a kink, 1000 x 1000 nodes see it to 1e-6
    const alb_vector axis = {0.48, 0.6, 0.64};
    alb_sh_zonal_turn(c, cosine, 4, axis);
    double expected[16];
    truth_project(expected, 4, 200, lobe, &axis);
    check_coefficients(c, expected, 4, 1e-4);
    // band-limited light comes back as its exact irradiance: order 2 has no more than A_0, A_1
    double light[4] = {1, 0.2, -0.3, 0.1};
    alb_sh_zonal_convolve(irradiance, light, cosine, 2);
    check_near(alb_sh_value(irradiance, 2, axis),
               M_PI * light[0] / sqrt(4 * M_PI) +
                   2 * M_PI / 3 * (alb_sh_value(light, 2, axis) - light[0] / sqrt(4 * M_PI)),
               1e-14);
    // of a cap, all bands: towards pi sin^2 a
    enum { MANY = 200 };
    static double lobe_zonal[MANY], cap_zonal[MANY];
    alb_sh_zonal_cosine(lobe_zonal, MANY);
    alb_sh_zonal_cap(cap_zonal, MANY, 0.7);
    double sum = 0;
    for (int l = 0; l < MANY; l++)
        sum += lobe_zonal[l] * cap_zonal[l];
    check_near(sum, M_PI * pow(sin(0.7), 2), 1e-5); // the bands left out fall like l^-4
    alb_sh_zonal_cap(zonal, 12, M_PI);
    for (int l = 0; l < 12; l++)
        check_near(zonal[l], l ? 0 : sqrt(4 * M_PI), 1e-15);
}

// Single precision; F26 for caps.
static void batches_of_caps(void **state)
{
    (void)state;
    enum { ITEMS = 75 };
    static float axes[3 * ITEMS], cosines[ITEMS], whole[COUNT * ITEMS], cut[COUNT * ITEMS];
    for (int k = 0; k < ITEMS; k++) {
        alb_random random = alb_random_at(6, 2, (uint64_t)k);
        const alb_vector d = random_direction(&random);
        axes[k] = (float)d.x, axes[ITEMS + k] = (float)d.y, axes[2 * ITEMS + k] = (float)d.z;
        cosines[k] = k == 0 ? 1 : k == 1 ? -1 : (float)(2 * alb_random_uniform(&random) - 1);
    }
    for (int order = 1; order <= ORDER; order++) {
        alb_sh_cap_batch(whole, order, axes, cosines, ITEMS, ITEMS);
        for (int k = 0; k < ITEMS; k++) {
            double exact[COUNT];
            const alb_vector axis = {(double)axes[k], (double)axes[ITEMS + k], (double)axes[2 * ITEMS + k]};
            alb_sh_project_cap(exact, order, alb_unit(axis), acos((double)cosines[k]));
            for (int i = 0; i < order * order; i++)
                check_near((double)whole[i * ITEMS + k], exact[i], 3e-6);
        }
        for (int size = 1; size <= 40; size += 3) {
            memset(cut, 0, sizeof cut);
            for (int k = 0; k < ITEMS; k += size)
                alb_sh_cap_batch(cut + k, order, axes + k, cosines + k, ITEMS,
                                 (size_t)(k + size < ITEMS ? size : ITEMS - k));
            assert_memory_equal(cut, whole, (size_t)(order * order * ITEMS) * sizeof *cut);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(functions),       cmocka_unit_test(latitude_longitude), cmocka_unit_test(cube_map),
        cmocka_unit_test(even_pictures),   cmocka_unit_test(polygons),           cmocka_unit_test(polygons_at_the_edge),
        cmocka_unit_test(discs),           cmocka_unit_test(discs_near_the_rim), cmocka_unit_test(caps_and_spheres),
        cmocka_unit_test(zonal_functions), cmocka_unit_test(batches_of_caps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
