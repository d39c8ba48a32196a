// A pixel is covered where its centre lies in a face; edges belong to the pixels on one side of them, so that faces
// that share an edge leave no gap. With 64 pixels a row the cover of a picture is a word a row, and
//     S_i = sum over rows and their covered runs [a, b) of  P[row][b][i] - P[row][a][i],   P = sums of the lens
// A pixel's integral is the mean of 4 x 4 points times the solid angle dA / (1 + x^2 + y^2)^(3/2).
// Stops being true for what is thinner than a pixel: it is seen where it meets a centre, right on average alone.
#include "render/shadow_view.h"
#include "base/memory.h"
#include "base/vector_clones.h"
#include "render/sh.h"
#include "render/shadow_rows.h"
#include <stdlib.h>
#include <string.h>

bool alb_shadow_lens_create(alb_shadow_lens *lens, int pixels, int order, double distance, alb_error *error)
{
    enum { POINTS = 4 };
    *lens = (alb_shadow_lens){.pixels = pixels, .values = order * order, .distance = distance};
    if (!(distance >= ALB_SHADOW_NEAREST && distance <= 1e3) || pixels < 4 || pixels > ALB_SHADOW_PIXELS_MAX)
        return alb_fail(error, ALB_BAD_DATA,
                        "pictures of %d pixels from %g radii; 4 to %d from %g radii or farther are possible", pixels,
                        distance, ALB_SHADOW_PIXELS_MAX, ALB_SHADOW_NEAREST);
    lens->tangent = 1.001 / sqrt(distance * distance - 1); // roundings of corners on the sphere stay inside
    const size_t values = (size_t)lens->values, row_values = (size_t)(pixels + 1) * values;
    if (!(lens->sums = alb_allocate((size_t)pixels * row_values, sizeof *lens->sums, error)))
        return false;
    const double step = 2 * lens->tangent / pixels / POINTS;
    for (int row = 0; row < pixels; row++) {
        double sum[ALB_SH_COUNT_MAX] = {0}, basis[ALB_SH_COUNT_MAX];
        for (int column = 0; column < pixels; column++) {
            for (int k = 0; k < POINTS * POINTS; k++) {
                const alb_vector to = {(column * POINTS + k % POINTS + 0.5) * step - lens->tangent,
                                       (row * POINTS + k / POINTS + 0.5) * step - lens->tangent, 1};
                const double length = alb_length(to);
                alb_sh_evaluate(basis, order, alb_unit(to));
                for (size_t i = 0; i < values; i++)
                    sum[i] += basis[i] * step * step / (length * length * length);
            }
            for (size_t i = 0; i < values; i++)
                lens->sums[(size_t)row * row_values + (size_t)(column + 1) * values + i] = (float)sum[i];
        }
    }
    return true;
}

void alb_shadow_lens_free(alb_shadow_lens *lens)
{
    free(lens->sums);
    *lens = (alb_shadow_lens){0};
}

ALB_VECTOR_CLONES
void alb_shadow_project(alb_shadow_corners *out, const float *x, const float *y, const float *z,
                        const double world_from_picture[3][3], const alb_shadow_lens *lens)
{
    float m[3][3];
    for (int i = 0; i < 9; i++)
        m[i % 3][i / 3] = (float)world_from_picture[i / 3][i % 3];
    const float away = (float)lens->distance, middle = 0.5f * (float)lens->pixels,
                scale = (float)(0.5 * lens->pixels / lens->tangent);
    float *restrict px = out->x, *restrict py = out->y, *restrict depth = out->depth;
    for (size_t i = 0; i < out->count; i++) {
        const float forward = m[2][0] * x[i] + m[2][1] * y[i] + m[2][2] * z[i] + away, by = scale / forward;
        px[i] = middle + by * (m[0][0] * x[i] + m[0][1] * y[i] + m[0][2] * z[i]);
        py[i] = middle + by * (m[1][0] * x[i] + m[1][1] * y[i] + m[1][2] * z[i]);
    }
    if (depth)
        for (size_t i = 0; i < out->count; i++)
            depth[i] = m[2][0] * x[i] + m[2][1] * y[i] + m[2][2] * z[i] + away;
}

static inline uint64_t bits_below(int n) { return n >= 64 ? UINT64_MAX : ((uint64_t)1 << n) - 1; }

static int faces_from(size_t first, size_t count)
{
    return count - first < ALB_SHADOW_FACES ? (int)(count - first) : ALB_SHADOW_FACES;
}

