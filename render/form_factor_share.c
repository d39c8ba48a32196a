// Rows of neighbours hold independent rays. Where two patches see nearly the same, what both gather is known better
// from the rays of both. With q the patches across the edges of p,
//     (W x)_p = x_p + sum over q of w_pq (x_q - x_p),   w_pq = min(A_p, A_q) / (4 A_p) or 0
// twice. W keeps constants (rows of W F sum to what those of F do), signs, and fluxes (A_p w_pq = A_q w_qp).
// How unlike the irradiance of two places may be is bounded by how near the things are that they see and how their
// normals differ (Ward, Rubinstein & Clear 1988, the split sphere):
//     |E_p - E_q| / E  <~  d <1/r> + sqrt(1 - n_p . n_q)
// They share where that is below `unlike`, chosen for the noise of a row of 256 rays, and in proportion for others.
// Where the rows of a neighbourhood are lattices turned at random, their mean errs as the root of their number says;
// the phases (form_factor_cast.c) turn them so that together they are one finer lattice, as far as two rings of
// neighbours can each have another. Stops being true: a shadow's edge of a small lamp is blurred by about a patch, as
// patches blur it themselves.
#include "render/form_factor_share.h"
#include "base/memory.h"
#include "render/form_factor_cast.h"
#include "render/mesh_edges.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double unlike = 0.12;

typedef float float4 __attribute__((vector_size(16), may_alias));

static double bend_of(const alb_patches *patches, uint32_t p, uint32_t q)
{
    return sqrt(fmax(0, 1 - alb_dot(patches->normals[p], patches->normals[q])));
}

bool alb_row_shares_create(alb_row_shares *shares, const alb_patches *patches, alb_error *error)
{
    const size_t n = patches->count;
    alb_half_edge *edges = alb_half_edges_sorted((const uint32_t(*)[3])patches->mesh->faces, NULL, n, error);
    *shares = (alb_row_shares){.count = n};
    const bool ok = edges && (shares->neighbours = alb_allocate(n, sizeof *shares->neighbours, error));
    for (size_t i = 0; ok && i < 3 * n; i++)
        shares->neighbours[i / 3][i % 3] = (uint32_t)(i / 3);
    for (size_t i = 0, next; ok && i < 3 * n; i = next) {
        next = alb_half_edges_end(edges, 3 * n, i);
        const uint32_t a = edges[i].place, b = edges[next - 1].place, p = a / 3, q = b / 3;
        if (next - i == 2 && p != q && bend_of(patches, p, q) < unlike) {
            shares->neighbours[p][a % 3] = q;
            shares->neighbours[q][b % 3] = p;
        }
    }
    free(edges);
    if (!ok)
        alb_row_shares_free(shares);
    return ok;
}

// --- phases ----------------------------------------------------------------------------------------------------------
static void count_phase(int counts[ALB_RAY_PHASES], const uint8_t *phases, uint32_t patch, int weight)
{
    if (phases[patch] < ALB_RAY_PHASES)
        counts[phases[patch]] += weight;
}

// The phase that the two rings of neighbours have least, the nearer counting twice; of equals one that follows from the
// patch's number.
static uint8_t rarest_phase(const alb_row_shares *shares, const uint8_t *phases, uint32_t patch)
{
    int counts[ALB_RAY_PHASES] = {0};
    for (int i = 0; i < 3; i++) {
        const uint32_t near = shares->neighbours[patch][i];
        if (near == patch)
            continue;
        count_phase(counts, phases, near, 2);
        for (int k = 0; k < 3; k++)
            if (shares->neighbours[near][k] != patch && shares->neighbours[near][k] != near)
                count_phase(counts, phases, shares->neighbours[near][k], 1);
    }
    uint32_t rarest = 0;
    for (uint32_t k = 0; k < ALB_RAY_PHASES; k++) {
        const uint32_t phase = (patch * 7 + k) % ALB_RAY_PHASES;
        if (k == 0 || counts[phase] < counts[rarest])
            rarest = phase;
    }
    return (uint8_t)rarest;
}

void alb_row_shares_phases(uint8_t *phases, const alb_row_shares *shares)
{
    enum { SWEEPS = 2 }; // the second knows all neighbours
    memset(phases, ALB_RAY_PHASES, shares->count);
    for (int sweep = 0; sweep < SWEEPS; sweep++)
        for (size_t p = 0; p < shares->count; p++)
            phases[p] = rarest_phase(shares, phases, (uint32_t)p);
}

// --- who shares ------------------------------------------------------------------------------------------------------
static bool are_alike(const alb_patches *patches, const alb_hit_rows *rows, const float *nearness_per_mm, uint32_t p,
                      uint32_t q)
{
    const double distance = alb_length(alb_sub(patches->centroids[p], patches->centroids[q]));
    const double rays = fmin((double)alb_hit_rows_length(rows, p), (double)alb_hit_rows_length(rows, q));
    const double nearness = fmax((double)nearness_per_mm[p], (double)nearness_per_mm[q]);
    return fmin(patches->areas_mm2[p], patches->areas_mm2[q]) > 0 &&
           distance * nearness + bend_of(patches, p, q) < unlike * fmin(256 / rays, 1);
}

void alb_row_shares_limit(alb_row_shares *shares, const alb_patches *patches, const alb_hit_rows *rows,
                          const float *nearness_per_mm)
{
    for (size_t p = 0; p < shares->count; p++)
        for (int i = 0; i < 3; i++)
            if (!are_alike(patches, rows, nearness_per_mm, (uint32_t)p, shares->neighbours[p][i]))
                shares->neighbours[p][i] = (uint32_t)p;
}

void alb_row_shares_free(alb_row_shares *shares)
{
    free(shares->neighbours);
    *shares = (alb_row_shares){0};
}

size_t alb_row_shares_bytes(const alb_row_shares *shares) { return shares->count * sizeof *shares->neighbours; }

void alb_row_shares_apply(double (*values)[3], float (*room)[4], const alb_row_shares *shares)
{
#pragma omp parallel
    {
#pragma omp for schedule(static)
        for (size_t p = 0; p < shares->count; p++) {
            const uint32_t *q = shares->neighbours[p];
            const double *own = values[p], a = own[0], b = own[1], c = own[2], scale = 1 / (double)room[p][3];
            double sum[3] = {0};
            for (int i = 0; i < 3; i++) {
                const double ratio = (double)room[q[i]][3] * scale, w = 0.25 * (ratio < 1 ? ratio : 1);
                const double *other = values[q[i]];
                sum[0] += w * (other[0] - a), sum[1] += w * (other[1] - b), sum[2] += w * (other[2] - c);
            }
            room[p][0] = (float)(a + sum[0]), room[p][1] = (float)(b + sum[1]), room[p][2] = (float)(c + sum[2]);
        }
#pragma omp for schedule(static)
        for (size_t p = 0; p < shares->count; p++) {
            const float4 own = *(const float4 *)room[p];
            const float scale = 1 / own[3];
            float4 sum = {0};
            for (int i = 0; i < 3; i++) {
                const float4 other = *(const float4 *)room[shares->neighbours[p][i]];
                const float ratio = other[3] * scale, w = 0.25F * (ratio < 1 ? ratio : 1);
                sum += w * (other - own);
            }
            for (int c = 0; c < 3; c++)
                values[p][c] = (double)(own[c] + sum[c]);
        }
    }
}
