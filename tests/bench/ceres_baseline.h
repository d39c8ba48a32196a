// What a user of Ceres writes first: a e^(-b r) + c e^(-d r), default options.
#pragma once
#include <stdbool.h>

// parameters a, b, c, d in place, from a start; derivatives by dual numbers, a residual block for each reading, or
// analytic in one block. *chi_square is infinite where Ceres gives up.
void ceres_baseline(double parameters[4], double *chi_square, const double *r_mm, const double *value, const double *sd,
                    int count, bool one_block, int iterations);
