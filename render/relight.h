// Relighting of fixed meshes and materials without a solution: B = S'(E + U V^T E), the bounces of light between
// patches as a product of two narrow matrices, made once; or B = S'(E + F S'E + U V^T E), more exact and dearer.
#pragma once
#include "render/radiosity.h"

typedef struct alb_relight {
    size_t count;
    int rank;                 // columns of U and V for each channel
    bool exact_bounce;        // the first bounce by form factors, the columns for the rest
    alb_radiosity *equations; // borrowed
    // [mode][column][channel] and [cluster][column][channel], whole numbers times the column's step; V has the areas in
    // it. Modes of cluster k are first_mode[k] .. first_mode[k + 1] - 1; the shares of its patches in them, patch after
    // patch, begin at first_share[k].
    int16_t *u, *v;
    uint32_t *first_mode, *first_share;
    float (*shares)[3];
    float *u_step, *v_step;        // [column][channel]
    double *partial;               // scratch
    alb_rgb *even;                 // scratch, of clusters
    alb_rgb *irradiance, *bounced; // scratch
    // |B - exact| / |exact|, area-weighted 2-norm, worst channel, exact with the same scattering: rms over the test
    // lights of the kind that errs most, and the worst light
    double error_percent, worst_percent;
    int tests;
} alb_relight;

enum { ALB_RELIGHT_RANK_MAX = 512, ALB_RELIGHT_MODES_MAX = 16, ALB_RELIGHT_ROWS = 256 };

static inline size_t alb_relight_numbers(const alb_relight *r) { return 3 * (size_t)r->rank; }
// Clusters are summed in blocks of ALB_RELIGHT_ROWS.
static inline size_t alb_relight_blocks(const alb_relight *r)
{
    return (r->equations->clusters.count + ALB_RELIGHT_ROWS - 1) / ALB_RELIGHT_ROWS;
}

// Made of 2 rank solutions: about 6 rank products with S'F. rank: 1..ALB_RELIGHT_RANK_MAX and at most the number of
// patches, rounded up to whole eights. The error is stated from lights of four kinds at random places, solved to 1e-4.
// Quicker to make and to use where the scattering keeps weights (scatter.h), whose error comes on top. ALB_BAD_DATA for
// a rank out of range; else it fails as solutions do. After the materials change, make it anew.
bool alb_relight_create(alb_relight *relight, alb_radiosity *equations, const alb_patches *patches, int rank,
                        bool exact_bounce, uint64_t seed, alb_error *error);
// A step of it: U and its modes from its columns, each with the length of its adjoint.
bool alb_relight_find_modes(alb_relight *relight, alb_rgb *const *columns, const double (*lengths)[3],
                            alb_error *error);
void alb_relight_free(alb_relight *relight);
size_t alb_relight_bytes(const alb_relight *relight);
// radiosity: all bounces of the irradiance E.
void alb_relight_apply(alb_rgb *radiosity, alb_relight *relight, const alb_rgb *irradiance);
