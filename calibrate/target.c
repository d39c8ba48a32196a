// Corner (i, j) of a board of c x r corners lies at ((i - (c - 1) / 2) s, (j - (r - 1) / 2) s, 0), y down, z into the
// board: OpenCV's order. A face has the same origin and plane with y up and z towards the camera: a half turn about x.
// A board looks the same after half a turn about its normal, so the face's x axis is taken to point right in the
// picture.
// Distortion is modelled no richer than the views demand (BIC over 1, 2, 4 and 5 coefficients): a free coefficient that
// nothing holds bends the edges of the picture, where the tail of a profile is read. Not poorer either: every lens has
// a k1, and leaving out one of two standard deviations, as BIC would, biases lengths by as much as their own sd. One
// flat board fixes the lens only if its views differ in tilt; the standard deviations say how well it did.
#include "calibrate/target.h"
#include "base/memory.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void alb_board_views_free(alb_board_views *views)
{
    free(views->corners);
    *views = (alb_board_views){0};
}

static bool board_points(double *points, const alb_board *board, alb_error *error)
{
    if (board->columns < 3 || board->rows < 3 || board->columns > 64 || board->rows > 64 ||
        board->columns * board->rows > ALB_BOARD_POINTS_MAX)
        return alb_fail(error, ALB_BAD_DATA,
                        "a board of %d x %d inner corners; 3 to 64 each way and at most %d together are supported",
                        board->columns, board->rows, ALB_BOARD_POINTS_MAX);
    const int count = board->columns * board->rows;
    for (int i = 0; i < count; i++) {
        points[2 * i] = (i % board->columns - 0.5 * (board->columns - 1)) * board->square_mm;
        points[2 * i + 1] = (i / board->columns - 0.5 * (board->rows - 1)) * board->square_mm;
    }
    return true;
}

bool alb_board_look(alb_board_views *views, const alb_image *photograph, const char *name, const alb_board *board,
                    alb_error *error)
{
    double points[2 * ALB_BOARD_POINTS_MAX];
    if (!board_points(points, board, error))
        return false;
    const int count = board->columns * board->rows;
    if (views->count == ALB_BOARD_VIEWS_MAX)
        return alb_fail(error, ALB_BAD_DATA, "more than %d photographs of the board", ALB_BOARD_VIEWS_MAX);
    if (!views->corners) {
        views->corners = alb_allocate((size_t)ALB_BOARD_VIEWS_MAX * (size_t)count * 2, sizeof *views->corners, error);
        if (!views->corners)
            return false;
    }
    alb_image grey = {0};
    if (!alb_image_create(&grey, photograph->width, photograph->height, "Y", error))
        return false;
    const size_t pixels = (size_t)grey.width * (size_t)grey.height, channels = (size_t)photograph->channels;
    for (size_t i = 0; i < pixels; i++)
        for (size_t c = 0; c < channels; c++)
            grey.pixels[i] += photograph->pixels[i * channels + c] / (float)channels;
    const int v = views->count;
    const bool ok = alb_vision_chessboard(views->corners + (size_t)(views->found_count * count) * 2, &views->found[v],
                                          &grey, board->columns, board->rows, error);
    alb_image_free(&grey);
    if (!ok)
        return false;
    snprintf(views->name[v], sizeof views->name[v], "%.63s", name);
    views->found_count += views->found[v];
    views->count++;
    return true;
}

static double rounded(double value, int digits)
{
    if (!(value > 0) || !isfinite(value))
        return value;
    const double unit = pow(10, floor(log10(value)) + 1 - digits);
    return rint(value / unit) * unit;
}

// Same pictures, same bytes: OpenCV solves by LAPACK, and an optimised BLAS rounds by where its memory happens to lie,
// so that from run to run the lens moves by up to 1e-7 of its sd. Rounded to a thousandth of the sd (a power of two) it
// does not, but for one case in ten thousand.
static void settle(alb_lens_estimate *estimate, double *rms, int count)
{
    alb_lens *l = &estimate->lens;
    double *const values[9] = {&l->fx, &l->fy, &l->cx, &l->cy, &l->k1, &l->k2, &l->p1, &l->p2, &l->k3};
    for (int i = 0; i < 9; i++) {
        const double sd = estimate->sd[i], step = sd > 0 && isfinite(sd) ? exp2(floor(log2(sd)) - 10) : 0;
        *values[i] = step > 0 ? rint(*values[i] / step) * step : *values[i];
        estimate->sd[i] = rounded(sd, 4);
    }
    estimate->rms_px = rounded(estimate->rms_px, 9);
    for (int v = 0; v < count; v++)
        rms[v] = rounded(rms[v], 6);
}

static bool solve(alb_lens_estimate *estimate, double *rms, const double *corners, int count, const alb_board *board,
                  int width, int height, int terms, alb_error *error)
{
    double points[2 * ALB_BOARD_POINTS_MAX];
    alb_transform poses[ALB_BOARD_VIEWS_MAX];
    if (!board_points(points, board, error) ||
        !alb_vision_calibrate(estimate, poses, rms, corners, points, count, board->columns * board->rows, width, height,
                              terms, error))
        return false;
    settle(estimate, rms, count);
    return true;
}

