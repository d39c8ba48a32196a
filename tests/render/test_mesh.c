// Meshes: readers against good and hostile input, welding, subdivision, generated shapes.
#include "check.h"
#include "render/patch.h"
#include "render/shape.h"
#include <dirent.h>

static bool parse(alb_mesh *mesh, const char *text, alb_error *error)
{
    return strncmp(text, "ply", 3) ? alb_mesh_parse_obj(mesh, "text", text, strlen(text), error)
                                   : alb_mesh_parse_ply(mesh, "text", text, strlen(text), error);
}

static double total_area(const alb_mesh *mesh)
{
    alb_error error = {0};
    alb_patches patches;
    check_ok(alb_patches_create(&patches, mesh, &error), &error);
    double area = 0;
    for (size_t i = 0; i < patches.count; i++)
        area += patches.areas_mm2[i];
    alb_patches_free(&patches);
    return area;
}

static void reads_obj(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_mesh mesh = {0};
    check_ok(parse(&mesh,
                   "# a comment\r\nmtllib a.mtl\nv 0 0 0\nv 2 0 0 1.0\nv 2 2 0\nv 0\t2 0 # tail\nusemtl one\n"
                   "f 1/1/1 2//2 3 \\\n 4\nusemtl two\nf -4 -2 -1\nf 1 1 2\n",
                   &error),
             &error);
    assert_int_equal(mesh.vertex_count, 4);
    assert_int_equal(mesh.face_count, 3);
    assert_int_equal(mesh.dropped, 1);
    assert_int_equal(mesh.group_count, 2);
    assert_string_equal(mesh.group_names[mesh.groups[1]], "one");
    assert_string_equal(mesh.group_names[mesh.groups[2]], "two");
    assert_int_equal(mesh.faces[1][1], 2);
    assert_int_equal(mesh.faces[2][2], 3);
    check_near(total_area(&mesh), 6, 1e-12);
    alb_mesh_free(&mesh);
}

