// View factors of planar polygons that nothing stands between: near pairs, and the truth that rays are checked against.
#pragma once
#include "base/error.h"
#include "base/vector.h"
#include <stddef.h>

enum { ALB_POLYGON_MAX = 256 }; // corners

// Polygons are planar and simple; corners run counter-clockwise seen from the front, the side that sends and receives.
// Backs are black. Lengths in any one unit.

// Share of the flux leaving a small patch at `point`, with unit `normal`, that arrives on the polygon's front (Lambert
// 1760; Baum et al. 1989): exact. Zero where the point is in the polygon's plane or behind it.
double alb_form_factor_point(alb_vector point, alb_vector normal, const alb_vector *polygon, size_t count);
// Share of the flux leaving the front of `from` that arrives on the front of `to`, to 1e-9 relative; shared edges and
// corners are fine. ALB_BAD_DATA for fewer than 3 or more than ALB_POLYGON_MAX corners, or a polygon without area.
bool alb_form_factor_exact(double *factor, const alb_vector *from, size_t from_count, const alb_vector *to,
                           size_t to_count, alb_error *error);
