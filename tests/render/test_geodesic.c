// Geodesics against surfaces that unfold: there the answer is a straight line in the plane.
#include "base/random.h"
#include "check.h"
#include "render/geodesic.h"
#include "render/optical_solid.h"
#include "render/prisms.h"
#include "render/shape.h"

typedef struct skin {
    alb_mesh mesh;
    alb_patches patches;
    alb_bodies bodies;
    alb_surface_net net;
    alb_geodesic_surface surface;
    alb_geodesic_memory memory;
} skin;

static void skin_create(skin *s, const alb_body *all)
{
    alb_error error = {0};
    check_ok(alb_patches_create(&s->patches, &s->mesh, &error), &error);
    int *labels = calloc(s->patches.count, sizeof *labels);
    check_ok(alb_bodies_find(&s->bodies, &s->patches, labels, &error), &error);
    free(labels);
    check_ok(alb_surface_net_create(&s->net, all ? all : &s->bodies.bodies[0], &s->patches, &error), &error);
    check_ok(alb_geodesic_surface_create(&s->surface, (const alb_vector(*)[3])s->net.triangles,
                                         (const uint32_t(*)[3])s->net.neighbours, s->net.count, &error),
             &error);
    check_ok(alb_geodesic_memory_create(&s->memory, &s->surface, &error), &error);
}

static void skin_free(skin *s)
{
    alb_geodesic_memory_free(&s->memory);
    alb_geodesic_surface_free(&s->surface);
    alb_surface_net_free(&s->net);
    alb_bodies_free(&s->bodies);
    alb_patches_free(&s->patches);
    alb_mesh_free(&s->mesh);
}

// From the middle of one triangle to the middles of all.
static alb_geodesic_target *to_all(skin *s, uint32_t from, double reach_mm)
{
    alb_geodesic_target *targets = calloc(s->net.count, sizeof *targets);
    for (uint32_t i = 0; i < s->net.count; i++)
        targets[i] = (alb_geodesic_target){.triangle = i, .at = s->net.middles[i], .end = s->net.middles[i]};
    alb_geodesic_run(targets, s->net.count, 1, &s->memory, &s->surface, from, s->net.middles[from], reach_mm);
    assert_int_equal(s->memory.dropped, 0);
    return targets;
}

// A lattice of n by m cells mapped by `place`; around: the last column joins the first.
static void lattice(alb_mesh *mesh, int n, int m, bool around, alb_vector (*place)(double u, double v, uint64_t index))
{
    alb_error error = {0};
    uint16_t group;
    check_ok(alb_mesh_add_group(&group, mesh, "", &error), &error);
    const int columns = around ? n : n + 1;
    for (int j = 0; j <= m; j++)
        for (int i = 0; i < columns; i++)
            check_ok(
                alb_mesh_add_vertex(mesh, place((double)i / n, (double)j / m, (uint64_t)(j * columns + i)), &error),
                &error);
    for (int j = 0; j < m; j++)
        for (int i = 0; i < n; i++) {
            const uint32_t a = (uint32_t)(j * columns + i), b = (uint32_t)(j * columns + (i + 1) % columns),
                           d = a + (uint32_t)columns, c = b + (uint32_t)columns;
            const bool odd = (i + j) % 2;
            check_ok(alb_mesh_add_face(mesh, a, b, odd ? d : c, 0, &error), &error);
            check_ok(alb_mesh_add_face(mesh, odd ? b : a, c, d, 0, &error), &error);
        }
}

static alb_vector jittered_plane(double u, double v, uint64_t index)
{
    alb_random random = alb_random_at(5, 1, index);
    const bool inner = u > 0 && u < 1 && v > 0 && v < 1;
    const double x = u + (inner ? 0.03 * (alb_random_uniform(&random) - 0.5) : 0),
                 y = v + (inner ? 0.03 * (alb_random_uniform(&random) - 0.5) : 0);
    return (alb_vector){0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y, 2}; // turned, so that no edge lies along an axis
}

