// Scattering in bent sheets. A sheet bent without stretching scatters as it did when it was flat: the same mesh, flat
// and rolled into part of a cylinder or into a wave, gives the same S' irradiance, patch by patch.
#include "base/random.h"
#include "check.h"
#include "render/scatter.h"
#include <omp.h>

enum { WIDE = 60, TALL = 24 };
static const double width = 30, height = 12, thin = 0.1;

static const alb_profile reflected = {ALB_FORM_TWO_EXPONENTIALS, {0.3, 3, 0.06, 0.9}},
                         transmitted = {ALB_FORM_EXPONENTIAL, {0.09, 1.2}};

// Where the middle of the sheet lies at s along it, and its normal there: at angle a, the integral of the curvature.
typedef struct bend {
    double curvature_per_mm;
    bool wave; // curvature as a sine of one period over the width
    double thickness_mm;
} bend;

static alb_vector bent(const bend *b, double s, double z, double off)
{
    enum { STEPS = 400 };
    double x = 0, y = 0, angle = 0;
    for (int k = 0; k < STEPS; k++) { // midpoints of the angle
        const double at = (k + 0.5) / STEPS * s;
        angle = b->wave ? b->curvature_per_mm * width / (2 * M_PI) * (1 - cos(2 * M_PI * at / width))
                        : b->curvature_per_mm * at;
        x += cos(angle) * s / STEPS, y += sin(angle) * s / STEPS;
    }
    angle =
        b->wave ? b->curvature_per_mm * width / (2 * M_PI) * (1 - cos(2 * M_PI * s / width)) : b->curvature_per_mm * s;
    return (alb_vector){x - off * sin(angle), y + off * cos(angle), z};
}

static void add_quad(alb_mesh *mesh, const uint32_t q[4], bool odd)
{
    alb_error error = {0};
    check_ok(alb_mesh_add_face(mesh, q[0], q[1], q[odd ? 3 : 2], 0, &error), &error);
    check_ok(alb_mesh_add_face(mesh, q[odd ? 1 : 0], q[2], q[3], 0, &error), &error);
}

// Two faces of WIDE x TALL quads and a rim.
static void make_sheet(alb_mesh *mesh, const bend *b)
{
    alb_error error = {0};
    uint16_t group;
    *mesh = (alb_mesh){0};
    check_ok(alb_mesh_add_group(&group, mesh, "", &error), &error);
    const uint32_t row = WIDE + 1, face = row * (TALL + 1);
    for (int side = -1; side <= 1; side += 2)
        for (int j = 0; j <= TALL; j++)
            for (int i = 0; i <= WIDE; i++)
                check_ok(alb_mesh_add_vertex(
                             mesh, bent(b, width * i / WIDE, height * j / TALL, 0.5 * side * b->thickness_mm), &error),
                         &error);
    for (uint32_t j = 0; j < TALL; j++)
        for (uint32_t i = 0; i < WIDE; i++) {
            const uint32_t a = j * row + i, d = a + row;
            // seen with s to the right and z up, the front of side -1 faces the viewer
            add_quad(mesh, (const uint32_t[4]){a, a + 1, d + 1, d}, (i + j) % 2);
            add_quad(mesh, (const uint32_t[4]){face + a, face + d, face + d + 1, face + a + 1}, (i + j) % 2);
        }
    for (uint32_t i = 0; i < WIDE; i++) {
        const uint32_t low = i, high = TALL * row + i;
        add_quad(mesh, (const uint32_t[4]){low + 1, low, face + low, face + low + 1}, 0);
        add_quad(mesh, (const uint32_t[4]){high, high + 1, face + high + 1, face + high}, 0);
    }
    for (uint32_t j = 0; j < TALL; j++) {
        const uint32_t left = j * row, right = left + WIDE;
        add_quad(mesh, (const uint32_t[4]){left, left + row, face + left + row, face + left}, 0);
        add_quad(mesh, (const uint32_t[4]){right + row, right, face + right, face + right + row}, 0);
    }
}

typedef struct sheet {
    alb_mesh mesh;
    alb_patches patches;
    alb_scatter scatter;
} sheet;

static const alb_surface petal = {
    .name = "petal",
    .scatters = true,
    .slab = true,
    .profiles = {{reflected, reflected, reflected}, {transmitted, transmitted, transmitted}}};

static void scatter_sheet(sheet *s, const bend *b, const alb_surface *surface)
{
    alb_error error = {0};
    *s = (sheet){0};
    make_sheet(&s->mesh, b);
    check_ok(alb_patches_create(&s->patches, &s->mesh, &error), &error);
    check_ok(alb_scatter_create(&s->scatter, &s->patches, s->mesh.groups, surface, 0.005, &error), &error);
    assert_int_equal(s->scatter.body_count, 1);
    assert_true(s->scatter.bodies[0].closed);
}

static void sheet_free(sheet *s)
{
    alb_scatter_free(&s->scatter);
    alb_patches_free(&s->patches);
    alb_mesh_free(&s->mesh);
}

