// The least window that leaves no value below a bound: the minimum over the sphere as a function of the window's
// strength, by bisection. For the minimum, values on a grid four times as fine as the highest harmonic, and from the
// lowest places of the grid Newton's steps along the sphere: a polynomial of degree below 8 has few valleys, and none
// narrower than the grid. (Sloan 2017 does the same for zonal functions and order 3, where the polynomial is of one
// variable.)
#include "render/sh_window.h"
#include <string.h>

enum { RINGS = 4 * ALB_SH_ORDER_MAX, STEPS = 2 * RINGS, STARTS = 12, NEWTON = 12, HALVINGS = 40 };

void alb_sh_window(double *coefficients, int order, double strength)
{
    for (int l = 1; l < order; l++)
        for (int i = l * l; i < (l + 1) * (l + 1); i++)
            coefficients[i] /= 1 + strength * l * l * (l + 1) * (l + 1);
}

static alb_vector grid_direction(int ring, int step)
{
    const double theta = M_PI * (ring + 0.5) / RINGS, phi = 2 * M_PI * step / STEPS;
    return (alb_vector){sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
}

// Along the part of `to` that is tangent.
static double slope(const double *c, int order, alb_vector d, alb_vector to)
{
    double slopes[ALB_SH_COUNT_MAX], sum = 0;
    alb_sh_differentiate(slopes, order, d, alb_sub(to, alb_times(alb_dot(to, d), d)));
    for (int i = 0; i < order * order; i++)
        sum += c[i] * slopes[i];
    return sum;
}

// Along the great circle through d.
static alb_vector walk(alb_vector d, alb_vector t, alb_vector b, double x, double y)
{
    return alb_unit(alb_add(d, alb_add(alb_times(x, t), alb_times(y, b))));
}

// Where Newton's step leads, with the curvatures' absolute values: always downhill. From the slopes along t and b at
// d and a little beside it.
static void newton_step(double step[2], const double *c, int order, alb_vector d, alb_vector t, alb_vector b)
{
    const double h = 1e-4, longest = M_PI / RINGS;
    const alb_vector east = walk(d, t, b, h, 0), north = walk(d, t, b, 0, h);
    const double x = slope(c, order, d, t), y = slope(c, order, d, b);
    const double xx = (slope(c, order, east, t) - x) / h, yy = (slope(c, order, north, b) - y) / h;
    const double xy = (slope(c, order, north, t) - x) / h, spread = hypot((xx - yy) / 2, xy);
    const double turn = atan2(xy, (xx - yy) / 2) / 2, u = cos(turn), v = sin(turn);
    const double first = fabs((xx + yy) / 2 + spread), second = fabs((xx + yy) / 2 - spread);
    const double along = -(u * x + v * y) / fmax(first, 1e-9), across = -(u * y - v * x) / fmax(second, 1e-9);
    const double length = hypot(along, across), cut = length > longest ? longest / length : 1;
    step[0] = cut * (u * along - v * across);
    step[1] = cut * (v * along + u * across);
}

// Steps halved until they fall.
static double descend(alb_vector *at, const double *c, int order)
{
    double value = alb_sh_value(c, order, *at);
    for (int k = 0; k < NEWTON; k++) {
        alb_vector t, b;
        double step[2];
        alb_tangents(&t, &b, *at);
        newton_step(step, c, order, *at, t, b);
        for (int half = 0; half < 8; half++, step[0] /= 2, step[1] /= 2) {
            const alb_vector to = walk(*at, t, b, step[0], step[1]);
            const double there = alb_sh_value(c, order, to);
            if (there < value) {
                *at = to, value = there;
                break;
            }
        }
    }
    return value;
}

// The lowest places, none lower beside it; later ones where all are taken.
static int find_starts(alb_vector *starts, const double values[RINGS][STEPS])
{
    int count = 0;
    double kept[STARTS];
    for (int r = 0; r < RINGS; r++)
        for (int s = 0; s < STEPS; s++) {
            const double v = values[r][s];
            if (v > values[r][(s + 1) % STEPS] || v > values[r][(s + STEPS - 1) % STEPS] ||
                (r && v > values[r - 1][s]) || (r < RINGS - 1 && v > values[r + 1][s]))
                continue;
            int at = count < STARTS ? count++ : STARTS;
            while (at > 0 && kept[at - 1] > v) {
                if (at < STARTS)
                    kept[at] = kept[at - 1], starts[at] = starts[at - 1];
                at--;
            }
            if (at < STARTS)
                kept[at] = v, starts[at] = grid_direction(r, s);
        }
    return count;
}

double alb_sh_minimum(alb_vector *where, const double *coefficients, int order)
{
    double values[RINGS][STEPS], lowest = INFINITY;
    for (int r = 0; r < RINGS; r++)
        for (int s = 0; s < STEPS; s++)
            values[r][s] = alb_sh_value(coefficients, order, grid_direction(r, s));
    alb_vector starts[STARTS];
    const int count = find_starts(starts, (const double(*)[STEPS])values);
    for (int k = 0; k < count; k++) {
        const double value = descend(&starts[k], coefficients, order);
        if (value < lowest) {
            lowest = value;
            if (where)
                *where = starts[k];
        }
    }
    return lowest;
}

static double minimum_with(double *windowed, const double *c, int order, double strength)
{
    memcpy(windowed, c, (size_t)(order * order) * sizeof *c);
    alb_sh_window(windowed, order, strength);
    return alb_sh_minimum(NULL, windowed, order);
}

static double energy_of(const double *c, int order)
{
    double sum = 0;
    for (int i = 0; i < order * order; i++)
        sum += c[i] * c[i];
    return sum;
}

bool alb_sh_dering(double *coefficients, alb_sh_dering_report *report, int order, double least, alb_error *error)
{
    const double mean = coefficients[0] / sqrt(4 * M_PI), energy = energy_of(coefficients, order);
    double windowed[ALB_SH_COUNT_MAX];
    if (!isfinite(energy) || !(mean >= least))
        return alb_fail(error, ALB_BAD_DATA, "no window brings a function of mean %g to %g and above", mean, least);
    alb_sh_dering_report found = {.minimum_before = minimum_with(windowed, coefficients, order, 0)};
    found.minimum = found.minimum_before;
    if (found.minimum < least) {
        double low = 0, high = 1e-6;
        while (high < 1e12 && minimum_with(windowed, coefficients, order, high) < least)
            low = high, high *= 4;
        if (high >= 1e12)
            high = low = INFINITY; // to the mean alone
        for (int k = 0; k < HALVINGS && high > 1.001 * low; k++) {
            const double middle = low > 0 ? sqrt(low * high) : high / 2;
            *(minimum_with(windowed, coefficients, order, middle) < least ? &low : &high) = middle;
        }
        found.strength = high;
        found.minimum = minimum_with(windowed, coefficients, order, high);
        memcpy(coefficients, windowed, (size_t)(order * order) * sizeof *windowed);
    }
    found.energy = energy > 0 ? energy_of(coefficients, order) / energy : 1;
    if (report)
        *report = found;
    return true;
}
