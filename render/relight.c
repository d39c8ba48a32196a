// With B = S'E + S'F B, the irradiance that patches send each other is G = F B = T E, T = (I - F S')^-1 F S', and
//     B = S'(E + G),    G = F S'(E + G)
// (Sheng et al. 2014 precompute the whole inverse for this, n^2 numbers.) S'(E + G) at last is exact: shadows have
// edges. What patches send each other is known as well as need be from less:
//     G  ~=  P F_r S~ (E + P g),    g = F_c S_c Q E + U V^T Q E
// F_r: rays of the receivers, groups of patches on which G is even (relight_receivers.h), P: the same on each patch of
// a group. Q: means over the clusters of the equations' coarse level, F_c, S_c: bounces between these, S~: that which
// scatters between clusters and keeps what varies within one where it is (radiosity_two_level.c). Each F sees little of
// what the step before it got wrong. What is left, light that has bounced twice and more,
//     T2 = F S' T  ~=  U V^T    by a randomised range finder (Halko, Martinsson & Tropp 2011, alg. 4.1)
// U: means over clusters of an orthonormal basis, in the inner product weighted by area, of T2 applied to random
// lights, one solution each. Lights and not white noise: that would find the sampling noise of F, which is most of the
// rank and of which smooth light sees little. V: means over clusters of T2* of its columns. T*, the adjoint in that
// product, is S'F (I - S'F)^-1 by reciprocity, T* q = x - q with x = q + S'F x: another solution. Numbers are kept as
// 16-bit whole numbers of a step a column, 1/32767 of the largest, rows side by side: a product reads U and V once.
//
// Where it stops being true: light that a few large columns do not span falls outside Q; reciprocity holds for rays and
// for sampled scattering only statistically. Both are in the stated error, which is measured.
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

// factors = V^T of the clusters' irradiance, with the steps of V and U.
static void project(float *factors, const alb_relight *r)
{
    const size_t count = alb_relight_numbers(r), clusters = r->equations->clusters.count;
#pragma omp parallel for schedule(static)
    for (size_t block = 0; block < (count ? alb_relight_blocks(r) : 0); block++) {
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

// g, of the clusters, from Q E in r->even.
static void bounce_coarsely(const alb_relight *r)
{
    const alb_clusters *clusters = &r->equations->clusters;
    const size_t count = alb_relight_numbers(r);
    float factors[3 * ALB_RELIGHT_RANK_MAX];
    project(factors, r);
    alb_clusters_scatter(r->sent, clusters, (const alb_rgb *)r->even);
    alb_clusters_gather(r->bounced, clusters, (const alb_rgb *)r->sent, 2);
#pragma omp parallel for schedule(static)
    for (size_t k = 0; k < clusters->count; k++) {
        double later[3];
        dot_row(later, r->u + k * count, factors, count);
        for (int c = 0; c < 3; c++)
            r->bounced[k][c] += r->even[k][c] + later[c];
    }
}

// S~ (E + P g), as what receivers gather, from Q E + g in r->bounced.
static void send_roughly(const alb_relight *r, const alb_rgb *irradiance)
{
    const alb_clusters *clusters = &r->equations->clusters;
    alb_clusters_move(r->sent, clusters, (const alb_rgb *)r->bounced, (const alb_rgb *)r->even);
#pragma omp parallel for schedule(static)
    for (size_t p = 0; p < r->count; p++)
        for (int c = 0; c < 3; c++)
            r->receivers.values[p][c] =
                (float)alb_clusters_sent(clusters, (const alb_rgb *)r->sent, p, c, irradiance[p][c]);
}

void alb_relight_apply(alb_rgb *radiosity, alb_relight *r, const alb_rgb *irradiance)
{
    const alb_receivers *receivers = &r->receivers;
    alb_clusters_average(r->even, &r->equations->clusters, irradiance);
    bounce_coarsely(r);
    send_roughly(r, irradiance);
    alb_receivers_gather(receivers);
#pragma omp parallel for schedule(static)
    for (size_t k = 0; k < receivers->count; k++)
        for (uint32_t i = receivers->first[k]; i < receivers->first[k + 1]; i++)
            for (int c = 0; c < 3; c++) {
                const double bounced =
                    receivers->gathered[k][c]; // off by more than itself beside a sharp edge in the dark
                r->irradiance[receivers->members[i]][c] =
                    irradiance[receivers->members[i]][c] + (bounced < 0 ? 0 : bounced);
            }
    alb_scatter_apply(radiosity, r->equations->scatter, (const alb_rgb *)r->irradiance);
}

void alb_relight_free(alb_relight *relight)
{
    alb_receivers_free(&relight->receivers);
    free(relight->u);
    free(relight->v);
    free(relight->u_step);
    free(relight->v_step);
    free(relight->partial);
    free(relight->irradiance);
    free(relight->even);
    free(relight->sent);
    free(relight->bounced);
    *relight = (alb_relight){0};
}

size_t alb_relight_bytes(const alb_relight *r)
{
    if (!r->equations)
        return 0;
    const size_t clusters = r->equations->clusters.count;
    return 2 * clusters * alb_relight_numbers(r) * sizeof *r->u + alb_receivers_bytes(&r->receivers) +
           3 * clusters * sizeof *r->even + r->count * sizeof *r->irradiance;
}