void alb_shadow_view_occlusion(float *out, const alb_shadow_corners *at, const uint32_t (*faces)[3], size_t face_count,
                               bool fronts_only, const alb_shadow_lens *lens)
{
    uint64_t cover[ALB_SHADOW_PIXELS_MAX + 1] = {0}, below[ALB_SHADOW_PIXELS_MAX + 1];
    alb_shadow_rows rows;
    for (int n = 0; n <= ALB_SHADOW_PIXELS_MAX; n++)
        below[n] = bits_below(n);
    for (size_t first = 0; first < face_count; first += ALB_SHADOW_FACES) {
        alb_shadow_rows_set(&rows, at, faces + first, faces_from(first, face_count), fronts_only);
        for (int n = 0; n < rows.count; n++)
            for (int row = rows.top[n]; row < rows.bottom[n]; row++) {
                int run[2];
                alb_shadow_rows_run(run, &rows, n, row);
                cover[row] |= below[run[1]] ^ below[run[0]];
            }
    }
    const size_t values = (size_t)lens->values;
    memset(out, 0, values * sizeof *out);
    for (int row = 0; row < lens->pixels; row++)
        for (uint64_t rest = cover[row]; rest;) {
            const int start = __builtin_ctzll(rest),
                      end = ~(rest >> start) ? start + __builtin_ctzll(~(rest >> start)) : 64;
            const float *sums = lens->sums + (size_t)row * (size_t)(lens->pixels + 1) * values;
            for (size_t i = 0; i < values; i++)
                out[i] += sums[(size_t)end * values + i] - sums[(size_t)start * values + i];
            rest &= ~bits_below(end);
        }
}

// The depth of a face at pixel centres is a plane in 1 / depth.
typedef struct plane {
    float at_origin, along_x, along_y;
} plane;

static plane inverse_depth(const float x[3], const float y[3], const float depth[3], float area)
{
    const float da = 1 / depth[0], db = 1 / depth[1] - da, dc = 1 / depth[2] - da;
    plane p;
    p.along_x = (db * (y[2] - y[0]) - dc * (y[1] - y[0])) / area;
    p.along_y = (dc * (x[1] - x[0]) - db * (x[2] - x[0])) / area;
    p.at_origin = da - p.along_x * x[0] - p.along_y * y[0];
    return p;
}

// Face n of those counted, with corners v.
ALB_VECTOR_CLONES
static void draw(float *nearest, uint32_t *seen, const alb_shadow_rows *rows, int n, const alb_shadow_corners *at,
                 const uint32_t *v, uint32_t mark, int pixels)
{
    const float x[3] = {at->x[v[0]], at->x[v[1]], at->x[v[2]]}, y[3] = {at->y[v[0]], at->y[v[1]], at->y[v[2]]};
    const float depth[3] = {at->depth[v[0]], at->depth[v[1]], at->depth[v[2]]};
    const float area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
    if (area == 0)
        return;
    mark = area > 0 ? 0 : mark; // its back
    const plane p = inverse_depth(x, y, depth, area);
    for (int row = rows->top[n]; row < rows->bottom[n]; row++) {
        const float start = p.at_origin + p.along_y * ((float)row + 0.5f) + 0.5f * p.along_x;
        float *restrict near = nearest + (size_t)(row * pixels);
        uint32_t *restrict what = seen + (size_t)(row * pixels);
        int run[2];
        alb_shadow_rows_run(run, rows, n, row);
        for (int column = run[0]; column < run[1]; column++) { // without a branch: eight pixels at a time
            const float inverse = start + p.along_x * (float)column, before = near[column];
            near[column] = inverse > before ? inverse : before;
            what[column] = inverse > before ? mark : what[column];
        }
    }
}

void alb_shadow_view_radiance(float *out, const alb_shadow_corners *corners, const uint32_t (*faces)[3],
                              size_t face_count, const uint32_t *face_colours, const float (*colours)[3],
                              const alb_shadow_lens *lens, float *nearest, uint32_t *seen)
{
    const int pixels = lens->pixels;
    const size_t values = (size_t)lens->values, all = (size_t)pixels * (size_t)pixels;
    memset(nearest, 0, all * sizeof *nearest);
    memset(seen, 0, all * sizeof *seen);
    memset(out, 0, 3 * values * sizeof *out);
    alb_shadow_rows rows;
    for (size_t first = 0; first < face_count; first += ALB_SHADOW_FACES) {
        alb_shadow_rows_set(&rows, corners, faces + first, faces_from(first, face_count), false);
        for (int n = 0; n < rows.count; n++) {
            const size_t face = first + (size_t)rows.faces[n];
            draw(nearest, seen, &rows, n, corners, faces[face], face_colours[face], pixels);
        }
    }
    for (int row = 0; row < pixels; row++)
        for (int column = 0; column < pixels;) {
            const uint32_t mark = seen[row * pixels + column];
            const float *sums = lens->sums + ((size_t)row * (size_t)(pixels + 1) + (size_t)column) * values;
            size_t run = 1;
            while (column + (int)run < pixels && seen[row * pixels + column + (int)run] == mark)
                run++;
            for (size_t i = 0; mark && i < values; i++) {
                const float integral = sums[run * values + i] - sums[i];
                for (size_t c = 0; c < 3; c++)
                    out[c * values + i] += colours[mark][c] * integral;
            }
            column += (int)run;
        }
}
