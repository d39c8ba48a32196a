// A constant in all readings (stray light, a background taken off too much): found, tested, told from a slow term.
#pragma once
#include "fit/measurement.h"

// alb_choose, and where a constant explains the readings decidedly better (offset.c), it is taken off the readings and
// the outcome is that of the rest, with the sd of the constant in everything; the outcome says what was taken off, or,
// where the data do not decide, that a constant would do as well. Fails as alb_choose does.
bool alb_offset_choose(alb_measurement *measurement, alb_error *error);
