// Rows of pixels that faces cover, against the signs of areas at every pixel's centre, in double precision.
#include "base/random.h"
#include "render/shadow_rows.h"
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <string.h>

#include <cmocka.h>

enum { FACES_MAX = ALB_SHADOW_FACES, CORNERS_MAX = 3 * FACES_MAX, PIXELS = 64 };

typedef struct faces {
    float x[CORNERS_MAX], y[CORNERS_MAX];
    uint32_t corners[FACES_MAX][3];
    int count;
} faces;

static alb_shadow_rows rows_of(const faces *f, bool fronts_only)
{
    static alb_shadow_rows rows;
    const alb_shadow_corners at = {.x = (float *)(uintptr_t)f->x, .y = (float *)(uintptr_t)f->y, .count = CORNERS_MAX};
    memset(&rows, 0xff, sizeof rows);
    alb_shadow_rows_set(&rows, &at, f->corners, f->count, fronts_only);
    return rows;
}

static void count_cover(int cover[FACES_MAX][PIXELS][PIXELS], const alb_shadow_rows *rows)
{
    memset(cover, 0, FACES_MAX * sizeof *cover);
    for (int n = 0; n < rows->count; n++)
        for (int row = rows->top[n]; row < rows->bottom[n]; row++) {
            int run[2];
            alb_shadow_rows_run(run, rows, n, row);
            assert_in_range(run[1], run[0], PIXELS);
            for (int column = run[0]; column < run[1]; column++)
                cover[rows->faces[n]][row][column]++;
        }
}

// Faces of many sizes; every fifth has a side along a row, every seventh its corners at pixels' centres.
static void draw_faces(faces *f, alb_random *random)
{
    for (int i = 0; i < f->count; i++) {
        const double size = pow(64, alb_random_uniform(random)), x = (64 - size) * alb_random_uniform(random),
                     y = (64 - size) * alb_random_uniform(random);
        for (int k = 0; k < 3; k++) {
            const int c = 3 * i + k;
            f->corners[i][k] = (uint32_t)c;
            f->x[c] = (float)(x + size * alb_random_uniform(random));
            f->y[c] = i % 5 == 0 && k == 2 ? f->y[c - 1] : (float)(y + size * alb_random_uniform(random));
            if (i % 7 == 0) {
                f->x[c] = floorf(f->x[c]) + 0.5F;
                f->y[c] = floorf(f->y[c]) + 0.5F;
            }
        }
    }
}

// Twice the area of a, b and the point, over the length of the side: how far the point lies to one side of it.
static double beside(const faces *f, uint32_t a, uint32_t b, double x, double y)
{
    const double ex = (double)f->x[b] - (double)f->x[a], ey = (double)f->y[b] - (double)f->y[a], length = hypot(ex, ey);
    return length > 0 ? (ex * (y - (double)f->y[a]) - ey * (x - (double)f->x[a])) / length : 0;
}

static double area_of(const faces *f, int i)
{
    const uint32_t *v = f->corners[i];
    return beside(f, v[0], v[1], (double)f->x[v[2]], (double)f->y[v[2]]);
}

static void check_face(const faces *f, int i, int cover[PIXELS][PIXELS], bool fronts_only)
{
    const uint32_t *v = f->corners[i];
    const double area = area_of(f, i);
    for (int row = 0; row < PIXELS; row++)
        for (int column = 0; column < PIXELS; column++) {
            double inside = INFINITY, clear = INFINITY;
            for (int k = 0; k < 3; k++) {
                const double at = beside(f, v[k], v[(k + 1) % 3], column + 0.5, row + 0.5);
                inside = fmin(inside, area > 0 ? at : -at);
                clear = fmin(clear, fabs(at));
            }
            if (clear < 1e-3) // an edge in single precision, of up to 64 pixels and any slope, may lie on either side
                continue;
            assert_int_equal(cover[row][column], inside > 0 && (area < 0 || !fronts_only));
        }
}

static void rows_are_what_faces_cover(void **state)
{
    static faces f;
    static int cover[FACES_MAX][PIXELS][PIXELS];
    (void)state;
    for (uint64_t n = 0; n < 40; n++) {
        alb_random random = alb_random_at(5, 0x70a5, n);
        f.count = n < 8 ? (int)n : FACES_MAX - (int)n % 9;
        draw_faces(&f, &random);
        const alb_shadow_rows rows = rows_of(&f, n % 2);
        assert_in_range(rows.count, 0, f.count);
        count_cover(cover, &rows);
        for (int i = 0; i < f.count; i++)
            if (fabs(area_of(&f, i)) > 1e-3) // sides on one line have no inside
                check_face(&f, i, cover[i], n % 2);
    }
}

// A fan about a point inside a square: every pixel of the square belongs to one face, those on edges too.
static void faces_that_share_edges_leave_no_gap(void **state)
{
    static faces f;
    static int cover[FACES_MAX][PIXELS][PIXELS];
    (void)state;
    for (uint64_t n = 0; n < 200; n++) {
        alb_random random = alb_random_at(6, 0x70a5, n);
        const float x = 2 + 60 * (float)alb_random_uniform(&random), y = 2 + 60 * (float)alb_random_uniform(&random);
        const float middle_x = n % 3 ? x : floorf(x) + 0.5F, middle_y = n % 3 ? y : floorf(y) + 0.5F;
        memcpy(f.x, (const float[]){0, 64, 64, 0, middle_x}, 5 * sizeof *f.x);
        memcpy(f.y, (const float[]){0, 0, 64, 64, middle_y}, 5 * sizeof *f.y);
        f.count = 4;
        for (uint32_t i = 0; i < 4; i++)
            memcpy(f.corners[i], (const uint32_t[]){i, 4, (i + 1) % 4}, sizeof f.corners[i]);
        const alb_shadow_rows rows = rows_of(&f, true);
        count_cover(cover, &rows);
        int twice = 0;
        for (int row = 0; row < PIXELS; row++)
            for (int column = 0; column < PIXELS; column++) {
                const int faces_here =
                    cover[0][row][column] + cover[1][row][column] + cover[2][row][column] + cover[3][row][column];
                assert_true(faces_here > 0);
                twice += faces_here > 1;
            }
        assert_in_range(twice, 0, 1); // next to the middle, where rounding may exchange two edges
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_are_what_faces_cover),
        cmocka_unit_test(faces_that_share_edges_leave_no_gap),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
