// Totals of a slab by another road than fit's: discrete ordinates solved in their eigenvectors, the beam followed
// exactly (not a stream), Gauss nodes (none at the normal), Fresnel's reflectance at each node, plain delta-M. Nodes
// above the critical cosine c lie at c + (1 - c) t^2, over which Fresnel's reflectance is smooth.
//   p = v+ + v-, m = v+ - v-, v = sqrt(mu w) I:  p' = -O m + q_m,  m' = -E p + q_p;  O = L L^T, L^T E L y = k^2 y gives
//   p = L y e^(-+k z), m = +-k L^-T y e^(-+k z)  (Stamnes & Conklin 1984, in symmetric form).
// Needs absorption > 0, n > 1, k d of no bound. Truncation at g^64: 1e-6 of the flux at g = 0.9.
#pragma once
#include "base/quadrature.h"
#include "capture/photon.h"
#include "fit/fresnel.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ORD_BELOW = 24, ORD_ABOVE = 64, ORD_N = ORD_BELOW + ORD_ABOVE, ORD_MOMENTS = 64 };

typedef struct ordinates {
    double mu[ORD_N], w[ORD_N], face[ORD_N];
    double e[ORD_N][ORD_N], o[ORD_N][ORD_N], source_even[ORD_N], source_odd[ORD_N]; // sources of a unit beam
    double l[ORD_N][ORD_N], vector[ORD_N][ORD_N], k[ORD_N];
    double p_mode[ORD_N][ORD_N], m_mode[ORD_N][ORD_N]; // columns: modes
    double system[2 * ORD_N][2 * ORD_N + 1];
} ordinates;

// Gauss's elimination with pivots on n rows of `system`; the solution ends in the last column.
static inline void ord_solve(ordinates *o, int n)
{
    for (int c = 0; c < n; c++) {
        int best = c;
        for (int r = c; r < n; r++)
            best = fabs(o->system[r][c]) > fabs(o->system[best][c]) ? r : best;
        for (int j = c; j <= n; j++) {
            const double t = o->system[c][j];
            o->system[c][j] = o->system[best][j], o->system[best][j] = t;
        }
        for (int r = 0; r < n; r++) {
            const double f = r == c ? 0 : o->system[r][c] / o->system[c][c];
            for (int j = c; j <= n && f != 0; j++)
                o->system[r][j] -= f * o->system[c][j];
        }
    }
    for (int r = 0; r < n; r++)
        o->system[r][n] /= o->system[r][r];
}

static inline void ord_media(ordinates *o, double sigma_a, double sigma_s, double g)
{
    const double peak = pow(g, ORD_MOMENTS), s = sigma_s * (1 - peak), t = sigma_a + s;
    memset(o->e, 0, sizeof o->e), memset(o->o, 0, sizeof o->o);
    memset(o->source_even, 0, sizeof o->source_even), memset(o->source_odd, 0, sizeof o->source_odd);
    for (int i = 0; i < ORD_N; i++)
        for (int j = 0; j <= ORD_N; j++) {
            const double x = o->mu[i], y = j < ORD_N ? o->mu[j] : 1;
            double a0 = 1, a1 = x, b0 = 1, b1 = y, sum[2] = {0};
            for (int l = 0; l < ORD_MOMENTS; l++) {
                sum[l % 2] += (2 * l + 1) * (pow(g, l) - peak) / (1 - peak) * a0 * b0;
                const double a2 = ((2 * l + 3) * x * a1 - (l + 1) * a0) / (l + 2),
                             b2 = ((2 * l + 3) * y * b1 - (l + 1) * b0) / (l + 2);
                a0 = a1, a1 = a2, b0 = b1, b1 = b2;
            }
            if (j == ORD_N) {
                o->source_even[i] = s * sum[0] * sqrt(o->w[i] / x), o->source_odd[i] = s * sum[1] * sqrt(o->w[i] / x);
                continue;
            }
            const double scale = s * sqrt(o->w[i] * o->w[j] / (x * y));
            o->e[i][j] = (i == j) * t / x - scale * sum[0];
            o->o[i][j] = (i == j) * t / x - scale * sum[1];
        }
}

