// Other profiles on the same links.
#include "scatter_world.h"
#include "scenes/scenes.h"

static double rows_apart(const world *a, const world *b)
{
    double square = 0, all = 0;
    for (size_t p = 0; p < a->patches.count; p++)
        for (int c = 0; c < 3; c++) {
            square += pow(a->scatter.row_sums[p][c] - b->scatter.row_sums[p][c], 2);
            all += pow(b->scatter.row_sums[p][c], 2);
        }
    return sqrt(square / all);
}

// Links made for a profile, then a profile four times wider or narrower written to them, against links of its own.
// Nothing is cut: clusters reach the whole body.
static void wider_than_stored_reach(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_surface wax = {.name = "wax", .scatters = true}, other = wax;
    for (int times = -1; times <= 1; times += 2) {
        const double scale = pow(4, times);
        for (int c = 0; c < 3; c++) {
            const double decay = 0.3 + 0.2 * c;
            wax.profiles[0][c] = (alb_profile){ALB_FORM_EXPONENTIAL, {0.1 * decay * decay, decay}};
            other.profiles[0][c] =
                (alb_profile){ALB_FORM_EXPONENTIAL, {0.1 * decay * decay * scale * scale, decay * scale}};
        }
        world found, fresh;
        world_of_sphere(&found, 25, 4, &wax);
        world_of_sphere(&fresh, 25, 4, &other);
        check_ok(alb_scatter_rewrite(&found.scatter, &other, &error), &error);
        check_below(rows_apart(&found, &fresh),
                    times < 0 ? 0.0075 : 0.03); // as wide: each half a percent; narrower: more
        check_ok(alb_scatter_rewrite(&found.scatter, &wax, &error), &error);
        world again;
        world_of_sphere(&again, 25, 4, &wax);
        assert_memory_equal(found.scatter.row_sums, again.scatter.row_sums,
                            again.patches.count * sizeof *again.scatter.row_sums); // and back: the same bytes
        world_free(&found);
        world_free(&fresh);
        world_free(&again);
    }
}

// The world's profiles, all two exponentials, `scale` times as narrow on its links, against links of their own.
static void check_rewriting(world *found, const alb_surface *surfaces, size_t count, double scale)
{
    alb_error error = {0};
    alb_surface *other = calloc(count, sizeof *other);
    memcpy(other, surfaces, count * sizeof *other);
    for (size_t i = 0; i < count * ALB_SIDES * 3; i++) {
        double *p = other[i / (ALB_SIDES * 3)].profiles[i / 3 % ALB_SIDES][i % 3].parameters;
        p[0] *= scale * scale, p[1] *= scale, p[2] *= scale * scale, p[3] *= scale;
    }
    world fresh = {0};
    check_ok(alb_mesh_append(&fresh.mesh, &found->mesh, 1, (alb_vector){0}, &error), &error);
    memcpy(fresh.mesh.groups, found->mesh.groups, fresh.mesh.face_count * sizeof *fresh.mesh.groups);
    world_of_mesh(&fresh, other);
    check_ok(alb_scatter_rewrite(&found->scatter, other, &error), &error);
    check_below(rows_apart(found, &fresh), 0.0075); // half a percent each
    for (size_t p = 0; p < fresh.patches.count; p++)
        for (int c = 0; c < 3; c++) { // both faces reflect and transmit 0.78; light goes around some bends
            check_below(fresh.scatter.row_sums[p][c], 0.95);
            check_below(fresh.scatter.column_sums[p][c], 0.95);
            check_below(found->scatter.row_sums[p][c], 0.95);
            check_below(found->scatter.column_sums[p][c], 0.95);
        }
    world_free(&fresh);
    free(other);
}

