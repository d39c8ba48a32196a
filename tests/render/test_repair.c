// What is put right before light is traced: faces turned and dropped, parts of patches that lie buried.
#include "base/random.h"
#include "check.h"
#include "render/patch_cull.h"
#include "render/shape.h"

static void make_ball(alb_mesh *mesh, double radius)
{
    alb_error error = {0};
    const alb_sphere sphere = {.radius_mm = radius, .subdivisions = 2};
    check_ok(alb_shape_sphere(mesh, &sphere, &error), &error);
}

static void turn(alb_mesh *mesh, size_t face)
{
    const uint32_t swap = mesh->faces[face][1];
    mesh->faces[face][1] = mesh->faces[face][2];
    mesh->faces[face][2] = swap;
}

// Any minority of turned faces is found and turned back; two balls in one mesh are each their own case.
static void turned_faces_turn_back(void **state)
{
    (void)state;
    for (uint64_t seed = 0; seed < 20; seed++) {
        alb_error error = {0};
        alb_mesh ball = {0}, mesh = {0};
        alb_random random = alb_random_at(61, seed, 0);
        make_ball(&ball, 10);
        check_ok(alb_mesh_append(&mesh, &ball, 1, (alb_vector){0}, &error), &error);
        check_ok(alb_mesh_append(&mesh, &ball, 0.5, (alb_vector){30, 0, 0}, &error), &error);
        const size_t n = ball.face_count;
        uint32_t(*sound)[3] = malloc(2 * n * sizeof *sound);
        memcpy(sound, mesh.faces, 2 * n * sizeof *sound);
        const double share = 0.4 * alb_random_uniform(&random); // of the second; all of the first: it stays as it is
        size_t count = 0;
        for (size_t f = 0; f < n; f++)
            turn(&mesh, f);
        for (size_t f = n; f < 2 * n; f++)
            if (alb_random_uniform(&random) < share) {
                turn(&mesh, f);
                count++;
            }
        check_ok(alb_mesh_repair(&mesh, &error), &error);
        assert_int_equal(mesh.turned, count);
        assert_memory_equal(mesh.faces + n, sound + n, n * sizeof *sound);
        for (size_t f = 0; f < n; f++)
            turn(&mesh, f);
        assert_memory_equal(mesh.faces, sound, n * sizeof *sound);
        free(sound);
        alb_mesh_free(&mesh);
        alb_mesh_free(&ball);
    }
}

// A strip with half a twist has one side: there is nothing to turn towards.
static void moebius_strip_stays(void **state)
{
    (void)state;
    enum { N = 24 };
    alb_error error = {0};
    alb_mesh mesh = {0};
    for (int i = 0; i < N; i++)
        for (int side = -1; side <= 1; side += 2) {
            const double angle = 2 * M_PI * i / N, r = 10 + 2 * side * cos(angle / 2);
            check_ok(alb_mesh_add_vertex(&mesh, (alb_vector){r * cos(angle), r * sin(angle), 2 * side * sin(angle / 2)},
                                         &error),
                     &error);
        }
    for (uint32_t i = 0; i < N; i++) {
        const bool last = i == N - 1;
        const uint32_t a = 2 * i, b = a + 1, c = last ? 1 : a + 2, d = last ? 0 : a + 3;
        check_ok(alb_mesh_add_face(&mesh, a, c, b, 0, &error), &error);
        check_ok(alb_mesh_add_face(&mesh, b, c, d, 0, &error), &error);
    }
    check_ok(alb_mesh_repair(&mesh, &error), &error);
    assert_int_equal(mesh.turned, 0);
    assert_int_equal(mesh.face_count, 2 * N);
    alb_mesh_free(&mesh);
}

// Faces of another object at the same place are dropped; its vertices stay apart, and so do faces turned the other way.
static void duplicates_of_other_objects_go(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_mesh ball = {0}, mesh = {0};
    make_ball(&ball, 10);
    const size_t n = ball.face_count;
    for (int k = 0; k < 2; k++)
        check_ok(alb_mesh_append(&mesh, &ball, 1, (alb_vector){0}, &error), &error);
    for (size_t f = n; f < n + 7; f++)
        turn(&mesh, f);
    check_ok(alb_mesh_repair(&mesh, &error), &error);
    assert_int_equal(mesh.dropped, n - 7);
    assert_int_equal(mesh.face_count, n + 7);
    assert_int_equal(mesh.vertex_count, 2 * ball.vertex_count);
    alb_mesh_free(&mesh);
    alb_mesh_free(&ball);
}

// The 64 cells of a triangle have one area each and tile it; points fall into the cells that lie free alone.
static void cells_tile_the_patch(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_mesh ball = {0};
    alb_patches patches;
    make_ball(&ball, 10);
    check_ok(alb_patches_create(&patches, &ball, &error), &error);
    uint64_t *cells = malloc(patches.count * sizeof *cells);
    for (size_t p = 0; p < patches.count; p += 37) {
        alb_vector sum = {0};
        for (int cell = 0; cell < 64; cell++) {
            alb_vector t[3];
            alb_patch_cell(t, &patches, p, cell);
            const alb_vector cross = alb_cross(alb_sub(t[1], t[0]), alb_sub(t[2], t[0]));
            check_relative(0.5 * alb_length(cross), patches.areas_mm2[p] / 64, 1e-9);
            assert_true(alb_dot(cross, patches.normals[p]) > 0);
            sum = alb_add(sum, alb_times(1.0 / 192, alb_add(t[0], alb_add(t[1], t[2]))));
        }
        check_near(alb_length(alb_sub(sum, patches.centroids[p])), 0, 1e-12); // the middle of the whole
        for (int cell = 0; cell < 64; cell++) {
            alb_random random = alb_random_at(62, p, (uint64_t)cell);
            alb_vector t[3];
            for (size_t q = 0; q < patches.count; q++)
                cells[q] = (uint64_t)1 << cell;
            patches.free_cells = cells;
            alb_patch_cell(t, &patches, p, cell);
            for (int k = 0; k < 10; k++) {
                const double u = alb_random_uniform(&random), v = alb_random_uniform(&random);
                const alb_vector at = alb_patch_point(&patches, p, u, v);
                for (int e = 0; e < 3; e++) { // on the inner side of each edge
                    const alb_vector edge = alb_sub(t[(e + 1) % 3], t[e]);
                    assert_true(alb_dot(alb_cross(edge, alb_sub(at, t[e])), patches.normals[p]) > -1e-9);
                }
            }
            patches.free_cells = NULL;
        }
    }
    free(cells);
    alb_patches_free(&patches);
    alb_mesh_free(&ball);
}

