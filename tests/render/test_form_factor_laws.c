// What must not change the irradiance: size and place of the room, how it is turned, the order of its faces, how finely
// the senders are cut.
#include "convex_room.h"

static const alb_box hall = {.size_mm = {4, 2, 3}, .cells = {8, 5, 6}, .grading = 3, .inward = true};

// out = F light by the rays of seed 1, in a room without openings.
static void gather(double (*out)[3], const world *w, const double (*light)[3], int rays)
{
    alb_form_factors f;
    cast(&f, w, rays, 1);
    assert_int_equal(f.sky_rays + f.back_rays, 0);
    alb_form_factors_apply(out, &f, light);
    alb_form_factors_free(&f);
}

// A field that goes with the room: places are measured in its size. The third channel is sharp.
static void field_of(double (*light)[3], const world *w, double size, alb_vector at)
{
    for (size_t p = 0; p < w->patches.count; p++) {
        const alb_vector c = alb_times(1 / size, alb_sub(w->patches.centroids[p], at));
        light[p][0] = 0.5 + 0.5 * sin(2 * c.x) * cos(1.5 * c.y + c.z);
        light[p][1] = alb_dot(c, c);
        light[p][2] = c.x > 0.3 ? 1 : 0;
    }
}

static void irradiance_of(double (*out)[3], const world *w, double size, alb_vector at, int rays)
{
    double(*light)[3] = calloc(w->patches.count, sizeof *light);
    field_of(light, w, size, at);
    gather(out, w, (const double(*)[3])light, rays);
    free(light);
}

static void move(world *w, double scale, alb_vector by)
{
    alb_tracer_free(&w->tracer);
    alb_patches_free(&w->patches);
    for (size_t v = 0; v < w->mesh.vertex_count; v++)
        w->mesh.vertices[v] = alb_add(alb_times(scale, w->mesh.vertices[v]), by);
    world_of(w);
}

// Sizes from 1e-4 to 1e4, and far from the origin: the same rays. Rounding moves one in ten thousand to a neighbour.
static void scale_and_place_do_not_matter(void **state)
{
    (void)state;
    const struct {
        double scale;
        alb_vector by;
    } cases[] = {{0x1p-13, {0, 0, 0}}, {0x1p13, {0, 0, 0}},   {1e-4, {0, 0, 0}},
                 {1e4, {0, 0, 0}},     {1, {3e5, -2e5, 1e5}}, {1e-4, {7, 8, 9}}};
    world first;
    world_of_box(&first, &hall);
    const size_t n = first.patches.count;
    double(*expected)[3] = calloc(n, sizeof *expected), (*found)[3] = calloc(n, sizeof *found);
    irradiance_of(expected, &first, 1, (alb_vector){0}, 256);
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        world w;
        world_of_box(&w, &hall);
        move(&w, cases[k].scale, cases[k].by);
        irradiance_of(found, &w, cases[k].scale, cases[k].by, 256);
        for (int c = 0; c < 3; c++)
            check_below(rms_percent((const double(*)[3])found, (const double(*)[3])expected, n, 1, c),
                        k < 2 ? 1e-12 : 0.02);
        world_free(&w);
    }
    free(expected);
    free(found);
    world_free(&first);
}

// What the 256 rays of seed 1 state as their error, of the worst channel.
static double stated_percent(const world *w, const double (*light)[3])
{
    alb_form_factors f;
    alb_error error = {0};
    double stated;
    cast(&f, w, 256, 1);
    check_ok(alb_form_factors_error(&stated, NULL, &f, light, NULL, NULL, &error), &error);
    alb_form_factors_free(&f);
    return stated;
}

// Turned, a patch has other tangents and so other rays: the same answer within what both state as errors.
static void turning_does_not_matter(void **state)
{
    (void)state;
    world first, second;
    world_of_box(&first, &hall);
    world_of_box(&second, &hall);
    const size_t n = first.patches.count;
    const alb_vector x = alb_unit((alb_vector){2, -1, 3});
    alb_vector y, z;
    alb_tangents(&y, &z, x);
    for (size_t v = 0; v < second.mesh.vertex_count; v++) {
        const alb_vector c = second.mesh.vertices[v];
        second.mesh.vertices[v] = alb_add(alb_times(c.x, x), alb_add(alb_times(c.y, y), alb_times(c.z, z)));
    }
    move(&second, 1, (alb_vector){0});
    double(*a)[3] = calloc(n, sizeof *a), (*b)[3] = calloc(n, sizeof *b), (*light)[3] = calloc(n, sizeof *light);
    field_of(light, &first, 1, (alb_vector){0});
    gather(a, &first, (const double(*)[3])light, 256);
    gather(b, &second, (const double(*)[3])light, 256);
    const double stated = stated_percent(&first, (const double(*)[3])light);
    for (int c = 0; c < 3; c++) {
        const double apart = rms_percent((const double(*)[3])b, (const double(*)[3])a, n, 1, c);
        check_below(apart, sqrt(2) * stated);
        assert_true(apart > 0); // they are other rays
    }
    free(a);
    free(b);
    free(light);
    world_free(&first);
    world_free(&second);
}

