// Products of functions given by spherical harmonics. Bases, orders and batches as in sh.h.
#pragma once
#include "base/error.h"
#include "render/sh_project.h"

// Integral of the product of two functions over the sphere.
static inline double alb_sh_dot(const double *a, const double *b, int order)
{
    double sum = 0;
    for (int i = 0; i < order * order; i++)
        sum += a[i] * b[i];
    return sum;
}
void alb_sh_dot_batch(float *out, const float *a, const float *b, int order, size_t stride, size_t count);

// The first out_order^2 coefficients of the product of `count` functions of `order` (0: the constant one), exact: the
// factors are multiplied as functions, at nodes enough for the whole product, and projected once. No order of
// multiplication, no loss between; `factors` coefficients one function after the other. Needs (degree + 1)^2 / 2 nodes,
// degree = count (order - 1) + out_order - 1, which may be at most ALB_SH_DEGREE_MAX, as for alb_sh_project.
bool alb_sh_product(double *out, int out_order, const double *factors, int order, size_t count, alb_error *error);

// The product of two, cut to the order of both (the triple product of Snyder 2006), errors below 3e-6 of the product
// of their norms. `out` may be a or b.
//
// Cutting after each of several factors loses what the next would have brought back into the bands kept, and something
// else in another order of multiplication: it is not associative (for eight caps of order 4 the orders differ by rms
// 0.04). Where several are multiplied in turn, multiply from the nearest to the farthest, the same for every receiver.
// Most of the error is that of the factors: order 6 throughout, cut at the end, brings 0.065 down to 0.018.
void alb_sh_product_batch(float *out, const float *a, const float *b, int order, size_t stride, size_t count);
