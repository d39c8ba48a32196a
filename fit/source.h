// Where readings come from: a calibrated session, images, a table. Each fills the material's name and channels and fits
// every side and channel it finds; adds what it read to the inputs, and sentences for the reader to the notes.
#pragma once
#include "base/text.h"
#include "fit/curvature.h"
#include "fit/map.h"
#include "fit/measurement.h"

// Where the session holds a grid and no single spot, `map` is filled too (free with alb_map_free), and the material is
// the mean of the spots.
bool alb_fitting_from_session(alb_fitting *fitting, alb_map *map, alb_provenance *provenance, alb_text *notes,
                              const char *folder, alb_error *error);

// What is known of images by hand. The light: a spot measured on an opaque white face, or a Gaussian, or an even disc.
typedef struct alb_image_setting {
    double mm_per_pixel;
    double spot_radius_mm;      // of a disc; 0: a pencil beam
    double spot_gaussian_mm;    // where irradiance has fallen to 1/e^2; 0: a disc
    const char *spot_image;     // in the same pixels as the images; NULL: as stated
    double curvature_radius_mm; // of a sphere that bulges towards the camera at the spot; 0: flat
    alb_distance distance;      // on it
} alb_image_setting;

// paths[side] may be NULL, not both.
bool alb_fitting_from_images(alb_fitting *fitting, alb_provenance *provenance, alb_text *notes,
                             const char *const paths[ALB_SIDES], const alb_image_setting *setting, alb_error *error);
bool alb_fitting_from_table(alb_fitting *fitting, alb_provenance *provenance, const char *path, alb_side side,
                            alb_error *error);
