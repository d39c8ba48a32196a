// Choice of links. Exit patches go in blocks of eight neighbours that share the list of clusters and have each their
// own distances. For a block of radius R_b, a cluster at distance d, of radius R and squared size 12 spread:
//     it is taken where   R <= 0.65 (d - R_b)   and   size^2 <= what the kernel allows at d - R_b - R / 2
// and opened elsewhere. Between the faces of a slab d is lateral and the first condition, which keeps a patch out of
// the clusters that light it, falls away.
//
// A patch is taken whole or as 4, 16 or (long ones) 64 equal triangles: the least that leave (scatter_parts.c), of a
// row's sum, no more than 0.15 of the error wanted; where the smallest leave sixteen times that, exactly
// (scatter_rule.c). Of more than one, three distances stay that have the parts' mean, variance and skewness, or eight
// where these leave too much.
//
// The distance that is coded is the mean over the cluster to second order, sqrt(d^2 + variance across the line of
// sight); what the variance along it adds, the kernel knows (scatter_kernel.c).
#include "render/scatter_links.h"
#include "base/memory.h"
#include "base/progress.h"
#include "base/vector_clones.h"
#include "render/scatter_block.h"
#include <float.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

enum { EXACT = -1 };

// A link before its distances are known; left_out: bits of the rows that are the source itself or take it exactly.
typedef struct wish {
    uint32_t cluster, source; // source: node or leaf
    uint8_t side, left_out;
    int8_t kind;
} wish;

// How much longer paths are than straight at a distance and beyond; nearer, in proportion.
typedef struct detour {
    float length, at;
} detour;

// What one thread works with.
typedef struct workspace {
    wish *wishes;
    detour (*detours)[ALB_BLOCK]; // of each wish and row
    alb_optical_target *targets;  // of the wishes
    float *distances;
    unsigned char *opposite;
    size_t wish_count, wish_capacity, detour_capacity, target_capacity, distance_capacity, opposite_capacity;
    alb_optical_workspace paths;
    const alb_optical_paths *paths_of; // whom it serves
    alb_found_links found;
} workspace;

typedef struct viewer {
    const alb_forest *forest;
    const alb_patches *patches;
    const alb_scatter_kernel *kernels[ALB_SIDES];
    const alb_scatter_kernel_needs *needs[ALB_SIDES];
    const uint16_t *index; // of the kernels
    const alb_tree *tree;
    const alb_optical_paths *paths;
    double error_wanted;
    uint32_t first_leaf, row_count, middle_row;
    float at[3][ALB_BLOCK]; // centroids, rows that are missing stand where the last one does
    float centre[3], radius;
    float axes[3][ALB_BLOCK]; // slab: its normal, of a sheet the rows' own; else zero
    workspace *work;
} viewer;

static void project(float v[3], float x, float y, float z)
{
    const float across = v[0] * x + v[1] * y + v[2] * z;
    v[0] -= across * x, v[1] -= across * y, v[2] -= across * z;
}

// Lateral to the row's axis.
static void project_for(float to[3], const viewer *v, uint32_t row)
{
    project(to, v->axes[0][row], v->axes[1][row], v->axes[2][row]);
}

// Mean distances from the rows to the source, and its variances along the lines of sight; across: lateral to the axis.
ALB_VECTOR_CLONES
static void measure(float distances[ALB_BLOCK], float along_mm2[ALB_BLOCK], const viewer *v, const alb_source *from,
                    bool across)
{
    const float *m = from->moments;
    for (int row = 0; row < ALB_BLOCK; row++) {
        const float a = across ? v->axes[0][row] : 0, b = across ? v->axes[1][row] : 0,
                    c = across ? v->axes[2][row] : 0;
        const float trace = m[0] * (1 - a * a) + m[1] * (1 - b * b) + m[2] * (1 - c * c) -
                            2 * (m[3] * a * b + m[4] * a * c + m[5] * b * c);
        float x = from->at[0] - v->at[0][row], y = from->at[1] - v->at[1][row], z = from->at[2] - v->at[2][row];
        const float rise = x * a + y * b + z * c;
        x -= rise * a, y -= rise * b, z -= rise * c;
        const float squared = x * x + y * y + z * z;
        const float along =
            m[0] * x * x + m[1] * y * y + m[2] * z * z + 2 * (m[3] * x * y + m[4] * x * z + m[5] * y * z);
        const float variance = squared > 0 ? along / squared : 0.5F * trace;
        const float sum = squared + trace - variance;
        distances[row] = sqrtf(sum > 0 ? sum : 0);
        along_mm2[row] = variance;
    }
}

