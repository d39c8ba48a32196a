// The bits of x, y and z in turns, from the highest on.
#include "base/morton.h"
#include <math.h>

alb_morton alb_morton_of(const alb_vector *points, size_t count)
{
    alb_vector low = {INFINITY, INFINITY, INFINITY}, high = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < count; i++) {
        low = (alb_vector){fmin(low.x, points[i].x), fmin(low.y, points[i].y), fmin(low.z, points[i].z)};
        high = (alb_vector){fmax(high.x, points[i].x), fmax(high.y, points[i].y), fmax(high.z, points[i].z)};
    }
    const double side = fmax(high.x - low.x, fmax(high.y - low.y, high.z - low.z));
    return (alb_morton){low, side > 0 ? 1 / side : 0};
}

// The first bits of a share in 0..1, two zeros after each.
static uint64_t spread(double share, int bits)
{
    const double steps = (double)(UINT64_C(1) << bits);
    const uint64_t place = (uint64_t)fmin(steps - 1, fmax(0, steps * share));
    uint64_t out = 0;
    for (int k = 0; k < bits; k++)
        out |= (place >> k & 1) << 3 * k;
    return out;
}

uint64_t alb_morton_place(const alb_morton *curve, alb_vector point, int bits)
{
    const alb_vector at = alb_times(curve->per_mm, alb_sub(point, curve->low));
    return spread(at.x, bits) << 2 | spread(at.y, bits) << 1 | spread(at.z, bits);
}
