// Where form factors fail: each way provoked, and what the rays do there. Truths are polygons' exact factors.
#include "convex_room.h"

typedef double rgb[3];

static double exact(const world *w, size_t p, size_t j)
{
    alb_error error = {0};
    alb_vector from[3], to[3];
    double factor;
    alb_patch_triangle(from, &w->patches, p);
    alb_patch_triangle(to, &w->patches, j);
    check_ok(alb_form_factor_exact(&factor, from, 3, to, 3, &error), &error);
    return factor;
}

static double area(const world *w, size_t p) { return w->patches.areas_mm2[p]; }

// counts[p * n + j]: how many rays of p hit j.
static double *count_hits(const world *w, int rays, uint64_t seed)
{
    const size_t n = w->patches.count;
    alb_form_factors f;
    double *counts = calloc(n * n, sizeof *counts);
    uint32_t *hits = calloc((size_t)rays, sizeof *hits);
    cast(&f, w, rays, seed);
    assert_int_equal(f.sky_rays + f.back_rays, 0);
    for (size_t p = 0; p < n; p++) {
        alb_form_factors_row(hits, &f, p);
        for (int q = 0; q < rays; q++)
            counts[p * n + hits[q]] += 1;
    }
    free(hits);
    alb_form_factors_free(&f);
    return counts;
}

// Patches that share an edge at a right angle: 1/r^2 has no end there. Every factor within five standard errors of
// counting (a lattice does better), and the exact rows, abutting pairs among them, sum to 1.
static void abutting_patches(void **state)
{
    (void)state;
    enum { RAYS = 65536 };
    const alb_box box = {.size_mm = {2, 1, 1}, .cells = {3, 2, 2}, .grading = 1, .inward = true};
    world w;
    world_of_box(&w, &box);
    const size_t n = w.patches.count;
    double *counts = count_hits(&w, RAYS, 1), largest = 0;
    for (size_t p = 0; p < n; p++) {
        double sum = 0;
        for (size_t j = 0; j < n; j++) {
            const double factor = p == j ? 0 : exact(&w, p, j);
            check_near(counts[p * n + j] / RAYS, factor, 5 * sqrt(factor * (1 - factor) / RAYS) + 3.0 / RAYS);
            sum += factor;
            largest = fmax(largest, factor);
        }
        check_near(sum, 1, 1e-8);
    }
    assert_true(largest > 0.15); // pairs that abut are among them
    free(counts);
    world_free(&w);
}

// From points of a grid exactly at the vertices and edges of a mesh on that grid: robust intersection meets something
// every time, and rows that leave from turned lattices never see the sky.
static void ray_through_vertex_or_edge(void **state)
{
    (void)state;
    const alb_box box = {.size_mm = {4, 4, 4}, .cells = {8, 8, 8}, .grading = 1, .inward = true};
    world w;
    alb_form_factors f;
    world_of_box(&w, &box);
    size_t missed = 0, cast_rays = 0;
    for (int from = 0; from < 27; from++) {
        const alb_vector origin = {from % 3 - 1.0, from / 3 % 3 - 1.0, from / 9 - 1.0};
        for (size_t p = 0; p < w.patches.count; p++) {
            alb_vector t[3];
            alb_hit hit;
            alb_patch_triangle(t, &w.patches, p);
            for (int k = 0; k < 3; k++) {
                const alb_vector middle = alb_times(0.5, alb_add(t[k], t[(k + 1) % 3]));
                missed += !alb_tracer_closest(&hit, &w.tracer, origin, alb_unit(alb_sub(t[k], origin)));
                missed += !alb_tracer_closest(&hit, &w.tracer, origin, alb_unit(alb_sub(middle, origin)));
                cast_rays += 2;
            }
        }
    }
    assert_true(cast_rays > 100000);
    assert_int_equal(missed, 0);
    cast(&f, &w, 1024, 1);
    assert_int_equal(f.sky_rays + f.back_rays, 0);
    alb_form_factors_free(&f);
    world_free(&w);
}

