// The reduced problem of variable projection: chi^2 of one to three exponentials by the logarithms of their decays
// alone, amplitudes eliminated; and descents in it.
#pragma once
#include "fit/columns.h"
#include "fit/material.h"

enum { ALB_TERMS_MAX = ALB_PARAMETERS_MAX / 2 };

// Positive amplitudes; or of a pair a1 > 0, a2 < 0, a1 + a2 >= 0, b2 / b1 >= ALB_TIED_RATIO; or the same at that ratio.
typedef enum alb_signs { ALB_POSITIVE, ALB_SIGNED, ALB_TIED } alb_signs;

typedef double alb_small_matrix[ALB_TERMS_MAX][ALB_TERMS_MAX];

// One profile's data and room for the terms of a place. Borrowed.
typedef struct alb_reduced {
    alb_whitened data;
    double squares; // of the whitened values
    double pivot;   // ln b between the decays of a positive pair: that of the best single exponential
    alb_term term[ALB_TERMS_MAX];
    double *residual, *work; // rows, 3 rows
} alb_reduced;

typedef struct alb_place {
    double x[ALB_TERMS_MAX], amplitude[ALB_TERMS_MAX]; // ln b
    double chi_square;                                 // INFINITY: amplitudes have not the wanted signs
    double gradient[ALB_TERMS_MAX];                    // of chi^2 / 2 by x
    alb_small_matrix newton, kaufman;                  // its Hessian, and Kaufman's approximation of it
    alb_small_matrix cc, cf, ff;                       // c_k.c_l, c_k.f_l, f_k.f_l
    double bend;                                       // r.s of the first term
} alb_place;

// Fills the place at its x.
void alb_reduced_evaluate(alb_place *place, alb_reduced *problem, int terms, alb_signs signs);
// Descends from the place's x until the next step promises less than `wanted` of chi^2.
void alb_reduced_minimise(alb_place *place, alb_reduced *problem, int terms, alb_signs signs, double wanted);
