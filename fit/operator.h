// The forward model: what the readings of a profile S lit by a finite spot would be, as a sparse linear operator.
#pragma once
#include "fit/material.h"
#include "fit/observe.h"

typedef struct alb_operator {
    int row_count, grid_count;
    double *grid_mm;   // distances at which S is wanted, rising
    int *first, *last; // row i uses grid points first[i] .. last[i]
    size_t *offset;    // of its weights
    double *weight;
} alb_operator;

bool alb_operator_create(alb_operator *forward, const alb_readings *readings, const alb_spot *spot, alb_error *error);
// Readings that are values of S at their distances.
bool alb_operator_identity(alb_operator *forward, const alb_readings *readings, alb_error *error);
// The same on every `factor`-th grid point, the weights of the others split between their neighbours; a copy where the
// grid is too small for that (readings at their distances).
bool alb_operator_coarsen(alb_operator *coarse, const alb_operator *forward, int factor, alb_error *error);
void alb_operator_free(alb_operator *forward);
// out[row][c] = sum_k weight on_grid[k][c], four columns at once.
enum { ALB_OPERATOR_COLUMNS = 4 };
void alb_operator_apply(double (*out)[ALB_OPERATOR_COLUMNS], const alb_operator *forward,
                        const double (*on_grid)[ALB_OPERATOR_COLUMNS]);
// The readings of a profile; free with free().
double *alb_operator_readings(const alb_operator *forward, const alb_profile *profile, alb_error *error);
