// With B = S'E + S'F B, the irradiance that patches send each other is G = F B = T E, T = (I - F S')^-1 F S', and
//     B = S'(E + T E),    T ~= Q (T* Q)*        randomised range finder (Halko, Martinsson & Tropp 2011, alg. 4.1)
// Q: an orthonormal basis, in the inner product weighted by area, of T applied to random lights, one solution each.
// Lights and not white noise: that would find the sampling noise of F, which is most of T's rank and of which smooth
// light sees little.
// T*, the adjoint in that product, is S'F (I - S'F)^-1 by reciprocity, T* q = x - q with x = q + S'F x: another
// solution. S'E stays exact, so that only light that has left one patch for another is narrowed down. (Sheng et al.
// 2014 precompute the whole inverse for this, n^2 numbers.) With an exact bounce,
//     B = S'(E + F S'E + T2 E),    T2 = F S' T
// and T2 is narrower still: the light of a small spot has spread before the columns see it. It costs F and S' once
// more.
//
// T* q is as smooth as scattered light is: V is kept as its means over the clusters of the equations, V^T E ~= V^T Q E.
// The rows of U that belong to one cluster are alike: few modes of them are kept, and what share each patch has in
// each. Numbers are kept as 16-bit whole numbers of a step a column, 1/32767 of the largest, rows side by side: a
// product reads U and V once.
//
// Where it stops being true: light that a few large columns do not span, such as the bounce of a small spot in a
// corner, falls outside Q; reciprocity holds for rays and for sampled scattering only statistically. Both are in the
// stated error, which is measured.
#include "render/relight.h"
#include "base/vector_clones.h"
#include <stdlib.h>

enum { LANES = 24 };

// out += values of one row times light[l % 3].
ALB_VECTOR_CLONES
static void add_row(float *restrict out, const int16_t *restrict values, const float light[LANES], size_t count)
{
    for (size_t k = 0; k < count; k += LANES)
        for (int l = 0; l < LANES; l++)
            out[k + (size_t)l] += light[l] * (float)values[k + (size_t)l];
}

ALB_VECTOR_CLONES
static void dot_row(double out[3], const int16_t *restrict values, const float *restrict factors, size_t count)
{
    float sums[LANES] = {0};
    for (size_t k = 0; k < count; k += LANES)
        for (int l = 0; l < LANES; l++)
            sums[l] += factors[k + (size_t)l] * (float)values[k + (size_t)l];
    for (int c = 0; c < 3; c++) {
        out[c] = 0;
        for (int l = c; l < LANES; l += 3)
            out[c] += (double)sums[l];
    }
}

// factors = V^T Q E, with the steps of V and U.
static void project(float *factors, const alb_relight *r, const alb_rgb *irradiance)
{
    const size_t count = alb_relight_numbers(r), clusters = r->equations->clusters.count;
    alb_clusters_average(r->even, &r->equations->clusters, irradiance);
#pragma omp parallel for schedule(static)
    for (size_t block = 0; block < alb_relight_blocks(r); block++) {
        float sums[3 * ALB_RELIGHT_RANK_MAX] = {0}, light[LANES];
        for (size_t k = block * ALB_RELIGHT_ROWS; k < clusters && k < (block + 1) * ALB_RELIGHT_ROWS; k++) {
            const double *e = r->even[k];
            for (int l = 0; l < LANES; l++)
                light[l] = (float)e[l % 3];
            if (e[0] != 0 || e[1] != 0 || e[2] != 0)
                add_row(sums, r->v + k * count, light, count);
        }
        for (size_t k = 0; k < count; k++)
            r->partial[block * count + k] = (double)sums[k];
    }
    for (size_t k = 0; k < count; k++) {
        double sum = 0;
        for (size_t block = 0; block < alb_relight_blocks(r); block++)
            sum += r->partial[block * count + k];
        factors[k] = (float)(sum * (double)r->v_step[k] * (double)r->u_step[k]);
    }
}

// The irradiance of a cluster's patches, and what the columns add to it.
static void add_cluster(const alb_relight *r, size_t cluster, const float *factors, const alb_rgb *irradiance)
{
    const alb_clusters *clusters = &r->equations->clusters;
    const uint32_t first = r->first_mode[cluster], count = r->first_mode[cluster + 1] - first;
    const float(*share)[3] = (const float(*)[3])r->shares + r->first_share[cluster];
    double modes[ALB_RELIGHT_MODES_MAX][3];
    for (uint32_t k = 0; k < count; k++)
        dot_row(modes[k], r->u + (first + k) * alb_relight_numbers(r), factors, alb_relight_numbers(r));
    for (uint32_t i = clusters->first[cluster]; i < clusters->first[cluster + 1]; i++, share += count) {
        const uint32_t p = clusters->members[i];
        for (int c = 0; c < 3; c++) {
            double bounced = 0;
            for (uint32_t k = 0; k < count; k++)
                bounced += (double)share[k][c] * modes[k][c];
            r->irradiance[p][c] = irradiance[p][c] + bounced;
        }
    }
}

void alb_relight_apply(alb_rgb *radiosity, alb_relight *r, const alb_rgb *irradiance)
{
    float factors[3 * ALB_RELIGHT_RANK_MAX];
    project(factors, r, irradiance);
#pragma omp parallel for schedule(dynamic, 16)
    for (size_t k = 0; k < r->equations->clusters.count; k++)
        add_cluster(r, k, factors, irradiance);
    if (r->exact_bounce) {
        alb_scatter_apply(radiosity, r->equations->scatter, irradiance);
        alb_form_factors_apply(r->bounced, r->equations->factors, (const alb_rgb *)radiosity);
#pragma omp parallel for schedule(static)
        for (size_t p = 0; p < r->count; p++)
            for (int c = 0; c < 3; c++)
                r->irradiance[p][c] += r->bounced[p][c];
    }
    alb_scatter_apply(radiosity, r->equations->scatter, (const alb_rgb *)r->irradiance);
}

void alb_relight_free(alb_relight *relight)
{
    free(relight->u);
    free(relight->v);
    free(relight->first_mode);
    free(relight->first_share);
    free(relight->shares);
    free(relight->u_step);
    free(relight->v_step);
    free(relight->partial);
    free(relight->irradiance);
    free(relight->bounced);
    free(relight->even);
    *relight = (alb_relight){0};
}

size_t alb_relight_bytes(const alb_relight *r)
{
    if (!r->rank)
        return 0;
    const size_t clusters = r->equations->clusters.count;
    return (r->first_mode[clusters] + clusters) * alb_relight_numbers(r) * sizeof *r->u +
           r->first_share[clusters] * sizeof *r->shares + 2 * (clusters + 1) * sizeof *r->first_mode;
}
