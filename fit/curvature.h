// Distances on a convex sample that is seen square on.
#pragma once
#include "fit/observe.h"

typedef enum alb_distance {
    ALB_DISTANCE_CHORD, // straight through the sample
    ALB_DISTANCE_ARC,   // along its surface
    ALB_DISTANCES
} alb_distance;
extern const char *const alb_distance_names[ALB_DISTANCES]; // "chord", "arc"

// Distance from the apex of a sphere of the radius to the point seen `aside_mm` beside it; NaN beyond the rim.
double alb_curved_distance(double aside_mm, double radius_mm, alb_distance distance);
// Bends a flat face: its apex, which faces the camera, is at (x, y). Pixels seen more than ALB_EXIT_MOST_DEG off the
// normal do not lie on it.
void alb_face_curve(alb_face *face, double x_mm, double y_mm, double radius_mm, alb_distance distance);
