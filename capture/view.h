// The virtual camera: where each point of a pixel looks, what board poses it sees, and pictures of flat scenes.
//
// World: the face that is seen is z = 0, z towards the camera, x to the right and y up in the picture, the origin at
// the middle of the board and of the slab.
#pragma once
#include "base/camera.h"
#include "base/image.h"
#include "capture/truth.h"

typedef struct alb_sight {
    alb_camera camera;  // at the rig's place: world = the face
    double *corners_xy; // (width + 1) x (height + 1) undistorted x/z, y/z of the pixels' corners
} alb_sight;

// Radiance, three channels, of a point of the plane; cosine of the line of sight to the plane's normal.
typedef struct alb_flat_scene {
    void (*radiance)(double out[3], const void *scene, double x_mm, double y_mm, double cosine);
    const void *scene;
    int samples; // per pixel, a Fibonacci number: 1; 5 for smooth scenes, 34 for edges
} alb_flat_scene;

// ALB_BAD_DATA where the distortion cannot be undone within the picture or the camera does not see the plane.
bool alb_sight_open(alb_sight *sight, const alb_truth *truth, alb_error *error);
void alb_sight_free(alb_sight *sight);
// Averages the scene's radiance over each pixel. camera_from_plane: the rig's own, or that of a board in the hand.
void alb_sight_picture(alb_image *out, const alb_sight *sight, const alb_transform *camera_from_plane,
                       const alb_flat_scene *scene);
// Multiplies by 1 - v (1 - cos^4 a) / (1 - cos^4 a_corner), a: angle to the axis, corner: half diagonal from the
// middle.
void alb_sight_vignette(alb_image *image, const alb_sight *sight, double vignetting);
// Pose number `index` of a hand-held board of half_x_mm by half_y_mm: fully in view, turned up to 35 degrees about both
// axes. A function of (seed, index). ALB_BAD_DATA where the board does not fit into the picture.
bool alb_sight_hand_pose(alb_transform *camera_from_board, const alb_sight *sight, double half_x_mm, double half_y_mm,
                         uint64_t seed, uint64_t index, alb_error *error);
// True where the rectangle is fully in view.
bool alb_sight_sees(const alb_sight *sight, const alb_transform *camera_from_plane, double half_x_mm, double half_y_mm);
