// Relighting of fixed meshes and materials without a solution: B = S'(E + G), the irradiance G that patches send each
// other as a first bounce at the few receivers that it takes, and two narrow matrices for the bounces after it.
#pragma once
#include "render/relight_receivers.h"

typedef struct alb_relight {
    size_t count;
    int rank;                 // columns of U and V for each channel
    alb_radiosity *equations; // borrowed
    alb_receivers receivers;
    // [receiver][column][channel] and [cluster][column][channel], whole numbers times the column's step; V has the
    // areas in it.
    int16_t *u, *v;
    float *u_step, *v_step;         // [column][channel]
    double *partial;                // scratch
    alb_rgb *even, *sent, *bounced; // scratch, of clusters
    alb_rgb *irradiance;            // scratch
    // |B - exact| / |exact|, area-weighted 2-norm, worst channel, exact by the links of the scattering: rms over the
    // test lights of the kind that errs most, and the worst light
    double error_percent, worst_percent;
    int tests;
} alb_relight;

enum { ALB_RELIGHT_RANK_MAX = 512, ALB_RELIGHT_ROWS = 256 };

static inline size_t alb_relight_numbers(const alb_relight *r) { return 3 * (size_t)r->rank; }
// Clusters are summed in blocks of ALB_RELIGHT_ROWS.
static inline size_t alb_relight_blocks(const alb_relight *r)
{
    return (r->equations->clusters.count + ALB_RELIGHT_ROWS - 1) / ALB_RELIGHT_ROWS;
}

// Made of 2 rank + 32 solutions. rank: 0..ALB_RELIGHT_RANK_MAX and at most the number of patches, rounded up to whole
// eights. The error is stated from lights of four kinds at random places, solved to 1e-4. Quicker to make and to use
// where the scattering keeps weights (scatter.h), whose error is in what is stated. ALB_BAD_DATA for a rank out of
// range; else it fails as solutions do. After the materials change, make it anew.
bool alb_relight_create(alb_relight *relight, alb_radiosity *equations, const alb_patches *patches, int rank,
                        uint64_t seed, alb_error *error);
void alb_relight_free(alb_relight *relight);
size_t alb_relight_bytes(const alb_relight *relight);
// radiosity: all bounces of the irradiance E, RGB per area, a row for each patch both. E is nowhere negative; nor is
// the radiosity. One at a time: it uses the scratch.
void alb_relight_apply(alb_rgb *radiosity, alb_relight *relight, const alb_rgb *irradiance);
