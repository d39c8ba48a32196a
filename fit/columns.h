// Readings of e^(-b r) and their derivatives by ln b, whitened, for any decay b: what separable.c is built of.
#pragma once
#include "fit/operator.h"

// What all profiles read at the same places share. Arrays of `rows` hold the readings, behind them room for their
// energy (sum value * area), and zeros up to a multiple of four. Zero is empty.
typedef struct alb_basis {
    int count, rows;
    double lowest, highest;   // bounds of ln b, b in 1/mm
    int nodes;                // of the grid on which a search starts
    double first, step;       // ln b of its first node, and between nodes
    double *column;           // nodes x rows: readings of e^(-b r) at the nodes
    double *tied;             // the same at ALB_TIED_RATIO b
    double *distance, *slope; // fine nodes x rows: rho(ln b) in mm and its derivative; slope NULL: one row of distances
    int fine_nodes;           // from `lowest` on
    double fine_step;
    double *share, *area_mm2; // rows: reading of S = 1; area that a reading stands for
    int *group;               // readings [group[g], group[g + 1]) are one of `merged`
    struct alb_basis *merged; // of neighbouring readings merged, for the first steps of a search; NULL there
} alb_basis;

bool alb_basis_create(alb_basis *basis, const alb_readings *readings, const alb_operator *forward, alb_error *error);
void alb_basis_free(alb_basis *basis);

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
