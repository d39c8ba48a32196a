// From the exitance of a face that sheds light as exit_angle.h says to that of the slab which the two sides speak of.
#pragma once
#include "base/text.h"
#include "fit/measurement.h"

// Channels whose slab is known, both sides seen to the centre, smooth faces: readings are scaled, their common sd and
// basis.own_sd become those of the slab's own lobe, and a sentence is noted. All others stay as they are.
void alb_exit_correct(alb_fitting *fitting, alb_text *notes);
