// Small symmetric positive definite systems: A = L L^T (Golub & Van Loan, Matrix Computations, sec. 4.2). In the
// header, because fits of microseconds solve them in their innermost loop.
#pragma once
#include <math.h>
#include <stdbool.h>

// L in place of the lower triangle of the first n rows of a, `stride` doubles apart. False, with a destroyed, where a
// pivot is not above `least` of its diagonal: a row is linear in those before it but for that share.
static inline bool alb_cholesky_factor(double *a, int n, int stride, double least)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            const double diagonal = a[i * stride + i];
            double sum = a[i * stride + j];
            for (int k = 0; k < j; k++)
                sum -= a[i * stride + k] * a[j * stride + k];
            if (i == j && !(sum > least * diagonal))
                return false;
            a[i * stride + j] = i == j ? sqrt(sum) : sum / a[j * stride + j];
        }
    return true;
}

// x = (L L^T)^-1 x, in place.
static inline void alb_cholesky_solve(double *x, const double *l, int n, int stride)
{
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++)
            x[i] -= l[i * stride + k] * x[k];
        x[i] /= l[i * stride + i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++)
            x[i] -= l[k * stride + i] * x[k];
        x[i] /= l[i * stride + i];
    }
}
