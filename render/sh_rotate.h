// Rotations of spherical harmonics: out are the coefficients of f(R^-1 d), the function turned with R; bands do not
// mix. Bases, orders and batches as in sh.h; `out` may be `in`.
#pragma once
#include "render/sh.h"

// Exact to 1e-13 of the coefficients' norm. `rotation` row-major, orthonormal. Order up to ALB_SH_ROTATE_MAX.
enum { ALB_SH_ROTATE_MAX = 24 };
void alb_sh_rotate(double *out, const double *in, int order, const double rotation[3][3]);

// The frame of an axis (unit), R = Rz(phi) Ry(theta): its z is the axis, its y horizontal; from_axis turns with R,
// to_axis with its inverse. Along +z and -z phi is zero.
void alb_sh_axis_rotation(double rotation[3][3], alb_vector axis);

// In single precision, errors below 2e-6 of the coefficients' norm at every angle.
// Of a function given in the world the coefficients in the frame of its item's axis, axes[c * stride + r] of any
// length; and back. A length of zero turns nothing.
void alb_sh_to_axis_batch(float *out, const float *in, int order, const float *axes, size_t stride, size_t count);
void alb_sh_from_axis_batch(float *out, const float *in, int order, const float *axes, size_t stride, size_t count);
// By quaternions x, y, z, w at [c * stride + r], of any length but zero.
void alb_sh_rotate_batch(float *out, const float *in, int order, const float *quaternions, size_t stride, size_t count);
