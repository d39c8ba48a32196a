// The environment's coefficients: c_i = integral L Y_i, by the midpoint rule on 256 x 128 cells of azimuth and height
// (equal solid angles), exact enough (1e-4 of the largest) for maps that are not sharper than that.
#include "render/shadow_light.h"

void alb_shadow_sky_create(alb_shadow_sky *sky, const alb_light *environment)
{
    enum { TURNS = 256, HEIGHTS = 128 };
    *sky = (alb_shadow_sky){.order = environment->radius_mm > 0 ? ALB_SH_ORDER_MAX : 4,
                            .centre_mm = environment->position_mm,
                            .radius_mm = environment->radius_mm};
    double sum[3][ALB_SH_COUNT_MAX] = {{0}}, basis[ALB_SH_COUNT_MAX], radiance[3];
    const int values = sky->order * sky->order;
    for (int h = 0; h < HEIGHTS; h++)
        for (int t = 0; t < TURNS; t++) {
            const double z = (2 * h + 1.0) / HEIGHTS - 1, turn = 2 * M_PI * (t + 0.5) / TURNS, r = sqrt(1 - z * z);
            const alb_vector d = {r * cos(turn), r * sin(turn), z};
            alb_light_sky(radiance, environment, d);
            alb_sh_evaluate(basis, sky->order, d);
            for (int c = 0; c < 3; c++)
                for (int i = 0; i < values; i++)
                    sum[c][i] += radiance[c] * basis[i];
        }
    for (int c = 0; c < 3; c++)
        for (int i = 0; i < values; i++)
            sky->radiance[c][i] = (float)(4 * M_PI / (TURNS * HEIGHTS) * sum[c][i]);
}