// A slit of 5e-6 between ceiling and walls, which a few in a million rays from the floor find: they are cast again,
// turned by 1e-5, and none sees the sky. A real slit, a hundredth wide, stays open.
static void crack_between_walls(void **state)
{
    (void)state;
    enum { RAYS = 65536 };
    static uint32_t hits[RAYS];
    for (int wide = 0; wide < 2; wide++) {
        const alb_box box = {.size_mm = {1, 1, 1}, .cells = {2, 2, 2}, .grading = 1, .inward = true};
        alb_error error = {0};
        world w = {0};
        size_t sky = 0, slipped = 0;
        check_ok(alb_shape_box(&w.mesh, &box, &error), &error);
        for (size_t p = 0; p < w.mesh.face_count; p++) {
            alb_vector corners[3];
            bool ceiling = true;
            for (int k = 0; k < 3; k++) {
                corners[k] = w.mesh.vertices[w.mesh.faces[p][k]];
                ceiling &= corners[k].z == 0.5;
            }
            for (int k = 0; k < 3 && ceiling; k++) { // it gets vertices of its own
                const double shrink = 1 - (wide ? 2e-2 : 1e-5);
                const alb_vector moved = {shrink * corners[k].x, shrink * corners[k].y, corners[k].z};
                check_ok(alb_mesh_add_vertex(&w.mesh, moved, &error), &error);
                w.mesh.faces[p][k] = (uint32_t)w.mesh.vertex_count - 1;
            }
        }
        world_of(&w);
        for (size_t p = 0; p < w.patches.count; p++)
            for (uint64_t seed = 0; seed < (wide ? 1 : 8) && w.patches.normals[p].z > 0.9; seed++) {
                const alb_ray_pattern pattern = {RAYS, seed, ALB_SAMPLING_LATTICE, NULL};
                slipped += alb_rays_cast(hits, &pattern, &w.patches, &w.tracer, p);
                for (int q = 0; q < RAYS; q++)
                    sky += hits[q] == w.patches.count;
            }
        assert_true(wide ? sky > 1000 : sky == 0);
        assert_true(wide ? slipped < sky / 100 : slipped > 0);
        world_free(&w);
    }
}

// The mean with the transpose, A_i F_ij made equal both ways and rows scaled back to 1, is worse than the rows.
static void symmetrised_ray_factors(void **state)
{
    (void)state;
    enum { RAYS = 64 };
    const alb_box box = {.size_mm = {4, 4, 4}, .cells = {6, 6, 6}, .grading = 4, .inward = true};
    world w;
    world_of_box(&w, &box);
    const size_t n = w.patches.count;
    double *counts = count_hits(&w, RAYS, 2);
    rgb *light = calloc(n, sizeof *light), *truth = calloc(n, sizeof *truth);
    rgb *rows = calloc(n, sizeof *rows), *even = calloc(n, sizeof *even);
    random_radiosity(light, &w, 4, 3);
    room_irradiance(truth, &w, (const rgb *)light, 1);
    for (size_t p = 0; p < n; p++) {
        double sum = 0;
        for (size_t j = 0; j < n; j++) {
            const double row = counts[p * n + j] / RAYS, column = counts[j * n + p] / RAYS * area(&w, j) / area(&w, p);
            sum += 0.5 * (row + column);
            rows[p][0] += row * light[j][0];
            even[p][0] += 0.5 * (row + column) * light[j][0];
        }
        even[p][0] /= sum;
    }
    const double as_cast = rms_percent((const rgb *)rows, (const rgb *)truth, n, 1, 0);
    const double symmetrised = rms_percent((const rgb *)even, (const rgb *)truth, n, 1, 0);
    check_below(1.15 * as_cast, symmetrised);
    free(counts);
    free(light);
    free(truth);
    free(rows);
    free(even);
    world_free(&w);
}