bool alb_board_lens(alb_lens_estimate *estimate, int *terms, alb_board_views *views, const alb_board *board, int width,
                    int height, alb_error *error)
{
    static const int candidates[] = {1, 2, 4, 5};
    double best = INFINITY, rms[ALB_BOARD_VIEWS_MAX];
    if (views->found_count < 3)
        return alb_fail(error, ALB_BAD_DATA,
                        "the board of %d x %d inner corners was found in %d of %d photographs; at least 3 are needed",
                        board->columns, board->rows, views->found_count, views->count);
    const double n = 2.0 * views->found_count * board->columns * board->rows;
    for (int i = 0; i < 4; i++) {
        alb_lens_estimate candidate;
        if (!solve(&candidate, rms, views->corners, views->found_count, board, width, height, candidates[i], error))
            return false;
        const double bic = n * log(candidate.rms_px * candidate.rms_px) + candidates[i] * log(n);
        if (!(bic < best))
            continue;
        best = bic;
        *terms = candidates[i];
        *estimate = candidate;
        for (int v = 0, k = 0; v < views->count; v++)
            views->rms_px[v] = views->found[v] ? rms[k++] : (double)NAN;
    }
    const double focal = estimate->lens.fx / width;
    if (!(focal > 0.1 && focal < 100) || !isfinite(best) || estimate->rms_px > 0.02 * width)
        return alb_fail(error, ALB_BAD_DATA,
                        "no lens explains the boards: focal length %.4g px, rms %.3g px; check the board's size",
                        estimate->lens.fx, estimate->rms_px);
    return true;
}

// Where a view's corners start; its place among the found ones.
static const double *corners_of(const alb_board_views *views, int view, const alb_board *board, int *place)
{
    *place = 0;
    for (int v = 0; v < view; v++)
        *place += views->found[v];
    return views->corners + (size_t)(2 * *place * board->columns * board->rows);
}

bool alb_board_pose(alb_transform *camera_from_world, double *rms_px, const alb_board_views *views, int view,
                    const alb_board *board, const alb_lens *lens, alb_error *error)
{
    double points[2 * ALB_BOARD_POINTS_MAX];
    int place;
    if (!views->found[view])
        return alb_fail(error, ALB_BAD_DATA, "%s: no board of %d x %d inner corners is to be seen", views->name[view],
                        board->columns, board->rows);
    alb_transform pose;
    if (!board_points(points, board, error) || !alb_vision_pose(&pose, rms_px, corners_of(views, view, board, &place),
                                                                points, board->columns * board->rows, lens, error))
        return false;
    const double x = pose.rotation[0][0] < 0 ? -1 : 1;
    const double signs[3] = {x, -x, -1};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            pose.rotation[i][j] *= signs[j];
    *camera_from_world = pose;
    return true;
}

// The length that stands for the scale of a face: the root of the area that the middle half of the picture covers
// there.
static double length_on_face(const alb_camera *camera)
{
    double x[4], y[4], area = 0;
    for (int i = 0; i < 4; i++)
        if (!alb_camera_on_plane(&x[i], &y[i], NULL, camera, 0, camera->lens.width * (i == 1 || i == 2 ? 0.75 : 0.25),
                                 camera->lens.height * (i < 2 ? 0.25 : 0.75)))
            return NAN;
    for (int i = 0; i < 4; i++)
        area += (x[i] * y[(i + 1) % 4] - x[(i + 1) % 4] * y[i]) / 2;
    return sqrt(fabs(area));
}

// sum |p - mean|^2 of the view's corners: a scale of the picture by 1 + e moves them by e times that much.
static double spread_px2(const double *corners, int points)
{
    double u = 0, v = 0, sum = 0;
    for (int i = 0; i < points; i++)
        u += corners[2 * i] / points, v += corners[2 * i + 1] / points;
    for (int i = 0; i < points; i++)
        sum += (corners[2 * i] - u) * (corners[2 * i] - u) + (corners[2 * i + 1] - v) * (corners[2 * i + 1] - v);
    return sum;
}

// What corner detection is off by without telling: a hundredth of a pixel, measured on drawn boards of known geometry.
static const double corner_bias_px = 0.01;

bool alb_board_length_sd(double *relative_sd, const alb_board_views *views, int view, const alb_board *board,
                         const alb_lens *lens, int terms, alb_error *error)
{
    const int points = board->columns * board->rows, count = views->found_count;
    int place;
    const double *own = corners_of(views, view, board, &place);
    double lengths[ALB_BOARD_VIEWS_MAX], mean = 0, squares = 0, rms = 0, view_rms[ALB_BOARD_VIEWS_MAX];
    const size_t row = (size_t)points * 2;
    double *kept = alb_allocate((size_t)count * row, sizeof *kept, error);
    bool ok = kept != NULL;
    for (int out = 0; ok && out < count; out++) {
        alb_lens_estimate estimate;
        alb_camera camera;
        memcpy(kept, views->corners, (size_t)out * row * sizeof *kept);
        memcpy(kept + (size_t)out * row, views->corners + (size_t)(out + 1) * row,
               (size_t)(count - 1 - out) * row * sizeof *kept);
        ok = solve(&estimate, view_rms, kept, count - 1, board, lens->width, lens->height, terms, error);
        camera.lens = estimate.lens;
        ok = ok && alb_board_pose(&camera.camera_from_world, &rms, views, view, board, &camera.lens, error);
        lengths[out] = ok ? length_on_face(&camera) : (double)NAN;
        mean += lengths[out] / count;
    }
    for (int out = 0; out < count; out++)
        squares += (lengths[out] / mean - 1) * (lengths[out] / mean - 1);
    alb_transform pose;
    ok = ok && alb_board_pose(&pose, &rms, views, view, board, lens, error);
    // of one axis; six parameters from 2 points numbers
    const double corner_variance = 0.5 * rms * rms * points / (points - 3.0);
    const double spread = spread_px2(own, points);
    const double systematic_variance = corner_bias_px * corner_bias_px * points; // all corners outwards, say
    *relative_sd = sqrt(squares * (count - 1) / count + (corner_variance + systematic_variance) / spread);
    free(kept);
    return ok;
}
