// Bounded nonlinear least squares by Ceres (Levenberg-Marquardt, dense QR), behind a C face; the last digits by
// Gauss-Newton steps (gauss_newton.h). Where a term has run off to where it no longer shows, so that the Jacobian has
// lost its rank, once more from the start with short steps.
#pragma once
#include "base/error.h"

typedef struct alb_problem {
    int parameter_count, residual_count;
    // Fills the whitened residuals and, where not NULL, their Jacobian (row-major, residual_count x parameter_count).
    // Must not fail; values that are not finite make the solver shorten its step. chi-square and the sd scaled by it
    // have the digits that the residuals have: where those are below 1e-9 of the values, subtract in extended
    // precision.
    void (*evaluate)(double *residuals, double *jacobian, const double *parameters, const void *context);
    const void *context;
    const double *lower, *upper; // bounds of the parameters
} alb_problem;

// Improves the parameters in place; *chi_square is the sum of squares there. Silent. The starting point must lie within
// the bounds. Fails only where memory or Ceres itself does.
bool alb_solve(double *parameters, double *chi_square, const alb_problem *problem, alb_error *error);
