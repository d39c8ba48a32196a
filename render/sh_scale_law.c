// The laws k -> M by name. Occlusion 1 - V is scaled with the part of the map that a sample outside the object's
// bounding sphere can see, tau < pi/2: M_w (nothing else is occluded; the printed M leaves the ringing of tau = pi -
// alpha there for ever). M_w is a projector at k = 1, so the whole M fades into it from k = 1 to 1.3.
//
// Where it stops being true: shells inside the object see it beyond pi/2; for them k <= 1 and the whole M.
#include "render/sh_regress.h"
#include <math.h>

const char *const alb_sh_law_names[ALB_SH_LAWS] = {"visibility", "energy", "light", "occlusion", "regressed"};
const char *const alb_sh_map_names[ALB_SH_MAP_CUSTOM] = {"cone", "midrange", "sphere"};

static const double blend_end = 1.3;

bool alb_sh_law_check(const alb_sh_law *law, alb_error *error)
{
    const char *const name = alb_sh_law_names[law->kind];
    if (law->map == ALB_SH_MAP_SPHERE && law->kind != ALB_SH_LAW_OCCLUSION)
        return alb_fail(error, ALB_USAGE, "the sphere map scales occlusion; %s needs the cone map", name);
    if (law->map == ALB_SH_MAP_MIDRANGE && law->kind != ALB_SH_LAW_VISIBILITY && law->kind != ALB_SH_LAW_ENERGY)
        return alb_fail(error, ALB_USAGE, "the mid-range map scales light around: visibility or energy, not %s", name);
    if (law->kind == ALB_SH_LAW_REGRESSED &&
        (law->map != ALB_SH_MAP_CONE || law->alpha_deg != 45 || law->order_out != ALB_SH_REGRESS_ORDER ||
         law->order_in != ALB_SH_REGRESS_ORDER))
        return alb_fail(error, ALB_USAGE, "the regressed law is fitted for the cone map, alpha 45 and order %d",
                        ALB_SH_REGRESS_ORDER);
    return true;
}

static bool make_map(alb_sh_map *map, const alb_sh_law *law, double k, alb_error *error)
{
    switch (law->map) {
    case ALB_SH_MAP_CONE:
        return alb_sh_map_cone(map, k, law->alpha_deg, error);
    case ALB_SH_MAP_MIDRANGE:
        return alb_sh_map_midrange(map, k, error);
    case ALB_SH_MAP_SPHERE:
        return alb_sh_map_sphere(map, k, error);
    default:
        return alb_fail(error, ALB_INTERNAL, "a law of a map without a name");
    }
}

// scaling = (1 - share) scaling + share other.
static void blend(alb_sh_scaling *scaling, const alb_sh_scaling *other, double share)
{
    const int count = alb_sh_scaling_count(scaling->order_out, scaling->order_in);
    for (int i = 0; i < count; i++)
        scaling->value[i] += share * (other->value[i] - scaling->value[i]);
}

static bool occlusion_at(alb_sh_scaling *scaling, const alb_sh_law *law, alb_sh_map *map, alb_error *error)
{
    const double x = (map->k - 1) / (blend_end - 1), share = x <= 0 ? 0 : x >= 1 ? 1 : x * x * (3 - 2 * x);
    const bool fades = !map->windowed && share > 0 && share < 1;
    alb_sh_scaling windowed;
    map->windowed |= share >= 1;
    if (!alb_sh_scaling_compute(scaling, map, ALB_SH_VISIBILITY, law->order_out, law->order_in, error))
        return false;
    if (!fades)
        return true;
    map->windowed = true;
    if (!alb_sh_scaling_compute(&windowed, map, ALB_SH_VISIBILITY, law->order_out, law->order_in, error))
        return false;
    blend(scaling, &windowed, share);
    return true;
}

bool alb_sh_law_at(alb_sh_scaling *scaling, const alb_sh_law *law, double k, alb_error *error)
{
    alb_sh_map map;
    if (!alb_sh_law_check(law, error) || !make_map(&map, law, k, error))
        return false;
    const bool fall_off = law->kind == ALB_SH_LAW_LIGHT && k > 1;
    const alb_sh_measure measure = law->kind == ALB_SH_LAW_ENERGY || fall_off ? ALB_SH_ENERGY : ALB_SH_VISIBILITY;
    if (law->map == ALB_SH_MAP_MIDRANGE)
        return alb_sh_scaling_midrange(scaling, k, measure, law->order_out, law->order_in, error);
    if (law->kind == ALB_SH_LAW_OCCLUSION)
        return occlusion_at(scaling, law, &map, error);
    if (law->kind == ALB_SH_LAW_REGRESSED && k > 1) {
        alb_sh_regress_at(scaling, k);
        return true;
    }
    if (!alb_sh_scaling_compute(scaling, &map, measure, law->order_out, law->order_in, error))
        return false;
    if (fall_off)
        for (int i = alb_sh_scaling_count(law->order_out, law->order_in) - 1; i >= 0; i--)
            scaling->value[i] /= map.k * map.k;
    return true;
}
