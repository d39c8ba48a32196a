// Vectors of three channels a patch and what solvers do with them: inner products weighted by area and sums of many
// vectors at once, each in one pass over memory. Same bytes with any number of threads: partial sums of blocks of fixed
// size, added in order.
#pragma once
#include "base/error.h"
#include <math.h>
#include <stddef.h>

typedef double alb_rgb[3];

enum { ALB_SPACE_VECTORS = 24 }; // at once, at most

typedef struct alb_space {
    size_t count;
    const double *areas_mm2; // borrowed
    double total_mm2;
    double (*partial)[ALB_SPACE_VECTORS][3]; // scratch: of each block
} alb_space;

// Vectors of `count` patches. Fails for want of memory alone.
bool alb_space_create(alb_space *space, const double *areas_mm2, size_t count, alb_error *error);
void alb_space_free(alb_space *space);

// The largest channel, NAN where one is none: fmax would pass over it.
static inline double alb_rgb_largest(const double values[3])
{
    double largest = values[0];
    for (int c = 1; c < 3; c++)
        if (!(values[c] <= largest) && !isnan(largest))
            largest = values[c];
    return largest;
}

// out[k] = <a, b_k> per channel, the mean over area.
void alb_space_dots(double (*out)[3], const alb_space *space, const alb_rgb *a, alb_rgb *const *b, int count);
// a += sum_k factors[k] b_k; norm (may be NULL) of the result.
void alb_space_add(double norm[3], const alb_space *space, alb_rgb *a, const double (*factors)[3], alb_rgb *const *b,
                   int count);
// a *= factor, channel by channel.
void alb_space_scale(const alb_space *space, alb_rgb *a, const double factor[3]);
// r = right + r - x, with its norm and its mean absolute value: the residual from r = K x.
void alb_space_residual(double norm[3], double mean[3], const alb_space *space, alb_rgb *r, const alb_rgb *right,
                        const alb_rgb *x);
// Area-weighted 2-norm; the same of sqrt(weights) a (NULL: ones); mean over area of |a|.
void alb_space_norm(double out[3], const alb_space *space, const alb_rgb *a);
void alb_space_weighted_norm(double out[3], const alb_space *space, const alb_rgb *a, const alb_rgb *weights);
void alb_space_mean(double out[3], const alb_space *space, const alb_rgb *a);
// Takes from vectors[k] what the orthonormal vectors[0 .. k) span, twice (Gram-Schmidt), and makes it one long; a
// channel of which no more than the share `least` is left becomes zero. images (NULL: none): of the vectors under one
// linear map, which they stay.
void alb_space_orthonormalise(const alb_space *space, alb_rgb *const *vectors, alb_rgb *const *images, int k,
                              double least);