// Entries below 1e-3 left out, as sparse storage of exact entries does: a tenth of the energy goes. Rows of rays keep
// all.
static void thresholded_f(void **state)
{
    (void)state;
    const alb_box box = {.size_mm = {4, 4, 4}, .cells = {7, 7, 7}, .grading = 1, .inward = true};
    alb_form_factors f;
    world w;
    world_of_box(&w, &box);
    const size_t n = w.patches.count;
    double kept = 0;
    for (size_t j = 0; j < n; j++) {
        const double factor = j ? exact(&w, 0, j) : 0;
        kept += factor > 1e-3 ? factor : 0;
    }
    check_below(kept, 0.9);
    rgb *one = calloc(n, sizeof *one), *out = calloc(n, sizeof *out);
    for (size_t p = 0; p < n; p++)
        one[p][0] = 1;
    cast(&f, &w, 256, 1);
    alb_form_factors_apply(out, &f, (const rgb *)one);
    for (size_t p = 0; p < n; p++)
        check_near(out[p][0], 1, 0);
    free(one);
    free(out);
    alb_form_factors_free(&f);
    world_free(&w);
}

// The patch and the front-facing square (two triangles) around `at`, its normal down.
static void lamp_over(world *w, const alb_vector receiver[3], alb_vector at, double half)
{
    alb_error error = {0};
    *w = (world){0};
    for (int k = 0; k < 3; k++)
        check_ok(alb_mesh_add_vertex(&w->mesh, receiver[k], &error), &error);
    for (int k = 0; k < 4; k++)
        check_ok(alb_mesh_add_vertex(&w->mesh, alb_add(at, (alb_vector){k % 2 ? half : -half, k / 2 ? half : -half, 0}),
                                     &error),
                 &error);
    check_ok(alb_mesh_add_face(&w->mesh, 0, 1, 2, 0, &error), &error);
    check_ok(alb_mesh_add_face(&w->mesh, 3, 6, 4, 0, &error), &error);
    check_ok(alb_mesh_add_face(&w->mesh, 3, 5, 6, 0, &error), &error);
    world_of(w);
}

// Share of patch 0's rays that hit another patch.
static double lit_share(const world *w, int rays, uint64_t seed)
{
    alb_form_factors f;
    cast(&f, w, rays, seed);
    assert_int_equal(f.back_rays, 0);
    const double share = 1 - alb_form_factors_sky_share(&f, 0);
    alb_form_factors_free(&f);
    return share;
}

// A long receiver with a small lamp near its end: the factor at the centroid is far off, rays from all over it are not.
static void centroid_sampling(void **state)
{
    (void)state;
    enum { RAYS = 65536 };
    const alb_vector receiver[3] = {{0, 0, 0}, {10, 0, 0}, {0, 0.5, 0}};
    world w;
    lamp_over(&w, receiver, (alb_vector){0.4, 0.2, 0.3}, 0.1);
    double at_centroid = 0;
    for (size_t j = 1; j < 3; j++) {
        alb_vector triangle[3];
        alb_patch_triangle(triangle, &w.patches, j);
        at_centroid += alb_form_factor_point(w.patches.centroids[0], w.patches.normals[0], triangle, 3);
    }
    const double truth = exact(&w, 0, 1) + exact(&w, 0, 2);
    assert_true(at_centroid < 0.05 * truth);
    check_near(lit_share(&w, RAYS, 1), truth, 5 * sqrt(truth / RAYS));
    world_free(&w);
}

// The hemicube's answer at a point looking along +z (Cohen & Greenberg 1985): pixels whose centre falls on a square of
// the plane z = height, each weighing 1/(pi (1 + x^2 + y^2)^2) of its area. Only the top face is needed here.
static double hemicube(alb_vector at, double half, int pixels)
{
    double sum = 0;
    for (int i = 0; i < pixels * pixels; i++) {
        const double x = 2 * (i % pixels + 0.5) / pixels - 1, y = 2 * (i / pixels + 0.5) / pixels - 1;
        if (fabs(x * at.z - at.x) < half && fabs(y * at.z - at.y) < half)
            sum += 4.0 / (pixels * pixels) / (M_PI * pow(1 + x * x + y * y, 2));
    }
    return sum;
}

