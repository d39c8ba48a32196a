// From the pixels of a lit spot to readings by distance. Lengths in mm; values in the unit of the image.
#pragma once
#include "base/camera.h"
#include "base/error.h"
#include <stddef.h>

// Where the pixels of an image lie on a plane. NaN: not on the plane.
typedef struct alb_face {
    int width, height;
    double *x_mm, *y_mm, *area_mm2;
    double *cosine; // of the line of sight to the face's normal
} alb_face;

// A plane seen square on.
bool alb_face_flat(alb_face *face, int width, int height, double mm_per_pixel, alb_error *error);
// The plane z = 0 of the camera's world.
bool alb_face_seen(alb_face *face, const alb_camera *camera, alb_error *error);
// Of the pixel nearest to a place.
double alb_face_cosine(const alb_face *face, double x_mm, double y_mm);
void alb_face_free(alb_face *face);

// One channel of an image on a face: width * height values, NaN where nothing was measured, and their variances (NULL
// where they are not known). Borrowed.
typedef struct alb_channel {
    const alb_face *face;
    const double *value, *variance;
    const char *name; // for messages: "reflection R"
} alb_channel;

enum { ALB_RING_SAMPLES = 16 };

// How far from round: of the part of the rings that goes once (or twice) round, amplitude relative to the value.
typedef struct alb_anisotropy {
    double most, most_r_mm; // largest among the rings of clear light, and where
    double chance;          // that noise alone makes as much over all rings
} alb_anisotropy;

// Mean values over rings about the centre. Ring i holds sample_share[i][k] of its pixels at distances of mean
// sample_r_mm[i][k] with mean value sample_value[i][k].
typedef struct alb_readings {
    int count;
    double *r_mm;     // mean distance of the pixels
    double *value;    // their plain mean
    double *sd;       // of the mean
    double *area_mm2; // of the face that the reading stands for
    double (*sample_r_mm)[ALB_RING_SAMPLES], (*sample_share)[ALB_RING_SAMPLES], (*sample_value)[ALB_RING_SAMPLES];
    double (
        *harmonics)[4];  // parts of cos phi, sin phi, cos 2 phi, sin 2 phi, relative to the value; NaN: too few pixels
    double *harmonic_sd; // of each
    alb_anisotropy anisotropy[2];
    double x_mm, y_mm;               // centre
    double centre_covariance_mm2[3]; // xx, xy, yy
    long pixels, missing, glints;    // within outer_mm: read; not measured (saturated, dead); left out (glint.c)
    double outer_mm;                 // where the readings end
    double core_mm;           // a quarter of the pixels or more was not measured (saturated) out to here; 0: none
    double complete_mm;       // rings beyond are cut by the border of the image
    bool drowned;             // ended in the noise, not at the border
    double far_value, far_sd; // mean over the pixels beyond, out to the border of the image; sd 0: there are none
} alb_readings;

bool alb_readings_create(alb_readings *readings, int count, alb_error *error);
void alb_readings_free(alb_readings *readings);

// Finds the spot and reads rings. ALB_BAD_DATA where there is no spot: nothing valid, nothing above the noise, or the
// brightest place on the border.
bool alb_observe(alb_readings *readings, const alb_channel *channel, alb_error *error);
// The same, no glints looked for: every pixel counts (a spot with a sharp rim that is not round).
bool alb_observe_whole(alb_readings *readings, const alb_channel *channel, alb_error *error);

// How a spot's power lies about its centre: shares of the power (sum 1) at distances. A single sample at 0: a pencil
// beam.
typedef struct alb_spot {
    int count;
    double *r_mm, *share;
    double x_mm, y_mm; // centre of a measured one
} alb_spot;

// From an image of the spot on a white face: cut where it drowns in the noise, divided by its own sum.
bool alb_spot_measure(alb_spot *spot, const alb_channel *white, alb_error *error);
// Evenly lit disc; radius 0: a pencil beam.
bool alb_spot_disc(alb_spot *spot, double radius_mm, alb_error *error);
// Gaussian whose irradiance falls to 1/e^2 of its peak at radius_mm.
bool alb_spot_gaussian(alb_spot *spot, double radius_mm, alb_error *error);
// Spreads a stated spot over a square pixel, turned in all directions: what a camera of such pixels sees.
bool alb_spot_see(alb_spot *spot, double pixel_mm, alb_error *error);
void alb_spot_free(alb_spot *spot);
