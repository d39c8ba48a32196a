// Relighting of fixed meshes and materials without a solution: B = S'(E + U V^T E), the bounces of light between
// patches as a product of two narrow matrices, made once; or B = S'(E + F S'E + U V^T E), more exact and dearer.
#pragma once
#include "render/radiosity.h"

typedef struct alb_relight {
    size_t count;
    int rank;                 // columns of U and V for each channel
    bool exact_bounce;        // the first bounce by form factors, the columns for the rest
    alb_radiosity *equations; // borrowed
    // [patch][column][channel] and [cluster][column][channel], whole numbers times the column's step; V has the areas
    // in it
    int16_t *u, *v;
    float *u_step, *v_step;        // [column][channel]
    double *partial;               // scratch
    alb_rgb *even;                 // scratch, of clusters
    alb_rgb *irradiance, *bounced; // scratch
    double error_percent;          // |B - exact| / |exact|, area-weighted 2-norm, worst channel: rms over test lights
    double worst_percent;          // the worst of them
    int tests;
} alb_relight;

enum { ALB_RELIGHT_RANK_MAX = 512 };

// Made of 2 rank solutions: about 6 rank products with S'F. rank: 1..ALB_RELIGHT_RANK_MAX and at most the number of
// patches, rounded up to whole eights. The error is stated from spots and points of light at random places, each solved
// to 1e-4; under a sky it is two or three times that. ALB_BAD_DATA for a rank out of range; else it fails as solutions
// do. After the materials change, make it anew.
bool alb_relight_create(alb_relight *relight, alb_radiosity *equations, const alb_patches *patches, int rank,
                        bool exact_bounce, uint64_t seed, alb_error *error);
void alb_relight_free(alb_relight *relight);
size_t alb_relight_bytes(const alb_relight *relight);
// radiosity: all bounces of the irradiance E.
void alb_relight_apply(alb_rgb *radiosity, alb_relight *relight, const alb_rgb *irradiance);
