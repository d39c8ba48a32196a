#include "base/statistics.h"
#include <math.h>
#include <stdlib.h>

// Q(a, x): series for P below x = a + 1, Lentz's continued fraction for Q above. Abramowitz & Stegun 6.5.29, 6.5.31.
static double gamma_tail(double a, double x)
{
    const double front = exp(a * log(x) - x - lgamma(a));
    if (x < a + 1) {
        double term = 1 / a, sum = term;
        for (double n = a + 1; fabs(term) > 1e-17 * fabs(sum); n++)
            sum += term *= x / n;
        return 1 - front * sum;
    }
    double b = x + 1 - a, c = 1e300, d = 1 / b, h = d;
    for (int i = 1; i < 100000; i++) {
        const double an = -i * (i - a);
        b += 2;
        d = 1 / (an * d + b);
        c = b + an / c;
        h *= d * c;
        if (fabs(d * c - 1) < 1e-16)
            break;
    }
    return front * h;
}

double alb_chi_square_tail(double chi_square, double dof)
{
    if (!(dof > 0) || isnan(chi_square))
        return NAN;
    return chi_square <= 0 ? 1 : isinf(chi_square) ? 0 : gamma_tail(dof / 2, chi_square / 2);
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double alb_median(double *values, size_t count)
{
    if (!count)
        return NAN;
    qsort(values, count, sizeof *values, ascending);
    return count % 2 ? values[count / 2] : (values[count / 2 - 1] + values[count / 2]) / 2;
}
