// Pixels that do not belong to the glow of the slab: glints, dust, veins.
#pragma once
#include "fit/ring.h"

// Flags them, and their eight neighbours, in glint[width * height]. false only for want of memory.
bool alb_glints_find(bool *glint, const alb_channel *channel, double x_mm, double y_mm, double pitch_mm,
                     alb_error *error);