// Modes: Cholesky of O, then Jacobi's rotations of L^T E L.
static inline void ord_modes(ordinates *o)
{
    static double a[ORD_N][ORD_N], el[ORD_N][ORD_N];
    memset(o->l, 0, sizeof o->l);
    for (int i = 0; i < ORD_N; i++)
        for (int j = 0; j <= i; j++) {
            double sum = o->o[i][j];
            for (int k = 0; k < j; k++)
                sum -= o->l[i][k] * o->l[j][k];
            o->l[i][j] = i == j ? sqrt(sum) : sum / o->l[j][j];
        }
    for (int pass = 0; pass < 2; pass++) // el = E L, then a = L^T el
        for (int i = 0; i < ORD_N; i++)
            for (int j = 0; j < ORD_N; j++) {
                double sum = 0;
                for (int k = 0; k < ORD_N; k++)
                    sum += pass ? o->l[k][i] * el[k][j] : o->e[i][k] * o->l[k][j];
                *(pass ? &a[i][j] : &el[i][j]) = sum;
            }
    for (int i = 0; i < ORD_N; i++)
        for (int j = 0; j < ORD_N; j++)
            o->vector[i][j] = i == j;
    for (int sweep = 0; sweep < 14; sweep++)
        for (int p = 0; p < ORD_N; p++)
            for (int q = p + 1; q < ORD_N; q++) {
                if (fabs(a[p][q]) < 1e-300)
                    continue;
                const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]),
                             t = copysign(1, theta) / (fabs(theta) + hypot(theta, 1)), c = 1 / hypot(t, 1), s = t * c;
                for (int k = 0; k < ORD_N; k++) {
                    const double x = a[k][p], y = a[k][q];
                    a[k][p] = c * x - s * y, a[k][q] = s * x + c * y;
                }
                for (int k = 0; k < ORD_N; k++) {
                    const double x = a[p][k], y = a[q][k], u = o->vector[k][p], v = o->vector[k][q];
                    a[p][k] = c * x - s * y, a[q][k] = s * x + c * y;
                    o->vector[k][p] = c * u - s * v, o->vector[k][q] = s * u + c * v;
                }
            }
    for (int j = 0; j < ORD_N; j++) {
        o->k[j] = sqrt(a[j][j]);
        for (int i = 0; i < ORD_N; i++) {
            o->p_mode[i][j] = 0;
            for (int k = 0; k < ORD_N; k++)
                o->p_mode[i][j] += o->l[i][k] * o->vector[k][j];
        }
        for (int i = ORD_N - 1; i >= 0; i--) { // L^T x = k y
            double sum = o->k[j] * o->vector[i][j];
            for (int k = i + 1; k < ORD_N; k++)
                sum -= o->l[k][i] * o->m_mode[k][j];
            o->m_mode[i][j] = sum / o->l[i][i];
        }
    }
}

// (p, m) that a beam of unit flux along `direction` (+1 or -1) forces: e^(-direction t z) times these.
static inline void ord_forced(double *p, double *m, ordinates *o, double t, double direction)
{
    memset(o->system, 0, sizeof o->system);
    for (int i = 0; i < ORD_N; i++) {
        for (int j = 0; j < ORD_N; j++)
            o->system[i][j] = o->e[i][j], o->system[ORD_N + i][ORD_N + j] = o->o[i][j];
        o->system[i][ORD_N + i] -= direction * t, o->system[ORD_N + i][i] -= direction * t;
        o->system[i][2 * ORD_N] = o->source_even[i], o->system[ORD_N + i][2 * ORD_N] = direction * o->source_odd[i];
    }
    ord_solve(o, 2 * ORD_N);
    for (int i = 0; i < ORD_N; i++)
        p[i] = o->system[i][2 * ORD_N], m[i] = o->system[ORD_N + i][2 * ORD_N];
}

// pi L / M of the scattered light, and cosines to the normal in air, rising.
typedef struct ord_lobe {
    double cosine[ORD_ABOVE], ratio[2][ORD_ABOVE];
} ord_lobe;

