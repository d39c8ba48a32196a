// Where the spot is.
#pragma once
#include "fit/observe.h"

typedef struct alb_centre {
    double x_mm, y_mm, pitch_mm; // on the face; distance between neighbouring pixels there
    double covariance_mm2[3];    // xx, xy, yy
} alb_centre;

// Flags glints (glint.h) in glint[width * height] on the way where they are to be left out.
// ALB_BAD_DATA where there is no spot.
bool alb_centre_find(alb_centre *centre, bool *glint, bool leave_out_glints, const alb_channel *channel,
                     alb_error *error);
