// Scattering in bodies: energy, density form on unequal patches, both faces of a slab, around a hollow.
#include "base/random.h"
#include "prisms.h"
#include "scatter_world.h"

// More light out than in is refused with numbers; a coarse mesh for a narrow profile is not: S(0) A is far above 1
// there, the exact self-term below.
static void row_sum_of_s_above_one(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_surface wax = {.name = "wax", .scatters = true, .slab = true};
    const uint16_t *materials;
    const alb_box slab = {.size_mm = {120, 120, 5}, .cells = {8, 8, 1}, .grading = 1};
    for (int bright = 0; bright < 2; bright++) {
        for (int side = 0; side < ALB_SIDES; side++)
            for (int c = 0; c < 3; c++) // in all 0.98, or 1.2 in green
                wax.profiles[side][c] =
                    (alb_profile){ALB_FORM_EXPONENTIAL, {(bright && c == 1 ? 0.6 : 0.49) * 25 / 2 / M_PI, 5}};
        world w;
        double largest;
        world_of_box(&w, &slab, &wax);
        materials = w.mesh.groups;
        assert_true(alb_profile_value(&wax.profiles[0][0], 0) * w.patches.areas_mm2[0] > 10);
        if (bright)
            check_fails(alb_radiosity_check(&largest, &w.scatter, true, materials, &wax, &error), &error, ALB_BAD_DATA,
                        "channel G sends out 1.");
        else
            check_ok(alb_radiosity_check(&largest, &w.scatter, true, materials, &wax, &error), &error);
        world_free(&w);
    }
}

// The columns of S' are its rows weighted by area: sum_j A_j S'_ji E_i over all i and j is one number, for light of one
// and for light at random, which tells where in a cluster it falls.
static void columns_balance_rows(void **state)
{
    (void)state;
    const alb_box box = {.size_mm = {30, 20, 10}, .cells = {12, 8, 4}, .grading = 10};
    const alb_surface stone = {.name = "marble", .scatters = true, .profiles = {{marble, one, two}}};
    world w;
    world_of_box(&w, &box, &stone);
    const size_t n = w.patches.count;
    double(*light)[3] = calloc(n, sizeof *light), (*out)[3] = calloc(n, sizeof *out);
    for (int random = 0; random < 2; random++) {
        for (size_t k = 0; k < 3 * n; k++) {
            alb_random numbers = alb_random_at(5, 0, k);
            light[k / 3][k % 3] = random ? pow(alb_random_uniform(&numbers), 4) : 1;
        }
        alb_scatter_apply(out, &w.scatter, (const double(*)[3])light);
        for (int c = 0; c < 3; c++) {
            double by_rows = 0, by_columns = 0;
            for (size_t p = 0; p < n; p++) {
                by_rows += w.patches.areas_mm2[p] * out[p][c];
                by_columns += w.patches.areas_mm2[p] * w.scatter.column_sums[p][c] * light[p][c];
            }
            check_relative(by_columns, by_rows, 1e-6); // sums of floats
        }
    }
    for (size_t k = 0; k < 3 * n; k++)
        check_relative(w.scatter.row_sums[k / 3][k % 3], w.sums[k / 3][k % 3], 1e-12); // the product with ones
    assert_true(w.scatter.bodies[0].closed && w.scatter.bodies[0].convex);
    free(light);
    free(out);
    world_free(&w);
}

// Density form: irradiance 1 on half of an unequal mesh and the same on a uniform one give one answer at the same
// place. With the paper's form the answer would differ by the ratio of areas, here up to 100^2.
static void area_grading(void **state)
{
    (void)state;
    double found[3];
    const int cells[3] = {16, 32, 32};
    const double grading[3] = {1, 1, 100};
    alb_surface wax = {.name = "wax", .scatters = true};
    for (int c = 0; c < 3; c++)
        wax.profiles[0][c] = one;
    for (int k = 0; k < 3; k++) {
        const alb_box box = {.size_mm = {60, 60, 40}, .cells = {cells[k], cells[k], 8}, .grading = grading[k]};
        world w;
        world_of_box(&w, &box, &wax);
        double(*light)[3] = calloc(w.patches.count, sizeof *light), (*out)[3] = calloc(w.patches.count, sizeof *out);
        for (size_t p = 0; p < w.patches.count; p++)
            light[p][0] = exp(-pow(alb_length(alb_sub(w.patches.centroids[p], (alb_vector){8, 3, 20})) / 6, 2));
        alb_scatter_apply(out, &w.scatter, (const double(*)[3])light);
        // mean radiosity over the middle of the top, within 4 mm
        double sum = 0, area = 0;
        for (size_t p = 0; p < w.patches.count; p++)
            if (alb_length(alb_sub(w.patches.centroids[p], (alb_vector){0, 0, 20})) < 4)
                sum += w.patches.areas_mm2[p] * out[p][0], area += w.patches.areas_mm2[p];
        found[k] = sum / area;
        free(light);
        free(out);
        world_free(&w);
    }
    // the error of the uniform mesh, second order: (coarse - fine) / 3 is that of the fine one; the graded mesh is
    // coarser where the light falls, as coarse as the coarse one: its error and the edge of the averaging disc allow
    // that difference
    check_near(found[2], found[1], fabs(found[0] - found[1]) + 0.01 * found[1]);
    check_near(found[0], found[1], 0.02 * found[1]); // the meshes resolve the light at all
}

