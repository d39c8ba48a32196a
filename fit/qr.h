// J = Q R of a tall matrix with columns scaled to unit length, and what least squares take from it.
#pragma once
#include <stdbool.h>

// Borrowed room, all of it the caller's.
typedef struct alb_qr {
    int rows, columns;        // rows >= columns
    double *const *column;    // columns x rows: J, then R above the diagonal
    double *right;            // rows: r, then Q^T r; may be NULL
    double *scale, *diagonal; // columns: their lengths; the diagonal of R
} alb_qr;

// Factors in place. False, with the columns destroyed, where one is zero or not finite, or linear in those before it
// but for `least` of itself.
bool alb_qr_factor(const alb_qr *qr, double least);
// x = R^-1 x, in units of the columns' lengths.
void alb_qr_back_substitute(double *x, const alb_qr *qr);
// (J^T J)^-1, rows `stride` apart. `work` has room for columns * columns. Returns the condition of the scaled J^T J by
// Frobenius norms, an upper bound of the 2-norm's.
double alb_qr_covariance(double *covariance, int stride, const alb_qr *qr, double *work);
