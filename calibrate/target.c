// Corner (i, j) of a board of c x r corners lies at ((i - (c - 1) / 2) s, (j - (r - 1) / 2) s, 0), y down, z into the
// board: OpenCV's order. A face has the same origin and plane with y up and z towards the camera: a half turn about x.
// A board looks the same after half a turn about its normal, so the face's x axis is taken to point right in the
// picture. One flat board fixes the lens only if its views differ in tilt; the standard deviations say how well it did.
#include "calibrate/target.h"
#include "base/memory.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

void alb_board_views_free(alb_board_views *views)
{
    free(views->corners);
    *views = (alb_board_views){0};
}

static bool board_points(double *points, const alb_board *board, alb_error *error)
{
    const int count = board->columns * board->rows;
    if (board->columns < 3 || board->rows < 3 || board->columns > 64 || board->rows > 64 ||
        count > ALB_BOARD_POINTS_MAX)
        return alb_fail(error, ALB_BAD_DATA, "a board of %d x %d inner corners; 3 x 3 to 32 x 32 are supported",
                        board->columns, board->rows);
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
    const int count = board->columns * board->rows;
    if (!board_points(points, board, error))
        return false;
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

bool alb_board_lens(alb_lens_estimate *estimate, alb_board_views *views, const alb_board *board, int width, int height,
                    alb_error *error)
{
    double points[2 * ALB_BOARD_POINTS_MAX], rms[ALB_BOARD_VIEWS_MAX];
    alb_transform poses[ALB_BOARD_VIEWS_MAX];
    if (views->found_count < 3)
        return alb_fail(error, ALB_BAD_DATA,
                        "the board of %d x %d inner corners was found in %d of %d photographs; at least 3 are needed",
                        board->columns, board->rows, views->found_count, views->count);
    if (!board_points(points, board, error) ||
        !alb_vision_calibrate(estimate, poses, rms, views->corners, points, views->found_count,
                              board->columns * board->rows, width, height, error))
        return false;
    for (int v = 0, k = 0; v < views->count; v++)
        views->rms_px[v] = views->found[v] ? rms[k++] : (double)NAN;
    const double focal = estimate->lens.fx / width;
    if (!(focal > 0.1 && focal < 100) || !isfinite(estimate->rms_px) || estimate->rms_px > 0.02 * width)
        return alb_fail(error, ALB_BAD_DATA,
                        "no lens explains the boards: focal length %.4g px, rms %.3g px; check the board's size",
                        estimate->lens.fx, estimate->rms_px);
    return true;
}

bool alb_board_pose(alb_transform *camera_from_world, double *rms_px, const alb_board_views *views,
                    const alb_board *board, const alb_lens *lens, alb_error *error)
{
    double points[2 * ALB_BOARD_POINTS_MAX];
    if (views->found_count != 1)
        return alb_fail(error, ALB_BAD_DATA, "the board that lies on the face was not found (%d x %d inner corners)",
                        board->columns, board->rows);
    alb_transform pose;
    if (!board_points(points, board, error) ||
        !alb_vision_pose(&pose, rms_px, views->corners, points, board->columns * board->rows, lens, error))
        return false;
    const double x = pose.rotation[0][0] < 0 ? -1 : 1;
    const double signs[3] = {x, -x, -1};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            pose.rotation[i][j] *= signs[j];
    *camera_from_world = pose;
    return true;
}
