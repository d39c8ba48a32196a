// Chessboards: the lens from boards in hand, the pose of a face from a board that lies on it.
#pragma once
#include "base/image.h"
#include "base/vision.h"
#include "capture/session.h"

enum { ALB_BOARD_VIEWS_MAX = 128, ALB_BOARD_POINTS_MAX = 1024 };

typedef struct alb_board {
    int columns, rows; // inner corners
    double square_mm;
} alb_board;

typedef struct alb_board_views {
    int count; // photographs looked at
    char name[ALB_BOARD_VIEWS_MAX][64];
    bool found[ALB_BOARD_VIEWS_MAX];
    double rms_px[ALB_BOARD_VIEWS_MAX]; // of those that were found
    double *corners;                    // [view][point][2] of the found ones, one after the other; owned
    int found_count;
} alb_board_views;

void alb_board_views_free(alb_board_views *views);
// Looks for the board in one photograph (any channels: their mean) and adds it to the views.
bool alb_board_look(alb_board_views *views, const alb_image *photograph, const char *name, const alb_board *board,
                    alb_error *error);
// The lens from all views found; at least 3. ALB_BAD_DATA says how many were.
bool alb_board_lens(alb_lens_estimate *estimate, alb_board_views *views, const alb_board *board, int width, int height,
                    alb_error *error);
// camera_from_world of the face that the board lies on (see alb_view in calibration.h) from the only view in `views`.
bool alb_board_pose(alb_transform *camera_from_world, double *rms_px, const alb_board_views *views,
                    const alb_board *board, const alb_lens *lens, alb_error *error);
