// How a face answers light at one point, made ready to be summed: the radial kernel, blurred by the projector's
// Gaussian, in a fine table.
#pragma once
#include "capture/lobe.h"
#include "capture/truth.h"

typedef struct alb_kernel {
    double step_mm;        // spacing of the table
    int count;             // 0: empty
    double *value_per_mm2; // at 0, step, 2 step, ...; zero beyond the last
    double unscattered;    // share of the light that leaves where it falls
    double total;          // share that leaves, everywhere
    alb_lobe lobe;         // the directions it takes
} alb_kernel;

// What truth.json tells of a traced or stated kernel; stated ones are exact (sd 0).
void alb_response_from_photons(alb_response *response, const alb_photon_tally *tally, int face);
void alb_response_from_profile(alb_response *response, const alb_stated_profile *profile, double radius_mm);
// The table out to radius_mm; ALB_NO_MEMORY only. Free with alb_kernel_free.
bool alb_kernel_from_photons(alb_kernel *kernel, const alb_photon_tally *tally, int face, double blur_sd_mm,
                             double radius_mm, alb_error *error);
bool alb_kernel_from_profile(alb_kernel *kernel, const alb_stated_profile *profile, double blur_sd_mm, double radius_mm,
                             alb_error *error);
void alb_kernel_free(alb_kernel *kernel);
// Blurred kernel at the distance r (mm), by linear interpolation.
static inline double alb_kernel_value(const alb_kernel *kernel, double r)
{
    const double t = r / kernel->step_mm;
    const int i = (int)t;
    if (i >= kernel->count - 1)
        return 0;
    return kernel->value_per_mm2[i] + (t - i) * (kernel->value_per_mm2[i + 1] - kernel->value_per_mm2[i]);
}
