// Zonal functions, those round an axis: one coefficient a band, z_l along the basis function Y_l0 of the axis. Basis,
// orders and batches as in sh.h.
#pragma once
#include "render/sh.h"

// One within `angle` (0 to pi) of the axis, zero beyond: 2 pi K_l^0 (P_l-1 - P_l+1)(cos angle) / (2l + 1).
void alb_sh_zonal_cap(double *zonal, int order, double angle);
// max(0, cos theta): what turns radiance into irradiance (Ramamoorthi & Hanrahan 2001).
void alb_sh_zonal_cosine(double *zonal, int order);
// The function with its axis along a unit vector: sqrt(4 pi / (2l + 1)) z_l Y_lm(axis).
void alb_sh_zonal_turn(double *out, const double *zonal, int order, alb_vector axis);
// Of f the integral of f(d) kernel(angle between d and e) for every e: with the cosine, irradiance by normal.
void alb_sh_zonal_convolve(double *out, const double *in, const double *kernel, int order);
// Caps, each with its axis (unit) and the cosine of its angle; errors below 3e-6. `out` as in sh.h.
void alb_sh_cap_batch(float *out, int order, const float *axes, const float *cosines, size_t stride, size_t count);
