// Where readings come from: a calibrated session, images, a table. Each fills the material's name and channels and fits
// every side and channel it finds; adds what it read to the inputs, and sentences for the reader to the notes.
#pragma once
#include "base/text.h"
#include "fit/map.h"
#include "fit/measurement.h"

// Where the session holds a grid and no single spot, `map` is filled too (free with alb_map_free), and the material is
// the mean of the spots.
bool alb_fitting_from_session(alb_fitting *fitting, alb_map *map, alb_provenance *provenance, alb_text *notes,
                              const char *folder, alb_error *error);
// paths[side] may be NULL, not both. spot_radius_mm 0: a pencil beam.
bool alb_fitting_from_images(alb_fitting *fitting, alb_provenance *provenance, alb_text *notes,
                             const char *const paths[ALB_SIDES], double mm_per_pixel, double spot_radius_mm,
                             alb_error *error);
bool alb_fitting_from_table(alb_fitting *fitting, alb_provenance *provenance, const char *path, alb_side side,
                            alb_error *error);
