// Form factors against closed forms and laws.
#include "convex_room.h"
#include <omp.h>

// Area-weighted share of the rays from the face with normal `from` that meet the face with normal `to`.
static double share(const world *w, const alb_form_factors *f, alb_vector from, alb_vector to)
{
    double area = 0, sum = 0;
    uint32_t hits[256];
    for (size_t p = 0; p < w->patches.count; p++) {
        if (alb_dot(w->patches.normals[p], from) < 0.9)
            continue;
        area += w->patches.areas_mm2[p];
        alb_form_factors_row(hits, f, p);
        for (int q = 0; q < f->rays; q++) {
            const uint32_t hit = hits[q];
            if (hit < w->patches.count && alb_dot(w->patches.normals[hit], to) > 0.9)
                sum += w->patches.areas_mm2[p] / f->rays;
        }
    }
    return sum / area;
}

// Opposite and adjacent faces of rooms: configuration C-11 and C-14 of Howell's catalogue. The sampling error is taken
// from the scatter over ten seeds; four of its standard errors.
static void rooms_match_closed_forms(void **state)
{
    (void)state;
    const struct {
        alb_vector size;
        double opposite, adjacent; // floor to ceiling, floor to the wall of normal x
    } rooms[] = {{{1, 1, 1}, 0.199824895698, 0.200043776075},
                 {{1, 1, 10}, 0.003162056839, NAN},
                 {{2, 1, 1}, 0.285875384851, 0.116426301398}};
    for (size_t r = 0; r < 3; r++) {
        const alb_box box = {.size_mm = rooms[r].size, .cells = {6, 6, 6}, .grading = 1, .inward = true};
        world w;
        world_of_box(&w, &box);
        double sum[2] = {0}, squares[2] = {0};
        for (uint64_t seed = 0; seed < 10; seed++) {
            alb_error error = {0};
            alb_form_factors f;
            check_ok(alb_form_factors_create(&f, &w.patches, &w.tracer, 256, seed, ALB_SAMPLING_LATTICE, &error),
                     &error);
            assert_int_equal(f.sky_rays, 0);
            assert_int_equal(f.back_rays, 0);
            const double found[2] = {share(&w, &f, (alb_vector){0, 0, 1}, (alb_vector){0, 0, -1}),
                                     share(&w, &f, (alb_vector){0, 0, 1}, (alb_vector){1, 0, 0})};
            for (int k = 0; k < 2; k++)
                sum[k] += found[k], squares[k] += found[k] * found[k];
            alb_form_factors_free(&f);
        }
        const double truth[2] = {rooms[r].opposite, rooms[r].adjacent};
        for (int k = 0; k < 2; k++) {
            const double mean = sum[k] / 10, error_of_mean = sqrt(fmax(0, squares[k] / 10 - mean * mean) / 9);
            if (isfinite(truth[k]))
                check_near(mean, truth[k], 4 * error_of_mean);
            check_below(error_of_mean, 2e-3); // the check above has teeth
        }
        world_free(&w);
    }
}

// A closed room: every row sums to 1, so even radiosity comes back as the same irradiance, exactly.
static void closed_rows_sum_to_one(void **state)
{
    (void)state;
    const alb_box box = {.size_mm = {3, 2, 1}, .cells = {5, 4, 3}, .grading = 4, .inward = true};
    alb_error error = {0};
    world w;
    alb_form_factors f;
    world_of_box(&w, &box);
    check_ok(alb_form_factors_create(&f, &w.patches, &w.tracer, 64, 3, ALB_SAMPLING_LATTICE, &error), &error);
    double(*one)[3] = calloc(w.patches.count, sizeof *one), (*out)[3] = calloc(w.patches.count, sizeof *out);
    for (size_t p = 0; p < w.patches.count; p++)
        one[p][0] = one[p][1] = one[p][2] = 0.75;
    alb_form_factors_apply(out, &f, (const double(*)[3])one);
    for (size_t p = 0; p < w.patches.count; p++)
        check_near(out[p][p % 3], 0.75, 0);
    free(one);
    free(out);
    alb_form_factors_free(&f);
    world_free(&w);
}

