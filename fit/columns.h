// Readings of e^(-b r) and their derivatives by ln b, whitened, for any decay b: what separable.c is built of.
#pragma once
#include "fit/basis.h"

// The whitened problem of one profile; arrays of `rows`. Borrowed.
typedef struct alb_whitened {
    const alb_basis *basis;
    const double *weight; // share / sd
    const double *energy; // the energy, whitened, is sum energy * whitened reading; NULL: not a reading of its own
    const double *value;  // value / sd
} alb_whitened;

// One term e^(-b r): column, first and second derivative by ln b, `rows` each, and their products with each other and
// the values.
typedef struct alb_term {
    double *column, *first, *second;
    double cc, cf, ff, cv;
} alb_term;

// `work` has room for 3 rows.
void alb_term_evaluate(alb_term *term, const alb_whitened *whitened, double ln_decay, double *work);
// Sums of column_x column_y, column_x first_y, first_x column_y, first_x first_y.
void alb_term_products(double out[4], const alb_term *x, const alb_term *y, int rows);
// residual = value - sum amplitude column; returns its sum of squares; products[t] those of the residual with column,
// first and second of each term.
double alb_term_residual(double *residual, double (*products)[3], const alb_whitened *whitened, const alb_term *terms,
                         const double *amplitude, int count);
// gram[i * count + j] = column_i . column_j for j >= i.
void alb_columns_gram(double *gram, const double *const *columns, int count, int rows);
double alb_columns_dot(const double *x, const double *y, int rows);
// e^x for -300 <= x <= 300 within 1e-15 of itself; below that e^-300.
void alb_columns_exp(double *x, int rows);
