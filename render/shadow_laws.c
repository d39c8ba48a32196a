#include "render/shadow_laws.h"
#include "render/shadow_field.h"

enum { CELLS = 256, LAWS = 5 };
// Of the far shell's cone: objects that fill their spheres have silhouettes nearer the middle than the printed 45
// degrees put them. Best of 45 to 75 on eight objects from 2.7 to 8 radii; nearer by 45 is better.
static const double far_alpha_deg = 53;

bool alb_shadow_laws_create(alb_shadow_laws *laws, int order, bool paper, alb_error *error)
{
    const alb_sh_law_kind outside = paper ? ALB_SH_LAW_VISIBILITY : ALB_SH_LAW_OCCLUSION;
    const alb_sh_law kinds[LAWS] = {
        {outside, ALB_SH_MAP_CONE, 45, ALB_SHADOW_ORDER, order},
        {outside, ALB_SH_MAP_CONE, far_alpha_deg, ALB_SHADOW_ORDER, ALB_SH_ORDER_MAX},
        {ALB_SH_LAW_VISIBILITY, ALB_SH_MAP_CONE, 45, ALB_SHADOW_ORDER, order},
        {ALB_SH_LAW_LIGHT, ALB_SH_MAP_CONE, 45, ALB_SHADOW_ORDER, ALB_SHADOW_ORDER},
        {ALB_SH_LAW_VISIBILITY, ALB_SH_MAP_MIDRANGE, 45, ALB_SH_ORDER_MAX, ALB_SH_ORDER_MAX},
    };
    *laws = (alb_shadow_laws){0};
    alb_sh_batch *const batches[LAWS] = {&laws->outer, &laws->far, &laws->inner, &laws->light, &laws->sky};
    alb_error errors[LAWS] = {{0}};
#pragma omp parallel for schedule(dynamic, 1)
    for (int i = 0; i < LAWS; i++)
        alb_sh_batch_create(batches[i], &kinds[i], CELLS, &errors[i]);
    for (int i = 0; i < LAWS; i++)
        if (errors[i].status != ALB_OK) {
            alb_shadow_laws_free(laws);
            return alb_fail(error, errors[i].status, "%s", errors[i].text);
        }
    return true;
}

void alb_shadow_laws_free(alb_shadow_laws *laws)
{
    alb_sh_batch_free(&laws->outer);
    alb_sh_batch_free(&laws->far);
    alb_sh_batch_free(&laws->inner);
    alb_sh_batch_free(&laws->light);
    alb_sh_batch_free(&laws->sky);
}
