// From the radiance that a camera sees to the radiant exitance of the face.
#pragma once
#include "capture/session.h" // alb_side, alb_finish

typedef struct alb_exit {
    alb_side side;
    bool smooth;
    double refractive_index, first_moment, boundary; // of fit/fresnel.h
} alb_exit;

// Relative standard deviation of what alb_exit_ratio says of a smooth face, common to all readings of a side.
#define ALB_EXIT_RELATIVE_SD 0.01
// Pixels seen further off the normal are not measured: the ratio falls steeply, and with it the trust in the pose.
#define ALB_EXIT_MOST_DEG 75

alb_exit alb_exit_of(alb_side side, alb_finish finish, double refractive_index);
// pi L / M seen at this cosine to the normal, in air: 1 for a ground face.
double alb_exit_ratio(const alb_exit *face, double cosine);