// A convex body sees only the sky; the same box turned inside out, seen from a patch outside, shows its backs.
static void sky_and_backs_are_told_apart(void **state)
{
    (void)state;
    const alb_box box = {.size_mm = {1, 1, 1}, .cells = {3, 3, 3}, .grading = 1};
    const alb_box inward = {
        .size_mm = {1, 1, 1}, .centre_mm = {0, 0, 3}, .cells = {1, 1, 1}, .grading = 1, .inward = true};
    alb_error error = {0};
    alb_mesh other = {0};
    world w;
    alb_form_factors f;
    world_of_box(&w, &box);
    check_ok(alb_form_factors_create(&f, &w.patches, &w.tracer, 64, 3, ALB_SAMPLING_LATTICE, &error), &error);
    assert_int_equal(f.sky_rays, 64 * w.patches.count);
    assert_int_equal(f.rows.segments[f.rows.chunks * f.rows.blocks], 0); // the sky's hits are counted, not kept
    alb_form_factors_free(&f);
    check_ok(alb_shape_box(&other, &inward, &error), &error);
    check_ok(alb_mesh_append(&w.mesh, &other, 1, (alb_vector){0}, &error), &error);
    alb_mesh_free(&other);
    alb_tracer_free(&w.tracer);
    alb_patches_free(&w.patches);
    check_ok(alb_patches_create(&w.patches, &w.mesh, &error), &error);
    check_ok(alb_tracer_create(&w.tracer, &w.mesh, &error), &error);
    check_ok(alb_form_factors_create(&f, &w.patches, &w.tracer, 64, 3, ALB_SAMPLING_LATTICE, &error), &error);
    assert_true(f.back_rays > 0);
    for (size_t p = 0; p < w.patches.count; p++) { // nobody sees a front: the room's face inwards, the cube's turn away
        uint32_t hits[64];
        alb_form_factors_row(hits, &f, p);
        for (size_t q = 0; q < 64; q++)
            assert_true(hits[q] >= w.patches.count || w.mesh.faces[p][0] >= w.mesh.faces[108][0] - 8);
    }
    alb_form_factors_free(&f);
    world_free(&w);
}

// One thread or two, rows in memory or in a file: the same bytes.
static void threads_and_files_do_not_matter(void **state)
{
    (void)state;
    enum { KINDS = 3, BYTE = 1 };
    const alb_box box = {.size_mm = {3, 2, 1}, .cells = {7, 6, 5}, .grading = 4, .inward = true};
    world w;
    world_of_box(&w, &box);
    const size_t n = w.patches.count;
    double(*out[KINDS])[3], (*light)[3] = calloc(n, sizeof *light);
    random_radiosity(light, &w, 3, 1);
    for (int k = 0; k < KINDS; k++) {
        alb_form_factors f;
        alb_error error = {0};
        omp_set_num_threads(k ? 2 : 1);
        check_ok(alb_form_factors_create_within(&f, &w.patches, &w.tracer, 64, 3, ALB_SAMPLING_LATTICE,
                                                k == 2 ? BYTE : 0, &error),
                 &error);
        assert_true((f.rows.mapped_bytes > 0) == (k == 2));
        out[k] = calloc(n, sizeof *out[k]);
        alb_form_factors_apply(out[k], &f, (const double(*)[3])light);
        assert_memory_equal(out[k], out[0], n * sizeof *out[k]);
        alb_form_factors_free(&f);
    }
    for (int k = 0; k < KINDS; k++)
        free(out[k]);
    free(light);
    world_free(&w);
}

static const alb_box hall = {.size_mm = {4, 2, 3}, .cells = {8, 5, 6}, .grading = 3, .inward = true};

// A_i F_ij = A_j F_ji between walls, to the scatter over seeds: rays hold it only statistically.
static void reciprocity_holds_statistically(void **state)
{
    (void)state;
    enum { SEEDS = 10 };
    world w;
    double sum = 0, squares = 0;
    const alb_vector up = {0, 0, 1}, across = {1, 0, 0};
    world_of_box(&w, &hall);
    for (uint64_t seed = 0; seed < SEEDS; seed++) {
        alb_form_factors f;
        cast(&f, &w, 256, seed);
        const double apart = 4.0 * 2 * share(&w, &f, up, across) - 2.0 * 3 * share(&w, &f, across, up);
        sum += apart;
        squares += apart * apart;
        alb_form_factors_free(&f);
    }
    const double mean = sum / SEEDS, error_of_mean = sqrt(fmax(0, squares / SEEDS - mean * mean) / (SEEDS - 1));
    check_near(mean, 0, 4 * error_of_mean);
    check_below(error_of_mean, 5e-3); // of 1.7: the check above has teeth
    world_free(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rooms_match_closed_forms),        cmocka_unit_test(closed_rows_sum_to_one),
        cmocka_unit_test(sky_and_backs_are_told_apart),    cmocka_unit_test(threads_and_files_do_not_matter),
        cmocka_unit_test(reciprocity_holds_statistically),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
