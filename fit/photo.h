// An image of one lit spot, and what its channels are read with.
#pragma once
#include "base/image.h"
#include "base/text.h"
#include "fit/measurement.h"

typedef struct alb_photo {
    const char *from; // what errors call it; notes, which end up in derived files, do not
    alb_side side;
    const alb_image *image;
    const alb_face *face;
    const alb_spot *spots[3];
    const double *factor; // of each pixel; NULL: 1
    double saturation;
} alb_photo;

// Observes the channels of the material, each by a thread, builds their forward models and notes what a reader should
// know of them.
bool alb_photo_observe(alb_fitting *fitting, const alb_photo *seen, alb_text *notes, alb_error *error);
// What the fitted tails say of the light beyond the border of the image.
void alb_photo_note_border(alb_text *notes, const alb_fitting *fitting);
