// M of Wang et al. 2006, eq. 6, with what its line 1 and its appendix dropped: once eta, 2 pi K K' (see sh_scale.h).
// Panels of Gauss-Legendre points along the map's own parameter, halved until halving changes nothing.
#include "render/sh_scale.h"
#include "base/memory.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { PAIRS = 12, DEPTH = 48, PANELS_MAX = 20000, LEGENDRE_MAX = 136 };

// Gauss-Legendre, 24 points on [-1, 1]: the positive nodes, and weights (Abramowitz & Stegun 25.4.30).
static const double gauss[PAIRS][2] = {
    {0.06405689286260563, 0.12793819534675216}, {0.19111886747361631, 0.12583745634682830},
    {0.31504267969616340, 0.12167047292780339}, {0.43379350762604513, 0.11550566805372560},
    {0.54542147138883956, 0.10744427011596563}, {0.64809365193697555, 0.09761865210411388},
    {0.74012419157855436, 0.08619016153195327}, {0.82000198597390295, 0.07334648141108030},
    {0.88641552700440107, 0.05929858491543678}, {0.93827455200273280, 0.04427743881741981},
    {0.97472855597130947, 0.02853138862893366}, {0.99518721999702131, 0.01234122979998720},
};

int alb_sh_scaling_index(int order_out, int order_in, int m, int l_out, int l_in)
{
    int at = 0;
    for (int k = 0; k < m; k++)
        at += (order_out - k) * (order_in - k);
    return at + (l_out - m) * (order_in - m) + l_in - m;
}

int alb_sh_scaling_count(int order_out, int order_in)
{
    int count = 0;
    for (int m = 0; m < order_out && m < order_in; m++)
        count += (order_out - m) * (order_in - m);
    return count;
}

typedef struct integral {
    const alb_sh_map *map;
    alb_sh_measure measure;
    int order_out, order_in, count;
} integral;

static void add_point(double *sum, const integral *in, double at, double weight)
{
    alb_sh_map_point p;
    double out_values[LEGENDRE_MAX], in_values[LEGENDRE_MAX];
    alb_sh_map_at(&p, in->map, at);
    const double eta = in->measure == ALB_SH_ENERGY ? p.sin_tau * p.tau_slope : p.sin_theta * p.theta_slope;
    alb_sh_legendre(out_values, in->order_out, p.cos_theta, p.sin_theta);
    alb_sh_legendre(in_values, in->order_in, p.cos_tau, p.sin_tau);
    for (int m = 0; m < in->order_out && m < in->order_in; m++)
        for (int i = m; i < in->order_out; i++) {
            const double factor = 2 * M_PI * weight * eta * out_values[i * (i + 1) / 2 + m];
            for (int j = m; j < in->order_in; j++)
                *sum++ += factor * in_values[j * (j + 1) / 2 + m];
        }
}

static void integrate(double *sum, const integral *in, double from, double to)
{
    memset(sum, 0, (size_t)in->count * sizeof *sum);
    const double middle = from + (to - from) / 2, half = (to - from) / 2;
    for (int i = 0; i < PAIRS; i++) {
        add_point(sum, in, middle - gauss[i][0] * half, gauss[i][1] * half);
        add_point(sum, in, middle + gauss[i][0] * half, gauss[i][1] * half);
    }
}

// Adds the integral over [from, to], whose panel `whole` is; the panels of its halves go behind it. False where the
// panels run out.
static bool refine(double *sum, const integral *in, double from, double to, double *whole, int depth, int *panels)
{
    double *left = whole + in->count, *right = left + in->count, change = 0;
    const double middle = from + (to - from) / 2;
    integrate(left, in, from, middle);
    integrate(right, in, middle, to);
    for (int i = 0; i < in->count; i++)
        change = fmax(change, fabs(left[i] + right[i] - whole[i]));
    if ((*panels += 2) > PANELS_MAX)
        return false;
    if (change > 1e-13 && depth < DEPTH) // halving a smooth panel squares the error
        return refine(sum, in, middle, to, right, depth + 1, panels) &&
               refine(sum, in, from, middle, left, depth + 1, panels);
    for (int i = 0; i < in->count; i++)
        sum[i] += left[i] + right[i];
    return true;
}

bool alb_sh_scaling_begin(alb_sh_scaling *scaling, int order_out, int order_in, alb_error *error)
{
    const int most = ALB_SH_SCALING_ORDER_MAX;
    if (order_out < 1 || order_out > most || order_in < 1 || order_in > most)
        return alb_fail(error, ALB_USAGE, "angular scaling of order %d to %d; expected 1 to %d", order_in, order_out,
                        most);
    scaling->order_out = order_out, scaling->order_in = order_in;
    memset(scaling->value, 0, (size_t)alb_sh_scaling_count(order_out, order_in) * sizeof *scaling->value);
    return true;
}

bool alb_sh_scaling_compute(alb_sh_scaling *scaling, const alb_sh_map *map, alb_sh_measure measure, int order_out,
                            int order_in, alb_error *error)
{
    int panels = 0;
    if (!alb_sh_scaling_begin(scaling, order_out, order_in, error))
        return false;
    const integral in = {map, measure, order_out, order_in, alb_sh_scaling_count(order_out, order_in)};
    double *whole = alb_allocate((size_t)in.count * (2 * DEPTH + 4), sizeof *whole, error);
    if (!whole)
        return false;
    integrate(whole, &in, 0, alb_sh_map_end(map));
    bool ok = refine(scaling->value, &in, 0, alb_sh_map_end(map), whole, 0, &panels);
    for (int i = 0; i < in.count && ok; i++)
        ok = isfinite(scaling->value[i]);
    free(whole);
    return ok || alb_fail(error, ALB_BAD_DATA, "angular scaling: the map tau is not continuous and finite");
}

void alb_sh_scaling_apply(double *out, const alb_sh_scaling *scaling, const double *in)
{
    const int n = scaling->order_out, inner = scaling->order_in, orders = n < inner ? n : inner;
    memset(out, 0, (size_t)(n * n) * sizeof *out);
    for (int m = 0; m < orders; m++) {
        const double *value = scaling->value + alb_sh_scaling_index(n, inner, m, m, m);
        for (int i = m; i < n; i++)
            for (int j = m; j < inner; j++, value++) {
                out[alb_sh_index(i, m)] += *value * in[alb_sh_index(j, m)];
                if (m)
                    out[alb_sh_index(i, -m)] += *value * in[alb_sh_index(j, -m)];
            }
    }
}
