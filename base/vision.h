// What is taken from OpenCV, behind a C face. base/vision.cpp is the only file that includes it: translation, no
// physics.
#pragma once
#include "base/camera.h"
#include "base/image.h"

// Decodes PNG, TIFF, JPEG, PFM or HDR bytes (see alb_image_read). `name` is for messages.
bool alb_vision_decode(alb_image *image, int *bits, const void *bytes, size_t size, const char *name, alb_error *error);
// Encodes width x height x channels (1 or 3, RGB) samples of 1 or 2 bytes as PNG; *bytes is the caller's (free).
bool alb_vision_encode_png(unsigned char **bytes, size_t *size, const void *samples, int width, int height,
                           int channels, int bytes_per_sample, alb_error *error);
// Inner corners of a chessboard in an image of one channel, row by row, columns x rows pairs (u, v) in pixels, by
// findChessboardCornersSB with CALIB_CB_ACCURACY, then cornerSubPix where that fails. *found false where no board is
// seen.
bool alb_vision_chessboard(double *corners, bool *found, const alb_image *grey, int columns, int rows,
                           alb_error *error);

typedef struct alb_lens_estimate {
    alb_lens lens;
    double sd[9];  // of fx, fy, cx, cy, k1, k2, p1, p2, k3
    double rms_px; // sqrt(mean(du^2 + dv^2)) over all corners
} alb_lens_estimate;

// Intrinsics and poses from `views` photographs of one board: corners[view][point][2] pixels, board[point][2] mm (z =
// 0). poses (views, camera_from_board) and view_rms_px (views) are filled. OpenCV's calibrateCamera with `terms`
// coefficients of distortion free and the rest zero: 1 k1, 2 k1 k2, 4 k1 k2 p1 p2, 5 all.
bool alb_vision_calibrate(alb_lens_estimate *estimate, alb_transform *poses, double *view_rms_px, const double *corners,
                          const double *board, int views, int points, int width, int height, int terms,
                          alb_error *error);
// camera_from_board from one photograph with known intrinsics (solvePnP, IPPE then Levenberg-Marquardt refinement).
bool alb_vision_pose(alb_transform *pose, double *rms_px, const double *corners, const double *board, int points,
                     const alb_lens *lens, alb_error *error);
// Mean SSIM of two images of the same size by OpenCV's quality module, per channel, on values in 0..peak.
bool alb_vision_ssim(double ssim[ALB_CHANNELS_MAX], const alb_image *a, const alb_image *b, double peak,
                     alb_error *error);
