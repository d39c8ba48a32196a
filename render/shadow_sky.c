#include "render/sh_project.h"
#include "render/shadow_light.h"

bool alb_shadow_sky_create(alb_shadow_sky *sky, const alb_light *environment, alb_error *error)
{
    const alb_image *map = &environment->map;
    *sky = (alb_shadow_sky){.order = environment->radius_mm > 0 ? ALB_SH_ORDER_MAX : ALB_SHADOW_ORDER,
                            .centre_mm = environment->position_mm,
                            .radius_mm = environment->radius_mm};
    for (int c = 0; c < 3; c++) {
        double out[ALB_SH_COUNT_MAX] = {sqrt(4 * M_PI) * environment->radiance[c]};
        if (map->pixels && !alb_sh_project_map(out, sky->order, map, map->channels >= 3 ? c : 0, error))
            return false;
        for (int i = 0; i < sky->order * sky->order; i++)
            sky->radiance[c][i] = (float)out[i];
    }
    return true;
}
