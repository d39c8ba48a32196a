// What neighbours' rays have in common: laws, and that it errs less than the rows alone.
#include "convex_room.h"

typedef double rgb[3];

static double uniform(uint64_t stream, uint64_t index)
{
    alb_random random = alb_random_at(83, stream, index);
    return alb_random_uniform(&random);
}

// A ball over the floor of a room whose patches are graded.
static void room_with_ball_create(world *w, int cells)
{
    alb_error error = {0};
    alb_mesh ball = {0};
    const alb_box room = {
        .centre_mm = {2, 2, 2}, .size_mm = {4, 4, 4}, .cells = {cells, cells, cells}, .grading = 1.05, .inward = true};
    const alb_sphere sphere = {.centre_mm = {1.6, 2.3, 1}, .radius_mm = 0.8, .subdivisions = 3};
    *w = (world){0};
    check_ok(alb_shape_box(&w->mesh, &room, &error), &error);
    check_ok(alb_shape_sphere(&ball, &sphere, &error), &error);
    check_ok(alb_mesh_append(&w->mesh, &ball, 1, (alb_vector){0}, &error), &error);
    alb_mesh_free(&ball);
    world_of(w);
}

// What is even stays even, to the bit; fluxes stay within rounding to single precision; signs stay.
static void sharing_keeps_constants_and_fluxes(void **state)
{
    (void)state;
    world w;
    alb_form_factors f;
    room_with_ball_create(&w, 16);
    cast(&f, &w, 64, 1);
    const size_t n = w.patches.count;
    rgb *x = calloc(n, sizeof *x);
    double before = 0, after = 0;
    size_t changed = 0;
    for (size_t p = 0; p < n; p++) {
        x[p][0] = 0.75, x[p][1] = uniform(1, p), x[p][2] = uniform(2, p) < 0.01;
        before += w.patches.areas_mm2[p] * x[p][1];
    }
    alb_form_factors_share(x, &f);
    for (size_t p = 0; p < n; p++) {
        check_near(x[p][0], 0.75, 0);
        assert_true(x[p][2] >= 0);
        after += w.patches.areas_mm2[p] * x[p][1];
        changed += fabs(x[p][1] - uniform(1, p)) > 1e-3;
    }
    check_relative(after, before, 1e-6);
    assert_true(changed > n / 4); // most of them share
    free(x);
    alb_form_factors_free(&f);
    world_free(&w);
}

// Across the edges of a box, seen from outside with nothing near, nothing is shared: each side sees what the other does
// not.
static void bends_are_not_shared_across(void **state)
{
    (void)state;
    const alb_box box = {.size_mm = {1, 1, 1}, .cells = {8, 8, 8}, .grading = 1};
    alb_error error = {0};
    world w;
    alb_form_factors f;
    world_of_box(&w, &box);
    check_ok(alb_mesh_weld(&w.mesh, &error), &error); // sides joined along their edges
    cast(&f, &w, 64, 1);
    rgb *x = calloc(w.patches.count, sizeof *x);
    for (size_t p = 0; p < w.patches.count; p++)
        x[p][0] = w.patches.normals[p].z > 0.5;
    alb_form_factors_share(x, &f);
    for (size_t p = 0; p < w.patches.count; p++)
        check_near(x[p][0], w.patches.normals[p].z > 0.5, 0);
    free(x);
    alb_form_factors_free(&f);
    world_free(&w);
}

// A small bright spot away from everything and smooth light, against 2,048 rays of other random numbers, which err
// a tenth as much. Twice four independent rows in common would err a third as much, but not all share
// all.
static void shared_rows_err_less(void **state)
{
    (void)state;
    world w;
    alb_form_factors f, fine;
    room_with_ball_create(&w, 26);
    const size_t n = w.patches.count;
    rgb *radiosity = calloc(n, sizeof *radiosity), *truth = calloc(n, sizeof *truth), *found = calloc(n, sizeof *found);
    for (size_t p = 0; p < n; p++) {
        const alb_vector c = w.patches.centroids[p];
        radiosity[p][0] = 0.5 + 0.5 * sin(2 * c.x) * cos(1.5 * c.y + c.z);
        radiosity[p][1] = c.z == 0 && hypot(c.x - 3, c.y - 1) < 0.85;
    }
    cast(&fine, &w, 2048, 9);
    alb_form_factors_apply_rows(truth, &fine, (const rgb *)radiosity);
    alb_form_factors_free(&fine);
    cast(&f, &w, 64, 1);
    for (int c = 0; c < 2; c++) {
        double off[2] = {0};
        for (int way = 0; way < 2; way++) {
            (way ? alb_form_factors_apply : alb_form_factors_apply_rows)(found, &f, (const rgb *)radiosity);
            for (size_t p = 0; p < n; p++)
                off[way] += pow(found[p][c] - truth[p][c], 2);
        }
        check_below(sqrt(off[1]), 0.7 * sqrt(off[0]));
    }
    free(radiosity);
    free(truth);
    free(found);
    alb_form_factors_free(&f);
    world_free(&w);
}

