// The regressed law: Clenshaw's sum over the coefficients of render/sh_regress_data.c.
#include "render/sh_regress.h"
#include <math.h>

void alb_sh_regress_at(alb_sh_scaling *scaling, double k)
{
    const double u = 1 - 1 / fmax(k, 1), x = 2 * u - 1, share = (1 - u) * (1 - u);
    scaling->order_out = scaling->order_in = ALB_SH_REGRESS_ORDER;
    for (int i = 0; i < ALB_SH_REGRESS_VALUES; i++) {
        double next = 0, after = 0;
        for (int j = ALB_SH_REGRESS_POWERS - 1; j >= 1; j--) {
            const double value = 2 * x * next - after + (double)alb_sh_regress_coefficients[j][i];
            after = next, next = value;
        }
        scaling->value[i] = share * u * (x * next - after + (double)alb_sh_regress_coefficients[0][i]);
    }
    for (int m = 0; m < ALB_SH_REGRESS_ORDER; m++)
        for (int l = m; l < ALB_SH_REGRESS_ORDER; l++)
            scaling->value[alb_sh_scaling_index(ALB_SH_REGRESS_ORDER, ALB_SH_REGRESS_ORDER, m, l, l)] += share;
}
