// The pairs of one body's patches (scatter.c): the far ones summed anew at every product, in blocks of sources so that
// distances and table entries come out of vector instructions; the near ones integrated once.
#include "render/scatter_pairs.h"
#include "base/vector_clones.h"
#include <string.h>

enum { BLOCK = 256 };

// Which run of sources the body's patch j belongs to.
static int run_of(const alb_sources *sources, size_t j)
{
    return (j >= sources->starts[1]) + (j >= sources->starts[2]);
}

// The sources that act on a patch of this run by the side's profile: one stretch of them.
static void stretch_of(size_t *from, size_t *to, const alb_sources *sources, int run, alb_side side)
{
    const size_t *starts = sources->starts;
    const bool across = side == ALB_TRANSMISSION;
    *from = run == 0 ? (across ? starts[2] : 0) : run == 1 ? 0 : across ? 0 : starts[1];
    *to = run == 0   ? (across ? starts[3] : starts[2])
          : run == 1 ? (across ? 0 : starts[3])
          : across   ? starts[1]
                     : starts[3];
}

// Where the pair's profile is taken: squared distances of a block of sources from patch j, straight, or lateral between
// the faces of a slab.
typedef struct viewpoint {
    float at[3], across[3]; // centre of j; the faces' normal, or zeros for straight distances
} viewpoint;

static viewpoint viewpoint_of(const alb_scatter_body *body, size_t j, alb_side side)
{
    viewpoint out = {{body->sources.x_mm[j], body->sources.y_mm[j], body->sources.z_mm[j]}, {0}};
    if (side == ALB_TRANSMISSION)
        memcpy(out.across, body->axis, sizeof out.across);
    return out;
}

ALB_VECTOR_CLONES
static void measure_block(float *restrict distance2, const alb_sources *sources, size_t first, size_t count,
                          const viewpoint *from)
{
    const float *restrict xs = sources->x_mm + first, *restrict ys = sources->y_mm + first,
                          *restrict zs = sources->z_mm + first;
    const viewpoint r = *from;
    for (size_t k = 0; k < count; k++) {
        const float x = r.at[0] - xs[k], y = r.at[1] - ys[k], z = r.at[2] - zs[k];
        const float across = x * r.across[0] + y * r.across[1] + z * r.across[2];
        const float squared = x * x + y * y + z * z - across * across;
        distance2[k] = squared > 0 ? squared : 0;
    }
}

static size_t block_size(size_t first, size_t to) { return to - first < BLOCK ? to - first : BLOCK; }

// What the far pairs of a patch come to.
typedef struct far_sums {
    double rows[4], columns[4]; // of kernel times amount where the source, or the patch itself, sets what is far
    size_t near;                // pairs that are near by the source
} far_sums;

// Adds the stretch from .. to of the sources. own_near2 INFINITY: no columns.
ALB_VECTOR_CLONES
static void add_far(far_sums *out, const alb_radial *radial, const alb_sources *sources, const float *near2,
                    float own_near2, size_t from, size_t to, const viewpoint *seen_from)
{
    typedef float float4 __attribute__((vector_size(16)));
    typedef double double4 __attribute__((vector_size(32)));
    double4 rows = {0}, columns = {0};
    float distance2[BLOCK], at[BLOCK];
    int entries[BLOCK];
    size_t near = 0;
    const float per_mm = (float)radial->entries_per_mm;
    for (size_t first = from; first < to; first += BLOCK) {
        const size_t count = block_size(first, to);
        measure_block(distance2, sources, first, count, seen_from);
        for (size_t k = 0; k < count; k++) {
            at[k] = sqrtf(distance2[k]) * per_mm;
            entries[k] = (int)at[k];
        }
        for (size_t k = 0; k < count; k++) {
            float4 low, high;
            double4 amount;
            memcpy(&low, radial->values[entries[k]], sizeof low);
            memcpy(&high, radial->values[entries[k] + 1], sizeof high);
            memcpy(&amount, sources->amounts[first + k], sizeof amount);
            low += (at[k] - (float)entries[k]) * (high - low);
            const double4 share = __builtin_convertvector(low, double4) * amount;
            if (distance2[k] >= near2[first + k])
                rows += share;
            else
                near++;
            if (distance2[k] >= own_near2)
                columns += share;
        }
    }
    for (int c = 0; c < 4; c++)
        out->rows[c] += rows[c], out->columns[c] += columns[c];
    out->near += near;
}

