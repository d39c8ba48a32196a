// chi-square of a profile and its Gauss-Newton matrix, with a quantity held and the form's limits: the inside of
// profile_likelihood.h. u: logarithms of the parameters, the offset last, in its own sd.
#pragma once
#include "fit/profile_likelihood.h"

enum { ALB_LIKELIHOOD_FREE = ALB_PARAMETERS_MAX + 1, ALB_POINT_MATRIX = ALB_LIKELIHOOD_FREE * ALB_LIKELIHOOD_FREE };

typedef struct alb_hold {
    alb_quantity quantity;
    double value, sd; // of ln |quantity|
} alb_hold;

// A point: where it is, chi-square there, and the Gauss-Newton matrix of chi-square alone.
typedef struct alb_point {
    double u[ALB_LIKELIHOOD_FREE], chi_square, penalty, matrix[ALB_POINT_MATRIX], gradient[ALB_LIKELIHOOD_FREE];
    double full_matrix[ALB_POINT_MATRIX], full_gradient[ALB_LIKELIHOOD_FREE]; // with what is held and the limits
    double held;                                                              // ln |quantity|, where one is held
} alb_point;

alb_profile alb_likelihood_profile(const alb_likelihood *likelihood, const double *u);
void alb_likelihood_logarithms(double *u, const alb_likelihood *likelihood, const alb_profile *profile);
// ln |quantity| and its derivatives by u.
double alb_likelihood_quantity(double *gradient, const alb_likelihood *likelihood, alb_quantity quantity,
                               const double *u);
// Of limit c, above 0 where it is violated.
double alb_likelihood_violation(const alb_likelihood *likelihood, int c, const double *u);
void alb_likelihood_set_constraints(alb_likelihood *likelihood);
// The constant 1, whitened, of unit length, so that the offset counts in its own sd: the last of the columns.
void alb_likelihood_set_offset_column(alb_likelihood *likelihood);
// Residuals and Jacobian at u into the likelihood's room.
void alb_likelihood_linearise(alb_likelihood *likelihood, const double *u);
// Fills the point at its u; held may be NULL.
void alb_point_evaluate(alb_point *at, alb_likelihood *likelihood, const alb_hold *held);
// From at->u to the nearest minimum, in place, until a step promises less than 1e-9 of chi-square.
void alb_point_minimise(alb_point *at, alb_likelihood *likelihood, const alb_hold *held);
// x of (A + damping diag A) x = b; false where it is not positive definite.
bool alb_point_solve(double *x, const double *a, const double *b, int n, double damping);