static void plane_is_exact(void **state)
{
    (void)state;
    skin s = {0};
    lattice(&s.mesh, 20, 20, false, jittered_plane);
    skin_create(&s, NULL);
    for (uint32_t from = 7; from < s.net.count; from += 131) {
        alb_geodesic_target *t = to_all(&s, from, (double)INFINITY);
        for (size_t i = 0; i < s.net.count; i++) // rounding of some twenty unfoldings
            check_near(t[i].distance_mm, alb_length(alb_sub(s.net.middles[i], s.net.middles[from])), 1e-12);
        free(t);
    }
    skin_free(&s);
}

enum { FACETS = 24 };

static alb_vector tube_place(double u, double v, uint64_t index)
{
    (void)index;
    return (alb_vector){cos(2 * M_PI * u), sin(2 * M_PI * u), 3 * v};
}

// A point of the tube, unrolled: along the polygon, and z.
static void unroll(double out[2], alb_vector p)
{
    const double step = 2 * M_PI / FACETS, side = 2 * sin(step / 2), angle = fmod(atan2(p.y, p.x) + 2 * M_PI, 2 * M_PI);
    const double facet = floor(angle / step), within = angle - (facet + 0.5) * step;
    out[0] = (facet + 0.5) * side + cos(step / 2) * tan(within);
    out[1] = p.z;
}

static void cylinder_unrolls(void **state)
{
    (void)state;
    skin s = {0};
    lattice(&s.mesh, FACETS, 16, true, tube_place);
    skin_create(&s, NULL);
    const double around = FACETS * 2 * sin(M_PI / FACETS);
    for (uint32_t from = 11; from < s.net.count; from += 97) {
        alb_geodesic_target *t = to_all(&s, from, (double)INFINITY);
        double a[2], b[2];
        unroll(a, alb_add(s.net.middles[from], s.net.origin));
        for (size_t i = 0; i < s.net.count; i++) {
            const alb_vector p = alb_add(s.net.middles[i], s.net.origin),
                             q = alb_add(s.net.middles[from], s.net.origin);
            unroll(b, p);
            const double across = fabs(a[0] - b[0]), truth = hypot(fmin(across, around - across), a[1] - b[1]);
            check_near(t[i].distance_mm, truth, 1e-11);
            // and the round cylinder: the polygon is shorter by (pi / 24)^2 / 6 = 0.3 % and points lie up to as far in
            double angle = fabs(atan2(p.y, p.x) - atan2(q.y, q.x));
            angle = fmin(angle, 2 * M_PI - angle);
            check_near(t[i].distance_mm, hypot(angle, p.z - q.z), 0.004 * (0.1 + angle));
        }
        free(t);
    }
    skin_free(&s);
}

static alb_vector cone_place(double u, double v, uint64_t index)
{
    (void)index;
    const double r = 0.05 + v;
    return (alb_vector){r * cos(2 * M_PI * u), r * sin(2 * M_PI * u), 1.5 * r};
}

// With the apex closed by a fan: unrolled about it the cone is a sector, and distances follow the law of cosines.
static void cone_unrolls(void **state)
{
    (void)state;
    alb_error error = {0};
    skin s = {0};
    lattice(&s.mesh, FACETS, 12, true, cone_place);
    check_ok(alb_mesh_add_vertex(&s.mesh, (alb_vector){0}, &error), &error);
    for (uint32_t i = 0; i < FACETS; i++)
        check_ok(alb_mesh_add_face(&s.mesh, (uint32_t)s.mesh.vertex_count - 1, (i + 1) % FACETS, i, 0, &error), &error);
    skin_create(&s, NULL);
    const double slant = sqrt(1 + 1.5 * 1.5),
                 step = 2 * asin(sin(M_PI / FACETS) / slant); // of a facet, seen from the apex
    const double facet = 2 * M_PI / FACETS;
    for (uint32_t from = 3; from < s.net.count; from += 83) {
        alb_geodesic_target *t = to_all(&s, from, (double)INFINITY);
        double angles[2], radii[2];
        for (size_t i = 0; i < s.net.count; i++) {
            for (int k = 0; k < 2; k++) {
                const alb_vector p = alb_add(s.net.middles[k ? i : from], s.net.origin);
                const double angle = fmod(atan2(p.y, p.x) + 2 * M_PI, 2 * M_PI), number = floor(angle / facet);
                const double middle = (number + 0.5) * facet, side = -p.x * sin(middle) + p.y * cos(middle);
                radii[k] = alb_length(p);
                angles[k] = (number + 0.5) * step + asin(side / radii[k]);
            }
            const double apart = fabs(angles[0] - angles[1]), least = fmin(apart, FACETS * step - apart);
            const double truth = sqrt(radii[0] * radii[0] + radii[1] * radii[1] - 2 * radii[0] * radii[1] * cos(least));
            check_near(t[i].distance_mm, truth, 1e-7 + (i == from) * 1e-6); // the root amplifies rounding near zero
        }
        free(t);
    }
    skin_free(&s);
}

