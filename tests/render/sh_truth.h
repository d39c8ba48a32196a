// What tests of spherical harmonics compare with: the basis by Rodrigues' formula in long double, term by term, and
// integrals over the sphere by Fejer's rule in theta and the trapezoidal rule in phi.
#pragma once
#include "base/random.h"
#include "check.h"
#include "render/sh.h"

static inline long double truth_binomial(int n, int k)
{
    long double value = 1;
    for (int i = 1; i <= k; i++)
        value = value * (n - k + i) / i;
    return value;
}

enum { TRUTH_ORDER = 16 };

// d^m/dx^m of P_l(x) = 2^-l sum_k (-1)^k C(l, k) C(2l - 2k, l) x^(l - 2k), l < TRUTH_ORDER; the terms are kept.
static inline long double truth_legendre(int l, int m, long double x)
{
    static long double kept[TRUTH_ORDER][TRUTH_ORDER][TRUTH_ORDER];
    long double *terms = kept[l][m], sum = 0;
    const int last = (l - m) / 2;
    for (int k = last; k >= 0 && terms[0] == 0; k--) { // the first last: it says that all are there
        terms[k] = ldexpl((k & 1 ? -1 : 1) * truth_binomial(l, k) * truth_binomial(2 * l - 2 * k, l), -l);
        for (int i = 0; i < m; i++)
            terms[k] *= l - 2 * k - i;
    }
    for (int k = 0; k <= last; k++)
        sum = sum * x * x + terms[k];
    return (l - m) & 1 ? sum * x : sum;
}

static inline long double truth_y(int l, int m, long double x, long double y, long double z)
{
    const int n = abs(m);
    long double re = 1, im = 0, norm = (2 * l + 1) / (4 * acosl(-1));
    for (int i = 0; i < n; i++) {
        const long double old = re;
        re = re * x - im * y, im = old * y + im * x;
    }
    for (int i = l - n + 1; i <= l + n; i++)
        norm /= i;
    return sqrtl(norm * (n ? 2 : 1)) * truth_legendre(l, n, z) * (m < 0 ? im : re);
}

static inline double truth_sum(const double *c, int order, alb_vector d)
{
    long double sum = 0;
    for (int l = 0; l < order; l++)
        for (int m = -l; m <= l; m++)
            sum += (long double)c[l * l + l + m] * truth_y(l, m, (long double)d.x, (long double)d.y, (long double)d.z);
    return (double)sum;
}

// Node j of n in theta: exact for polynomials in cos theta of degree below n.
static inline double truth_weight(int j, int n)
{
    const double theta = M_PI * (j + 0.5) / n;
    double sum = 1;
    for (int k = 1; k <= n / 2; k++)
        sum -= (2 * k == n ? 1 : 2) * cos(2 * k * theta) / (4.0 * k * k - 1);
    return 2 * sum / n;
}

typedef double truth_function(const void *context, alb_vector direction);

// Coefficients of a function of bounded degree: exact where n exceeds degree + order - 1.
static inline void truth_project(double *c, int order, int n, truth_function *function, const void *context)
{
    memset(c, 0, (size_t)(order * order) * sizeof *c);
    for (int j = 0; j < n; j++)
        for (int k = 0; k < n; k++) {
            const double theta = M_PI * (j + 0.5) / n, phi = 2 * M_PI * (k + 0.25) / n;
            const alb_vector d = {sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
            const double value = function(context, d) * truth_weight(j, n) * 2 * M_PI / n;
            for (int l = 0; l < order; l++)
                for (int m = -l; m <= l; m++)
                    c[l * l + l + m] +=
                        value * (double)truth_y(l, m, (long double)d.x, (long double)d.y, (long double)d.z);
        }
}

static inline alb_vector random_direction(alb_random *random)
{
    const double z = 2 * alb_random_uniform(random) - 1, phi = 2 * M_PI * alb_random_uniform(random);
    return (alb_vector){sqrt(1 - z * z) * cos(phi), sqrt(1 - z * z) * sin(phi), z};
}

// Of unit norm.
static inline void random_coefficients(double *c, int order, alb_random *random)
{
    double sum = 0;
    for (int i = 0; i < order * order; i++) {
        c[i] = alb_random_normal(random);
        sum += c[i] * c[i];
    }
    for (int i = 0; i < order * order; i++)
        c[i] /= sqrt(sum);
}
