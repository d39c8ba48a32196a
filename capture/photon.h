// Photons scattered in a slab: Monte Carlo of a pencil beam at normal incidence. The virtual rig's truth; it shares no
// formula with what fit recovers.
#pragma once
#include "base/error.h"
#include <stdint.h>

enum { ALB_PHOTON_BINS = 64, ALB_PHOTON_BLOCKS = 128, ALB_PHOTON_COSINES = 40 };

typedef struct alb_medium {
    double absorption_per_mm, scattering_per_mm;
    double anisotropy;       // Henyey-Greenstein g, -1 < g < 1
    double refractive_index; // of the slab, in air; both faces smooth for the light inside
    double thickness_mm;
} alb_medium;

// What became of the light: shares of the incident flux. Faces: 0 reflection (the lit face), 1 transmission.
// specular + absorbed + leaving[0] + leaving[1] = 1 to rounding.
typedef struct alb_photon_tally {
    double edges_mm[ALB_PHOTON_BINS + 1]; // radius * (i / bins)^2
    double ring[2][ALB_PHOTON_BINS];      // scattered light that leaves through ring i
    double ring_sd[2][ALB_PHOTON_BINS];
    double cosine[2][ALB_PHOTON_COSINES]; // scattered light that leaves, at all radii, by its cosine to the normal in
                                          // air: equal bins from 0 to 1
    double unscattered[2];                // leaves at r = 0, exact
    double leaving[2], leaving_sd[2];     // all radii, unscattered included
    double specular, absorbed;            // specular: from the outside of the lit face
} alb_photon_tally;

// Traces `photons`, rounded up to whole blocks. Photon i depends on (seed, stream, i) alone: same bytes with any number
// of threads. Standard deviations come from the scatter of the blocks (6 % uncertain themselves). ALB_NO_MEMORY is the
// only failure; the medium must be sensible (truth.h checks).
bool alb_photon_trace(alb_photon_tally *tally, const alb_medium *medium, double radius_mm, long photons, uint64_t seed,
                      uint64_t stream, alb_error *error);
