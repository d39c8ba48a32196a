// Active sets (Lawson & Hanson 1974, Solving Least Squares Problems, ch. 23) on normal equations of columns of unit
// length. Convex: there is one minimum. Stops being true where columns are linear in each other but for 1e-13.
#include "fit/measure.h"
#include "fit/cholesky.h"
#include "fit/columns.h"
#include <math.h>
#include <stdbool.h>

enum { ATOMS = ALB_ATOMS_MAX };

// Amplitudes of the columns of m without regard to sign; gram: rows of the columns in it, `columns` long.
static bool solve(double *amplitude, const alb_measure *m, const double *gram, const double *right, int columns)
{
    double l[ATOMS][ATOMS];
    for (int i = 0; i < m->count; i++) {
        amplitude[i] = right[m->column[i]];
        for (int j = 0; j <= i; j++)
            l[i][j] = gram[m->column[i] * columns + m->column[j]];
    }
    if (!alb_cholesky_factor(l[0], m->count, ATOMS, 1e-13))
        return false;
    alb_cholesky_solve(amplitude, l[0], m->count, ATOMS);
    return true;
}

// The column along which the sum of squares falls fastest; -1 where none does enough.
static int steepest(const alb_measure *m, const double *gram, const double *right, int columns, double least)
{
    int best = -1;
    for (int j = 0; j < columns; j++) {
        double slope = right[j];
        for (int k = 0; k < m->count; k++)
            slope -= m->amplitude[k] * gram[m->column[k] * columns + j];
        if (slope > least) {
            least = slope;
            best = j;
        }
    }
    return best;
}

static void insert(alb_measure *m, int column)
{
    int at = m->count++;
    for (; at > 0 && m->column[at - 1] > column; at--) {
        m->column[at] = m->column[at - 1];
        m->amplitude[at] = m->amplitude[at - 1];
    }
    m->column[at] = column;
    m->amplitude[at] = 0;
}

// Moves towards the solution without signs as far as amplitudes stay positive, drops those that reach zero, and again.
static bool settle(alb_measure *m, const double *gram, const double *right, int columns)
{
    for (;;) {
        double amplitude[ATOMS], share = 1;
        if (!solve(amplitude, m, gram, right, columns))
            return false;
        int first = -1, kept = 0; // to reach zero
        for (int k = 0; k < m->count; k++)
            if (amplitude[k] <= 0 && m->amplitude[k] <= share * (m->amplitude[k] - amplitude[k])) {
                share = m->amplitude[k] / (m->amplitude[k] - amplitude[k]);
                first = k;
            }
        for (int k = 0; k < m->count; k++)
            if (k != first) {
                m->column[kept] = m->column[k];
                m->amplitude[kept++] = m->amplitude[k] + share * (amplitude[k] - m->amplitude[k]);
            }
        m->count = kept;
        if (first < 0)
            return true;
    }
}

void alb_measure_fit(alb_measure *measure, const double *const *column, const double *right, const double *scale,
                     int columns, int rows, double wanted, double *work)
{
    *measure = (alb_measure){0};
    for (int step = 0; step < 3 * ATOMS && measure->count < ATOMS; step++) {
        const int next = steepest(measure, work, right, columns, sqrt(wanted));
        for (int k = 0; k < measure->count; k++)
            if (measure->column[k] == next)
                return; // nothing but rounding is left
        if (next < 0)
            return;
        for (int j = 0; j < columns; j++)
            work[next * columns + j] = scale[next] * scale[j] * alb_columns_dot(column[next], column[j], rows);
        insert(measure, next);
        if (!settle(measure, work, right, columns))
            return;
    }
}
