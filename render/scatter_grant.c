// A block's wishes granted: links with codes of their distances along the paths, and exact pairs.
#include "render/scatter_viewer.h"
#include <float.h>
#include <string.h>

static uint8_t encode(float distance, float per_mm)
{
    const float at = distance * per_mm + 0.5F;
    return at < ALB_NO_LINK ? (uint8_t)at : ALB_NO_LINK;
}

// Direction from the block to the cluster, through a slab and in a sheet along its faces, and the cluster's variance
// along it.
static void aim(int8_t direction[4], const alb_viewer *v, const alb_cluster *cluster, int side)
{
    float to[3];
    const float *m = cluster->moments;
    for (int k = 0; k < 3; k++)
        to[k] = cluster->centre_mm[k] - v->centre[k];
    if (alb_viewer_in_sheet(v)) {
        const alb_vector there = v->patches->normals[v->forest->patches[cluster->leaf]];
        alb_project(to, (float)there.x, (float)there.y, (float)there.z);
    } else if (side == ALB_TRANSMISSION) {
        alb_viewer_project(to, v, v->middle_row);
    }
    const float x = to[0], y = to[1], z = to[2], squared = x * x + y * y + z * z;
    const float along = m[0] * x * x + m[1] * y * y + m[2] * z * z + 2 * (m[3] * x * y + m[4] * x * z + m[5] * y * z);
    memset(direction, 0, 4);
    direction[3] = 64;
    if (!(squared > 0))
        return;
    for (int k = 0; k < 3; k++)
        direction[k] = (int8_t)lrintf(INT8_MAX * to[k] / sqrtf(squared));
    direction[3] = (int8_t)fminf(rintf(64 * along / (squared * cluster->spread_mm2)), INT8_MAX);
}

static float lengthened(float distance, const alb_detour *by)
{
    return by->length != 0 ? distance + by->length * fminf(fmaxf(distance, by->length) / by->at, 1) : distance;
}

// Whether the rows see a source from distances too different for one look at how its profile bends.
static bool is_near(const float distances[ALB_BLOCK])
{
    float least = INFINITY, most = 0;
    for (int row = 0; row < ALB_BLOCK; row++)
        if (isfinite(distances[row]))
            least = fminf(least, distances[row]), most = fmaxf(most, distances[row]);
    return most - least > 0.25F * (most + least);
}

// The rows' mean distance, each weighed by what it is sent.
static float mean_distance(const float distances[ALB_BLOCK], const alb_scatter_kernel_needs *needs)
{
    float sum = 0, all = 0;
    for (int row = 0; row < ALB_BLOCK; row++)
        if (isfinite(distances[row])) {
            const float *shares = needs->shares[alb_scatter_kernel_bin(needs, distances[row])];
            const float weight = shares[0] + shares[1] + shares[2] + FLT_MIN;
            sum += weight * distances[row], all += weight;
        }
    return all > 0 ? sum / all : INFINITY;
}

// Distances along the paths; the result is the furthest. Rows that are left out stand nowhere.
static float find_paths(float distances[ALB_SHARES_MAX][ALB_BLOCK], const alb_viewer *v, const alb_wish *wished,
                        int kind, const alb_detour detours[ALB_BLOCK])
{
    float furthest = 0;
    alb_viewer_distances(distances, v, wished, kind);
    for (int k = 0; k < alb_link_codes(kind); k++)
        for (uint32_t row = 0; row < ALB_BLOCK; row++) {
            const alb_detour *by = &detours[row < v->row_count ? row : v->row_count - 1];
            if (wished->left_out >> row & 1 || !isfinite(by->length))
                distances[k][row] = INFINITY;
            else
                furthest = fmaxf(furthest, distances[k][row] = fmaxf(lengthened(distances[k][row], by), 0));
        }
    return furthest;
}

