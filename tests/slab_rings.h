// Readings of a slab made by photons (capture/photon.c, which fit knows nothing of): rings from 1 to 25 transport mean
// free paths about a pencil beam, to which a photograph adds noise and a scale.
#pragma once
#include "base/random.h"
#include "capture/photon.h"
#include "fit/joint.h"
#include <math.h>
#include <stdlib.h>

typedef struct slab_rings {
    alb_slab slab;
    int count[ALB_SIDES];
    double value[ALB_SIDES][ALB_PHOTON_BINS], sd[ALB_SIDES][ALB_PHOTON_BINS]; // of the photons
    alb_readings readings[ALB_SIDES];
    alb_operator forward[ALB_SIDES];
} slab_rings;

static inline void slab_rings_free(slab_rings *rings)
{
    for (int side = 0; side < ALB_SIDES; side++) {
        alb_readings_free(&rings->readings[side]);
        alb_operator_free(&rings->forward[side]);
    }
}

static inline bool slab_rings_side(slab_rings *rings, const alb_photon_tally *tally, int side, double mfp_mm,
                                   alb_error *error)
{
    int bins[ALB_PHOTON_BINS], count = 0;
    for (int i = 0; i < ALB_PHOTON_BINS; i++) // rings that a hundred photons reach
        if (tally->edges_mm[i] > mfp_mm && tally->edges_mm[i + 1] < 25 * mfp_mm &&
            tally->ring_sd[side][i] < 0.1 * tally->ring[side][i])
            bins[count++] = i;
    alb_readings *readings = &rings->readings[side];
    alb_spot beam = {0};
    if (!alb_readings_create(readings, count, error) || !alb_spot_disc(&beam, 0, error))
        return false;
    rings->count[side] = count;
    for (int k = 0; k < count; k++) {
        const double from = tally->edges_mm[bins[k]], to = tally->edges_mm[bins[k] + 1];
        const double area = M_PI * (to * to - from * from);
        rings->value[side][k] = tally->ring[side][bins[k]] / area;
        rings->sd[side][k] = tally->ring_sd[side][bins[k]] / area;
        readings->r_mm[k] = 0.5 * (from + to);
        readings->area_mm2[k] = area;
        for (int i = 0; i < ALB_RING_SAMPLES; i++) {
            readings->sample_r_mm[k][i] = sqrt(from * from + (to * to - from * from) * (i + 0.5) / ALB_RING_SAMPLES);
            readings->sample_share[k][i] = 1.0 / ALB_RING_SAMPLES;
        }
    }
    const bool ok = alb_operator_create(&rings->forward[side], readings, &beam, error);
    alb_spot_free(&beam);
    return ok;
}

static inline bool slab_rings_create(slab_rings *rings, const alb_slab *slab, long photons, alb_error *error)
{
    const alb_medium medium = {slab->absorption_per_mm, slab->scattering_per_mm, slab->anisotropy,
                               slab->refractive_index, slab->thickness_mm};
    const double mfp_mm = 1 / (slab->absorption_per_mm + slab->scattering_per_mm * (1 - slab->anisotropy));
    alb_photon_tally *tally = calloc(1, sizeof *tally);
    *rings = (slab_rings){.slab = *slab};
    const bool ok = tally && alb_photon_trace(tally, &medium, 26 * mfp_mm, photons, 21, 0, error) &&
                    slab_rings_side(rings, tally, 0, mfp_mm, error) && slab_rings_side(rings, tally, 1, mfp_mm, error);
    free(tally);
    return ok;
}

// Readings of one photograph: `noise` of each reading, a common factor; their sd has the photons' own in it, so that
// the bound of a fit has it too.
static inline bool slab_rings_photograph(alb_readings readings[ALB_SIDES], const slab_rings *rings, double noise,
                                         double scale, uint64_t trial, alb_error *error)
{
    alb_random random = alb_random_at(77, 0, trial);
    for (int side = 0; side < ALB_SIDES; side++) {
        if (!alb_readings_create(&readings[side], rings->count[side], error))
            return false;
        for (int k = 0; k < rings->count[side]; k++) {
            readings[side].r_mm[k] = rings->readings[side].r_mm[k];
            readings[side].value[k] = scale * rings->value[side][k] * (1 + noise * alb_random_normal(&random));
            readings[side].sd[k] = hypot(noise * rings->value[side][k], rings->sd[side][k]);
        }
    }
    return true;
}

// Fits one photograph. `one_side`: reflection alone.
static inline bool slab_rings_fit(alb_joint *joint, const slab_rings *rings, double noise, double scale,
                                  double scale_sd, uint64_t trial, bool one_side, alb_error *error)
{
    alb_readings readings[ALB_SIDES] = {{0}};
    const alb_joint_known known = {
        rings->slab.thickness_mm, rings->slab.refractive_index, rings->slab.anisotropy, 0, scale_sd, 0};
    bool ok = slab_rings_photograph(readings, rings, noise, scale, trial, error);
    alb_joint_side sides[ALB_SIDES] = {{&readings[0], &rings->forward[0]}, {&readings[1], &rings->forward[1]}};
    if (one_side)
        sides[1] = (alb_joint_side){0};
    ok = ok && alb_joint_fit(joint, sides, &known, error);
    alb_readings_free(&readings[0]);
    alb_readings_free(&readings[1]);
    return ok;
}
