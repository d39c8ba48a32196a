// Vignetting as a polynomial of the picture, least squares over all pixels:
//   D = c (1 + sum of f_ij x^i y^j over 1 <= i + j <= 4 + f (x^2 + y^2)^3),   (x, y) from the middle in half diagonals
// All terms to the fourth order hold an axis off the middle and a diffuser that is brighter on one side; the last one
// is the next of a centred lens. Stops being true for dust and for edges of the lens barrel within the picture.
#include "calibrate/flat.h"
#include <math.h>
#include <string.h>

enum { TERMS = ALB_FLAT_TERMS + 1 };

// 1, then x^i y^j by order, then the sixth power of the distance.
static void basis_at(double basis[TERMS], const alb_lens *lens, double u, double v)
{
    const double half = 0.5 * hypot(lens->width, lens->height);
    const double x = (u - 0.5 * (lens->width - 1)) / half, y = (v - 0.5 * (lens->height - 1)) / half;
    int k = 0;
    for (int order = 0; order <= 4; order++)
        for (int j = 0; j <= order; j++) {
            double term = 1;
            for (int i = 0; i < order; i++)
                term *= i < j ? y : x;
            basis[k++] = term;
        }
    const double q = x * x + y * y;
    basis[k] = q * q * q;
}

double alb_flat_value(const double flat[ALB_FLAT_TERMS], const alb_lens *lens, double u, double v)
{
    double basis[TERMS], sum = 1;
    basis_at(basis, lens, u, v);
    for (int i = 0; i < ALB_FLAT_TERMS; i++)
        sum += flat[i] * basis[i + 1];
    return sum;
}

// Gaussian elimination with partial pivoting; false where singular.
static bool solve(double x[TERMS], double a[TERMS][TERMS + 1])
{
    for (int k = 0; k < TERMS; k++) {
        int pivot = k;
        for (int i = k + 1; i < TERMS; i++)
            pivot = fabs(a[i][k]) > fabs(a[pivot][k]) ? i : pivot;
        double row[TERMS + 1];
        memcpy(row, a[pivot], sizeof row);
        memcpy(a[pivot], a[k], sizeof row);
        memcpy(a[k], row, sizeof row);
        if (!(fabs(a[k][k]) > 0))
            return false;
        for (int i = k + 1; i < TERMS; i++)
            for (int j = TERMS; j >= k; j--)
                a[i][j] -= a[i][k] / a[k][k] * a[k][j];
    }
    for (int k = TERMS - 1; k >= 0; k--) {
        x[k] = a[k][TERMS];
        for (int j = k + 1; j < TERMS; j++)
            x[k] -= a[k][j] * x[j];
        x[k] /= a[k][k];
    }
    return true;
}

static bool fit_channel(double flat[ALB_FLAT_TERMS], double *rms, const alb_image *merged, const alb_lens *lens,
                        int channel)
{
    double a[TERMS][TERMS + 1] = {{0}}, c[TERMS], squares = 0;
    long count = 0;
    for (int y = 0; y < merged->height; y++)
        for (int x = 0; x < merged->width; x++) {
            const double value = (double)alb_image_at(merged, x, y)[channel];
            double basis[TERMS];
            if (!isfinite(value))
                continue;
            basis_at(basis, lens, x, y);
            for (int i = 0; i < TERMS; i++) {
                for (int j = 0; j < TERMS; j++)
                    a[i][j] += basis[i] * basis[j];
                a[i][TERMS] += basis[i] * value;
            }
            count++;
        }
    if (count < 100 || !solve(c, a) || !(c[0] > 0))
        return false;
    for (int i = 0; i < ALB_FLAT_TERMS; i++)
        flat[i] = c[i + 1] / c[0];
    for (int y = 0; y < merged->height; y++)
        for (int x = 0; x < merged->width; x++) {
            const double value = (double)alb_image_at(merged, x, y)[channel];
            const double ratio = value / (c[0] * alb_flat_value(flat, lens, x, y)) - 1;
            squares += isfinite(ratio) ? ratio * ratio : 0;
        }
    *rms = fmax(*rms, sqrt(squares / (double)count));
    return true;
}

bool alb_flat_fit(double flat[3][ALB_FLAT_TERMS], double *rms, const alb_image *merged, const alb_lens *lens,
                  int channels, alb_error *error)
{
    *rms = 0;
    for (int c = 0; c < channels; c++)
        if (!fit_channel(flat[c], rms, merged, lens, c))
            return alb_fail(error, ALB_BAD_DATA,
                            "the diffuser is dark or saturated in channel %s; change its exposures", merged->name[c]);
    return true;
}