// Share of the cosine-weighted directions within a cap of half angle `half` whose axis leans by `lean` from the normal,
// all above the plane: sin^2(half) cos(lean), exact. Rows of all phases, together, against as many turned at random.
static void phases_together_are_one_finer_lattice(void **state)
{
    (void)state;
    enum { CAPS = 400, RAYS = 256 };
    world w;
    uint8_t phases[ALB_RAY_PHASES];
    double squares[2] = {0};
    room_with_ball_create(&w, 16);
    for (int k = 0; k < ALB_RAY_PHASES; k++)
        phases[k] = (uint8_t)k;
    for (uint64_t cap = 0; cap < CAPS; cap++) {
        const double half = 0.1 + 0.3 * uniform(3, cap), lean = (M_PI / 2 - half) * uniform(4, cap),
                     turn = 2 * M_PI * uniform(5, cap), truth = pow(sin(half), 2) * cos(lean);
        alb_vector t, b;
        const alb_vector n = w.patches.normals[0];
        alb_tangents(&t, &b, n);
        const alb_vector axis = alb_add(
            alb_times(cos(lean), n), alb_add(alb_times(sin(lean) * cos(turn), t), alb_times(sin(lean) * sin(turn), b)));
        for (int way = 0; way < 2; way++) {
            const alb_ray_pattern pattern = {RAYS, cap, ALB_SAMPLING_LATTICE, way ? phases : NULL};
            int inside = 0;
            for (size_t p = 0; p < ALB_RAY_PHASES; p++)
                for (int q = 0; q < RAYS; q++)
                    inside += alb_dot(alb_ray_direction(&pattern, &w.patches, p, q), axis) > cos(half);
            squares[way] += pow(inside / (double)(RAYS * ALB_RAY_PHASES) / truth - 1, 2);
        }
    }
    check_below(sqrt(squares[1] / squares[0]), 0.8); // found: 0.61
    world_free(&w);
}

// No patch has the phase of one across an edge, and few that of a neighbour's neighbour.
static void neighbours_differ_in_phase(void **state)
{
    (void)state;
    world w;
    alb_row_shares shares;
    alb_error error = {0};
    size_t pairs = 0, alike = 0;
    room_with_ball_create(&w, 16);
    uint8_t *phases = calloc(w.patches.count, 1);
    check_ok(alb_row_shares_create(&shares, &w.patches, &error), &error);
    alb_row_shares_phases(phases, &shares);
    for (size_t p = 0; p < w.patches.count; p++)
        for (int i = 0; i < 9; i++) {
            const uint32_t near = shares.neighbours[p][i / 3], next = shares.neighbours[near][i % 3];
            assert_true(near == p || phases[near] != phases[p]);
            pairs += next != p && next != near && near != p;
            alike += next != p && next != near && near != p && phases[next] == phases[p];
        }
    assert_true(pairs > w.patches.count);
    check_below((double)alike, 0.05 * (double)pairs);
    alb_row_shares_free(&shares);
    free(phases);
    world_free(&w);
}

// One list for a group: of one patch, as long as its row, it is that row; of many and very long, what it gathers is the
// mean over the group's area of what their rows do. Each of GROUP * RAYS hits is then there once more or less than its
// share of LENGTH says, at most.
static void a_group_gathers_the_mean_over_its_area(void **state)
{
    (void)state;
    enum { RAYS = 64, GROUP = 6, LENGTH = 200000 };
    world w;
    alb_form_factors f;
    room_with_ball_create(&w, 6);
    cast(&f, &w, RAYS, 1);
    const size_t n = w.patches.count;
    uint32_t *list = calloc(LENGTH, sizeof *list), row[RAYS], scratch[RAYS];
    for (uint64_t trial = 0; trial < 40; trial++) {
        uint32_t group[GROUP];
        const size_t count = 1 + trial % GROUP;
        double area = 0, wanted = 0, found = 0;
        for (size_t i = 0; i < count; i++) {
            group[i] = (uint32_t)(uniform(3 + trial, i) * (double)n);
            alb_form_factors_row(row, &f, group[i]);
            for (int q = 0; q < RAYS; q++)
                wanted += w.patches.areas_mm2[group[i]] * uniform(2, row[q]) / RAYS;
            area += w.patches.areas_mm2[group[i]];
        }
        alb_form_factors_group_row(list, LENGTH, &f, group, count, scratch);
        for (size_t q = 0; q < LENGTH; q++)
            found += uniform(2, list[q]) / LENGTH;
        check_near(found, wanted / area, (double)(count * RAYS) / LENGTH);
        alb_form_factors_row(row, &f, group[0]);
        alb_form_factors_group_row(list, RAYS, &f, group, 1, scratch);
        assert_memory_equal(list, row, sizeof row);
    }
    free(list);
    alb_form_factors_free(&f);
    world_free(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sharing_keeps_constants_and_fluxes),
        cmocka_unit_test(bends_are_not_shared_across),
        cmocka_unit_test(shared_rows_err_less),
        cmocka_unit_test(phases_together_are_one_finer_lattice),
        cmocka_unit_test(neighbours_differ_in_phase),
        cmocka_unit_test(a_group_gathers_the_mean_over_its_area),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