typedef struct world {
    alb_mesh mesh;
    alb_patches patches;
    alb_tracer tracer;
} world;

static void make_world(world *w, bool room, alb_vector block_at, double block_turn)
{
    alb_error error = {0};
    alb_mesh part = {0};
    const alb_box walls = {.size_mm = {100, 100, 100}, .cells = {5, 5, 5}, .grading = 1, .inward = true};
    const alb_box block = {.size_mm = {30, 30, 30}, .cells = {3, 3, 3}, .grading = 1};
    *w = (world){0};
    if (room) {
        check_ok(alb_shape_box(&part, &walls, &error), &error);
        check_ok(alb_mesh_append(&w->mesh, &part, 1, (alb_vector){0}, &error), &error);
        alb_mesh_free(&part);
    }
    check_ok(alb_shape_box(&part, &block, &error), &error);
    for (size_t i = 0; i < part.vertex_count; i++) {
        const alb_vector v = part.vertices[i];
        part.vertices[i] = (alb_vector){cos(block_turn) * v.x - sin(block_turn) * v.y,
                                        sin(block_turn) * v.x + cos(block_turn) * v.y, v.z};
    }
    check_ok(alb_mesh_append(&w->mesh, &part, 1, block_at, &error), &error);
    alb_mesh_free(&part);
    check_ok(alb_patches_create(&w->patches, &w->mesh, &error), &error);
    check_ok(alb_tracer_create(&w->tracer, &w->mesh, &error), &error);
    check_ok(alb_patches_cull(&w->patches, &w->tracer, &error), &error);
}

static void free_world(world *w)
{
    alb_tracer_free(&w->tracer);
    alb_patches_free(&w->patches);
    alb_mesh_free(&w->mesh);
}

static void crossings_count_what_lies_around(void **state)
{
    (void)state;
    world w;
    const alb_vector places[4] = {{-30, 20, 10}, {1, 2, 3}, {300, 20, 10}, {-30, 20, 300}};
    const int levels[4] = {1, 0, 0, 0}; // in the room, in the block in it, outside
    make_world(&w, true, (alb_vector){0}, 0.4);
    for (int k = 0; k < 4; k++)
        for (int d = 0; d < 100; d++) {
            alb_random random = alb_random_at(63, (uint64_t)k, (uint64_t)d);
            const alb_vector direction = alb_unit(
                (alb_vector){alb_random_normal(&random), alb_random_normal(&random), alb_random_normal(&random)});
            assert_int_equal(alb_tracer_crossings(&w.tracer, places[k], direction), levels[k]);
        }
    free_world(&w);
}

// Sound scenes are left alone; of a block through the floor what is above stays, to within the cells that the floor
// cuts, 1/8 of a patch of 10 mm, and the traces of what is buried.
static void buried_area_is_culled(void **state)
{
    (void)state;
    for (int room = 0; room < 2; room++) {
        world w;
        make_world(&w, room, (alb_vector){3, 2, -20}, 0.4);
        assert_int_equal(w.patches.culled, 0);
        assert_null(w.patches.free_cells);
        free_world(&w);
    }
    for (int k = 0; k < 6; k++) {
        const double above = 28 - 4.1 * k; // mm of the block's 30
        world w;
        make_world(&w, true, (alb_vector){3, 2, -50 + above - 15}, 0.4 + 0.3 * k);
        double sides = 0, top = 0, bottom = 0, floor = 0;
        for (size_t p = 0; p < w.patches.count; p++) {
            const bool of_block = p >= w.patches.count - 108;
            const double up = w.patches.normals[p].z, area = w.patches.areas_mm2[p];
            *(of_block                           ? up > 0.5    ? &top
                                                   : up < -0.5 ? &bottom
                                                               : &sides
              : w.patches.centroids[p].z < -49.9 ? &floor
                                                 : &(double){0}) += area;
        }
        check_near(top, 900, 1e-6);
        check_near(bottom, 0, 1e-3);
        assert_true(sides <= 120 * above + 1e-3 && sides >= 120 * (above - 1.3));
        // the floor under the block, and along its outline the cells of 2.5 mm that it cuts
        assert_true(floor <= 1e4 - 900 + 1e-3 && floor >= 1e4 - 900 - 120 * 2.5 * sqrt(2) - 60);
        free_world(&w);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(turned_faces_turn_back),           cmocka_unit_test(moebius_strip_stays),
        cmocka_unit_test(duplicates_of_other_objects_go),   cmocka_unit_test(cells_tile_the_patch),
        cmocka_unit_test(crossings_count_what_lies_around), cmocka_unit_test(buried_area_is_culled),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
