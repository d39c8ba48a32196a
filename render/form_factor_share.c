// Rows of neighbours hold independent rays. Where two patches see nearly the same, what both gather is known better
// from the rays of both. With q the patches across the edges of p,
//     (W x)_p = x_p + sum over q of w_pq (x_q - x_p),   w_pq = min(A_p, A_q) / (4 A_p) or 0
// twice. W keeps constants (rows of W F sum to what those of F do), signs, and fluxes (A_p w_pq = A_q w_qp).
// How unlike the irradiance of two places may be is bounded by how near the things are that they see and how their
// normals differ (Ward, Rubinstein & Clear 1988, the split sphere):
//     |E_p - E_q| / E  <~  d <1/r> + sqrt(1 - n_p . n_q)
// They share where that is below `unlike`, chosen for the noise of a row of 256 rays, and in proportion for others.
// Stops being true: a shadow's edge of a small lamp is blurred by about a patch, as patches blur it themselves.
#include "render/form_factor_share.h"
#include "base/memory.h"
#include <math.h>
#include <stdlib.h>

static const double unlike = 0.12;

typedef struct side {
    uint64_t edge; // lower vertex, higher vertex
    uint32_t patch, corner;
} side;

static int by_edge(const void *a, const void *b)
{
    const side *p = a, *q = b;
    if (p->edge != q->edge)
        return p->edge < q->edge ? -1 : 1;
    return p->patch < q->patch ? -1 : p->patch > q->patch;
}

static side *sorted_sides(const alb_patches *patches, alb_error *error)
{
    side *sides = alb_allocate(3 * patches->count, sizeof *sides, error);
    for (size_t i = 0; sides && i < 3 * patches->count; i++) {
        const uint32_t *face = patches->mesh->faces[i / 3], a = face[i % 3], b = face[(i + 1) % 3];
        sides[i] = (side){(uint64_t)(a < b ? a : b) << 32 | (a < b ? b : a), (uint32_t)(i / 3), (uint32_t)(i % 3)};
    }
    if (sides)
        qsort(sides, 3 * patches->count, sizeof *sides, by_edge);
    return sides;
}

static bool are_alike(const alb_patches *patches, const size_t *first, const float *nearness_per_mm, uint32_t p,
                      uint32_t q)
{
    const double distance = alb_length(alb_sub(patches->centroids[p], patches->centroids[q]));
    const double bend = sqrt(fmax(0, 1 - alb_dot(patches->normals[p], patches->normals[q])));
    const double rays = fmin((double)(first[p + 1] - first[p]), (double)(first[q + 1] - first[q]));
    const double nearness = fmax((double)nearness_per_mm[p], (double)nearness_per_mm[q]);
    return distance * nearness + bend < unlike * fmin(256 / rays, 1);
}

bool alb_row_shares_create(alb_row_shares *shares, const alb_patches *patches, const size_t *first,
                           const float *nearness_per_mm, alb_error *error)
{
    const size_t n = patches->count;
    *shares = (alb_row_shares){.count = n};
    side *sides = sorted_sides(patches, error);
    const bool ok = sides && (shares->neighbours = alb_allocate(n, sizeof *shares->neighbours, error)) &&
                    (shares->weights = alb_allocate(n, sizeof *shares->weights, error));
    for (size_t i = 0; ok && i < 3 * n; i++)
        shares->neighbours[i / 3][i % 3] = (uint32_t)(i / 3);
    for (size_t i = 0, next; ok && i < 3 * n; i = next) {
        for (next = i + 1; next < 3 * n && sides[next].edge == sides[i].edge;)
            next++;
        const uint32_t pair[2] = {sides[i].patch, sides[next - 1].patch};
        if (next - i != 2 || pair[0] == pair[1] || !are_alike(patches, first, nearness_per_mm, pair[0], pair[1]))
            continue;
        const double areas[2] = {patches->areas_mm2[pair[0]], patches->areas_mm2[pair[1]]};
        for (int k = 0; k < 2; k++) {
            const uint32_t corner = sides[i + (size_t)k].corner;
            shares->neighbours[pair[k]][corner] = pair[1 - k];
            shares->weights[pair[k]][corner] = (float)(0.25 * fmin(areas[0], areas[1]) / areas[k]);
        }
    }
    free(sides);
    if (!ok)
        alb_row_shares_free(shares);
    return ok;
}

void alb_row_shares_free(alb_row_shares *shares)
{
    free(shares->neighbours);
    free(shares->weights);
    *shares = (alb_row_shares){0};
}

size_t alb_row_shares_bytes(const alb_row_shares *shares)
{
    return shares->count * (sizeof *shares->neighbours + sizeof *shares->weights);
}

void alb_row_shares_apply(double (*values)[3], float (*scratch)[4], const alb_row_shares *shares)
{
#pragma omp parallel
    {
#pragma omp for schedule(static)
        for (size_t p = 0; p < shares->count; p++) {
            const uint32_t *q = shares->neighbours[p];
            const float *w = shares->weights[p];
            for (int c = 0; c < 3; c++) {
                const double own = values[p][c];
                scratch[p][c] =
                    (float)(own + (double)w[0] * (values[q[0]][c] - own) + (double)w[1] * (values[q[1]][c] - own) +
                            (double)w[2] * (values[q[2]][c] - own));
            }
        }
#pragma omp for schedule(static)
        for (size_t p = 0; p < shares->count; p++) {
            const uint32_t *q = shares->neighbours[p];
            const float *w = shares->weights[p];
            for (int c = 0; c < 3; c++) {
                const float own = scratch[p][c];
                values[p][c] = (double)(own + w[0] * (scratch[q[0]][c] - own) + w[1] * (scratch[q[1]][c] - own) +
                                        w[2] * (scratch[q[2]][c] - own));
            }
        }
    }
}
