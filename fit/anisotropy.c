// Light that falls obliquely makes the spot an ellipse (second harmonic) and drives the light inside the slab to one
// side (first harmonic, of one sign near the centre and of the other far off, for the centre is where the rings are as
// even as they can be); so do an edge or a vein of the sample. The mean over a ring is right to first order whatever
// the harmonics: of an elliptic spot about its own centroid it is exactly that of the spot made round.
//
// Chance: with amplitudes c, s of sd each, sum (c^2 + s^2) / sd^2 over the rings is chi-square with two degrees of
// freedom a ring where all is round. Rings of clear light: value above 10 sd, at least 16 pixels,
// not cut by the border.
#include "fit/anisotropy.h"
#include "base/statistics.h"
#include "fit/cholesky.h"
#include <math.h>

enum { PARTS = 5, FEWEST = 16 };

void alb_ring_harmonics(double harmonics[4], double *variance, const alb_ring_pixel *pixels, size_t count,
                        const alb_trend *trend)
{
    double a[PARTS][PARTS] = {{0}}, b[PARTS] = {0};
    for (size_t i = 0; i < count; i++) {
        const double r = fmax(pixels[i].r_mm, 1e-300), c = pixels[i].x_mm / r, s = pixels[i].y_mm / r;
        const double basis[PARTS] = {1, c, s, c * c - s * s, 2 * c * s};
        const double value = pixels[i].value - alb_trend_at(trend, pixels[i].r_mm);
        for (int j = 0; j < PARTS; j++) {
            b[j] += basis[j] * value;
            for (int k = 0; k <= j; k++)
                a[j][k] += basis[j] * basis[k];
        }
    }
    *variance = NAN;
    for (int j = 0; j < 4; j++)
        harmonics[j] = NAN;
    if (count < FEWEST || !alb_cholesky_factor(a[0], PARTS, PARTS, 1e-6))
        return;
    alb_cholesky_solve(b, a[0], PARTS, PARTS);
    for (int j = 0; j < 4; j++)
        harmonics[j] = b[j + 1];
    *variance = 2 / (double)count;
}

void alb_anisotropy_of(alb_readings *readings)
{
    for (int h = 0; h < 2; h++) {
        alb_anisotropy *out = &readings->anisotropy[h];
        double squares = 0, freedom = 0;
        *out = (alb_anisotropy){.chance = 1};
        for (int i = 0; i < readings->count; i++) {
            const double c = readings->harmonics[i][2 * h], s = readings->harmonics[i][2 * h + 1],
                         sd = readings->harmonic_sd[i];
            if (!(readings->value[i] > 10 * readings->sd[i]) || readings->r_mm[i] > readings->complete_mm ||
                !(sd > 0) || !isfinite(c + s))
                continue;
            squares += (c * c + s * s) / (sd * sd);
            freedom += 2;
            if (hypot(c, s) > out->most && hypot(c, s) > 4 * sd) {
                out->most = hypot(c, s);
                out->most_r_mm = readings->r_mm[i];
            }
        }
        if (freedom > 0)
            out->chance = alb_chi_square_tail(squares, freedom);
    }
}
