// Inversion of a slab's totals. A slab of unit thickness has two unknowns, x = (ln sigma_s' d, ln sigma_a d), and two
// readings, in which it is close to linear: ln of the share that is lost, A = 1 - r - R - T with r = ((n-1)/(n+1))^2,
// and ln(T/R).
//
//   1. Damped Newton on few streams from a first guess: without absorption T/(R + T) is (1 + 2 A/3)/(s' d + 4 A/3) in
//      diffusion, and light stays 2 n^2 d (its mean path under diffuse light); where that does not lead there, from a
//      grid of starts over all media.
//   2. The same equations on many streams, the Jacobian of the few kept and corrected as it goes (Broyden 1965).
//
// In this order each forward solution of many streams gains two digits or more, and there is one answer: with x given
// by the totals of random slabs no second slab was found (test_optical.c). Nothing lost, A <= 0, is sigma_a = 0 and one
// equation.
#include "fit/inversion.h"
#include <math.h>

enum { NEWTON_STEPS = 40, CORRECTIONS = 25, GRID = 7 };

// Residuals of the two equations; false where the model leaves their domain.
static bool residuals(double f[2], const alb_transfer *slab, const alb_wanted *wanted, const double x[2])
{
    const alb_totals t = slab->totals(slab->model, wanted->lossless ? 0 : exp(x[1]), exp(x[0]));
    const double lost = slab->entry - t.reflection - t.transmission;
    f[0] = log(t.transmission / t.reflection) - wanted->log_ratio;
    f[1] = wanted->lossless ? 0 : log(lost) - wanted->log_lost;
    return isfinite(f[0]) && isfinite(f[1]);
}

static double size_of(const double f[2]) { return fmax(fabs(f[0]), fabs(f[1])); }

bool alb_slab_jacobian(double j[2][2], const alb_transfer *slab, const alb_wanted *wanted, const double x[2],
                       const double f[2])
{
    const double h = 1e-5;
    for (int p = 0; p < 2; p++) {
        double moved[2] = {x[0], x[1]}, g[2];
        if (p == 1 && wanted->lossless) {
            j[0][1] = 0, j[1][1] = 1;
            break;
        }
        moved[p] += h;
        if (!residuals(g, slab, wanted, moved))
            return false;
        for (int i = 0; i < 2; i++)
            j[i][p] = (g[i] - f[i]) / h;
    }
    return true;
}

bool alb_slab_step(double step[2], double j[2][2], const double f[2], double limit)
{
    const double det = j[0][0] * j[1][1] - j[0][1] * j[1][0];
    step[0] = -(j[1][1] * f[0] - j[0][1] * f[1]) / det;
    step[1] = -(j[0][0] * f[1] - j[1][0] * f[0]) / det;
    const double longest = size_of(step);
    if (!isfinite(longest))
        return false;
    for (int p = 0; p < 2 && longest > limit; p++)
        step[p] *= limit / longest;
    return true;
}

static bool newton(double x[2], const alb_transfer *slab, const alb_wanted *wanted, double tolerance)
{
    double f[2], j[2][2], step[2];
    if (!residuals(f, slab, wanted, x))
        return false;
    for (int i = 0; i < NEWTON_STEPS && size_of(f) > tolerance; i++) {
        if (!alb_slab_jacobian(j, slab, wanted, x, f) || !alb_slab_step(step, j, f, 2))
            return false;
        double share = 1;
        for (;; share /= 2) {
            const double y[2] = {x[0] + share * step[0], x[1] + share * step[1]};
            double g[2];
            if (residuals(g, slab, wanted, y) && size_of(g) < size_of(f)) {
                x[0] = y[0], x[1] = y[1], f[0] = g[0], f[1] = g[1];
                break;
            }
            if (share < 1e-3)
                return false;
        }
    }
    return size_of(f) <= tolerance;
}

static bool solved(const double f[2], const alb_wanted *wanted, double tolerance)
{
    return fabs(f[0]) <= tolerance + wanted->rounding[0] && fabs(f[1]) <= tolerance + wanted->rounding[1];
}

bool alb_slab_refine(double x[2], const alb_transfer *slab, const alb_transfer *coarse, const alb_wanted *wanted)
{
    double f[2], g[2], step[2], j[2][2];
    if (!residuals(f, coarse, wanted, x) || !alb_slab_jacobian(j, coarse, wanted, x, f) ||
        !residuals(f, slab, wanted, x))
        return false;
    for (int i = 0; i < CORRECTIONS && !solved(f, wanted, 1e-10); i++) {
        if (!alb_slab_step(step, j, f, 1))
            return false;
        const double y[2] = {x[0] + step[0], x[1] + step[1]}, square = step[0] * step[0] + step[1] * step[1];
        if (!residuals(g, slab, wanted, y))
            return false;
        for (int r = 0; r < 2; r++) { // Broyden: j step = g - f, j unchanged across the step
            const double missed = (g[r] - f[r] - j[r][0] * step[0] - j[r][1] * step[1]) / square;
            j[r][0] += missed * step[0];
            j[r][1] += missed * step[1];
        }
        x[0] = y[0], x[1] = y[1], f[0] = g[0], f[1] = g[1];
    }
    return solved(f, wanted, 1e-8);
}

bool alb_slab_find(double x[2], const alb_transfer *slab, const alb_wanted *wanted, double tolerance)
{
    const double through = 1 / (1 + exp(-wanted->log_ratio)), lost = exp(wanted->log_lost) / slab->entry;
    x[0] = log(fmax(0.1, (1 + 2 * slab->boundary / 3) / through - 4 * slab->boundary / 3));
    x[1] = log(fmax(1e-12, -log1p(-fmin(lost, 0.999)) / (2 * slab->refractive_index * slab->refractive_index)));
    if (newton(x, slab, wanted, tolerance))
        return true;
    for (int i = 0; i < GRID * GRID; i++) { // sigma_s' d from 0.01 to 1e4, sigma_a d from 1e-8 to 100
        x[0] = log(0.01) + (i % GRID) * log(1e6) / (GRID - 1);
        x[1] = log(1e-8) + (double)(i / GRID) * log(1e10) / (GRID - 1);
        if (newton(x, slab, wanted, tolerance))
            return true;
    }
    return false;
}

alb_wanted alb_wanted_of(double entry, double reflection, double transmission)
{
    const double lost = entry - reflection - transmission;
    return (alb_wanted){.log_lost = lost > 0 ? log(lost) : -HUGE_VAL,
                        .log_ratio = log(transmission / reflection),
                        .rounding = {1e-12 / transmission, lost > 0 ? 1e-12 / lost : 0},
                        .lossless = !(lost > 1e-10)};
}