// A small lamp that moves: a hemicube of 64 pixels across sees one to four of them and is off by tens of percent
// however it is computed again; rays err at random, less, and less with more of them.
static void hemicube_aliasing(void **state)
{
    (void)state;
    enum { PLACES = 12, RAYS = 65536 };
    const alb_vector receiver[3] = {{-1e-3, -1e-3, 0}, {1e-3, -1e-3, 0}, {0, 2e-3, 0}};
    double of_cube = 0, of_rays = 0;
    for (int k = 0; k < PLACES; k++) {
        const alb_vector at = {0.043 * k, 0.029 * k, 1};
        const double half = 0.025;
        world w;
        lamp_over(&w, receiver, at, half);
        const double truth = exact(&w, 0, 1) + exact(&w, 0, 2);
        of_cube += pow(hemicube(at, half, 64) / truth - 1, 2) / PLACES;
        of_rays += pow(lit_share(&w, RAYS, 1) / truth - 1, 2) / PLACES;
        world_free(&w);
    }
    assert_true(sqrt(of_cube) > 0.2);
    assert_true(sqrt(of_rays) < 0.05); // 50 to 100 rays hit; a lattice does better than their root
}

// Two spots, 3.5 % of the area: the error falls with the rays, and what is asked of refine is what comes.
static void sharp_bright_spot(void **state)
{
    (void)state;
    enum { STRIDE = 8 };
    alb_error error = {0};
    const alb_box box = {.size_mm = {4, 4, 4}, .cells = {24, 24, 24}, .grading = 1, .inward = true};
    alb_form_factors f;
    world w;
    double found[2], reached;
    world_of_box(&w, &box);
    const size_t n = w.patches.count;
    rgb *spot = calloc(n, sizeof *spot), *truth = calloc(n, sizeof *truth), *out = calloc(n, sizeof *out);
    random_radiosity(spot, &w, 4, 5);
    for (size_t p = 0; p < n; p++)
        spot[p][0] = spot[p][1] = 0;
    room_irradiance(truth, &w, (const rgb *)spot, STRIDE);
    for (int k = 0; k < 2; k++) {
        cast(&f, &w, 64 << 2 * k, 1);
        alb_form_factors_apply(out, &f, (const rgb *)spot);
        found[k] = rms_percent((const rgb *)out, (const rgb *)truth, n, STRIDE, 2);
        if (k == 0)
            alb_form_factors_free(&f);
    }
    check_below(found[1], 0.6 * found[0]); // random rays: 0.5 at best
    check_ok(alb_form_factors_refine(&reached, &f, &w.patches, &w.tracer, (const rgb *)spot, NULL, 3, 8192, &error),
             &error);
    check_below(reached, 3.1);
    alb_form_factors_apply(out, &f, (const rgb *)spot);
    check_below(rms_percent((const rgb *)out, (const rgb *)truth, n, STRIDE, 2), reached);
    print_message("64 rays %.2f %%, 256 rays %.2f %%, refined to 3 %%: %.0f rays a patch\n", found[0], found[1],
                  (double)alb_hit_rows_rays(&f.rows) / (double)n);
    alb_form_factors_free(&f);
    free(spot);
    free(truth);
    free(out);
    world_free(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(abutting_patches),    cmocka_unit_test(ray_through_vertex_or_edge),
        cmocka_unit_test(crack_between_walls), cmocka_unit_test(symmetrised_ray_factors),
        cmocka_unit_test(thresholded_f),       cmocka_unit_test(centroid_sampling),
        cmocka_unit_test(hemicube_aliasing),   cmocka_unit_test(sharp_bright_spot),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
