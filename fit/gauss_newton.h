// Gauss-Newton steps and the covariance of a least-squares problem, by QR of its Jacobian.
#pragma once
#include "fit/solve.h"

// Improves parameters that are next to a minimum to the last digits; leaves them where no step brings them nearer.
// *chi_square is updated; *full_rank false where the Jacobian is not of full rank there. Fails only for want of memory.
bool alb_gauss_newton(double *parameters, double *chi_square, bool *full_rank, const alb_problem *problem,
                      alb_error *error);
// (J^T J)^-1, parameter_count x parameter_count; *full_rank false (and zeros) where a column of J is linear in those
// before it but for 1e-13 of itself.
bool alb_problem_covariance(double *covariance, bool *full_rank, const double *parameters, const alb_problem *problem,
                            alb_error *error);
