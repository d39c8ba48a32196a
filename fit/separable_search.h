// The inside of separable.h: the data of one search and the places it starts from.
#pragma once
#include "fit/reduced.h"
#include "fit/search.h"

enum { ALB_STARTS = 8 };

typedef struct alb_start {
    double merit, x[ALB_TERMS_MAX]; // x: ln b of the terms
} alb_start;

// The best come first.
typedef struct alb_starts {
    int count;
    alb_start list[ALB_STARTS];
} alb_starts;

// All room is the scratch.
typedef struct alb_separable_search {
    alb_reduced all, merged;
    double *input[2];            // of all and of the merged readings: rows of weight, value, energy
    double unit;                 // of the values
    int columns;                 // of the grid, for the merged readings: the nodes, and one more in its place
    const double **column;       // whitened, in order of decay
    double *nodes, *x, *scale;   // the columns themselves, their ln b, 1 / their lengths
    double *right, *gram, *gain; // products with the values and with each other, of unit length; room for merits
} alb_separable_search;

// Lays out the scratch, whitens the values in units of the largest and fills the grid; false where the values are not
// fit for it.
bool alb_separable_prepare(alb_separable_search *search, const alb_basis *basis, const double *value, const double *sd,
                           double energy_sd, double *scratch);
void alb_separable_whiten(double *out, const double *column, const alb_whitened *data);
// Makes the column of decay e^x one of the grid's.
void alb_separable_insert(alb_separable_search *search, double x);

void alb_starts_keep(alb_starts *starts, alb_start candidate);
// Goes from x to the nearest minimum of all readings; *best is replaced where that is lower.
void alb_separable_polish(alb_place *best, alb_separable_search *search, const double *x, int terms, alb_signs signs);
// A second term that gains little has rivals: from the single exponential and each peak of what a second term gains.
void alb_separable_second(alb_place *best, alb_separable_search *search, const alb_place *one, alb_signs signs);