void alb_scatter_add_far(double (*out)[3], alb_scatter *sums, const alb_scatter_body *body, const alb_sources *sources)
{
#pragma omp parallel for schedule(dynamic, 16)
    for (size_t j = 0; j < body->sources.count; j++) {
        far_sums found = {.near = 0};
        const size_t patch = body->patches[j];
        for (int side = 0; side < ALB_SIDES; side++) {
            size_t from, to;
            stretch_of(&from, &to, sources, run_of(&body->sources, j), (alb_side)side);
            const viewpoint seen_from = viewpoint_of(body, j, (alb_side)side);
            if (from < to)
                add_far(&found, &body->radials[side], sources, sources->near2_mm2[side],
                        sums ? body->sources.near2_mm2[side][j] : INFINITY, from, to, &seen_from);
        }
        for (int c = 0; c < 3; c++)
            out[patch][c] += found.rows[c];
        for (int c = 0; sums && c < 3; c++)
            sums->column_sums[patch][c] += found.columns[c];
        if (sums)
            sums->row_starts[patch + 1] = found.near - 1; // but for itself
    }
}

// The source triangle as exit patch j sees it: for a slab's other face, moved along the axis into the plane of c_j.
static void exact_pair(double weight[3], const alb_scatter_body *body, const alb_patches *patches, alb_side side,
                       size_t j, size_t i)
{
    alb_vector triangle[3], p = patches->centroids[body->patches[j]];
    alb_patch_triangle(triangle, patches, body->patches[i]);
    if (side == ALB_TRANSMISSION) {
        const alb_vector axis = {(double)body->axis[0], (double)body->axis[1], (double)body->axis[2]};
        for (int k = 0; k < 3; k++)
            triangle[k] = alb_add(triangle[k], alb_times(alb_dot(axis, alb_sub(p, triangle[k])), axis));
    }
    const alb_vector middle = alb_times(1.0 / 3, alb_add(triangle[0], alb_add(triangle[1], triangle[2])));
    if (alb_length(alb_sub(middle, p)) > 1.25 * alb_longest_edge(triangle))
        alb_scatter_triangle_from_afar(weight, &body->radials[side], triangle, p);
    else
        alb_scatter_triangle(weight, &body->radials[side], triangle, p);
    for (int c = 0; c < 3; c++)
        weight[c] = fmax(0, weight[c]); // quadrature noise where the profile has died away
}

void alb_scatter_fill_near(alb_scatter *scatter, const alb_scatter_body *body, const alb_patches *patches, size_t j)
{
    size_t at = scatter->row_starts[body->patches[j]], from, to;
    const int run = run_of(&body->sources, j);
    float distance2[BLOCK];
    double weight[3];
    for (int side = 0; side < ALB_SIDES; side++) {
        stretch_of(&from, &to, &body->sources, run, (alb_side)side);
        const viewpoint seen_from = viewpoint_of(body, j, (alb_side)side);
        for (size_t first = from; first < to; first += BLOCK) {
            const size_t count = block_size(first, to);
            measure_block(distance2, &body->sources, first, count, &seen_from);
            for (size_t k = 0; k < count; k++) {
                const size_t i = first + k;
                if (distance2[k] >= body->sources.near2_mm2[side][i])
                    continue;
                exact_pair(weight, body, patches, (alb_side)side, j, i);
                if (i == j) {
                    memcpy(scatter->local[body->patches[j]], weight, sizeof weight);
                    continue;
                }
                scatter->sources[at] = body->patches[i];
                for (int c = 0; c < 3; c++)
                    scatter->weights[at][c] = (float)weight[c];
                at++;
            }
        }
    }
}
