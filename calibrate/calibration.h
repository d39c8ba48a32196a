// A calibration: what calibrate leaves behind. calibration.json and calibration/*.exr inside the session's folder.
//
// Products: calibration/<shot>.exr for every slab shot and every spot or grid on the white reference: channels R,G,B
// and variance.R, variance.G, variance.B.
//   slab:            radiance per incident flux, L / Phi, 1/(mm^2 sr); a Lambertian face has M = pi L
//   white reference: irradiance per incident flux, E / Phi, 1/mm^2 (its integral over the face is 1 by construction)
// A pixel that no exposure measured (saturated in all) is NaN.
#pragma once
#include "base/camera.h"
#include "capture/session.h"

enum { ALB_FLAT_TERMS = 15 };

typedef struct alb_estimate {
    double value, sd;
} alb_estimate;

typedef struct alb_view {
    bool known;
    alb_camera camera; // world: the plane of the face, z = 0; origin the middle of the board's corners, x along its
                       // columns, y against its rows, z out of the face towards the camera; mm
    double rms_px;     // of the board photograph that gave the pose
    double relative_length_sd; // of all lengths on the face together
} alb_view;

// Product of one shot.
typedef struct alb_product {
    char shot[ALB_NAME_SIZE];
    alb_side side;
    alb_target target;
    alb_pattern pattern;
    double relative_scale_sd[3]; // of the common factor of all pixels, per channel (flux of the white reference)
} alb_product;

typedef struct alb_calibration {
    char folder[ALB_PATH_SIZE]; // of the session
    char sample[ALB_NAME_SIZE];
    double thickness_mm, refractive_index;
    alb_finish finish;
    int channels;
    char channel_names[3][8];
    alb_estimate black_dn[3], read_noise_dn[3], gain_dn_per_electron[3];
    double white_level_dn;
    double flat[3][ALB_FLAT_TERMS]; // vignetting, see flat.c
    double lens_sd[9];              // of fx, fy, cx, cy, k1, k2, p1, p2, k3
    double lens_rms_px;
    alb_view views[ALB_SIDES];
    alb_product products[ALB_SHOTS_MAX];
    int product_count;
} alb_calibration;

bool alb_calibration_read(alb_calibration *calibration, const char *session_folder, alb_error *error);
// Path of a product's image.
bool alb_calibration_image(char path[ALB_PATH_SIZE], const alb_calibration *calibration, const alb_product *product,
                           alb_error *error);
