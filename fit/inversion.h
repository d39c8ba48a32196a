// Two equations in two unknowns: the slab of thickness 1 whose totals are given.
#pragma once
#include "fit/adding_doubling.h"

// Totals of a slab of thickness 1 as a function of (sigma_a, sigma_s'), and the share of the light that enters it.
typedef struct alb_transfer {
    alb_totals (*totals)(const void *model, double absorption, double scattering);
    const void *model;
    double entry, boundary, refractive_index; // boundary: A of diffusion (fresnel.h), for the first guess
} alb_transfer;

// The readings as they are solved for: lost share and ln(T/R), or, where nothing is lost, ln(T/R) alone.
typedef struct alb_wanted {
    double log_lost, log_ratio;
    double rounding[2]; // of ln(T/R) and ln(lost): 1e-12 of the flux
    bool lossless;
} alb_wanted;

alb_wanted alb_wanted_of(double entry, double reflection, double transmission);

// x = (ln sigma_s', ln sigma_a) that gives these readings, from no start, to `tolerance` in each; false where none was
// found. Lossless: x[1] is not used.
bool alb_slab_find(double x[2], const alb_transfer *slab, const alb_wanted *wanted, double tolerance);
// The same for a dear `slab` from the solution x of a `coarse` one close to it, to 1e-10.
bool alb_slab_refine(double x[2], const alb_transfer *slab, const alb_transfer *coarse, const alb_wanted *wanted);
// Derivatives of the two equations, (ln(T/R), ln(lost)), by x, where their residuals are f.
bool alb_slab_jacobian(double j[2][2], const alb_transfer *slab, const alb_wanted *wanted, const double x[2],
                       const double f[2]);
// step = -j^-1 f, shortened to `limit` at most in either direction; false where j is singular.
bool alb_slab_step(double step[2], double j[2][2], const double f[2], double limit);
