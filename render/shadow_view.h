// Flat pictures of a mesh from outside its bounding sphere, and their spherical-harmonics coefficients. Lengths are in
// radii of the sphere, whose middle is the origin; a picture's eye looks at the origin.
#pragma once
#include "base/error.h"
#include "base/vector.h"
#include <stddef.h>
#include <stdint.h>

enum { ALB_SHADOW_PIXELS_MAX = 64 };

// What the pictures of a field share.
typedef struct alb_shadow_lens {
    int pixels;      // a side, at most ALB_SHADOW_PIXELS_MAX
    int values;      // coefficients: order squared
    double distance; // from the origin, above 1
    double tangent;  // of the half field, wide enough for the sphere
    // Of the pixels of a row left of a column, 0 to pixels: the integral of each basis function over their solid angle,
    // in the frame of the picture (x right, y down, z forward). [row][column][value]
    float *sums;
} alb_shadow_lens;

// distance at least ALB_SHADOW_NEAREST: nearer, a flat picture would have to reach too far to the side (ALB_BAD_DATA).
#define ALB_SHADOW_NEAREST 1.05
bool alb_shadow_lens_create(alb_shadow_lens *lens, int pixels, int order, double distance, alb_error *error);
void alb_shadow_lens_free(alb_shadow_lens *lens);

// Corners as the picture has them.
typedef struct alb_shadow_corners {
    float *x, *y, *depth; // pixels, pixels, radii along z; depth may be NULL
    size_t count;
} alb_shadow_corners;
// Projects the points x[], y[], z[], which must lie in the unit ball. The columns of world_from_picture are the axes of
// the picture, z towards the origin.
void alb_shadow_project(alb_shadow_corners *out, const float *x, const float *y, const float *z,
                        const double world_from_picture[3][3], const alb_shadow_lens *lens);

// What hides: out[values] = integral of the basis over the pixels that any face covers, whichever side it shows or,
// with fronts_only, those that show their front: the same of a closed surface, in half the time.
void alb_shadow_view_occlusion(float *out, const alb_shadow_corners *corners, const uint32_t (*faces)[3],
                               size_t face_count, bool fronts_only, const alb_shadow_lens *lens);
// What shines: out[3][values], the basis times the radiance of the nearest face: colours[face_colours[face]] where its
// front is seen; colour 0 is black. Backs are black and hide what lies behind them. `nearest` and `seen` are workspace
// of pixels^2.
void alb_shadow_view_radiance(float *out, const alb_shadow_corners *corners, const uint32_t (*faces)[3],
                              size_t face_count, const uint32_t *face_colours, const float (*colours)[3],
                              const alb_shadow_lens *lens, float *nearest, uint32_t *seen);