// A ball, a slab, and petals rolled as tightly as three times their thickness, whose rims look into the bend.
static void rewriting_agrees_with_new_links(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene rose;
    check_ok(scene_rose(&rose, 0.4, 0, &error), &error);
    const alb_surface *petal = &rose.surfaces[0];
    assert_true(petal->slab);
    const alb_sphere ball = {.radius_mm = 4, .subdivisions = 3};
    const alb_box slab = {.size_mm = {12, 12, 0.4}, .cells = {24, 24, 1}, .grading = 1};
    for (int shape = 0; shape < 3; shape++) {
        world w = {0};
        alb_surface solid = *petal;
        solid.slab = shape > 0;
        if (shape == 0)
            check_ok(alb_shape_sphere(&w.mesh, &ball, &error), &error);
        else if (shape == 1)
            check_ok(alb_shape_box(&w.mesh, &slab, &error), &error);
        else
            w.mesh = rose.mesh, rose.mesh = (alb_mesh){0};
        const alb_surface *surfaces = shape < 2 ? &solid : rose.surfaces;
        world_of_mesh(&w, surfaces);
        for (int times = -1; times <= 1; times += 2)
            check_rewriting(&w, surfaces, shape < 2 ? 1 : rose.surface_count, pow(1.25, times));
        world_free(&w);
    }
    alb_scene_free(&rose);
}

// Row sums are estimated until a product has found them: of profiles that change by a factor the estimate is exact.
// What sent out nothing before tells nothing, and is found at once.
static void estimated_row_sums_are_those_of_scaled_profiles(void **state)
{
    (void)state;
    alb_error error = {0};
    const double factors[2][3] = {{0.5, 1.25, 0.01}, {1.5, 0.2, 1}};
    const alb_profile profiles[3] = {one, two, one};
    const alb_box box = {.size_mm = {20, 20, 5}, .cells = {6, 6, 2}, .grading = 2};
    alb_surface glass = {.name = "glass", .scatters = true, .slab = true};
    world w;
    for (int c = 0; c < 3; c++)
        glass.profiles[0][c] = profiles[c], glass.profiles[1][c] = profiles[(c + 1) % 3];
    world_of_box(&w, &box, &glass);
    const size_t n = w.patches.count;
    double(*estimates)[3] = calloc(n, sizeof *estimates), (*light)[3] = calloc(n, sizeof *light),
    (*out)[3] = calloc(n, sizeof *out);
    for (int step = 0; step < 2; step++) {
        for (int k = 0; k < 3 * ALB_SIDES; k++)
            for (int term = 0; term < 4; term += 2)
                glass.profiles[k / 3][k % 3].parameters[term] *= factors[step][k % 3];
        check_ok(alb_scatter_rewrite_tables(&w.scatter, &glass, &error), &error);
        assert_false(alb_scatter_rows_known(&w.scatter));
        memcpy(estimates, w.scatter.row_sums, n * sizeof *estimates);
        alb_scatter_apply(out, &w.scatter, (const double(*)[3])light);
        assert_true(alb_scatter_rows_known(&w.scatter));
        for (size_t k = 0; k < 3 * n; k++) // tables are floats
            check_relative(estimates[k / 3][k % 3], w.scatter.row_sums[k / 3][k % 3], 1e-6);
    }
    const alb_profile dark = {ALB_FORM_EXPONENTIAL, {0, 0.3}};
    for (int lit = 0; lit < 2; lit++) {
        glass.profiles[0][0] = glass.profiles[1][0] = lit ? one : dark;
        check_ok(alb_scatter_rewrite_tables(&w.scatter, &glass, &error), &error);
        assert_true(alb_scatter_rows_known(&w.scatter) == (lit == 1));
        for (size_t p = 0; p < n; p++)
            assert_true((w.scatter.row_sums[p][0] > 0) == (lit == 1));
        alb_scatter_sum_rows(&w.scatter);
    }
    free(estimates);
    free(light);
    free(out);
    world_free(&w);
}

// What was opaque cannot scatter on links that were made without it.
static void other_kinds_of_surface_need_new_links(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_surface wax = {.name = "wax", .scatters = true, .profiles = {{one, two, marble}}};
    const alb_box box = {.size_mm = {20, 20, 5}, .cells = {4, 4, 1}, .grading = 1};
    world w;
    world_of_box(&w, &box, &wax);
    wax.slab = true;
    check_ok(alb_scatter_rewrite(&w.scatter, &wax, &error), &error);
    wax.scatters = false;
    check_fails(alb_scatter_rewrite(&w.scatter, &wax, &error), &error, ALB_BAD_DATA, "anew");
    world_free(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(wider_than_stored_reach),
        cmocka_unit_test(rewriting_agrees_with_new_links),
        cmocka_unit_test(estimated_row_sums_are_those_of_scaled_profiles),
        cmocka_unit_test(other_kinds_of_surface_need_new_links),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
