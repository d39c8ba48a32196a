// Where the spot is.
#pragma once
#include "fit/observe.h"

// Centre of the spot on the face and the distance between neighbouring pixels there. ALB_BAD_DATA where there is none.
bool alb_centre_find(double *x_mm, double *y_mm, double *pitch_mm, const alb_channel *channel, alb_error *error);
