// Rotations by recurrence from band to band, each entry from the block of l - 1 and the nine entries of R itself:
// Ivanic & Ruedenberg 1996, eqs. 6.1-6.7 with the additions and corrections of 1998. Polynomials of R's entries, so
// that no angle is taken and no direction is special. Rounding grows slowly with l: 1e-13 up to order 24.
#include "render/sh_rotate.h"
#include <stdlib.h>
#include <string.h>

enum { SIDE = 2 * ALB_SH_ROTATE_MAX - 1 };

// Entry (m, n) of band l at [m + l][n + l].
typedef struct band {
    int l;
    double entry[SIDE][SIDE];
} band;

static double at(const band *b, int m, int n) { return b->entry[m + b->l][n + b->l]; }

static double product(const band *one, const band *last, int i, int m, int n)
{
    const int l = last->l + 1;
    if (n == l)
        return at(one, i, 1) * at(last, m, l - 1) - at(one, i, -1) * at(last, m, 1 - l);
    if (n == -l)
        return at(one, i, 1) * at(last, m, 1 - l) + at(one, i, -1) * at(last, m, l - 1);
    return at(one, i, 0) * at(last, m, n);
}

// v's product; w's reads the same with m one further out.
static double inward(const band *one, const band *last, int m, int n)
{
    if (m == 0)
        return product(one, last, 1, 1, n) + product(one, last, -1, -1, n);
    if (m > 0)
        return product(one, last, 1, m - 1, n) * (m == 1 ? M_SQRT2 : 1) -
               (m == 1 ? 0 : product(one, last, -1, 1 - m, n));
    return (m == -1 ? 0 : product(one, last, 1, m + 1, n)) +
           product(one, last, -1, -m - 1, n) * (m == -1 ? M_SQRT2 : 1);
}

static double outward(const band *one, const band *last, int m, int n)
{
    return m > 0 ? product(one, last, 1, m + 1, n) + product(one, last, -1, -m - 1, n)
                 : product(one, last, 1, m - 1, n) - product(one, last, -1, 1 - m, n);
}

static void next_band(band *b, const band *one, const band *last)
{
    const int l = b->l = last->l + 1;
    for (int m = -l; m <= l; m++)
        for (int n = -l; n <= l; n++) {
            const int a = abs(m);
            const double below = abs(n) == l ? 2.0 * l * (2 * l - 1) : (double)(l + n) * (l - n);
            double sum = a < l ? sqrt((double)(l + m) * (l - m) / below) * product(one, last, 0, m, n) : 0;
            sum += (m ? 0.5 : -M_SQRT1_2) * sqrt((double)(l + a - 1) * (l + a) / below) * inward(one, last, m, n);
            if (a && a < l - 1)
                sum -= 0.5 * sqrt((double)(l - a - 1) * (l - a) / below) * outward(one, last, m, n);
            b->entry[m + l][n + l] = sum;
        }
}

static void apply(double *out, const double *in, const band *b)
{
    const int l = b->l;
    double turned[SIDE] = {0};
    for (int m = -l; m <= l; m++)
        for (int n = -l; n <= l; n++)
            turned[m + l] += at(b, m, n) * in[alb_sh_index(l, n)];
    memcpy(out + l * l, turned, (size_t)(2 * l + 1) * sizeof *out);
}

void alb_sh_rotate(double *out, const double *in, int order, const double rotation[3][3])
{
    static const int from[3] = {1, 2, 0}; // m = -1, 0, 1 are y, z, x
    band one = {.l = 1}, two[2];
    for (int m = 0; m < 3; m++)
        for (int n = 0; n < 3; n++)
            one.entry[m][n] = rotation[from[m]][from[n]];
    out[0] = in[0];
    const band *last = &one;
    for (int l = 1; l < order; l++) {
        if (l > 1) {
            next_band(&two[l & 1], &one, last);
            last = &two[l & 1];
        }
        apply(out, in, last);
    }
}

void alb_sh_axis_rotation(double rotation[3][3], alb_vector axis)
{
    const double s = hypot(axis.x, axis.y), x = s > 0 ? axis.x / s : 1, y = s > 0 ? axis.y / s : 0;
    const double made[3][3] = {{x * axis.z, -y, axis.x}, {y * axis.z, x, axis.y}, {-s, 0, axis.z}};
    memcpy(rotation, made, sizeof made);
}