static uint8_t encode(float distance, float per_mm)
{
    const float at = distance * per_mm + 0.5F;
    return at < ALB_NO_LINK ? (uint8_t)at : ALB_NO_LINK;
}

static bool is_sheet(const viewer *v) { return v->paths->kind == ALB_OPTICAL_SHEET; }

// Direction from the block to the cluster, through a slab and in a sheet along its faces, and the cluster's variance
// along it.
static void aim(int8_t direction[4], const viewer *v, const alb_cluster *cluster, int side)
{
    float to[3];
    const float *m = cluster->moments;
    for (int k = 0; k < 3; k++)
        to[k] = cluster->centre_mm[k] - v->centre[k];
    if (is_sheet(v)) {
        const alb_vector there = v->patches->normals[v->forest->patches[cluster->leaf]];
        project(to, (float)there.x, (float)there.y, (float)there.z);
    } else if (side == ALB_TRANSMISSION) {
        project_for(to, v, v->middle_row);
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

static void want(const viewer *v, wish wished)
{
    workspace *work = v->work;
    work->wishes =
        alb_grow(&work->found.failed, work->wishes, &work->wish_capacity, work->wish_count, 1, sizeof *work->wishes);
    if (!work->found.failed)
        work->wishes[work->wish_count++] = wished;
}

static float lengthened(float distance, const detour *by)
{
    return by->length != 0 ? distance + by->length * fminf(fmaxf(distance, by->length) / by->at, 1) : distance;
}

// Three distances with the mean, variance and skewness of a distribution whose fourth moment is that of a triangle's
// points along a line, 12/5: of weights 5, 14 and 5 in 24. In deviations, z = t - u, -5/7 t, t + u.
static void take_thirds(float distances[3], float mean, float deviation, float skewness)
{
    float t = skewness / 3;
    for (int step = 0; step < 3; step++) // Newton
        t -= (3 * t - 1.938776F * t * t * t - skewness) / (3 - 3 * 1.938776F * t * t);
    const float u = sqrtf(2.4F - 12.0F / 7 * t * t);
    distances[0] = mean + deviation * (t - u);
    distances[1] = mean - deviation * 5 / 7 * t;
    distances[2] = mean + deviation * (t + u);
}

// Means of eighths of the sorted distances, drawn apart until they have the variance.
static void take_eighths(float distances[ALB_SHARES_MAX], float *sorted, int count, float mean, float deviation)
{
    float second = 0;
    for (int gap = 13; gap; gap /= 3) // Shell 1959
        for (int k = gap; k < count; k++)
            for (int at = k; at >= gap && sorted[at] < sorted[at - gap]; at -= gap) {
                const float held = sorted[at];
                sorted[at] = sorted[at - gap], sorted[at - gap] = held;
            }
    for (int k = 0; k < ALB_SHARES_MAX; k++) {
        distances[k] = -mean;
        for (int at = k * count / ALB_SHARES_MAX; at < (k + 1) * count / ALB_SHARES_MAX; at++)
            distances[k] += sorted[at] * (float)ALB_SHARES_MAX / (float)count;
        second += distances[k] * distances[k] / ALB_SHARES_MAX;
    }
    for (int k = 0; k < ALB_SHARES_MAX; k++)
        distances[k] = mean + distances[k] * (second > 0 ? deviation / sqrtf(second) : 1);
}

// A row's distances from those of the parts, whose own variance is added.
static void share_out(float distances[ALB_SHARES_MAX], int kind, float *of_parts, int count, float variance_of_part)
{
    float mean = 0, second = 0, third = 0;
    for (int part = 0; part < count; part++)
        mean += of_parts[part] / (float)count;
    for (int part = 0; part < count; part++) {
        const float off = of_parts[part] - mean;
        second += off * off / (float)count;
        third += off * off * off / (float)count;
    }
    const float deviation = sqrtf(second + variance_of_part);
    if (kind == ALB_LINK_THIRDS)
        take_thirds(distances, mean, deviation, fmaxf(fminf(third / (deviation * deviation * deviation), 1), -1));
    else
        take_eighths(distances, of_parts, count, mean, deviation);
}

// A patch is known to the products by the mean of its variances alone. What it has more along the line of sight moves
// it, as far as that changes s by a quarter.
static void lean(float distances[ALB_BLOCK], const float along_mm2[ALB_BLOCK], const alb_cluster *cluster,
                 const alb_scatter_kernel_needs *needs)
{
    for (int row = 0; row < ALB_BLOCK; row++) {
        const int bin = alb_scatter_kernel_bin(needs, distances[row]);
        const float *slopes = needs->slopes[bin], move = needs->leans[bin] * (along_mm2[row] - cluster->spread_mm2);
        const float most = 0.25F / fmaxf(fmaxf(slopes[0], slopes[1]), fmaxf(slopes[2], 1 / distances[row]));
        distances[row] += fmaxf(fminf(move, most), -most);
    }
}

// Distances from the rows to the source, as many as the kind has codes.
static void find_distances(float distances[ALB_SHARES_MAX][ALB_BLOCK], const viewer *v, const wish *wished, int kind)
{
    const alb_cluster *cluster = &v->forest->clusters[wished->cluster];
    alb_source parts[ALB_PARTS_MAX];
    float of_parts[ALB_PARTS_MAX][ALB_BLOCK], along_mm2[ALB_BLOCK];
    if (kind <= ALB_LINK_NEAR_PATCH) {
        memcpy(parts[0].at, cluster->centre_mm, sizeof parts[0].at);
        memcpy(parts[0].moments, cluster->moments, sizeof parts[0].moments);
        measure(distances[0], along_mm2, v, &parts[0], wished->side == ALB_TRANSMISSION);
        if (kind >= ALB_LINK_PATCH)
            lean(distances[0], along_mm2, cluster, v->needs[wished->side]);
        return;
    }
    alb_vector t[3];
    alb_patch_triangle(t, v->patches, v->forest->patches[cluster->leaf]);
    for (int k = 0; k < 3; k++)
        t[k] = alb_sub(t[k], v->tree->middle_mm);
    const int count = alb_parts_most(cluster);
    const float share = alb_parts_cut(parts, cluster, t, count);
    for (int part = 0; part < count; part++)
        measure(of_parts[part], along_mm2, v, &parts[part], wished->side == ALB_TRANSMISSION);
    for (int row = 0; row < ALB_BLOCK; row++) {
        float of_row[ALB_PARTS_MAX], shares[ALB_SHARES_MAX];
        for (int part = 0; part < count; part++)
            of_row[part] = of_parts[part][row];
        share_out(shares, kind, of_row, count, share * cluster->spread_mm2);
        for (int k = 0; k < alb_link_codes(kind); k++)
            distances[k][row] = shares[k];
    }
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
static float find_paths(float distances[ALB_SHARES_MAX][ALB_BLOCK], const viewer *v, const wish *wished, int kind,
                        const detour detours[ALB_BLOCK])
{
    float furthest = 0;
    find_distances(distances, v, wished, kind);
    for (int k = 0; k < alb_link_codes(kind); k++)
        for (uint32_t row = 0; row < ALB_BLOCK; row++) {
            const detour *by = &detours[row < v->row_count ? row : v->row_count - 1];
            if (wished->left_out >> row & 1 || !isfinite(by->length))
                distances[k][row] = INFINITY;
            else
                furthest = fmaxf(furthest, distances[k][row] = fmaxf(lengthened(distances[k][row], by), 0));
        }
    return furthest;
}

static void add_link(const viewer *v, const wish *wished, int kind, const detour detours[ALB_BLOCK])
{
    const int side = wished->side;
    const alb_scatter_kernel *kernel = v->kernels[side];
    workspace *work = v->work;
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

// The patch as the row sees it: through a slab, moved along the axis into the plane of the row.
static void place_triangle(alb_vector t[3], const viewer *v, const alb_cluster *cluster, int side, uint32_t row)
{
    const alb_vector p = v->patches->centroids[v->forest->patches[v->first_leaf + row]];
    const alb_vector axis = {(double)v->axes[0][row], (double)v->axes[1][row], (double)v->axes[2][row]};
    alb_patch_triangle(t, v->patches, v->forest->patches[cluster->leaf]);
    for (int k = 0; k < 3 && side == ALB_TRANSMISSION; k++)
        t[k] = alb_add(t[k], alb_times(alb_dot(axis, alb_sub(p, t[k])), axis));
}

// How the patch is taken by a row at this distance of the centroids: EXACT where no parts do.
static int kind_of(const viewer *v, const alb_cluster *cluster, int side, uint32_t row, float distance)
{
    const alb_scatter_kernel_needs *needs = v->needs[side];
    float gap = distance - cluster->radius_mm;
    if (gap < cluster->radius_mm) {
        alb_vector t[3];
        place_triangle(t, v, cluster, side, row);
        gap = (float)alb_distance_to_triangle(v->patches->centroids[v->forest->patches[v->first_leaf + row]], t);
    }
    const int bin = alb_scatter_kernel_bin(needs, gap);
    const float allowed = 0.15F * (float)v->error_wanted, from = fmaxf(distance, 1e-15F);
    const int most = alb_parts_most(cluster);
    int parts = 1;
    bool thirds = true;
    for (int c = 0; c < 3; c++) {
        thirds &= needs->shares[bin][c] * cluster->area_mm2 *
                      alb_parts_left_by_thirds(cluster, needs->slopes[bin][c], from) <=
                  allowed;
        for (;; parts *= 4) {
            const float left = needs->shares[bin][c] * cluster->area_mm2 *
                               fminf(alb_parts_left(cluster, parts, needs->slopes[bin][c], from), 1);
            if (left > 16 * allowed && parts == most && distance <= 3 * cluster->radius_mm)
                return EXACT;
            if (left <= allowed || parts == most)
                break;
        }
    }
    return parts == 1 ? ALB_LINK_PATCH : thirds ? ALB_LINK_THIRDS : ALB_LINK_EIGHTHS;
}

// The patch at `scale` times its distances; its integral is then scale^2 times as large.
static void add_pair(const viewer *v, const wish *wished, uint32_t row, float scale)
{
    const int side = wished->side;
    const alb_cluster *cluster = &v->forest->clusters[wished->cluster];
    const alb_vector p = v->patches->centroids[v->forest->patches[v->first_leaf + row]];
    workspace *work = v->work;
    alb_vector t[3];
    work->found.pairs = alb_grow(&work->found.failed, work->found.pairs, &work->found.pair_capacity,
                                 work->found.pair_count, 1, sizeof *work->found.pairs);
    if (work->found.failed)
        return;
    place_triangle(t, v, cluster, side, row);
    for (int k = 0; k < 3; k++)
        t[k] = alb_add(p, alb_times((double)scale, alb_sub(t[k], p)));
    alb_exact_pair *pair = &work->found.pairs[work->found.pair_count++];
    *pair = (alb_exact_pair){.leaf = wished->source,
                             .kernel = v->index[side],
                             .row = (uint8_t)row,
                             .per_area = 1 / (scale * scale * cluster->area_mm2)};
    alb_rule_find(&pair->rule, t, p, v->kernels[side]->near_mm);
}

// Each row by itself where the patch is near for any.
static void add_leaf(const viewer *v, uint32_t index, uint32_t leaf, int side)
{
    const alb_cluster *cluster = &v->forest->clusters[index];
    const uint32_t own = leaf - v->first_leaf;
    const unsigned all = (1U << v->row_count) - 1;
    float distances[ALB_BLOCK], along_mm2[ALB_BLOCK];
    alb_source whole;
    unsigned left_out = own < v->row_count ? 1U << own : 0;
    int kind = ALB_LINK_PATCH;
    memcpy(whole.at, cluster->centre_mm, sizeof whole.at);
    memcpy(whole.moments, cluster->moments, sizeof whole.moments);
    measure(distances, along_mm2, v, &whole, side == ALB_TRANSMISSION);
    for (uint32_t row = 0; row < v->row_count; row++) {
        if (left_out >> row & 1)
            continue;
        const int wanted = kind_of(v, cluster, side, row, distances[row]);
        if (wanted == EXACT) {
            want(v, (wish){index, leaf, (uint8_t)side, (uint8_t) ~(1U << row), EXACT});
            left_out |= 1U << row;
        } else if (wanted > kind) {
            kind = wanted;
        }
    }
    if (left_out != all)
        want(v, (wish){index, leaf, (uint8_t)side, (uint8_t)left_out, (int8_t)kind});
}

static void visit(const viewer *v, uint32_t index, uint32_t leaf, uint32_t count, int side)
{
    const alb_cluster *cluster = &v->forest->clusters[index];
    if (count == 1) {
        add_leaf(v, index, leaf, side);
        return;
    }
    float to[3];
    for (int k = 0; k < 3; k++)
        to[k] = cluster->centre_mm[k] - v->centre[k];
    if (side == ALB_TRANSMISSION)
        project_for(to, v, v->middle_row);
    const float room = sqrtf(to[0] * to[0] + to[1] * to[1] + to[2] * to[2]) - v->radius;
    const int bin = alb_scatter_kernel_bin(v->needs[side], fmaxf(room - 0.5F * cluster->radius_mm, 0));
    if ((side == ALB_TRANSMISSION || cluster->radius_mm <= 0.65F * room) &&
        12 * cluster->spread_mm2 <= v->needs[side]->size2_mm2[bin]) {
        want(v, (wish){index, index - leaf, (uint8_t)side, 0, ALB_LINK_NODE});
        return;
    }
    const uint32_t left = alb_left_count(count);
    visit(v, index + 1, leaf, left, side);
    visit(v, index + 2 * left, leaf + left, count - left, side);
}

// Which profile light takes from one face to another: between the faces of a slab that of transmission.
static int side_between(const alb_tree *from, const alb_tree *to)
{
    return from->face != to->face && from->face != ALB_FACE_EDGE && to->face != ALB_FACE_EDGE ? ALB_TRANSMISSION
                                                                                              : ALB_REFLECTION;
}

static void place_rows(viewer *v)
{
    float middle[3] = {0};
    for (uint32_t row = 0; row < ALB_BLOCK; row++) {
        const uint32_t leaf = v->first_leaf + (row < v->row_count ? row : v->row_count - 1);
        const alb_vector at = alb_sub(v->patches->centroids[v->forest->patches[leaf]], v->tree->middle_mm),
                         own = v->patches->normals[v->forest->patches[leaf]];
        const float places[3] = {(float)at.x, (float)at.y, (float)at.z},
                    normal[3] = {(float)own.x, (float)own.y, (float)own.z};
        for (int k = 0; k < 3; k++) {
            v->at[k][row] = places[k];
            v->axes[k][row] = is_sheet(v) ? normal[k] : v->tree->axis[k];
            middle[k] += places[k] / ALB_BLOCK;
        }
    }
    v->radius = 0;
    memcpy(v->centre, middle, sizeof middle);
    for (int row = 0; row < ALB_BLOCK; row++)
        v->radius = fmaxf(v->radius, sqrtf((v->at[0][row] - middle[0]) * (v->at[0][row] - middle[0]) +
                                           (v->at[1][row] - middle[1]) * (v->at[1][row] - middle[1]) +
                                           (v->at[2][row] - middle[2]) * (v->at[2][row] - middle[2])));
}

static uint32_t middle_row(const viewer *v)
{
    uint32_t middle = 0;
    float nearest = INFINITY;
    for (uint32_t row = 0; row < v->row_count; row++) {
        const float x = v->at[0][row] - v->centre[0], y = v->at[1][row] - v->centre[1],
                    z = v->at[2][row] - v->centre[2];
        if (x * x + y * y + z * z < nearest)
            nearest = x * x + y * y + z * z, middle = row;
    }
    return middle;
}

// Paths from a row to the wishes' clusters, and then to the other rows.
static void measure_paths(const viewer *v, uint32_t from)
{
    workspace *work = v->work;
    const size_t n = work->wish_count, all = n + v->row_count;
    const alb_vector middle = v->tree->middle_mm;
    work->targets = alb_grow(&work->found.failed, work->targets, &work->target_capacity, 0, all, sizeof *work->targets);
    work->distances =
        alb_grow(&work->found.failed, work->distances, &work->distance_capacity, 0, all, sizeof *work->distances);
    work->opposite = alb_grow(&work->found.failed, work->opposite, &work->opposite_capacity, 0, all, 1);
    if (work->paths_of != v->paths && !work->found.failed) {
        alb_optical_workspace_free(&work->paths);
        work->found.failed = !alb_optical_workspace_create(&work->paths, v->paths, NULL);
        work->paths_of = v->paths;
    }
    if (work->found.failed)
        return;
    for (size_t k = 0; k < all; k++) {
        const alb_cluster *cluster = k < n ? &v->forest->clusters[work->wishes[k].cluster] : NULL;
        const uint32_t row = (uint32_t)(k - n), leaf = cluster ? cluster->leaf : v->first_leaf + row;
        float at[3];
        for (int i = 0; i < 3; i++)
            at[i] = cluster ? cluster->centre_mm[i] : v->at[i][row];
        work->targets[k] = (alb_optical_target){v->forest->patches[leaf], (float)(middle.x + (double)at[0]),
                                                (float)(middle.y + (double)at[1]), (float)(middle.z + (double)at[2])};
    }
    alb_optical_paths_measure(work->distances, work->opposite, &work->paths, v->paths,
                              v->forest->patches[v->first_leaf + from], work->targets, all);
}

static float chord_to(float to[3], const viewer *v, uint32_t from, const float at[3])
{
    for (int i = 0; i < 3; i++)
        to[i] = at[i] - v->at[i][from];
    return sqrtf(to[0] * to[0] + to[1] * to[1] + to[2] * to[2]);
}

// How much longer the paths inside the body are than what `measure` says: of this row, for those in the mask that it
// may stand for, which is told. In a sheet they also say which face is lit, but about the rim. Beyond the reach a path
// is taken as long as that: of light so far away it matters only that it is not lost.
static unsigned find_detours(const viewer *v, uint32_t from, unsigned rows)
{
    workspace *work = v->work;
    const size_t n = work->wish_count;
    unsigned served = 1U << from;
    float to[3];
    measure_paths(v, from);
    if (work->found.failed)
        return rows;
    for (uint32_t row = 0; row < v->row_count; row++) {
        const float chord = chord_to(to, v, from, (const float[3]){v->at[0][row], v->at[1][row], v->at[2][row]});
        if (work->distances[n + row] <= 1.2F * chord) // else one patch beyond a fold of the other
            served |= rows & 1U << row;
    }
    for (size_t k = 0; k < n; k++) {
        wish *wished = &work->wishes[k];
        const alb_cluster *cluster = &v->forest->clusters[wished->cluster];
        if (is_sheet(v) && v->tree->face != ALB_FACE_EDGE &&
            alb_optical_paths_face(v->paths, v->forest->patches[cluster->leaf]) != ALB_RIM)
            wished->side = work->opposite[k] ? ALB_TRANSMISSION : ALB_REFLECTION;
        const float chord = chord_to(to, v, from, cluster->centre_mm);
        if (wished->side == ALB_TRANSMISSION)
            project_for(to, v, from);
        const float straight = sqrtf(to[0] * to[0] + to[1] * to[1] + to[2] * to[2]),
                    path = fminf(work->distances[k], fmaxf((float)v->paths->reach_mm, chord)),
                    more = fabsf(path - straight) > 1e-4F * straight ? path - straight : 0;
        for (uint32_t row = 0; row < ALB_BLOCK; row++)
            if (served >> row & 1)
                work->detours[k][row] = (detour){more, fmaxf(straight, cluster->radius_mm)};
    }
    return served;
}

// Links and exact pairs from the wishes; what goes a long detour is not exact.
static void grant(const viewer *v)
{
    workspace *work = v->work;
    const size_t n = work->wish_count;
    work->detours = alb_grow(&work->found.failed, work->detours, &work->detour_capacity, 0, n, sizeof *work->detours);
    if (work->found.failed || !n)
        return;
    memset(work->detours, 0, n * sizeof *work->detours);
    unsigned left = v->paths->kind == ALB_OPTICAL_CONVEX ? 0 : (1U << v->row_count) - 1;
    for (uint32_t row = v->middle_row; left; row = (row + 1) % v->row_count)
        if (left >> row & 1)
            left &= ~find_detours(v, row, left);
    for (size_t k = 0; !work->found.failed && k < n; k++) {
        const wish *wished = &work->wishes[k];
        uint32_t row = 0;
        if (wished->kind != EXACT) {
            add_link(v, wished, wished->kind, work->detours[k]);
            continue;
        }
        while (wished->left_out >> row & 1)
            row++;
        const detour *by = &work->detours[k][row];
        const float scale = by->length != 0 ? 1 + by->length / by->at : 1;
        if (scale > 0.5F && scale < 1.25F)
            add_pair(v, wished, row, scale);
        else
            add_link(v, wished, ALB_LINK_EIGHTHS, work->detours[k]);
    }
}

static void link_block(alb_link_block *block, viewer *v, const uint16_t kernels[ALB_SIDES])
{
    v->work->wish_count = v->work->found.count = v->work->found.code_count = v->work->found.pair_count = 0;
    place_rows(v);
    v->middle_row = middle_row(v);
    for (size_t t = 0; t < v->forest->tree_count; t++) {
        const alb_tree *tree = &v->forest->trees[t];
        if (tree->body == v->tree->body)
            visit(v, tree->first_cluster, tree->first_leaf, tree->leaf_count, side_between(tree, v->tree));
    }
    grant(v);
    if (!v->work->found.failed)
        alb_link_block_write(block, &v->work->found, kernels);
}

// Blocks of leaves, tree after tree.
static bool lay_blocks(alb_links *links, uint32_t **trees, const alb_forest *forest, alb_error *error)
{
    for (size_t t = 0; t < forest->tree_count; t++)
        links->block_count += (forest->trees[t].leaf_count + ALB_BLOCK - 1) / ALB_BLOCK;
    if (!(links->blocks = alb_allocate(links->block_count, sizeof *links->blocks, error)) ||
        !(*trees = alb_allocate(links->block_count, sizeof **trees, error)))
        return false;
    size_t at = 0;
    for (size_t t = 0; t < forest->tree_count; t++) {
        const alb_tree *tree = &forest->trees[t];
        for (uint32_t leaf = 0; leaf < tree->leaf_count; leaf += ALB_BLOCK, at++) {
            const uint32_t left = tree->leaf_count - leaf;
            (*trees)[at] = (uint32_t)t;
            links->blocks[at] = (alb_link_block){.first_leaf = tree->first_leaf + leaf,
                                                 .row_count = left < ALB_BLOCK ? left : ALB_BLOCK};
        }
    }
    return true;
}

bool alb_links_create(alb_links *links, const alb_forest *forest, const alb_patches *patches,
                      const alb_body_kernels *of_bodies, const alb_scatter_kernel *kernels,
                      const alb_scatter_kernel_needs *needs, const alb_optical_paths *paths, double error_wanted,
                      alb_error *error)
{
    bool failed = false;
    uint32_t *trees = NULL;
    long done = 0;
    alb_progress progress;
    *links = (alb_links){0};
    if (!lay_blocks(links, &trees, forest, error)) {
        alb_links_free(links);
        return false;
    }
    alb_progress_begin(&progress, "scattering", (long)links->block_count);
#pragma omp parallel reduction(|| : failed)
    {
        workspace work = {0};
#pragma omp for schedule(dynamic, 16)
        for (size_t b = 0; b < links->block_count; b++) {
            alb_link_block *block = &links->blocks[b];
            const alb_tree *tree = &forest->trees[trees[b]];
            const uint16_t *own = of_bodies[tree->body].index;
            viewer v = {.forest = forest,
                        .patches = patches,
                        .kernels = {&kernels[own[0]], &kernels[own[1]]},
                        .index = own,
                        .needs = {&needs[own[0]], &needs[own[1]]},
                        .tree = tree,
                        .paths = &paths[tree->body],
                        .error_wanted = error_wanted,
                        .first_leaf = block->first_leaf,
                        .row_count = block->row_count,
                        .work = &work};
            link_block(block, &v, own);
            const long so_far = __atomic_add_fetch(&done, 1, __ATOMIC_RELAXED);
            if (omp_get_thread_num() == 0)
                alb_progress_at(&progress, so_far);
        }
        failed = failed || work.found.failed;
        free(work.wishes);
        free(work.detours);
        free(work.targets);
        free(work.distances);
        free(work.opposite);
        alb_optical_workspace_free(&work.paths);
        alb_found_links_free(&work.found);
    }
    alb_progress_end(&progress);
    free(trees);
    if (failed) {
        alb_links_free(links);
        return alb_fail(error, ALB_NO_MEMORY, "out of memory for the links of scattering");
    }
    return true;
}

void alb_links_free(alb_links *links)
{
    for (size_t b = 0; b < links->block_count; b++)
        free(links->blocks[b].pairs);
    free(links->blocks);
    *links = (alb_links){0};
}