// The shares that the parts of a patch receive add up to that of the patch: a room of which all but the first wall is
// cut finer. Rays belong to the sender, so they are the same ones; rounding at an edge may move one in ten thousand.
static void parts_add_up(void **state)
{
    (void)state;
    enum { RAYS = 256, PARTS = 4 };
    const size_t kept = 2 * 5 * 6;
    world whole, cut;
    alb_error error = {0};
    world_of_box(&whole, &hall);
    world_of_box(&cut, &hall);
    const size_t n = whole.patches.count;
    uint32_t *parents = calloc(PARTS * n, sizeof *parents);
    for (size_t p = 0; p < n; p++)
        parents[p] = (uint32_t)p;
    for (size_t p = kept; p < n; p++) {
        const uint32_t *corners = whole.mesh.faces[p], middles = (uint32_t)cut.mesh.vertex_count;
        for (int k = 0; k < 3; k++) {
            const alb_vector from = whole.mesh.vertices[corners[k]], to = whole.mesh.vertices[corners[(k + 1) % 3]];
            check_ok(alb_mesh_add_vertex(&cut.mesh, alb_times(0.5, alb_add(from, to)), &error), &error);
        }
        for (uint32_t k = 0; k < 3; k++) {
            parents[cut.mesh.face_count] = (uint32_t)p;
            check_ok(alb_mesh_add_face(&cut.mesh, corners[k], middles + k, middles + (k + 2) % 3, 0, &error), &error);
        }
        for (uint32_t k = 0; k < 3; k++)
            cut.mesh.faces[p][k] = middles + k;
    }
    move(&cut, 1, (alb_vector){0});
    assert_int_equal(cut.patches.count, n + (PARTS - 1) * (n - kept));
    alb_form_factors of_whole, of_cut;
    cast(&of_whole, &whole, RAYS, 1);
    cast(&of_cut, &cut, RAYS, 1);
    size_t apart = 0;
    for (size_t p = 0; p < kept; p++) {
        uint32_t hits[RAYS];
        int *counts = calloc(n, sizeof *counts);
        alb_form_factors_row(hits, &of_whole, p);
        for (int q = 0; q < RAYS; q++)
            counts[hits[q]]++;
        alb_form_factors_row(hits, &of_cut, p);
        for (int q = 0; q < RAYS; q++)
            counts[parents[hits[q]]]--;
        for (size_t k = 0; k < n; k++)
            apart += (size_t)abs(counts[k]);
        free(counts);
    }
    check_below((double)apart, 2e-4 * (double)(kept * RAYS)); // a moved ray counts twice
    alb_form_factors_free(&of_whole);
    alb_form_factors_free(&of_cut);
    free(parents);
    world_free(&whole);
    world_free(&cut);
}

// Faces in another order have other random numbers: the same answer in that order within what both state as errors.
static void order_of_faces_does_not_matter(void **state)
{
    (void)state;
    world first, second;
    world_of_box(&first, &hall);
    world_of_box(&second, &hall);
    const size_t n = first.patches.count;
    for (size_t p = 0; p < n; p++) // 401 and n have no common factor: every face once
        memcpy(second.mesh.faces[p], first.mesh.faces[p * 401 % n], sizeof second.mesh.faces[p]);
    move(&second, 1, (alb_vector){0});
    double(*a)[3] = calloc(n, sizeof *a), (*b)[3] = calloc(n, sizeof *b), (*light)[3] = calloc(n, sizeof *light);
    double(*back)[3] = calloc(n, sizeof *back);
    irradiance_of(a, &first, 1, (alb_vector){0}, 256);
    irradiance_of(b, &second, 1, (alb_vector){0}, 256);
    for (size_t p = 0; p < n; p++) {
        memcpy(back[p * 401 % n], b[p], sizeof b[p]);
        light[p][0] = first.patches.centroids[p].x > 0.3;
    }
    const double stated = stated_percent(&first, (const double(*)[3])light);
    const double apart = rms_percent((const double(*)[3])back, (const double(*)[3])a, n, 1, 2);
    check_below(apart, sqrt(2) * stated); // of the sharp field
    assert_true(apart > 0);               // they are other rays
    free(a);
    free(b);
    free(back);
    free(light);
    world_free(&first);
    world_free(&second);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scale_and_place_do_not_matter),
        cmocka_unit_test(turning_does_not_matter),
        cmocka_unit_test(order_of_faces_does_not_matter),
        cmocka_unit_test(parts_add_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
