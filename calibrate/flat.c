// Vignetting as an even polynomial of the distance from the principal point, least squares over all pixels:
//   D(u, v) = c0 (1 + f0 q + f1 q^2 + f2 q^3),   q = ((u - cx)^2 + (v - cy)^2) / half diagonal^2
// Stops being true for dust, lens shift beyond the image, and a diffuser that is not even.
#include "calibrate/flat.h"
#include <math.h>
#include <string.h>

static double distance(const alb_lens *lens, double u, double v)
{
    const double half2 = 0.25 * ((double)lens->width * lens->width + (double)lens->height * lens->height);
    return ((u - lens->cx) * (u - lens->cx) + (v - lens->cy) * (v - lens->cy)) / half2;
}

double alb_flat_value(const double flat[3], const alb_lens *lens, double u, double v)
{
    const double q = distance(lens, u, v);
    return 1 + q * (flat[0] + q * (flat[1] + q * flat[2]));
}

// Gaussian elimination with partial pivoting, 4 x 4; false where singular.
static bool solve4(double x[4], double a[4][5])
{
    for (int k = 0; k < 4; k++) {
        int pivot = k;
        for (int i = k + 1; i < 4; i++)
            pivot = fabs(a[i][k]) > fabs(a[pivot][k]) ? i : pivot;
        double row[5];
        memcpy(row, a[pivot], sizeof row);
        memcpy(a[pivot], a[k], sizeof row);
        memcpy(a[k], row, sizeof row);
        if (!(fabs(a[k][k]) > 0))
            return false;
        for (int i = k + 1; i < 4; i++)
            for (int j = 4; j >= k; j--)
                a[i][j] -= a[i][k] / a[k][k] * a[k][j];
    }
    for (int k = 3; k >= 0; k--) {
        x[k] = a[k][4];
        for (int j = k + 1; j < 4; j++)
            x[k] -= a[k][j] * x[j];
        x[k] /= a[k][k];
    }
    return true;
}

static bool fit_channel(double flat[3], double *rms, const alb_image *merged, const alb_lens *lens, int channel)
{
    double a[4][5] = {{0}}, c[4], squares = 0;
    long count = 0;
    for (int y = 0; y < merged->height; y++)
        for (int x = 0; x < merged->width; x++) {
            const double value = (double)alb_image_at(merged, x, y)[channel], q = distance(lens, x, y);
            if (!isfinite(value))
                continue;
            const double basis[5] = {1, q, q * q, q * q * q, value};
            for (int i = 0; i < 4; i++)
                for (int j = 0; j < 5; j++)
                    a[i][j] += basis[i] * basis[j];
            count++;
        }
    if (count < 100 || !solve4(c, a) || !(c[0] > 0))
        return false;
    for (int i = 0; i < 3; i++)
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

bool alb_flat_fit(double flat[3][3], double *rms, const alb_image *merged, const alb_lens *lens, int channels,
                  alb_error *error)
{
    *rms = 0;
    for (int c = 0; c < channels; c++)
        if (!fit_channel(flat[c], rms, merged, lens, c))
            return alb_fail(error, ALB_BAD_DATA,
                            "the diffuser is dark or saturated in channel %s; change its exposures", merged->name[c]);
    return true;
}
