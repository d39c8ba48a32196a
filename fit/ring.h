// The pixels of a channel, sorted into rings about a centre: one pixel wide out to 16 pixels, growing by a sixteenth
// each further out.
#pragma once
#include "fit/observe.h"

enum { ALB_RINGS_MAX = 400 };

typedef struct alb_ring_pixel {
    double r_mm, x_mm, y_mm; // from the centre
    double value, variance, area_mm2;
    size_t index; // in the image
} alb_ring_pixel;

typedef struct alb_rings {
    alb_ring_pixel *pixels; // those of ring k: begin[k] .. begin[k + 1], in the order of the image
    size_t begin[ALB_RINGS_MAX + 1];
    size_t missing[ALB_RINGS_MAX]; // without a value
    size_t glints[ALB_RINGS_MAX];  // left out as glints, dust or veins
    double pitch_mm;
} alb_rings;

double alb_ring_edge(int k, double pitch_mm);
// glint: a flag for each pixel of the image; NULL: none.
bool alb_rings_sort(alb_rings *rings, const alb_channel *channel, const bool *glint, double x_mm, double y_mm,
                    double pitch_mm, alb_error *error);
void alb_rings_free(alb_rings *rings);

// value ~ mean + linear t + bend (t^2 - square - skew t), t = (r - middle) / width - shift: the quadratic in r that
// fits pixels best, its three parts orthogonal over them.
typedef struct alb_trend {
    double middle_mm, width_mm, shift, mean, linear, bend, square, skew;
} alb_trend;

// chosen: which of the pixels count; NULL: all. At least one must.
alb_trend alb_trend_fit(const alb_ring_pixel *pixels, const bool *chosen, size_t count, double low_mm, double high_mm);
static inline double alb_trend_at(const alb_trend *trend, double r_mm)
{
    const double t = (r_mm - trend->middle_mm) / trend->width_mm - trend->shift;
    return trend->mean + trend->linear * t + trend->bend * (t * t - trend->square - trend->skew * t);
}