static void turns_at_boundary_corners(void **state)
{
    (void)state;
    alb_error error = {0};
    const squares snake = {5, 5, {"#####", "....#", "#####", "#....", "#####"}};
    plane_region *region = calloc(1, sizeof *region);
    skin s = {0};
    make_region(region, &snake);
    check_ok(make_squares(&s.mesh, &snake, 4, 1, &error), &error);
    check_ok(alb_patches_create(&s.patches, &s.mesh, &error), &error);
    alb_body top = {.patches = calloc(s.patches.count, sizeof(uint32_t))};
    for (uint32_t i = 0; i < s.patches.count; i++)
        if (s.patches.normals[i].z > 0.5)
            top.patches[top.count++] = i;
    alb_patches_free(&s.patches);
    skin_create(&s, &top);
    for (uint32_t from = 5; from < s.net.count; from += 61) {
        alb_geodesic_target *t = to_all(&s, from, (double)INFINITY);
        const alb_vector a = alb_add(s.net.middles[from], s.net.origin);
        for (size_t i = 0; i < s.net.count; i++) {
            const alb_vector b = alb_add(s.net.middles[i], s.net.origin);
            const double p[2] = {a.x, a.y}, q[2] = {b.x, b.y};
            check_near(t[i].distance_mm, region_distance(region, &snake, p, q), 1e-9);
        }
        free(t);
    }
    free(top.patches);
    free(region);
    skin_free(&s);
}

// Great circles; the icosahedron of 1,280 triangles lies up to 0.5 % inside its sphere and its paths are as much
// shorter.
static void sphere_follows_great_circles(void **state)
{
    (void)state;
    alb_error error = {0};
    skin s = {0};
    const alb_sphere sphere = {.radius_mm = 1, .subdivisions = 3};
    check_ok(alb_shape_sphere(&s.mesh, &sphere, &error), &error);
    skin_create(&s, NULL);
    alb_geodesic_target *t = to_all(&s, 17, (double)INFINITY);
    for (size_t i = 0; i < s.net.count; i++) {
        const alb_vector a = alb_unit(alb_add(s.net.middles[17], s.net.origin)),
                         b = alb_unit(alb_add(s.net.middles[i], s.net.origin));
        const double truth = atan2(alb_length(alb_cross(a, b)), alb_dot(a, b));
        check_near(t[i].distance_mm, truth, 0.008 * truth);
    }
    free(t);
    skin_free(&s);
}

// A reach cuts, and leaves what it does not cut.
static void reach_cuts(void **state)
{
    (void)state;
    skin s = {0};
    lattice(&s.mesh, FACETS, 16, true, tube_place);
    skin_create(&s, NULL);
    alb_geodesic_target *all = to_all(&s, 100, (double)INFINITY), *cut = to_all(&s, 100, 0.7);
    for (size_t i = 0; i < s.net.count; i++)
        if (all[i].distance_mm < 0.7)
            check_near(cut[i].distance_mm, all[i].distance_mm, 0);
        else
            assert_true(cut[i].distance_mm >= all[i].distance_mm - 1e-12);
    free(all);
    free(cut);
    skin_free(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(plane_is_exact),
        cmocka_unit_test(cylinder_unrolls),
        cmocka_unit_test(cone_unrolls),
        cmocka_unit_test(turns_at_boundary_corners),
        cmocka_unit_test(sphere_follows_great_circles),
        cmocka_unit_test(reach_cuts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
