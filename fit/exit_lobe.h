// The directions into which a slab of known absorption and scattering sheds the light of a beam that enters it
// perpendicularly, by radiative transfer.
#pragma once
#include "capture/session.h" // alb_side
#include "fit/adding_doubling.h"

typedef struct alb_exit_lobe {
    int count; // streams that leave
    double refractive_index, cosine[ALB_STREAMS_MAX];
    double radiance[ALB_SIDES][ALB_STREAMS_MAX]; // within, over that of an exitance of pi
} alb_exit_lobe;

// All distances from the beam together; thickness > 0. Coefficients in one unit of length, not both 0.
void alb_exit_lobe_of(alb_exit_lobe *lobe, const alb_streams *streams, double absorption, double reduced_scattering,
                      double thickness);
// pi L / M of the light that was scattered, at this cosine to the normal in air.
double alb_exit_lobe_ratio(const alb_exit_lobe *lobe, alb_side side, double cosine);
