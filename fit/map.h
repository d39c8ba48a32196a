// Many spots of one sample: the same form fitted to each, and whether they differ by more than their noise.
#pragma once
#include "base/text.h"
#include "calibrate/calibration.h"
#include "fit/measurement.h"
#include "fit/search.h"
#include "fit/site.h"

// Values of one quantity over the spots, each with an sd of its own.
typedef struct alb_spread {
    int count;               // of the spots that have it
    double mean, mean_sd;    // weighted by 1 / sd^2
    double between;          // sd between spots beyond what their own sd explain; 0 where these explain all
    double chi_square, tail; // about the mean; P(at least that | all alike)
} alb_spread;

// Values that are not finite are left out. All NaN where nothing is left.
alb_spread alb_spread_of(const double *values, const double *sd, int count);

// One side and channel of a map.
typedef struct alb_map_layer {
    alb_candidate candidate;      // the form of all spots; NONE: not measured
    int count;                    // of spots
    alb_fitted *spots;            // form NONE: not read, or its readings do not decide
    double *half_mm, *half_sd_mm; // distance within which half of its light leaves; NaN where form NONE
    alb_spread total, half;
} alb_map_layer;

// Makes the readings of one spot, values per flux of that spot, and their forward model. Called from many threads.
typedef bool (*alb_map_read)(alb_readings *readings, alb_operator *forward, int spot, const void *context,
                             alb_error *error);

// Fits all spots on all cores. The form is that which most of a few spots take (choose.h); a spot whose readings cannot
// be made or do not decide is left out. `flux_sd`: relative sd of a spot's own flux, in its total. ALB_UNDECIDED where
// no spot decides; the error names the first reason. Same input, same bytes, with any number of threads.
bool alb_map_layer_fit(alb_map_layer *layer, int count, double flux_sd, alb_map_read read, const void *context,
                       const char *label, alb_error *error);
void alb_map_layer_free(alb_map_layer *layer);

// A grid of spots on one sample.
typedef struct alb_map {
    int columns, rows;          // 0: no grid
    alb_site *sites[ALB_SIDES]; // columns * rows, row by row; NULL where the side was not measured
    alb_map_layer layers[ALB_SIDES][3];
    double tail_wanted; // quantities whose tail is below differ between the spots
    bool heterogeneous; // one of them does; of 100 samples that are alike 5 are called so
} alb_map;

// Whether the calibrated session holds a grid on the slab.
bool alb_map_is_wanted(const alb_calibration *calibration);
// Fits every spot of the session's grids; fills the material's mean (fitting->material and the outcomes, measured) and,
// as the other sources do, inputs and notes. Fails as they do.
bool alb_map_from_session(alb_map *map, alb_fitting *fitting, alb_provenance *provenance, alb_text *notes,
                          const alb_calibration *calibration, alb_error *error);
void alb_map_free(alb_map *map);

// folder/report/map.html.
bool alb_map_report(const alb_map *map, const alb_material *material, const char *notes, const char *folder,
                    alb_error *error);
// folder/map.json, folder/map/<side>.exr (total and half_light_mm with their sd, per channel) and
// folder/map/<side>_<channel>.exr (the form's parameters with their sd), a pixel a spot, NaN where it is not decided;
// and the page.
bool alb_map_write(const alb_map *map, const alb_fitting *fitting, const alb_provenance *provenance, const char *notes,
                   const char *folder, alb_error *error);
