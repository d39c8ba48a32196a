// Gauss-Legendre nodes are the roots of P_n, weights 2 (1 - x^2) / (n P_(n-1))^2. Gauss-Radau nodes with one at x = 1
// are the roots of P_(n-1) - P_n, weights (1 + x) / (n P_(n-1))^2, 2 / n^2 at x = 1 (Abramowitz & Stegun 25.4.29, .31).
// The roots are bracketed on a grid in theta = acos x finer than they can lie together (they are about pi/n apart),
// then halved: no start values that could miss one.
#include "base/quadrature.h"
#include <math.h>
#include <stdbool.h>
#include <string.h>

// P_n(x) and, in `before`, P_(n-1)(x).
static double legendre(double *before, int n, double x)
{
    double last = 1, value = x;
    for (int k = 2; k <= n; k++) {
        const double next = ((2 * k - 1) * x * value - (k - 1) * last) / k;
        last = value, value = next;
    }
    *before = last;
    return value;
}

static double polynomial(int n, double theta, bool radau)
{
    double before;
    const double value = legendre(&before, n, cos(theta));
    return radau ? before - value : value;
}

// Nodes in rising order, x = 1 of Radau excepted.
static void find_roots(double *node, double *weight, int n, bool radau)
{
    const int roots = radau ? n - 1 : n, steps = 8 * n;
    double low = M_PI, at_low = polynomial(n, low, radau);
    for (int i = steps - 1, found = 0; found < roots && i >= 0; i--) {
        const double high = M_PI * (i + 0.25) / (steps + 0.5), at_high = polynomial(n, high, radau);
        if ((at_low < 0) != (at_high < 0)) {
            double a = high, b = low, before;
            for (int k = 0; k < 54; k++) {
                const double middle = (a + b) / 2;
                *((polynomial(n, middle, radau) < 0) == (at_high < 0) ? &a : &b) = middle;
            }
            const double x = cos((a + b) / 2);
            legendre(&before, n, x);
            node[found] = x;
            weight[found++] = (radau ? 1 + x : 2 * (1 - x * x)) / (n * n * before * before);
        }
        low = high, at_low = at_high;
    }
}

static void stretch(double *node, double *weight, int count, double from, double to)
{
    for (int i = 0; i < count; i++) {
        node[i] = (from + to) / 2 + node[i] * (to - from) / 2;
        weight[i] *= (to - from) / 2;
    }
}

// Gauss's nodes once they were asked for. Each count is filled by the first thread that comes; those that come before
// it is done find the same ones for themselves.
enum { COUNT_MAX = 64, EMPTY = 0, FILLING, FILLED };

static void find_gauss(double *node, double *weight, int count)
{
    static double nodes[COUNT_MAX + 1][COUNT_MAX], weights[COUNT_MAX + 1][COUNT_MAX];
    static int states[COUNT_MAX + 1];
    const size_t size = (size_t)count * sizeof *node;
    int empty = EMPTY;
    if (__atomic_load_n(&states[count], __ATOMIC_ACQUIRE) == FILLED) {
        memcpy(node, nodes[count], size);
        memcpy(weight, weights[count], size);
        return;
    }
    find_roots(node, weight, count, false);
    if (__atomic_compare_exchange_n(&states[count], &empty, FILLING, false, __ATOMIC_RELAXED, __ATOMIC_RELAXED)) {
        memcpy(nodes[count], node, size);
        memcpy(weights[count], weight, size);
        __atomic_store_n(&states[count], FILLED, __ATOMIC_RELEASE);
    }
}

void alb_quadrature_gauss(double *node, double *weight, int count, double from, double to)
{
    find_gauss(node, weight, count);
    stretch(node, weight, count, from, to);
}

void alb_quadrature_radau(double *node, double *weight, int count, double from, double to)
{
    find_roots(node, weight, count, true);
    node[count - 1] = 1;
    weight[count - 1] = 2.0 / (count * count);
    stretch(node, weight, count, from, to);
    node[count - 1] = to;
}
