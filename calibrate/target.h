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
    double *corners;                    // [found view][point][2]; owned
    int found_count;                    // of the views, in their order
} alb_board_views;

void alb_board_views_free(alb_board_views *views);
// Looks for the board in one photograph (any channels: their mean) and adds it to the views.
bool alb_board_look(alb_board_views *views, const alb_image *photograph, const char *name, const alb_board *board,
                    alb_error *error);
// The lens from all views found, at least 3, with as many coefficients of distortion as lower BIC; *terms says how
// many. ALB_BAD_DATA says how many views were found.
bool alb_board_lens(alb_lens_estimate *estimate, int *terms, alb_board_views *views, const alb_board *board, int width,
                    int height, alb_error *error);
// camera_from_world of the face that the board of view `view` lies on (see alb_view in calibration.h).
bool alb_board_pose(alb_transform *camera_from_world, double *rms_px, const alb_board_views *views, int view,
                    const alb_board *board, const alb_lens *lens, alb_error *error);
// Relative standard deviation of lengths on the face of view `view`: what the lens does to them, by leaving out one
// view after the other (jackknife), what the noise of the board's own corners does, and a bias of 0.01 px of all of
// them.
bool alb_board_length_sd(double *relative_sd, const alb_board_views *views, int view, const alb_board *board,
                         const alb_lens *lens, int terms, alb_error *error);