static void refuses_bad_text(void **state)
{
    (void)state;
    static const char *const cases[][2] = {
        {"", "no face"},
        {"v 0 0 0\n", "no face"},
        {"v 0 0\n", "three numbers"},
        {"v 0 0 nan\n", "usable"},
        {"v 0 0 1e999\n", "usable"},
        {"v 0 0 0\nf 1 2 3\n", "not there"},
        {"v 0 0 0\nf 0 1 1\n", "not there"},
        {"v 0 0 0\nf -2 1 1\n", "not there"},
        {"v 0 0 0\nf 1 1\n", "three corners"},
        {"v 0 0 0\nf 99999999999999999999999 1 1\n", "not there"},
        {"v 0 0 0\nf 1 1 1x\n", "form"},
        {"hello\n", "not a statement"},
        {"ply\nformat ascii 1.0\n", "end_header"},
        {"ply\nformat ascii 2.0\nend_header\n", "unknown format"},
        {"ply\nformat ascii 1.0\nelement vertex 1\nend_header\n0\n", "without properties"},
        {"ply\nformat ascii 1.0\nelement vertex 99999999\nproperty float x\nend_header\n0\n", "promises"},
        {"ply\nformat ascii 1.0\nelement vertex -1\nproperty float x\nend_header\n0\n", "count"},
        {"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n", "needs vertex"},
        {"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nelement face "
         "1\n"
         "property list uchar int vertex_indices\nend_header\n0 0 0\n3 0 0 7\n",
         "refers to vertex"},
        {"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nelement face "
         "1\n"
         "property list uchar int vertex_indices\nend_header\n0 0 0\n300 0 0 0\n",
         "does not fit"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        alb_error error = {0};
        alb_mesh mesh = {0};
        check_fails(parse(&mesh, cases[i][0], &error), &error, ALB_BAD_DATA, cases[i][1]);
        assert_null(mesh.vertices);
    }
}

// The same triangle in three formats.
static void reads_ply_of_either_order(void **state)
{
    (void)state;
    static const char *const header =
        "ply\nformat %s 1.0\ncomment c\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nproperty uchar quality\nelement face 1\nproperty list uchar int vertex_index\n"
        "end_header\n";
    static const char little[] = "\0\0\0\0\0\0\0\0\0\0\0\0\1\0\0\200\77\0\0\0\0\0\0\0\0\2\0\0\0\0\0\0\200\77\0\0\0\0\3"
                                 "\3\0\0\0\0\1\0\0\0\2\0\0\0";
    static const char big[] = "\0\0\0\0\0\0\0\0\0\0\0\0\1\77\200\0\0\0\0\0\0\0\0\0\0\2\0\0\0\0\77\200\0\0\0\0\0\0\3\3\0"
                              "\0\0\0\0\0\0\1\0\0\0\2";
    static const char ascii[] = "0 0 0 1\n1 0 0 2\n0 1 0 3\n3 0 1 2\n";
    const struct {
        const char *format, *data;
        size_t size;
    } cases[] = {{"ascii", ascii, sizeof ascii - 1},
                 {"binary_little_endian", little, sizeof little - 1},
                 {"binary_big_endian", big, sizeof big - 1}};
    for (size_t i = 0; i < 3; i++) {
        char bytes[512];
        alb_error error = {0};
        alb_mesh mesh = {0};
        const size_t length = (size_t)snprintf(bytes, sizeof bytes, header, cases[i].format);
        memcpy(bytes + length, cases[i].data, cases[i].size);
        bytes[length + cases[i].size] = 0;
        check_ok(alb_mesh_parse_ply(&mesh, "bytes", bytes, length + cases[i].size, &error), &error);
        assert_int_equal(mesh.face_count, 1);
        check_near(total_area(&mesh), 0.5, 0);
        alb_mesh_free(&mesh);
        for (size_t cut = 1; cut < length + cases[i].size - (i == 0);
             cut++) { // an ascii file may lack its last newline
            char *part = malloc(cut + 1);
            memcpy(part, bytes, cut);
            part[cut] = 0;
            if (alb_mesh_parse_ply(&mesh, "cut", part, cut, &error) || error.status != ALB_BAD_DATA)
                fail_msg("format %s cut to %zu bytes was accepted", cases[i].format, cut);
            error = (alb_error){0};
            free(part);
        }
    }
}

static void writes_what_it_reads(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_mesh mesh = {0}, again = {0};
    const alb_sphere sphere = {.radius_mm = 3, .centre_mm = {1e6, 0, 0}, .subdivisions = 2};
    check_ok(alb_shape_sphere(&mesh, &sphere, &error), &error);
    float(*rgb)[3] = calloc(mesh.face_count, sizeof *rgb);
    check_ok(alb_mesh_write_ply(&mesh, (const float(*)[3])rgb, "a comment", "test_mesh.ply", &error), &error);
    check_ok(alb_mesh_read(&again, "test_mesh.ply", &error), &error);
    assert_int_equal(again.face_count, mesh.face_count);
    assert_memory_equal(again.faces, mesh.faces, mesh.face_count * sizeof *mesh.faces);
    assert_int_equal(again.vertex_count, mesh.vertex_count);
    assert_memory_equal(again.vertices, mesh.vertices, mesh.vertex_count * sizeof *mesh.vertices);
    free(rgb);
    remove("test_mesh.ply");
    alb_mesh_free(&mesh);
    alb_mesh_free(&again);
}

static alb_body body_of(const alb_mesh *mesh, size_t *count)
{
    alb_error error = {0};
    alb_patches patches;
    alb_bodies bodies;
    check_ok(alb_patches_create(&patches, mesh, &error), &error);
    int *labels = calloc(mesh->face_count, sizeof *labels);
    check_ok(alb_bodies_find(&bodies, &patches, labels, &error), &error);
    alb_body first = bodies.bodies[0];
    *count = bodies.count;
    free(labels);
    alb_bodies_free(&bodies);
    alb_patches_free(&patches);
    return first;
}

static void shapes_are_closed(void **state)
{
    (void)state;
    for (int inward = 0; inward < 2; inward++) {
        alb_error error = {0};
        alb_mesh box = {0}, ball = {0};
        size_t count;
        const alb_box a = {
            .centre_mm = {1, 2, 3}, .size_mm = {4, 5, 6}, .cells = {5, 4, 3}, .grading = 10, .inward = inward};
        const alb_sphere b = {.radius_mm = 2, .subdivisions = 4, .inward = inward};
        check_ok(alb_shape_box(&box, &a, &error), &error);
        check_ok(alb_shape_sphere(&ball, &b, &error), &error);
        check_near(total_area(&box), 2 * (20 + 30 + 24), 1e-10);
        assert_int_equal(ball.face_count, 20 * 256);
        // inscribed: area is below the sphere's by about (edge / radius)^2 / 4, edge = 2 * 1.05 / 16
        check_near(total_area(&ball) / (16 * M_PI), 1, 0.005);
        const alb_body box_body = body_of(&box, &count);
        assert_true(box_body.closed && box_body.convex == !inward && count == 1);
        const alb_body ball_body = body_of(&ball, &count);
        assert_true(ball_body.closed && ball_body.convex == !inward && count == 1);
        alb_mesh_free(&box);
        alb_mesh_free(&ball);
    }
}

// Subdivision leaves area, closedness and one body, whatever the edges' lengths; duplicates go in welding.
static void subdivision_and_welding_keep_the_body(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_mesh box = {0}, twice = {0};
    size_t count;
    const alb_box a = {.size_mm = {40, 5, 1}, .cells = {1, 1, 1}, .grading = 1};
    check_ok(alb_shape_box(&box, &a, &error), &error);
    const double area = total_area(&box);
    check_ok(alb_mesh_subdivide(&box, 1.3, &error), &error);
    check_relative(total_area(&box), area, 1e-12);
    for (size_t f = 0; f < box.face_count; f++)
        for (int k = 0; k < 3; k++)
            check_below(alb_length(alb_sub(box.vertices[box.faces[f][k]], box.vertices[box.faces[f][(k + 1) % 3]])),
                        1.3 + 1e-9);
    const alb_body body = body_of(&box, &count);
    assert_true(body.closed && body.convex && count == 1);
    for (int i = 0; i < 2; i++)
        check_ok(alb_mesh_append(&twice, &box, 1, (alb_vector){0}, &error), &error);
    check_ok(alb_mesh_weld(&twice, &error), &error);
    assert_int_equal(twice.face_count, box.face_count);
    assert_int_equal(twice.vertex_count, box.vertex_count);
    assert_int_equal(twice.dropped, box.face_count);
    check_fails(alb_mesh_subdivide(&box, 1e-6, &error), &error, ALB_BAD_DATA, "longer");
    alb_mesh_free(&box);
    alb_mesh_free(&twice);
}

// What each file of the collection must do; those not named here must be refused as bad data.
static bool is_valid(const char *name)
{
    static const char *const accepted[] = {"crlf_tabs_valid.obj", "missing_mtllib.obj", "face_repeated_vertex.obj",
                                           "long_line.obj"};
    for (size_t i = 0; i < sizeof accepted / sizeof *accepted; i++)
        if (!strcmp(name, accepted[i]))
            return true;
    return false;
}

static void survives_hostile_files(void **state)
{
    (void)state;
    int files = 0;
    for (int kind = 0; kind < 2; kind++) {
        char folder[4096];
        snprintf(folder, sizeof folder, "%s/bad_input/%s", ALB_SHARED_DATA, kind ? "ply" : "obj");
        DIR *directory = opendir(folder);
        if (!directory) {
            print_message("%s is absent: skipped\n", folder);
            skip();
        }
        for (struct dirent *entry; (entry = readdir(directory));) {
            char path[8192];
            alb_error error = {0};
            alb_mesh mesh = {0};
            if (entry->d_name[0] == '.')
                continue;
            snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
            const bool ok = alb_mesh_read(&mesh, path, &error);
            if (ok != is_valid(entry->d_name) || (!ok && error.status != ALB_BAD_DATA))
                fail_msg("%s: %s: %s", entry->d_name, ok ? "accepted" : "refused", error.text);
            alb_mesh_free(&mesh);
            files++;
        }
        closedir(directory);
    }
    assert_true(files >= 27);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(reads_obj),
        cmocka_unit_test(refuses_bad_text),
        cmocka_unit_test(reads_ply_of_either_order),
        cmocka_unit_test(writes_what_it_reads),
        cmocka_unit_test(shapes_are_closed),
        cmocka_unit_test(subdivision_and_welding_keep_the_body),
        cmocka_unit_test(survives_hostile_files),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
