// A pinhole camera with Brown-Conrady distortion, in OpenCV's convention: camera x right, y down, z forward; pixel
// centres at integers, (0, 0) the centre of the top left pixel.
//   x' = x (1 + k1 r2 + k2 r4 + k3 r6) + 2 p1 x y + p2 (r2 + 2 x2),  u = fx x' + cx
//   y' = y (1 + k1 r2 + k2 r4 + k3 r6) + p1 (r2 + 2 y2) + 2 p2 x y,  v = fy y' + cy     with x = X/Z, y = Y/Z
#pragma once
#include "base/vector.h"
#include <stdbool.h>

typedef struct alb_lens {
    int width, height;
    double fx, fy, cx, cy;     // pixels
    double k1, k2, p1, p2, k3; // dimensionless
} alb_lens;

typedef struct alb_camera {
    alb_lens lens;
    alb_transform camera_from_world; // mm
} alb_camera;

// Pixel of a world point; false behind the camera.
bool alb_camera_project(double *u, double *v, const alb_camera *camera, alb_vector world);
// Unit direction in the camera's frame of a pixel; distortion inverted by Newton's method. False where that does not
// converge (outside the field where the distortion is monotonic).
bool alb_lens_direction(alb_vector *direction, const alb_lens *lens, double u, double v);
// The pixel's line of sight in world coordinates: origin (the pinhole) and unit direction.
bool alb_camera_ray(alb_vector *origin, alb_vector *direction, const alb_camera *camera, double u, double v);
// Where the line of sight meets the plane z = z_mm of the world. *area_mm2 (may be NULL): the area on that plane that
// the pixel covers. False where it does not meet the plane in front of the camera.
bool alb_camera_on_plane(double *x_mm, double *y_mm, double *area_mm2, const alb_camera *camera, double z_mm, double u,
                         double v);
// A camera at `position` that looks at `target`, `up` upwards in the picture; no distortion.
alb_camera alb_camera_look_at(alb_vector position, alb_vector target, alb_vector up, double vertical_field_deg,
                              int width, int height);
