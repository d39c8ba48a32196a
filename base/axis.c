// Round ticks. Linear: the step is 1, 2 or 5 times a power of ten, the smallest that gives at most `wanted` intervals.
// Logarithmic: whole decades, every k-th when there are many, with 2..9 as minor ticks; below two decades the linear
// ticks, placed logarithmically. Ranges narrower than 1e-9 of their values are widened: labels would not tell them
// apart.
#include "base/axis.h"

#include <math.h>
#include <stdio.h>

bool alb_axis_accepts(bool logarithmic, double value)
{
    return isfinite(value) && fabs(value) <= 1e300 && (!logarithmic || value >= 1e-300);
}

// Makes the range wide enough to be divided.
static void widen(double *minimum, double *maximum, bool logarithmic)
{
    if (*minimum > *maximum) {
        const double swap = *minimum;
        *minimum = *maximum, *maximum = swap;
    }
    const double size = fmax(fabs(*minimum), fabs(*maximum));
    if (!logarithmic && size < 1e-290)
        *minimum = -1, *maximum = 1;
    else if (*maximum - *minimum > 1e-9 * size)
        return;
    else if (logarithmic)
        *minimum /= 1.5, *maximum *= 1.5;
    else
        *minimum -= 0.1 * size, *maximum += 0.1 * size;
}

static double round_step(double span, int wanted)
{
    const double least = span / wanted, power = pow(10, floor(log10(least)));
    for (int i = 0; i < 3; i++) {
        const double step = power * (double[]){1, 2, 5}[i];
        if (step >= least * (1 - 1e-9))
            return step;
    }
    return 10 * power;
}

static void linear_ticks(alb_axis *axis, int wanted)
{
    const double step = round_step(axis->maximum - axis->minimum, wanted), slack = 1e-6 * step;
    const double first = ceil((axis->minimum - slack) / step), last = floor((axis->maximum + slack) / step);
    for (double k = first; k <= last && axis->tick_count < ALB_TICKS_MAX; k++)
        axis->ticks[axis->tick_count++] = k * step;
    const double size = fmax(fabs(axis->minimum), fabs(axis->maximum));
    const int top = (int)floor(log10(size) + 1e-9), bottom = (int)floor(log10(step) + 1e-9);
    axis->exponent = top >= 5 || top < -3 ? top : 0;
    axis->decimals = bottom < axis->exponent ? axis->exponent - bottom : 0;
}

static void decade_ticks(alb_axis *axis, int wanted)
{
    const int first = (int)ceil(log10(axis->minimum) - 1e-9), last = (int)floor(log10(axis->maximum) + 1e-9);
    const int stride = (last - first) / wanted + 1;
    axis->by_decades = true;
    for (int e = (int)ceil((double)first / stride) * stride; e <= last && axis->tick_count < ALB_TICKS_MAX; e += stride)
        axis->ticks[axis->tick_count++] = pow(10, e);
    for (int e = first - 1; stride == 1 && last - first <= 6 && e <= last; e++)
        for (int k = 2; k < 10 && axis->minor_count < ALB_TICKS_MAX; k++) {
            const double value = k * pow(10, e);
            if (value > axis->minimum && value < axis->maximum)
                axis->minor[axis->minor_count++] = value;
        }
}

alb_axis alb_axis_make(bool logarithmic, double minimum, double maximum, double first_px, double last_px, int wanted)
{
    widen(&minimum, &maximum, logarithmic);
    alb_axis axis = {
        .logarithmic = logarithmic, .minimum = minimum, .maximum = maximum, .first_px = first_px, .last_px = last_px};
    wanted = wanted < 5 ? 5 : wanted; // at least two ticks then: steps grow by 2.5 at most
    if (logarithmic && floor(log10(maximum) + 1e-9) - ceil(log10(minimum) - 1e-9) >= 1)
        decade_ticks(&axis, wanted);
    else
        linear_ticks(&axis, wanted);
    return axis;
}

double alb_axis_at(const alb_axis *axis, double value)
{
    const double share = axis->logarithmic ? log(value / axis->minimum) / log(axis->maximum / axis->minimum)
                                           : (value - axis->minimum) / (axis->maximum - axis->minimum);
    return axis->first_px + fmin(fmax(share, -20), 20) * (axis->last_px - axis->first_px);
}

int alb_axis_label(char label[ALB_TICK_LABEL], const alb_axis *axis, int i)
{
    if (axis->by_decades) {
        const int exponent = (int)lround(log10(axis->ticks[i]));
        if (exponent >= 0 && exponent <= 2)
            return snprintf(label, ALB_TICK_LABEL, "%d", (int)lround(axis->ticks[i]));
        char digits[16];
        const int width = snprintf(digits, sizeof digits, "%d", exponent < 0 ? -exponent : exponent);
        snprintf(label, ALB_TICK_LABEL, "10<tspan dy=\"-5\" font-size=\"9\">%s%s</tspan>", exponent < 0 ? "\u2212" : "",
                 digits);
        return 2 + width + (exponent < 0);
    }
    const double value = axis->ticks[i] / pow(10, axis->exponent);
    const bool negative = value < 0 && axis->ticks[i] != 0;
    const int width = snprintf(label, ALB_TICK_LABEL, "%s%.*f", negative ? "\u2212" : "", axis->decimals, fabs(value));
    return negative ? width - 2 : width; // the minus sign is three bytes
}
