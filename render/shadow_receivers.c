// Between two shells both speak: the outer one by t^2 (3 - 2 t), t the place between them in the logarithm of the
// distance. Further out or in, the last one alone. Weights and k are continuous, so that nothing pops where a receiver
// crosses a shell or the bounding sphere. Where nodes of a shell are buried inside the object, the shell speaks that
// much less, and the other more.
#include "render/shadow_receivers.h"
#include "render/sh_rotate.h"
#include <string.h>

enum { BLOCK = ALB_SHADOW_BLOCK, VALUES = ALB_SHADOW_VALUES };

void alb_shadow_receivers_at(alb_shadow_receivers *receivers, const alb_shadow_field *field, const alb_vector *points,
                             size_t count)
{
    receivers->count = count;
    for (size_t r = 0; r < count; r++) {
        const alb_vector off = alb_sub(points[r], field->sphere.centre_mm);
        const double distance = alb_length(off);
        const alb_vector d = distance > 0 ? alb_times(1 / distance, off) : (alb_vector){0, 0, 1};
        receivers->distances_mm[r] = distance;
        receivers->directions[r] = d;
        receivers->axes[r] = (float)-d.x;
        receivers->axes[BLOCK + r] = (float)-d.y;
        receivers->axes[2 * BLOCK + r] = (float)-d.z;
    }
}

bool alb_shadow_receivers_weigh(alb_shadow_receivers *receivers, const alb_shadow_field *field, int shell)
{
    const double here = field->shells[shell].radius, inner = shell > 0 ? field->shells[shell - 1].radius : 0;
    const double outer = shell + 1 < field->shell_count ? field->shells[shell + 1].radius : 0;
    bool any = false;
    for (size_t r = 0; r < receivers->count; r++) {
        const double x = receivers->distances_mm[r] / field->sphere.radius_mm;
        double weight = 1;
        if (x < here && shell > 0) {
            double t = x <= inner ? 0 : log(x / inner) / log(here / inner);
            t = t * t * (3 - 2 * t);
            weight = t;
        } else if (x > here && outer > 0) {
            double t = x >= outer ? 1 : log(x / here) / log(outer / here);
            t = t * t * (3 - 2 * t);
            weight = 1 - t;
        }
        receivers->weights[r] = (float)weight;
        receivers->k[r] = (float)(x / here);
        any |= weight > 0;
    }
    return any;
}

// out += weight M(k) sample, in the frame of the axis.
static void add_scaled(float *out, const alb_shadow_receivers *receivers, const alb_shadow_field *field, int shell,
                       const alb_sh_batch *law)
{
    const alb_shadow_shell *of = &field->shells[shell];
    const size_t values = (size_t)(of->order * of->order), count = receivers->count;
    float samples[ALB_SH_COUNT_MAX * BLOCK], scaled[VALUES * BLOCK], one[ALB_SH_COUNT_MAX];
    memset(samples, 0, values * BLOCK * sizeof *samples);
    for (size_t r = 0; r < count; r++) {
        alb_shadow_field_at(one, field, shell, receivers->directions[r]);
        for (size_t i = 0; i < values; i++)
            samples[i * BLOCK + r] = one[i];
    }
    if (!of->turns)
        alb_sh_to_axis_batch(samples, samples, of->order, receivers->axes, BLOCK, count);
    alb_sh_batch_apply(scaled, law, false, receivers->k, samples, BLOCK, count);
    for (size_t i = 0; i < VALUES; i++)
        for (size_t r = 0; r < count; r++)
            out[i * BLOCK + r] += receivers->weights[r] * scaled[i * BLOCK + r];
}

static const alb_sh_batch *law_of(const alb_shadow_laws *laws, const alb_shadow_field *field, int shell)
{
    const int outer = shell - field->settings.inner;
    if (outer < 0)
        return &laws->inner;
    return outer == field->settings.outer ? &laws->far : &laws->outer;
}

void alb_shadow_receivers_occlusion(float *out, alb_shadow_receivers *receivers, const alb_shadow_field *field,
                                    const alb_shadow_laws *laws)
{
    memset(out, 0, VALUES * BLOCK * sizeof *out);
    for (int shell = 0; shell < field->shell_count; shell++)
        if (alb_shadow_receivers_weigh(receivers, field, shell))
            add_scaled(out, receivers, field, shell, law_of(laws, field, shell));
    alb_sh_from_axis_batch(out, out, ALB_SHADOW_ORDER, receivers->axes, BLOCK, receivers->count);
}
