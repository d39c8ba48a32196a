// What a lit face sheds: the projector's pattern on the white reference and on the slab.
//
// The projector lights the front perpendicularly. A disc consists of the square pixels whose centres lie within
// diameter/2 of its middle (the corner of four pixels where the diameter, rounded up, is even; the centre of one where
// it is odd), each blurred by a Gaussian. Patterns lie symmetrically about the origin, so that the far
// side, which sees them mirrored, sees the same.
#pragma once
#include "capture/kernel.h"
#include "capture/truth.h"

typedef struct alb_lit_face {
    alb_pattern_kind kind;
    const alb_kernel *kernels;                   // three; NULL: an opaque white face
    double reflectance[3];                       // of that
    double irradiance[3];                        // W/mm^2 of a white pixel
    double pixel_mm, blur_sd_mm, disc_radius_mm; // of a disc: to its furthest corner
    double (*disc)[2];                           // middles of the discs
    double (*pixel)[2];                          // middles of a disc's pixels, from its middle
    double (*point)[2];                          // points of a disc that stand for point_mm2 each
    int disc_count, pixel_count, point_count;
    double point_mm2;
} alb_lit_face;

// ALB_BAD_DATA where the pattern has more points than can be summed in reasonable time. Free with alb_lit_face_free.
bool alb_lit_face_create(alb_lit_face *face, const alb_truth *truth, const alb_pattern *pattern,
                         const alb_kernel *kernels, const double white_reflectance[3], alb_error *error);
void alb_lit_face_free(alb_lit_face *face);
// Radiance W/(mm^2 sr) of three channels towards a camera at this cosine to the normal; `face` is an alb_lit_face (the
// shape that alb_flat_scene wants).
void alb_lit_face_radiance(double out[3], const void *face, double x_mm, double y_mm, double cosine);
