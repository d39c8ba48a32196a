// The images of a calibrated session as numbers on a face: what single spots and grids of them are read from.
#pragma once
#include "base/image.h"
#include "base/text.h"
#include "calibrate/calibration.h"
#include "fit/observe.h"

// Reads the image of a product and adds it to the inputs. ALB_BAD_DATA where it does not belong to the calibration, or
// where the camera stood is not known. The image is the caller's.
bool alb_product_read(alb_image *image, alb_provenance *provenance, const alb_calibration *calibration,
                      const alb_product *product, alb_error *error);

// One channel of an image, times the factor of each pixel (NULL: 1): NaN where the value is not finite or at least
// `saturation`; variance NULL where the image has none of the channel.
typedef struct alb_plane {
    double *value, *variance;
} alb_plane;

bool alb_plane_take(alb_plane *out, const alb_image *image, const char *channel, const double *factor,
                    double saturation, alb_error *error);
void alb_plane_free(alb_plane *out);

// Exitance over radiance, M / L, of every pixel of a side's face (free with free()); NaN where it is seen too
// obliquely. What was corrected goes to the notes.
bool alb_exitance_factor(double **factor, alb_text *notes, const alb_calibration *calibration, alb_side side,
                         const alb_face *face, alb_error *error);