// Mean of the profile over the source, seen at the lateral distance, per its area.
static double ring_value(const world *w, const alb_profile *profile, size_t exit, size_t source)
{
    alb_vector t[3], p = w->patches.centroids[exit];
    alb_patch_triangle(t, &w->patches, source);
    p.z = t[0].z;
    return exact_triangle(profile, t, p) / w->patches.areas_mm2[source];
}

// Light on one face of a slab: the other face gets the transmission profile at the lateral distance.
static void faces_of_a_slab_are_told_apart(void **state)
{
    (void)state;
    alb_surface wax = {.name = "wax", .scatters = true, .slab = true};
    for (int c = 0; c < 3; c++) {
        wax.profiles[ALB_REFLECTION][c] = (alb_profile){ALB_FORM_EXPONENTIAL, {0.01, 0.5}};
        wax.profiles[ALB_TRANSMISSION][c] = (alb_profile){ALB_FORM_EXPONENTIAL, {0.002, 0.3}};
    }
    const alb_box slab = {.size_mm = {60, 60, 10}, .cells = {30, 30, 3}, .grading = 1};
    world w;
    world_of_box(&w, &slab, &wax);
    const size_t n = w.patches.count;
    double(*light)[3] = calloc(n, sizeof *light), (*out)[3] = calloc(n, sizeof *out),
    (*across)[3] = calloc(n, sizeof *across);
    size_t lit = 0;
    for (size_t p = 0; p < n; p++) // the patch of the top nearest to the middle
        if (w.patches.normals[p].z > 0.9 && hypot(w.patches.centroids[p].x, w.patches.centroids[p].y) < 1.5)
            lit = p;
    light[lit][0] = 1 / w.patches.areas_mm2[lit]; // flux 1
    alb_scatter_apply(out, &w.scatter, (const double(*)[3])light);
    alb_scatter_apply_across(across, &w.scatter, (const double(*)[3])light);
    double found[ALB_SIDES][4] = {{0}}, expected[ALB_SIDES][4] = {{0}}; // rings of 3 mm
    for (size_t p = 0; p < n; p++) {
        const alb_vector to = alb_sub(w.patches.centroids[p], w.patches.centroids[lit]);
        const double lateral = hypot(to.x, to.y);
        const alb_side side = w.patches.normals[p].z < -0.9 ? ALB_TRANSMISSION : ALB_REFLECTION;
        if (fabs(w.patches.normals[p].z) < 0.9 || lateral >= 12)
            continue;
        found[side][(int)(lateral / 3)] += w.patches.areas_mm2[p] * out[p][0];
        expected[side][(int)(lateral / 3)] += w.patches.areas_mm2[p] * ring_value(&w, &wax.profiles[side][0], p, lit);
        check_near(across[p][0], side == ALB_TRANSMISSION ? out[p][0] : 0, 0);
    }
    for (int side = 0; side < ALB_SIDES; side++)
        for (int ring = 0; ring < 4; ring++) // one patch in a cluster, to second order of its place there
            check_relative(found[side][ring], expected[side][ring], 0.08);
    free(light);
    free(out);
    free(across);
    world_free(&w);
}

// Across the hollow of a U light goes around: a patch of one arm's tip lit, the other arm's tip is as far as the path
// inside. Exact integrals at path lengths by the unfolding, the patch's extent in plain distances.
static void hollows_are_gone_around(void **state)
{
    (void)state;
    alb_error error = {0};
    static const squares shape = {3, 3, {"###", "#.#", "#.#"}};
    alb_surface wax = {.name = "wax", .scatters = true};
    for (int c = 0; c < 3; c++)
        wax.profiles[0][c] = (alb_profile){ALB_FORM_EXPONENTIAL, {0.05, 0.7}};
    world w = {0};
    check_ok(make_squares(&w.mesh, &shape, 8, 1, &error), &error);
    world_of_mesh(&w, &wax);
    assert_true(w.scatter.bodies[0].closed && w.scatter.bodies[0].paths == ALB_OPTICAL_SOLID);
    const size_t n = w.patches.count;
    plane_region region;
    make_region(&region, &shape);
    double(*light)[3] = calloc(n, sizeof *light), (*out)[3] = calloc(n, sizeof *out), exact = 0, found = 0,
    straight = 0;
    for (size_t p = 0; p < n; p++)
        light[p][0] = w.patches.centroids[p].x < 1 && w.patches.centroids[p].y > 2; // the tip of an arm
    alb_scatter_apply(out, &w.scatter, (const double(*)[3])light);
    for (size_t j = 0; j < n; j += 3) {
        const alb_vector to = w.patches.centroids[j];
        if (to.x < 2 || to.y < 2)
            continue;
        found += out[j][0];
        for (size_t i = 0; i < n; i++) {
            const alb_vector from = w.patches.centroids[i];
            if (light[i][0] == 0)
                continue;
            const double a[2] = {from.x, from.y}, b[2] = {to.x, to.y}, rise = to.z - from.z;
            const double area = w.patches.areas_mm2[i], length = hypot(region_distance(&region, &shape, a, b), rise);
            exact += area * alb_profile_value(&wax.profiles[0][0], length);
            straight += area * alb_profile_value(&wax.profiles[0][0], alb_length(alb_sub(to, from)));
        }
    }
    check_relative(found, exact, 0.04); // detours are those of the middle row of eight, and of one patch a cluster
    assert_true(straight > 2 * exact);
    free(light);
    free(out);
    world_free(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(row_sum_of_s_above_one),         cmocka_unit_test(area_grading),
        cmocka_unit_test(faces_of_a_slab_are_told_apart), cmocka_unit_test(hollows_are_gone_around),
        cmocka_unit_test(columns_balance_rows),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
