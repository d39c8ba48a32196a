// The form factors of Sheng et al. 2014, section 5.1, as a baseline: a hemicube at the centroid, counted in pixels,
// small values dropped.
#pragma once
#include "render/patch.h"
#include "render/tracer.h"

typedef struct hemicube {
    int side;                        // pixels along the top's edge
    double threshold;                // values below it are dropped
    size_t count;                    // pixels: side^2 of the top, 4 side^2 / 2 of the sides
    double (*directions)[3], *share; // in the patch's frame, unit; form factor of each pixel
} hemicube;

// One entry of a stored row.
typedef struct hemicube_entry {
    uint32_t patch;
    float value;
} hemicube_entry;

bool hemicube_create(hemicube *cube, int side, double threshold, alb_error *error);
void hemicube_free(hemicube *cube);
// The row of the patch: its entries in `row`, which has room for cube->count. Returns how many there are. A pixel is
// what the ray through its centre meets, as a rasteriser sees it.
size_t hemicube_row(hemicube_entry *row, const hemicube *cube, const alb_patches *patches, const alb_tracer *tracer,
                    size_t patch);
