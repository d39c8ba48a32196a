// Non-negative least squares over columns: which few, with positive amplitudes, come closest to the values.
#pragma once

enum { ALB_ATOMS_MAX = 8 };

typedef struct alb_measure {
    int count, column[ALB_ATOMS_MAX]; // rising
    double amplitude[ALB_ATOMS_MAX];  // of the column scaled to unit length
} alb_measure;

// right: products of the columns, scaled to unit length by `scale`, with the values. Ends where no column would lower
// the sum of squares by more than about `wanted`, or with ALB_ATOMS_MAX of them. `work` has room for columns * columns.
void alb_measure_fit(alb_measure *measure, const double *const *column, const double *right, const double *scale,
                     int columns, int rows, double wanted, double *work);
