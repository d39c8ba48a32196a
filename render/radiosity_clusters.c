// The coarse level: irradiance even on each cluster. Q is the mean over a cluster's area; what falls on the clusters of
// what they send out, b, is
//     g = (I - F_c S_c)^-1 F_c b
// F_c: means over a cluster's rays; S_c: the row sum of S' times the mean over its sources (radiosity_clusters_make.c
// says where both come from). The coarse solution is a guess that the solver corrects: what it gets wrong costs
// products, not accuracy.
#include "render/radiosity_clusters.h"
#include "base/vector_clones.h"
#include "render/radiosity_solver.h"
#include <stdlib.h>
#include <string.h>

static const double coarse_residual = 0.3;

void alb_clusters_free(alb_clusters *clusters)
{
    free(clusters->cluster);
    free(clusters->members);
    free(clusters->first);
    free(clusters->areas_mm2);
    free(clusters->first_hit);
    free(clusters->hits);
    free(clusters->kept);
    free(clusters->values);
    for (int c = 0; c < 3; c++)
        free(clusters->sources[c]);
    free(clusters->spreads);
    free(clusters->right);
    free(clusters->bounced);
    *clusters = (alb_clusters){0};
}

size_t alb_clusters_bytes(const alb_clusters *clusters)
{
    return clusters->patch_count * (sizeof *clusters->cluster + sizeof *clusters->members) +
           (clusters->count + 1) * (sizeof *clusters->first + sizeof *clusters->first_hit) +
           (clusters->first_hit ? clusters->first_hit[clusters->count] * sizeof *clusters->hits : 0) +
           clusters->count * (3 * ALB_CLUSTER_SOURCES * sizeof *clusters->sources[0] + sizeof *clusters->spreads +
                              sizeof(double) + 3 * sizeof(alb_rgb) + sizeof *clusters->values);
}

void alb_clusters_average(alb_rgb *out, const alb_clusters *clusters, const alb_rgb *values)
{
#pragma omp parallel for schedule(static) if (clusters->patch_count > 8192)
    for (size_t k = 0; k < clusters->count; k++) {
        double sum[3] = {0};
        for (uint32_t m = clusters->first[k]; m < clusters->first[k + 1]; m++)
            for (int c = 0; c < 3; c++)
                sum[c] += clusters->patch_areas_mm2[clusters->members[m]] * values[clusters->members[m]][c];
        for (int c = 0; c < 3; c++)
            out[k][c] = sum[c] / clusters->areas_mm2[k];
    }
}

void alb_clusters_refresh(alb_clusters *clusters, const alb_scatter *scatter)
{
    clusters->sums = (const alb_rgb *)scatter->row_sums;
    alb_clusters_average(clusters->kept, clusters, clusters->sums);
}

static void take_values(const alb_clusters *clusters, const alb_rgb *from)
{
    for (size_t k = 0; k < clusters->count; k++)
        for (int c = 0; c < 3; c++)
            clusters->values[k][c] = (float)from[k][c];
}

typedef float float4 __attribute__((vector_size(16), may_alias));

ALB_VECTOR_CLONES
void alb_clusters_gather(alb_rgb *out, const alb_clusters *clusters, const alb_rgb *radiosity, int stride)
{
    const float4 *values = (const float4 *)clusters->values;
    const double weight = (double)stride / ALB_CLUSTER_RAYS;
    take_values(clusters, radiosity);
#pragma omp parallel for schedule(static) if (clusters->count > 256)
    for (size_t k = 0; k < clusters->count; k++) {
        const uint16_t *hits = clusters->hits + clusters->first_hit[k], *const end =
                                                                            clusters->hits + clusters->first_hit[k + 1];
        float4 lanes[4] = {{0}};
        for (; end - hits > 3 * stride; hits += 4 * stride)
            for (int i = 0; i < 4; i++)
                lanes[i] += values[hits[i * stride]];
        for (; hits < end; hits += stride)
            lanes[0] += values[*hits];
        const float4 sum = (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]);
        for (int c = 0; c < 3; c++)
            out[k][c] = weight * (double)sum[c];
    }
}

// Means over the sources of cluster k.
static void gather_sources(double means[3], const alb_clusters *clusters, size_t k)
{
    const uint16_t *sources[3];
    float sums[2][3] = {{0}};
    for (int c = 0; c < 3; c++)
        sources[c] = clusters->sources[c] + k * ALB_CLUSTER_SOURCES;
    for (int q = 0; q < ALB_CLUSTER_SOURCES; q += 2)
        for (int odd = 0; odd < 2; odd++)
            for (int c = 0; c < 3; c++)
                sums[odd][c] += clusters->values[sources[c][q + odd]][c];
    for (int c = 0; c < 3; c++)
        means[c] = (double)(sums[0][c] + sums[1][c]) / ALB_CLUSTER_SOURCES;
}

void alb_clusters_scatter(alb_rgb *out, const alb_clusters *clusters, const alb_rgb *light)
{
    take_values(clusters, light);
#pragma omp parallel for schedule(static) if (clusters->count > 256)
    for (size_t k = 0; k < clusters->count; k++) {
        double means[3];
        if (clusters->spreads[k])
            gather_sources(means, clusters, k);
        for (int c = 0; c < 3; c++)
            out[k][c] = clusters->kept[k][c] * (clusters->spreads[k] ? means[c] : light[k][c]);
    }
}

void alb_clusters_move(alb_rgb *out, const alb_clusters *clusters, const alb_rgb *light, const alb_rgb *even)
{
    alb_clusters_scatter(out, clusters, light);
#pragma omp parallel for schedule(static)
    for (size_t k = 0; k < clusters->count; k++)
        for (int c = 0; c < 3; c++)
            out[k][c] = (clusters->kept[k][c] > 0 ? out[k][c] / clusters->kept[k][c] : 0) - even[k][c];
}

// out = F_c S_c x
static void bounce(alb_rgb *out, const void *data, const alb_rgb *x)
{
    const alb_clusters *clusters = data;
    alb_clusters_scatter(clusters->bounced, clusters, x);
    alb_clusters_gather(out, clusters, (const alb_rgb *)clusters->bounced, 1);
}

void alb_clusters_settle(alb_rgb *out, const alb_clusters *clusters, const alb_rgb *radiosity)
{
    alb_radiosity_report report;
    const alb_bounce coarse = {
        .count = clusters->count, .areas_mm2 = clusters->areas_mm2, .data = clusters, .apply = bounce};
    alb_clusters_gather(clusters->right, clusters, radiosity, 1);
    if (!alb_solver_run(out, &report, ALB_SOLVER_GMRES, &coarse, (const alb_rgb *)clusters->right, NULL,
                        coarse_residual, NULL))
        memset(out, 0, clusters->count * sizeof *out); // no memory: as without this level
}
