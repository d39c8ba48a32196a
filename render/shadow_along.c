// A field knows what lines through its nodes meet. The line of sight d from x enters the first sphere of nodes outside,
// of radius R about C, at e = x + t d; what stands in its way there is what the sample at e has along d:
//     O(x, d) = O_e(d),      t = -b - sqrt(R^2 - m^2),  b = (x - C).d,  m^2 = |x - C|^2 - b^2
// No scaling, no silhouette is guessed, and a line that misses the object's bounding sphere meets nothing: O fades out
// between that sphere and the nodes'. This is the light field of Levoy and Hanrahan 1996, of order 6 x cells^2 nodes.
// From inside the nodes' sphere e lies behind x. Where nothing of the object does, as below a ground that receives, it
// serves too, if x comes before the middle of the line's way through the sphere. Else the angular scaling of Wang et
// al. 2006 is applied to the direction itself, O(x, d) = O_r(tau(theta), phi), r in the receiver's direction, tau of
// the cone map with 45 degrees (sh_map.h), without a matrix and what a matrix cuts off; where there are shells inside,
// between the two around x.
//
// Stops being true: order n of the sample blurs silhouettes by 180 / n degrees as seen from e, the interpolation
// between nodes by what it takes e to move from one to the next.
#include "render/shadow_along.h"
#include "base/vector_clones.h"
#include "render/sh_product.h"

enum { BLOCK = ALB_SHADOW_BLOCK, LOOKS = 3 * BLOCK };
#define BEFORE 0.2 // radii before the middle, along a line, from where all of the object counts as ahead

// A sample and a direction in it.
typedef struct looks {
    size_t count, receivers[LOOKS];
    int shells[LOOKS];
    float weights[LOOKS], directions[3 * LOOKS];
    alb_vector nodes[LOOKS];
} looks;

static void add(looks *l, size_t receiver, int shell, double weight, alb_vector node, alb_vector direction)
{
    const size_t n = l->count++;
    l->receivers[n] = receiver;
    l->shells[n] = shell;
    l->weights[n] = (float)weight;
    l->nodes[n] = node;
    l->directions[n] = (float)direction.x;
    l->directions[LOOKS + n] = (float)direction.y;
    l->directions[2 * LOOKS + n] = (float)direction.z;
}

// The direction of the sample that the cone map takes for d; axis: from the receiver to the middle.
static alb_vector mapped(alb_vector axis, alb_vector d, double k)
{
    const double cosine = alb_dot(axis, d);
    const alb_vector across = alb_sub(d, alb_times(cosine, axis));
    const double sine = alb_length(across), tau = atan2(k * sine, cosine + (1 - k) * sine);
    return sine > 0 ? alb_add(alb_times(cos(tau), axis), alb_times(sin(tau) / sine, across)) : d;
}

// From x radii off, within the first shell outside: the shell next to it outside, and the one inside.
static void add_inner(looks *l, size_t receiver, const alb_shadow_field *field, alb_vector off, double x, alb_vector d,
                      double keep)
{
    const alb_vector out = x > 0 ? alb_times(1 / x, off) : (alb_vector){0, 0, 1}, axis = alb_times(-1, out);
    int above = 0;
    // bounded, for the root of a square below that of the last radius may be that radius
    while (above < field->settings.inner && field->shells[above].radius <= x)
        above++;
    const double high = field->shells[above].radius, low = above > 0 ? field->shells[above - 1].radius : 0;
    double t = low > 0 ? log(x / low) / log(high / low) : 1;
    t = t * t * (3 - 2 * t);
    add(l, receiver, above, keep * t, out, mapped(axis, d, x / high));
    if (t < 1)
        add(l, receiver, above - 1, keep * (1 - t), out, mapped(axis, d, x / low));
}

static void add_line(looks *l, size_t receiver, const alb_shadow_field *field, alb_vector point, alb_vector d,
                     bool apart)
{
    const int first = field->settings.inner;
    const double nodes = field->shells[first].radius;
    const alb_vector off = alb_times(1 / field->sphere.radius_mm, alb_sub(point, field->sphere.centre_mm));
    const double b = alb_dot(off, d), square = alb_dot(off, off), missed = fmax(square - b * b, 0);
    const double nearest = sqrt(b < 0 ? missed : square), keep = fmin((nodes - nearest) / (nodes - 1), 1);
    const double through = square >= nodes * nodes ? 1 : apart ? fmin(fmax(-b / BEFORE, 0), 1) : 0;
    if (!(keep > 0))
        return;
    if (through < 1)
        add_inner(l, receiver, field, off, sqrt(square), d, keep * (1 - through));
    if (through > 0)
        add(l, receiver, first, keep * through, alb_add(off, alb_times(-b - sqrt(nodes * nodes - missed), d)), d);
}

// The squares of how near lines come to the middle, in radii.
ALB_VECTOR_CLONES static void find_nearest(float *restrict nearest, const float *restrict off, const float *restrict d,
                                           size_t count)
{
    for (size_t r = 0; r < count; r++) {
        const float x = off[r], y = off[BLOCK + r], z = off[2 * BLOCK + r];
        const float b = x * d[r] + y * d[BLOCK + r] + z * d[2 * BLOCK + r], square = x * x + y * y + z * z;
        nearest[r] = b < 0 ? square - b * b : square;
    }
}

void alb_shadow_along(float *out, const alb_shadow_field *field, const alb_vector *points, const float *directions,
                      const float *wanted, bool apart, size_t count)
{
    float basis[ALB_SH_COUNT_MAX * LOOKS], sample[ALB_SH_COUNT_MAX], off[3 * BLOCK] = {0}, nearest[BLOCK];
    const double scale = 1 / field->sphere.radius_mm, nodes = field->shells[field->settings.inner].radius;
    looks l = {.count = 0};
    for (size_t r = 0; r < count; r++) {
        const alb_vector o = alb_times(scale, alb_sub(points[r], field->sphere.centre_mm));
        off[r] = (float)o.x, off[BLOCK + r] = (float)o.y, off[2 * BLOCK + r] = (float)o.z;
        out[r] = 0;
    }
    find_nearest(nearest, off, directions, count);
    for (size_t r = 0; r < count; r++) // some to spare for rounding far away: add_line knows exactly
        if (wanted[r] > 0 && nearest[r] < 1.01F * (float)(nodes * nodes))
            add_line(
                &l, r, field, points[r],
                (alb_vector){(double)directions[r], (double)directions[BLOCK + r], (double)directions[2 * BLOCK + r]},
                apart);
    if (!l.count)
        return;
    const int order = field->settings.order;
    alb_sh_evaluate_batch(basis, order, l.directions, LOOKS, l.count);
    for (size_t n = 0; n < l.count; n++) {
        float sum = 0;
        alb_shadow_field_at(sample, field, l.shells[n], l.nodes[n]);
        for (size_t i = 0; i < (size_t)(order * order); i++)
            sum += sample[i] * basis[i * LOOKS + n];
        out[l.receivers[n]] += l.weights[n] * sum;
    }
    for (size_t r = 0; r < count; r++)
        out[r] = fminf(fmaxf(out[r], 0), 1);
}
