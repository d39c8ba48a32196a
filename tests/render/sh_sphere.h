// Angular scaling without any of its formulas, for tests: harmonics by their sums, maps by geometry, integrals over the
// sphere by the tanh-sinh rule in theta times the trapezoid rule in phi.
#pragma once
#include <math.h>

// K_l^m P_l^m(cos theta), no Condon-Shortley phase: P_l^m = sin^m theta d^m/dx^m of the sum for P_l.
static inline long double sphere_legendre(int l, int m, long double theta)
{
    const long double x = cosl(theta);
    long double sum = 0, factor = (2 * l + 1) / (4 * (long double)M_PI);
    for (int p = 0; 2 * p <= l - m; p++) { // terms (-1)^p (2l-2p)! / (2^l p! (l-p)! (l-2p-m)!) x^(l-2p-m)
        long double term = p % 2 ? -1 : 1;
        term *= expl(lgammal(2 * l - 2 * p + 1) - lgammal(p + 1) - lgammal(l - p + 1) - lgammal(l - 2 * p - m + 1));
        sum += roundl(term) * powl(x, l - 2 * p - m);
    }
    for (int i = l - m + 1; i <= l + m; i++)
        factor /= i;
    return ldexpl(sum, -l) * powl(sinl(theta), m) * sqrtl(factor);
}

// Y_lm = sphere_legendre(l, |m|) sphere_azimuth(m).
static inline long double sphere_azimuth(int m, long double phi)
{
    return m == 0 ? 1 : sqrtl(2) * (m > 0 ? cosl(m * phi) : sinl(-m * phi));
}

// The cone map drawn: silhouette points at distance s from the centre, alpha from the axis to the viewer.
static inline long double sphere_cone(long double theta, long double k, long double alpha)
{
    const long double s = k * sinl(theta) / sinl(theta + alpha); // seen from distance k; the sample is at distance 1
    const long double y = s * sinl(alpha), x = 1 - s * cosl(alpha);
    return s < 0 ? atan2l(-y, -x) : atan2l(y, x);
}

// The mid-range map drawn: the ray from (0, k) under theta meets the unit sphere.
static inline long double sphere_midrange(long double theta, long double k)
{
    const long double along = -k * cosl(theta) + sqrtl(1 - k * k * sinl(theta) * sinl(theta));
    return atan2l(along * sinl(theta), k + along * cosl(theta));
}

// Node i in (-count, count) of the tanh-sinh rule on [from, to]; returns its weight.
static inline long double sphere_node(long double *at, int i, int count, long double from, long double to)
{
    const long double h = 4.2L / count, t = i * h, u = (long double)M_PI_2 * sinhl(t), c = coshl(u);
    *at = (from + to) / 2 + (to - from) / 2 * tanhl(u);
    return (to - from) / 2 * h * (long double)M_PI_2 * coshl(t) / (c * c);
}
