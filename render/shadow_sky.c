// Radiance that receivers at x see of an environment on a sphere of radius R about C is the radiance seen from C,
// scaled along the axis x - C with k = |x - C| / R (mid-range map, rotate, scale, rotate back: two angles, as M keeps
// m). The transfer is scaled instead, by M transposed, once for three colours. Source: Wang et al. 2006, 3.2.
// Stops being true: what the environment has beyond order ALB_SH_ORDER_MAX.
#include "render/shadow_sky.h"
#include "render/sh_project.h"
#include "render/sh_rotate.h"

enum { BLOCK = ALB_SHADOW_BLOCK, ORDER = ALB_SH_ORDER_MAX };

bool alb_shadow_sky_create(alb_shadow_sky *sky, const alb_light *environment, alb_error *error)
{
    const alb_image *map = &environment->map;
    *sky = (alb_shadow_sky){.centre_mm = environment->position_mm, .radius_mm = environment->radius_mm};
    for (int c = 0; c < 3; c++) {
        double out[ALB_SH_COUNT_MAX] = {sqrt(4 * M_PI) * environment->radiance[c]};
        if (map->pixels && !alb_sh_project_map(out, ORDER, map, map->channels >= 3 ? c : 0, error))
            return false;
        for (int i = 0; i < ALB_SH_COUNT_MAX; i++)
            sky->radiance[c][i] = (float)out[i];
    }
    return true;
}

// The transfer as weights of what is seen from the sky's centre.
static void move_to_centre(float *out, float *transfer, const alb_shadow_sky *sky, const alb_sh_batch *law,
                           const alb_vector *points, size_t count)
{
    float axes[3 * BLOCK], k[BLOCK];
    for (size_t r = 0; r < count; r++) {
        const alb_vector off = alb_sub(points[r], sky->centre_mm);
        const double distance = alb_length(off);
        const alb_vector d = distance > 0 ? alb_times(1 / distance, off) : (alb_vector){0, 0, 1};
        axes[r] = (float)d.x, axes[BLOCK + r] = (float)d.y, axes[2 * BLOCK + r] = (float)d.z;
        k[r] = (float)(distance / sky->radius_mm);
    }
    alb_sh_to_axis_batch(transfer, transfer, ORDER, axes, BLOCK, count);
    alb_sh_batch_apply(out, law, true, k, transfer, BLOCK, count);
    alb_sh_from_axis_batch(out, out, ORDER, axes, BLOCK, count);
}

void alb_shadow_sky_add(float (*irradiance)[3], const alb_shadow_sky *sky, const alb_sh_batch *law, float *transfer,
                        const alb_vector *points, size_t count)
{
    float moved[ALB_SH_COUNT_MAX * BLOCK];
    const float *from = transfer;
    if (sky->radius_mm > 0) {
        move_to_centre(moved, transfer, sky, law, points, count);
        from = moved;
    }
    for (int c = 0; c < 3; c++) {
        float sum[BLOCK] = {0};
        for (int i = 0; i < ALB_SH_COUNT_MAX; i++)
            for (size_t r = 0; r < count; r++)
                sum[r] += from[(size_t)i * BLOCK + r] * sky->radiance[c][i];
        for (size_t r = 0; r < count; r++)
            irradiance[r][c] += sum[r] > 0 ? sum[r] : 0;
    }
}