// out[0] reflection, out[1] transmission, as photon.h's `leaving`. lobe may be NULL.
static inline void discrete_ordinates_lobe(double out[2], ord_lobe *lobe, const alb_medium *medium)
{
    ordinates *o = calloc(1, sizeof *o);
    const double n = medium->refractive_index, c = sqrt(1 - 1 / (n * n)), d = medium->thickness_mm;
    alb_quadrature_gauss(o->mu, o->w, ORD_BELOW, 0, c);
    alb_quadrature_gauss(o->mu + ORD_BELOW, o->w + ORD_BELOW, ORD_ABOVE, 0, 1);
    for (int i = 0; i < ORD_N; i++) {
        if (i >= ORD_BELOW) {
            o->w[i] *= 2 * (1 - c) * o->mu[i];
            o->mu[i] = c + (1 - c) * o->mu[i] * o->mu[i];
        }
        o->face[i] = alb_fresnel_inside(n, o->mu[i]);
    }
    ord_media(o, medium->absorption_per_mm, medium->scattering_per_mm, medium->anisotropy);
    ord_modes(o);
    const double t = medium->absorption_per_mm + medium->scattering_per_mm * (1 - pow(medium->anisotropy, ORD_MOMENTS));
    const double r = pow((n - 1) / (n + 1), 2), e = exp(-t * d), down = (1 - r) / (1 - r * r * e * e),
                 up = down * r * e;
    double force[2][2][ORD_N]; // beam down, up; p, m
    ord_forced(force[0][0], force[0][1], o, t, 1);
    ord_forced(force[1][0], force[1][1], o, t, -1);
    memset(o->system, 0, sizeof o->system);
    for (int face = 0; face < 2; face++)
        for (int i = 0; i < ORD_N; i++) { // what comes in = F * what goes out; in: p +- m
            double *row = o->system[face * ORD_N + i], side = face ? -1 : 1, f = o->face[i];
            for (int j = 0; j < ORD_N; j++) {
                const double far = exp(-o->k[j] * d), p = o->p_mode[i][j], m = o->m_mode[i][j];
                row[j] = (face ? far : 1) * ((1 - f) * p + side * (1 + f) * m);
                row[ORD_N + j] = (face ? 1 : far) * ((1 - f) * p - side * (1 + f) * m);
            }
            const double from_down = down * (face ? e : 1), from_up = up * (face ? 1 : e);
            row[2 * ORD_N] = -(1 - f) * (from_down * force[0][0][i] + from_up * force[1][0][i]) -
                             side * (1 + f) * (from_down * force[0][1][i] + from_up * force[1][1][i]);
        }
    ord_solve(o, 2 * ORD_N);
    for (int face = 0; face < 2; face++) {
        const double side = face ? -1 : 1, from_down = down * (face ? e : 1), from_up = up * (face ? 1 : e);
        const double beam = (1 - r) * (face ? down * e : up * e);
        out[face] = beam;
        for (int i = 0; i < ORD_N; i++) {
            double leaving = from_down * (force[0][0][i] - side * force[0][1][i]) +
                             from_up * (force[1][0][i] - side * force[1][1][i]);
            for (int j = 0; j < ORD_N; j++) {
                const double far = exp(-o->k[j] * d), a = o->system[j][2 * ORD_N] * (face ? far : 1),
                             b = o->system[ORD_N + j][2 * ORD_N] * (face ? 1 : far);
                leaving +=
                    a * (o->p_mode[i][j] - side * o->m_mode[i][j]) + b * (o->p_mode[i][j] + side * o->m_mode[i][j]);
            }
            out[face] += leaving / 2 * (1 - o->face[i]) * sqrt(o->mu[i] * o->w[i]);
            if (lobe && i >= ORD_BELOW) {
                lobe->cosine[i - ORD_BELOW] = sqrt(1 - n * n * (1 - o->mu[i] * o->mu[i]));
                lobe->ratio[face][i - ORD_BELOW] =
                    leaving / 2 / sqrt(o->mu[i] * o->w[i]) * (1 - o->face[i]) / (2 * n * n);
            }
        }
        for (int i = 0; lobe && i < ORD_ABOVE; i++)
            lobe->ratio[face][i] /= out[face] - beam;
    }
    free(o);
}

static inline void discrete_ordinates(double out[2], const alb_medium *medium)
{
    discrete_ordinates_lobe(out, NULL, medium);
}