// Channel 0 even light, 1 smooth on both faces, 2 a spot on the front.
static void light_of(double (*light)[3], const sheet *flat)
{
    for (size_t p = 0; p < flat->patches.count; p++) {
        const alb_vector c = flat->patches.centroids[p];
        light[p][0] = 1;
        light[p][1] = 1 + 0.7 * sin(0.9 * c.x + 0.4) * cos(0.7 * c.z) + 0.2 * (c.y > 0 ? 1 : -1);
        light[p][2] = c.y < -0.49 * thin ? exp(-0.5 * (pow(c.x - 14, 2) + pow(c.z - 5.5, 2))) : 0;
    }
}

// rms of the difference of S' irradiance relative to its rms, on the faces.
static void differ(double relative[3], const sheet *flat, const sheet *other)
{
    const size_t n = flat->patches.count;
    double(*light)[3] = calloc(n, sizeof *light), (*a)[3] = calloc(n, sizeof *a), (*b)[3] = calloc(n, sizeof *b);
    double off[3] = {0}, all[3] = {0};
    light_of(light, flat);
    alb_scatter_apply(a, &flat->scatter, (const double(*)[3])light);
    alb_scatter_apply(b, &other->scatter, (const double(*)[3])light);
    for (size_t p = 0; p < n; p++)
        for (int c = 0; c < 3 && fabs(flat->patches.normals[p].y) > 0.9; c++) {
            off[c] += (a[p][c] - b[p][c]) * (a[p][c] - b[p][c]);
            all[c] += a[p][c] * a[p][c];
        }
    for (int c = 0; c < 3; c++)
        relative[c] = sqrt(off[c] / all[c]);
    free(light);
    free(a);
    free(b);
}

// The lateral distance between the faces is that along the face of the exit, longer or shorter than the middle's by
// half the thickness times the curvature; the rest is the links' error. The ring of curvature 0.2 all but closes.
static void bent_sheets_scatter_as_flat_ones(void **state)
{
    (void)state;
    static const bend bends[] = {{0.12, false, thin}, {0.2, false, thin}, {0.3, true, thin}};
    sheet flat;
    scatter_sheet(&flat, &(bend){.thickness_mm = thin}, &petal);
    assert_true(flat.scatter.bodies[0].convex);
    for (size_t k = 0; k < sizeof bends / sizeof *bends; k++) {
        sheet other;
        double relative[3];
        scatter_sheet(&other, &bends[k], &petal);
        assert_int_equal(other.scatter.bodies[0].paths, ALB_OPTICAL_SHEET);
        check_near(other.scatter.bodies[0].thickness_mm, thin, 0.01 * thin);
        differ(relative, &flat, &other);
        for (int c = 0; c < 3; c++)
            check_below(relative[c], 0.5 * thin * bends[k].curvature_per_mm + 0.005);
        sheet_free(&other);
    }
    sheet_free(&flat);
}

// Thicker than ten times the decay length and one and a half times what was measured: a solid, reflection alone. What
// was measured as thick is a sheet again. What is no slab is a solid, however thin.
static void thick_bodies_are_solids(void **state)
{
    (void)state;
    alb_surface narrow = petal;
    const alb_profile needle = {ALB_FORM_EXPONENTIAL, {25, 10}};
    for (int c = 0; c < 3; c++)
        narrow.profiles[ALB_REFLECTION][c] = needle;
    const bend ring = {0.12, false, 2};
    sheet s;
    scatter_sheet(&s, &ring, &narrow);
    assert_int_equal(s.scatter.bodies[0].paths, ALB_OPTICAL_SOLID);
    sheet_free(&s);
    narrow.thickness_mm = 1.5;
    scatter_sheet(&s, &ring, &narrow);
    assert_int_equal(s.scatter.bodies[0].paths, ALB_OPTICAL_SHEET);
    sheet_free(&s);
    narrow.slab = false;
    scatter_sheet(&s, &ring, &narrow);
    assert_int_equal(s.scatter.bodies[0].paths, ALB_OPTICAL_SOLID);
    sheet_free(&s);
}

static void threads_do_not_matter(void **state)
{
    (void)state;
    const int threads = omp_get_max_threads();
    sheet first, second;
    omp_set_num_threads(1);
    scatter_sheet(&first, &(bend){0.3, true, thin}, &petal);
    omp_set_num_threads(3);
    scatter_sheet(&second, &(bend){0.3, true, thin}, &petal);
    omp_set_num_threads(threads);
    assert_memory_equal(first.scatter.row_sums, second.scatter.row_sums,
                        first.patches.count * sizeof *first.scatter.row_sums);
    assert_memory_equal(first.scatter.column_sums, second.scatter.column_sums,
                        first.patches.count * sizeof *first.scatter.column_sums);
    sheet_free(&first);
    sheet_free(&second);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bent_sheets_scatter_as_flat_ones),
        cmocka_unit_test(thick_bodies_are_solids),
        cmocka_unit_test(threads_do_not_matter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
