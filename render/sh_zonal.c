// Zonal functions in closed form. The cosine's lobe: 2 pi K_l^0 times the integral of x P_l(x) over 0..1, which is 1/2,
// 1/3, zero for further odd l, and for even l  -(-1/4)^(l/2) l! / ((l/2)!^2 (l - 1) (l + 2)).
#include "render/sh_zonal.h"
#include "render/sh_lanes.h"

static double band_norm(int l) { return sqrt((2 * l + 1) / (4 * M_PI)); }

void alb_sh_zonal_cap(double *zonal, int order, double angle)
{
    const double x = cos(angle), half = sin(angle / 2);
    double before = 1, value = x; // P_l-1 and P_l
    zonal[0] = 4 * M_PI * half * half * band_norm(0);
    for (int l = 1; l < order; l++) {
        const double after = ((2 * l + 1) * x * value - l * before) / (l + 1);
        zonal[l] = 2 * M_PI * band_norm(l) * (before - after) / (2 * l + 1);
        before = value, value = after;
    }
}

void alb_sh_zonal_cosine(double *zonal, int order)
{
    double even = 1; // (-1/4)^(l/2) l! / (l/2)!^2
    for (int l = 0; l < order; l++) {
        if (l && !(l & 1))
            even *= -(l - 1.0) / l;
        const double integral = l == 1 ? 1.0 / 3 : l & 1 ? 0 : -even / ((l - 1.0) * (l + 2));
        zonal[l] = 2 * M_PI * band_norm(l) * integral;
    }
}

void alb_sh_zonal_turn(double *out, const double *zonal, int order, alb_vector axis)
{
    alb_sh_evaluate(out, order, axis);
    alb_sh_zonal_convolve(out, out, zonal, order);
}

void alb_sh_zonal_convolve(double *out, const double *in, const double *kernel, int order)
{
    for (int l = 0; l < order; l++)
        for (int i = l * l; i < (l + 1) * (l + 1); i++)
            out[i] = in[i] * kernel[l] / band_norm(l);
}

// out holds the basis along the axes: band by band times 2 pi (P_l-1 - P_l+1) / (2l + 1), of l = 0 2 pi (1 - x).
ALB_LANES_INLINE void weigh_bands(alb_lanes *out, int order, const alb_lanes x)
{
    alb_lanes before, value, weight;
    ALB_EACH_LANE before[lane] = 1;
    ALB_EACH_LANE value[lane] = x[lane];
    ALB_EACH_LANE out[0][lane] *= (float)(2 * M_PI) * (1 - x[lane]);
    for (int l = 1; l < order; l++) {
        const float a = (float)(2 * l + 1) / (float)(l + 1), b = (float)l / (float)(l + 1);
        const float share = (float)(2 * M_PI) / (float)(2 * l + 1);
        ALB_EACH_LANE
        {
            const float after = a * x[lane] * value[lane] - b * before[lane];
            weight[lane] = share * (before[lane] - after);
            before[lane] = value[lane], value[lane] = after;
        }
        for (int i = l * l; i < (l + 1) * (l + 1); i++)
            ALB_EACH_LANE out[i][lane] *= weight[lane];
    }
}

ALB_LANES_CLONES
static void weigh(float *out, int order, const float *cosines, size_t stride, size_t count)
{
    for (size_t r = 0; r < count; r += ALB_LANES) {
        alb_lanes x[1], rows[ALB_SH_COUNT_MAX];
        alb_lanes_load(x, cosines + r, stride, count - r, 1);
        alb_lanes_load(rows, out + r, stride, count - r, order * order);
        weigh_bands(rows, order, x[0]);
        alb_lanes_store(out + r, rows, stride, count - r, order * order);
    }
}

void alb_sh_cap_batch(float *out, int order, const float *axes, const float *cosines, size_t stride, size_t count)
{
    alb_sh_evaluate_batch(out, order, axes, stride, count);
    weigh(out, order, cosines, stride, count);
}
