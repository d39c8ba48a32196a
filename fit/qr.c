// J = Q R by Householder reflections (Golub & Van Loan, Matrix Computations, sec. 5.2), columns scaled to unit length;
// (J^T J)^-1 = R^-1 R^-T. The condition of J enters once, not squared. Stops being true where a column is linear in
// those before it but for about the rounding, 1e-15 times the square root of the rows.
#include "fit/qr.h"
#include <math.h>
#include <stddef.h>
#include <string.h>

// Sums from row `from` on, in order.
static double dot(const double *x, const double *y, int from, int rows)
{
    double sum = 0;
    for (int i = from; i < rows; i++)
        sum += x[i] * y[i];
    return sum;
}

// Reflects column j into the diagonal, and with it the columns behind it and the right side.
static void reflect(const alb_qr *qr, int j)
{
    double *v = qr->column[j];
    const int n = qr->columns, rows = qr->rows;
    const double length = sqrt(dot(v, v, j, rows)), head = v[j] > 0 ? -length : length;
    qr->diagonal[j] = head;
    v[j] -= head;
    const double half = -head * v[j]; // v.v / 2
    for (int k = j + 1; half > 0 && k <= n; k++) {
        double *x = k < n ? qr->column[k] : qr->right;
        if (!x)
            continue;
        const double share = dot(v, x, j, rows) / half;
        for (int i = j; i < rows; i++)
            x[i] -= share * v[i];
    }
}

bool alb_qr_factor(const alb_qr *qr, double least)
{
    for (int j = 0; j < qr->columns; j++) {
        double *x = qr->column[j];
        qr->scale[j] = sqrt(dot(x, x, 0, qr->rows));
        if (!(qr->scale[j] > 0) || !isfinite(qr->scale[j]))
            return false;
        for (int i = 0; i < qr->rows; i++)
            x[i] /= qr->scale[j];
    }
    for (int j = 0; j < qr->columns; j++) {
        reflect(qr, j);
        if (!(fabs(qr->diagonal[j]) > least))
            return false;
    }
    return true;
}

void alb_qr_back_substitute(double *x, const alb_qr *qr)
{
    for (int i = qr->columns - 1; i >= 0; i--) {
        for (int k = i + 1; k < qr->columns; k++)
            x[i] -= qr->column[k][i] * x[k];
        x[i] /= qr->diagonal[i];
    }
}

double alb_qr_covariance(double *covariance, int stride, const alb_qr *qr, double *work)
{
    const int n = qr->columns;
    double of_factor = 0, of_inverse = 0; // squared norms
    memset(work, 0, (size_t)n * (size_t)n * sizeof *work);
    for (int q = 0; q < n; q++) { // row q of the work: column q of R^-1
        work[q * n + q] = 1;
        alb_qr_back_substitute(work + q * n, qr);
        for (int i = 0; i <= q; i++) {
            const double r = i == q ? qr->diagonal[q] : qr->column[q][i];
            of_factor += r * r;
            of_inverse += work[q * n + i] * work[q * n + i];
        }
    }
    for (int p = 0; p < n; p++)
        for (int q = 0; q < n; q++) {
            covariance[p * stride + q] = 0;
            for (int k = p > q ? p : q; k < n; k++)
                covariance[p * stride + q] += work[k * n + p] * work[k * n + q] / qr->scale[p] / qr->scale[q];
        }
    return of_factor * of_inverse;
}
