// The directions into which a face sheds its light: radiance against that of a Lambertian face of the same exitance.
#pragma once
#include "capture/photon.h"

// Zero: a Lambertian face.
typedef struct alb_lobe {
    bool traced;
    double ratio[ALB_PHOTON_COSINES]; // pi L / M in the middles of equal bins of the cosine to the normal, in air
} alb_lobe;

// Of the scattered light that left `face` (0 reflection, 1 transmission); Lambertian where none did.
void alb_lobe_from_photons(alb_lobe *lobe, const alb_photon_tally *tally, int face);
// pi L / M towards a camera whose line of sight makes this cosine with the normal.
double alb_lobe_value(const alb_lobe *lobe, double cosine);
