// Intervals of a fitted profile by the profile likelihood, and the Cramer-Rao bound beside them.
#pragma once
#include "fit/search.h"

// What an interval is of.
typedef struct alb_quantity {
    enum { ALB_QUANTITY_PARAMETER, ALB_QUANTITY_TOTAL, ALB_QUANTITY_VALUE } kind;
    int parameter; // of the form
    double r_mm;   // of S(r)
} alb_quantity;

// Ends in the sign of the quantity, lower < upper. Open: the data set no limit; the end is then the furthest looked at.
typedef struct alb_interval {
    double lower, upper;
    bool lower_open, upper_open;
} alb_interval;

enum { ALB_LIKELIHOOD_CONSTRAINTS = 2 * ALB_PARAMETERS_MAX };

// chi-square around the best fit, in the logarithms of the parameters and the offset, a constant added to all readings.
// One thread each; zero is empty.
typedef struct alb_likelihood {
    alb_model model;
    alb_candidate candidate;
    alb_profile best;
    double chi_square; // of best
    double offset;     // of best, in the unit of the readings; 0 where none is fitted
    bool with_offset;
    int free_count, rows; // inside from here on
    int parameter[ALB_PARAMETERS_MAX + 1];
    double sign[ALB_PARAMETERS_MAX], offset_unit;
    struct {
        int plus, minus; // u[plus] - u[minus] >= limit; minus < 0: u[plus] alone; open: no limit of the form
        double scale, limit;
        bool open;
    } constraints[ALB_LIKELIHOOD_CONSTRAINTS];
    int constraint_count;
    double *reading, *residual, *columns[ALB_PARAMETERS_MAX + 1];
} alb_likelihood;

// Goes from `start` to the nearest minimum. No parameter of it may be 0. The weighing is borrowed.
bool alb_likelihood_create(alb_likelihood *likelihood, const alb_profile *start, alb_candidate candidate,
                           const alb_weighing *weighing, bool with_offset, alb_error *error);
void alb_likelihood_free(alb_likelihood *likelihood);

// Where chi-square, least over all else, has risen by `rise` (3.841: 95 %). Where `worst` is not NULL: raises worst[p]
// to the largest Cramer-Rao bound of parameter p, relative to it, at the two ends that the data allow with 99 % (rise
// 6.635); INFINITY where they set no limit there.
alb_interval alb_likelihood_interval(alb_likelihood *likelihood, alb_quantity quantity, double rise, double *worst);
// The best profile with the quantity held at `value`, from the best fit; returns its chi-square.
double alb_likelihood_hold(alb_profile *profile, alb_likelihood *likelihood, alb_quantity quantity, double value);
// Covariance of the logarithms of the parameters (the last row and column: of the offset, in its own unit) at the
// profile, by QR of the whitened Jacobian with columns scaled to unit length; the Cramer-Rao bound. *condition is that
// of the scaled J^T J by Frobenius norms, an upper bound of the 2-norm's. False where rank is deficient.
bool alb_likelihood_bound(double covariance[ALB_PARAMETERS_MAX + 1][ALB_PARAMETERS_MAX + 1], double *condition,
                          alb_likelihood *likelihood, const alb_profile *profile);