static void add_link(const alb_viewer *v, const alb_wish *wished, int kind, const alb_detour detours[ALB_BLOCK])
{
    const int side = wished->side;
    const alb_scatter_kernel *kernel = v->kernels[side];
    alb_link_workspace *work = v->work;
    float distances[ALB_SHARES_MAX][ALB_BLOCK];
    const float furthest = find_paths(distances, v, wished, kind, detours);
    if ((kind == ALB_LINK_NODE || kind == ALB_LINK_PATCH) && is_near(distances[0]))
        kind++;
    const int count = alb_link_codes(kind);
    work->found.links = alb_grow(&work->found.failed, work->found.links, &work->found.capacity, work->found.count, 1,
                                 sizeof *work->found.links);
    work->found.codes = alb_grow(&work->found.failed, work->found.codes, &work->found.code_capacity,
                                 work->found.code_count, alb_link_code_bytes(kind), 1);
    if (work->found.failed)
        return;
    int octave = ilogbf(fmaxf(furthest, 1e-30F)) + 1 - kernel->first_octave;
    octave = octave < 0 ? 0 : octave < kernel->octave_count ? octave : kernel->octave_count - 1;
    const float per_mm = ldexpf(ALB_CODES - 2, -(kernel->first_octave + octave));
    alb_found_link *added = &work->found.links[work->found.count++];
    *added = (alb_found_link){.source = wished->source,
                              .bucket = (uint16_t)((side * ALB_OCTAVES + octave) * ALB_LINK_KINDS + kind),
                              .codes = work->found.code_count};
    if (kind <= ALB_LINK_NEAR_NODE)
        aim(added->direction, v, &v->forest->clusters[wished->cluster], side);
    uint8_t *codes = work->found.codes + work->found.code_count;
    if (alb_link_bend_bytes(kind))
        *codes++ = encode(mean_distance(distances[0], v->needs[side]), per_mm);
    for (int k = 0; k < count * ALB_BLOCK; k++)
        *codes++ = encode(distances[k / ALB_BLOCK][k % ALB_BLOCK], per_mm);
    work->found.code_count += alb_link_code_bytes(kind);
}

// The patch at `scale` times its distances; its integral is then scale^2 times as large.
static void add_pair(const alb_viewer *v, const alb_wish *wished, uint32_t row, float scale)
{
    const int side = wished->side;
    const alb_cluster *cluster = &v->forest->clusters[wished->cluster];
    const alb_vector p = v->patches->centroids[v->forest->patches[v->first_leaf + row]];
    alb_link_workspace *work = v->work;
    alb_vector t[3];
    work->found.pairs = alb_grow(&work->found.failed, work->found.pairs, &work->found.pair_capacity,
                                 work->found.pair_count, 1, sizeof *work->found.pairs);
    if (work->found.failed)
        return;
    alb_viewer_triangle(t, v, cluster, side, row);
    for (int k = 0; k < 3; k++)
        t[k] = alb_add(p, alb_times((double)scale, alb_sub(t[k], p)));
    alb_exact_pair *pair = &work->found.pairs[work->found.pair_count++];
    *pair = (alb_exact_pair){.leaf = wished->source,
                             .kernel = v->index[side],
                             .row = (uint8_t)row,
                             .per_area = 1 / (scale * scale * cluster->area_mm2)};
    alb_rule_find(&pair->rule, t, p, v->kernels[side]->near_mm);
}

// What goes a long detour is not exact.
void alb_viewer_grant(const alb_viewer *v)
{
    alb_link_workspace *work = v->work;
    const size_t n = work->wish_count;
    for (size_t k = 0; !work->found.failed && k < n; k++) {
        const alb_wish *wished = &work->wishes[k];
        uint32_t row = 0;
        if (wished->kind != ALB_LINK_EXACT) {
            add_link(v, wished, wished->kind, work->detours[k]);
            continue;
        }
        while (wished->left_out >> row & 1)
            row++;
        const alb_detour *by = &work->detours[k][row];
        const float scale = by->length != 0 ? 1 + by->length / by->at : 1;
        if (scale > 0.5F && scale < 1.25F)
            add_pair(v, wished, row, scale);
        else
            add_link(v, wished, ALB_LINK_EIGHTHS, work->detours[k]);
    }
}
