// One axis of a plot: a range of values on a range of pixels, with round ticks.
#pragma once
#include <stdbool.h>

enum { ALB_TICKS_MAX = 64, ALB_TICK_LABEL = 96 };

typedef struct alb_axis {
    bool logarithmic;
    double minimum, maximum;  // values at the ends
    double first_px, last_px; // where they stand; last_px < first_px for an axis that points up
    double ticks[ALB_TICKS_MAX], minor[ALB_TICKS_MAX];
    int tick_count, minor_count;
    int decimals;    // of the labels, linear ticks
    int exponent;    // linear ticks are labelled in units of 10^exponent; the axis says so where it is not 0
    bool by_decades; // labels are powers of ten
} alb_axis;

// Whether the value has a place on such an axis: finite, |value| <= 1e300 and, on a logarithmic one, positive.
bool alb_axis_accepts(bool logarithmic, double value);
// An axis over [minimum, maximum] (both accepted, any order; a range too narrow to show is widened) with about `wanted`
// ticks: 1-2-5 steps, or decades on a logarithmic axis that spans at least two of them.
alb_axis alb_axis_make(bool logarithmic, double minimum, double maximum, double first_px, double last_px, int wanted);
// Pixel of a value; clamped far outside the range so that any accepted value has a printable place.
double alb_axis_at(const alb_axis *axis, double value);
// Label of tick i as SVG text content, and its width in characters.
int alb_axis_label(char label[ALB_TICK_LABEL], const alb_axis *axis, int i);
