// Choice of links. Exit patches go in blocks of eight neighbours that share the list of clusters and have each their
// own distances. For a block of radius R_b, a cluster at distance d, of radius R and squared size 12 spread:
//     it is taken where   R <= (d - R_b) / 2   and   size^2 <= what the kernel allows at d - R_b - R / 2
// and opened elsewhere. Between the faces of a slab d is lateral and the first condition, which keeps a patch out of
// the clusters that light it, falls away.
//
// A patch is taken whole or in 4, 16 or (long ones) 64 equal triangles: the least that leaves, of its share of a row's
// sum (s A / total), with b = -s' / s and a part's variances v1 >= v2, h^2 = 6 (v1 + v2),
//     (b h)^4 / 1920 + min(b d, 1) (h / d)^4 / 500 + b^2 (v1 - v2) / 40
// no more than 0.15 of the error wanted; where the smallest parts leave four times that, exactly (scatter_rule.c).
// The first term is what second moments leave of an exponential, the second what they leave of a cusp at no distance,
// the third that the variance along the line of sight is not v.
//
// The distance that is coded is the mean over the cluster to second order, sqrt(d^2 + variance across the line of
// sight); what the variance along it adds, the kernel knows (scatter_kernel.c).
#include "render/scatter_links.h"
#include "base/memory.h"
#include "base/vector_clones.h"
#include <stdlib.h>
#include <string.h>

enum { PARTS_MAX = 64, OCTAVES = ALB_KERNEL_BINS / 4, BUCKETS = ALB_SIDES * OCTAVES * ALB_LEVELS, EXACT = -1 };

typedef struct link {
    uint32_t node;
    uint16_t bucket; // (side, octave, level)
    int8_t direction[4];
    size_t codes;
} link;

// What one thread works with.
typedef struct workspace {
    link *links;
    uint32_t *order;
    uint8_t *codes;
    alb_exact_pair *pairs;
    size_t count, capacity, code_count, code_capacity, pair_count, pair_capacity, order_capacity;
    bool failed;
} workspace;

typedef struct viewer {
    const alb_forest *forest;
    const alb_patches *patches;
    const alb_scatter_kernel *kernels[ALB_SIDES];
    const alb_scatter_kernel_needs *needs[ALB_SIDES];
    const uint16_t *index; // of the kernels
    const alb_tree *tree;
    double error_wanted;
    uint32_t first_leaf, row_count;
    float at[3][ALB_BLOCK]; // centroids, rows that are missing stand where the last one does
    float centre[3], radius;
    workspace *work;
} viewer;

// A point source with its moments.
typedef struct source {
    float at[3], moments[6];
} source;

const alb_level alb_levels[ALB_LEVELS] = {
    {1, 1}, {4, 1.0F / 4}, {4, 1.0F / 16}, {16, 1.0F / 16}, {16, 1.0F / 256}, {64, 1.0F / 4096},
};

static void project(float v[3], const float axis[3])
{
    const float across = v[0] * axis[0] + v[1] * axis[1] + v[2] * axis[2];
    for (int k = 0; k < 3; k++)
        v[k] -= across * axis[k];
}

// Mean distances from the rows to the source; across: lateral to the axis.
ALB_VECTOR_CLONES
static void measure(float distances[ALB_BLOCK], const viewer *v, const source *from, bool across)
{
    const float *m = from->moments, *a = v->tree->axis;
    const float keep = across ? 1 : 0;
    const float own = keep * (m[0] * a[0] * a[0] + m[1] * a[1] * a[1] + m[2] * a[2] * a[2] +
                              2 * (m[3] * a[0] * a[1] + m[4] * a[0] * a[2] + m[5] * a[1] * a[2]));
    const float trace = m[0] + m[1] + m[2] - own;
    for (int row = 0; row < ALB_BLOCK; row++) {
        float x = from->at[0] - v->at[0][row], y = from->at[1] - v->at[1][row], z = from->at[2] - v->at[2][row];
        const float rise = keep * (x * a[0] + y * a[1] + z * a[2]);
        x -= rise * a[0], y -= rise * a[1], z -= rise * a[2];
        const float squared = x * x + y * y + z * z;
        const float along =
            m[0] * x * x + m[1] * y * y + m[2] * z * z + 2 * (m[3] * x * y + m[4] * x * z + m[5] * y * z);
        const float variance = squared > 0 ? along / squared : 0.5F * trace;
        const float sum = squared + trace - variance;
        distances[row] = sqrtf(sum > 0 ? sum : 0);
    }
}

// The items with room for so many more; failed, and as they were, for want of memory.
static void *grow(bool *failed, void *items, size_t *capacity, size_t count, size_t more, size_t size)
{
    if (*failed || count + more <= *capacity)
        return items;
    const size_t wanted = 2 * count + more + 256;
    void *larger = realloc(items, wanted * size);
    *failed = !larger;
    if (larger)
        *capacity = wanted;
    return larger ? larger : items;
}

// Halves the triangle across its longest side, and the halves.
static void halve(source *parts, alb_vector a, alb_vector b, alb_vector c, int count)
{
    const double ab = alb_length(alb_sub(b, a)), bc = alb_length(alb_sub(c, b)), ca = alb_length(alb_sub(a, c));
    if (count == 1) {
        const alb_vector centre = alb_times(1.0 / 3, alb_add(a, alb_add(b, c)));
        *parts = (source){.at = {(float)centre.x, (float)centre.y, (float)centre.z}};
        alb_moments_of_triangle(parts->moments, a, b, c);
    } else if (ab >= bc && ab >= ca) {
        const alb_vector middle = alb_times(0.5, alb_add(a, b));
        halve(parts, a, middle, c, count / 2);
        halve(parts + count / 2, middle, b, c, count / 2);
    } else if (bc >= ca) {
        halve(parts, b, c, a, count);
    } else {
        halve(parts, c, a, b, count);
    }
}

// Quarters it into triangles like itself, and the quarters.
static void quarter(source *parts, alb_vector a, alb_vector b, alb_vector c, int count)
{
    if (count == 1) {
        halve(parts, a, b, c, count);
        return;
    }
    const alb_vector ab = alb_times(0.5, alb_add(a, b)), bc = alb_times(0.5, alb_add(b, c)),
                     ca = alb_times(0.5, alb_add(c, a));
    const int each = count / 4;
    quarter(parts, a, ab, ca, each);
    quarter(parts + each, ab, b, bc, each);
    quarter(parts + 2 * each, ca, bc, c, each);
    quarter(parts + 3 * each, ab, bc, ca, each);
}

static void split(source parts[PARTS_MAX], const viewer *v, const alb_cluster *cluster, const alb_level *level)
{
    alb_vector t[3];
    alb_patch_triangle(t, v->patches, v->forest->patches[cluster->leaf]);
    for (int k = 0; k < 3; k++)
        t[k] = alb_sub(t[k], v->tree->middle_mm);
    if (level->spread * (float)level->parts < 0.99F) // a long one
        halve(parts, t[0], t[1], t[2], level->parts);
    else
        quarter(parts, t[0], t[1], t[2], level->parts);
}

static void encode(uint8_t codes[ALB_BLOCK], const float distances[ALB_BLOCK], float per_mm)
{
    for (int row = 0; row < ALB_BLOCK; row++) {
        const float at = distances[row] * per_mm + 0.5F;
        codes[row] = at < ALB_NO_LINK ? (uint8_t)at : ALB_NO_LINK;
    }
}

// Direction from the block to the cluster, through a slab along its faces, and the cluster's variance along it.
static void aim(int8_t direction[4], const viewer *v, const alb_cluster *cluster, int side)
{
    float to[3];
    const float *m = cluster->moments;
    for (int k = 0; k < 3; k++)
        to[k] = cluster->centre_mm[k] - v->centre[k];
    if (side == ALB_TRANSMISSION)
        project(to, v->tree->axis);
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

// left_out: bits of the rows that are the source itself or take it exactly.
static void add_link(const viewer *v, uint32_t node, int side, int level, unsigned left_out)
{
    const alb_cluster *cluster = &v->forest->clusters[node];
    const alb_scatter_kernel *kernel = v->kernels[side];
    workspace *work = v->work;
    source parts[PARTS_MAX];
    float distances[PARTS_MAX][ALB_BLOCK], furthest = 0;
    const int count = alb_levels[level].parts;
    if (level) {
        split(parts, v, cluster, &alb_levels[level]);
    } else {
        memcpy(parts[0].at, cluster->centre_mm, sizeof parts[0].at);
        memcpy(parts[0].moments, cluster->moments, sizeof parts[0].moments);
    }
    work->links = grow(&work->failed, work->links, &work->capacity, work->count, 1, sizeof *work->links);
    work->codes =
        grow(&work->failed, work->codes, &work->code_capacity, work->code_count, (size_t)count * ALB_BLOCK, 1);
    if (work->failed)
        return;
    for (int part = 0; part < count; part++) {
        measure(distances[part], v, &parts[part], side == ALB_TRANSMISSION);
        for (uint32_t row = 0; row < ALB_BLOCK; row++)
            if (row >= v->row_count || left_out >> row & 1)
                distances[part][row] = INFINITY;
            else
                furthest = fmaxf(furthest, distances[part][row]);
    }
    int octave = ilogbf(fmaxf(furthest, 1e-30F)) + 1 - kernel->first_octave;
    octave = octave < 0 ? 0 : octave < kernel->octave_count ? octave : kernel->octave_count - 1;
    const float per_mm = ldexpf(ALB_CODES - 2, -(kernel->first_octave + octave));
    link *added = &work->links[work->count++];
    *added = (link){node, (uint16_t)((side * OCTAVES + octave) * ALB_LEVELS + level), {0}, work->code_count};
    aim(added->direction, v, cluster, side);
    if (level) // of parts all round
        added->direction[3] = 64;
    for (int part = 0; part < count; part++) {
        encode(work->codes + work->code_count, distances[part], per_mm);
        work->code_count += ALB_BLOCK;
    }
}

// The principal variances of a part when a patch is in so many: halved across its length until it is no longer one.
static void variances_of_part(float variances[2], const alb_cluster *cluster, int parts)
{
    const float half = cluster->spread_mm2, product = cluster->area_mm2 * cluster->area_mm2 / 108; // of the whole
    const float longest = half + sqrtf(fmaxf(half * half - product, 0)), n = (float)parts;
    variances[0] = fmaxf(longest / (n * n), fminf(1.7F * sqrtf(product) / n, longest / n));
    variances[1] = product / (n * n * variances[0]);
}

// What is left of the light of one part, relative to it, seen from a distance where -s' / s = b.
static float left_of_part(const float variances[2], float b, float distance)
{
    const float h2 = 6 * (variances[0] + variances[1]), bh2 = b * b * h2, near = h2 / (distance * distance);
    return bh2 * bh2 / 1920 + fminf(b * distance, 1) * near * near / 500 + b * b * (variances[0] - variances[1]) / 40;
}

static bool is_long(const float variances[2], const alb_cluster *cluster, int parts)
{
    const float spread = 0.5F * (variances[0] + variances[1]) / cluster->spread_mm2, n = (float)parts;
    return parts > 1 && spread * n * sqrtf(n) < 1;
}

// Squared distance of p from the segment a b.
static double to_segment(alb_vector p, alb_vector a, alb_vector b)
{
    const alb_vector along = alb_sub(b, a), to = alb_sub(p, a);
    const double t = fmin(fmax(alb_dot(to, along) / fmax(alb_dot(along, along), 1e-300), 0), 1);
    const alb_vector off = alb_sub(to, alb_times(t, along));
    return alb_dot(off, off);
}

static double to_triangle(alb_vector p, const alb_vector t[3])
{
    const alb_vector normal = alb_unit(alb_cross(alb_sub(t[1], t[0]), alb_sub(t[2], t[0])));
    double nearest = INFINITY;
    bool inside = true;
    for (int k = 0; k < 3; k++) {
        const alb_vector a = t[k], b = t[(k + 1) % 3];
        nearest = fmin(nearest, to_segment(p, a, b));
        inside &= alb_dot(alb_cross(alb_sub(b, a), alb_sub(p, a)), normal) >= 0;
    }
    return inside ? fabs(alb_dot(normal, alb_sub(p, t[0]))) : sqrt(nearest);
}

// The patch as the row sees it: through a slab, moved along the axis into the plane of the row.
static void place_triangle(alb_vector t[3], const viewer *v, const alb_cluster *cluster, int side, uint32_t row)
{
    const alb_vector p = v->patches->centroids[v->forest->patches[v->first_leaf + row]];
    const alb_vector axis = {(double)v->tree->axis[0], (double)v->tree->axis[1], (double)v->tree->axis[2]};
    alb_patch_triangle(t, v->patches, v->forest->patches[cluster->leaf]);
    for (int k = 0; k < 3 && side == ALB_TRANSMISSION; k++)
        t[k] = alb_add(t[k], alb_times(alb_dot(axis, alb_sub(p, t[k])), axis));
}

// How the patch is parted for a row at this distance of the centroids: EXACT where no parts do.
static int level_of(const viewer *v, const alb_cluster *cluster, int side, uint32_t row, float distance)
{
    const alb_scatter_kernel_needs *needs = v->needs[side];
    float gap = distance - cluster->radius_mm;
    if (gap < cluster->radius_mm) {
        alb_vector t[3];
        place_triangle(t, v, cluster, side, row);
        gap = (float)to_triangle(v->patches->centroids[v->forest->patches[v->first_leaf + row]], t);
    }
    const int bin = alb_scatter_kernel_bin(needs, gap);
    const float allowed = 0.15F * (float)v->error_wanted, from = fmaxf(distance, 1e-15F);
    float variances[2], left;
    variances_of_part(variances, cluster, PARTS_MAX / 4);
    const int most = is_long(variances, cluster, PARTS_MAX / 4) ? PARTS_MAX : PARTS_MAX / 4;
    int parts = 1;
    for (int c = 0; c < 3; c++)
        for (;; parts *= 4) {
            variances_of_part(variances, cluster, parts);
            left = needs->shares[bin][c] * cluster->area_mm2 *
                   fminf(left_of_part(variances, needs->slopes[bin][c], from), 1);
            if (left > 4 * allowed && parts == most && distance <= 3 * cluster->radius_mm)
                return EXACT;
            if (left <= allowed || parts == most)
                break;
        }
    variances_of_part(variances, cluster, parts);
    if (is_long(variances, cluster, parts))
        return parts == 4 ? 2 : parts == 16 ? 4 : 5;
    return parts == 1 ? 0 : parts == 4 ? 1 : 3;
}

static void add_pair(const viewer *v, uint32_t node, int side, uint32_t row)
{
    const alb_cluster *cluster = &v->forest->clusters[node];
    const alb_vector p = v->patches->centroids[v->forest->patches[v->first_leaf + row]];
    workspace *work = v->work;
    alb_vector t[3];
    work->pairs = grow(&work->failed, work->pairs, &work->pair_capacity, work->pair_count, 1, sizeof *work->pairs);
    if (work->failed)
        return;
    place_triangle(t, v, cluster, side, row);
    alb_exact_pair *pair = &work->pairs[work->pair_count++];
    *pair = (alb_exact_pair){
        .node = node, .kernel = v->index[side], .row = (uint8_t)row, .per_area = 1 / cluster->area_mm2};
    alb_rule_find(&pair->rule, t, p, v->kernels[side]->near_mm);
}

// Each row by itself where the patch is near for any.
static void add_leaf(const viewer *v, uint32_t node, uint32_t leaf, int side)
{
    const alb_cluster *cluster = &v->forest->clusters[node];
    const uint32_t own = leaf - v->first_leaf;
    float distances[ALB_BLOCK];
    source whole;
    unsigned left_out = own < v->row_count ? 1U << own : 0;
    int level = 0;
    memcpy(whole.at, cluster->centre_mm, sizeof whole.at);
    memcpy(whole.moments, cluster->moments, sizeof whole.moments);
    measure(distances, v, &whole, side == ALB_TRANSMISSION);
    for (uint32_t row = 0; row < v->row_count; row++) {
        if (left_out >> row & 1)
            continue;
        const int wanted = level_of(v, cluster, side, row, distances[row]);
        if (wanted == EXACT) {
            add_pair(v, node, side, row);
            left_out |= 1U << row;
        } else if (alb_levels[wanted].parts >= alb_levels[level].parts) {
            level = wanted;
        }
    }
    if (left_out != (1U << v->row_count) - 1)
        add_link(v, node, side, level, left_out);
}

static void visit(const viewer *v, uint32_t node, uint32_t leaf, uint32_t count, int side)
{
    const alb_cluster *cluster = &v->forest->clusters[node];
    if (count == 1) {
        add_leaf(v, node, leaf, side);
        return;
    }
    float to[3];
    for (int k = 0; k < 3; k++)
        to[k] = cluster->centre_mm[k] - v->centre[k];
    if (side == ALB_TRANSMISSION)
        project(to, v->tree->axis);
    const float room = sqrtf(to[0] * to[0] + to[1] * to[1] + to[2] * to[2]) - v->radius;
    const int bin = alb_scatter_kernel_bin(v->needs[side], fmaxf(room - 0.5F * cluster->radius_mm, 0));
    if ((side == ALB_TRANSMISSION || cluster->radius_mm <= 0.5F * room) &&
        12 * cluster->spread_mm2 <= v->needs[side]->size2_mm2[bin]) {
        add_link(v, node, side, 0, 0);
        return;
    }
    const uint32_t left = alb_left_count(count);
    visit(v, node + 1, leaf, left, side);
    visit(v, node + 2 * left, leaf + left, count - left, side);
}

// Which profile light takes from one face to another: between the faces of a slab that of transmission.
static int side_between(const alb_tree *from, const alb_tree *to)
{
    return abs(from->face - to->face) == 2 ? ALB_TRANSMISSION : ALB_REFLECTION;
}

static void place_rows(viewer *v)
{
    float middle[3] = {0};
    for (uint32_t row = 0; row < ALB_BLOCK; row++) {
        const uint32_t leaf = v->first_leaf + (row < v->row_count ? row : v->row_count - 1);
        const alb_vector at = alb_sub(v->patches->centroids[v->forest->patches[leaf]], v->tree->middle_mm);
        v->at[0][row] = (float)at.x, v->at[1][row] = (float)at.y, v->at[2][row] = (float)at.z;
        for (int k = 0; k < 3; k++)
            middle[k] += v->at[k][row] / ALB_BLOCK;
    }
    v->radius = 0;
    memcpy(v->centre, middle, sizeof middle);
    for (int row = 0; row < ALB_BLOCK; row++)
        v->radius = fmaxf(v->radius, sqrtf((v->at[0][row] - middle[0]) * (v->at[0][row] - middle[0]) +
                                           (v->at[1][row] - middle[1]) * (v->at[1][row] - middle[1]) +
                                           (v->at[2][row] - middle[2]) * (v->at[2][row] - middle[2])));
}

// The order of the links by bucket, and in each as found: by node.
static void sort_links(workspace *work, uint32_t starts[BUCKETS + 1])
{
    uint32_t at[BUCKETS];
    memset(starts, 0, (BUCKETS + 1) * sizeof *starts);
    for (size_t k = 0; k < work->count; k++)
        starts[work->links[k].bucket + 1]++;
    for (int bucket = 0; bucket < BUCKETS; bucket++) {
        at[bucket] = starts[bucket];
        starts[bucket + 1] += starts[bucket];
    }
    for (size_t k = 0; k < work->count; k++)
        work->order[at[work->links[k].bucket]++] = (uint32_t)k;
}

// Steps of at most 65,535 between the nodes of a bucket: how many, counting those that only fill a gap.
static size_t steps_of(const workspace *work, uint32_t from, uint32_t to)
{
    size_t steps = to - from;
    for (uint32_t k = from + 1; k < to; k++)
        steps += (work->links[work->order[k]].node - work->links[work->order[k - 1]].node) / (UINT16_MAX + 1U);
    return steps;
}

static bool allocate_block(alb_link_block *block, const workspace *work, const uint32_t starts[BUCKETS + 1])
{
    size_t steps = 0, codes = 0;
    for (int bucket = 0; bucket < BUCKETS; bucket++)
        if (starts[bucket + 1] > starts[bucket]) {
            const size_t more = steps_of(work, starts[bucket], starts[bucket + 1]);
            block->run_count++;
            steps += more;
            codes += more * (size_t)alb_levels[bucket % ALB_LEVELS].parts;
        }
    block->pair_count = (uint32_t)work->pair_count;
    block->bytes = block->pair_count * sizeof *block->pairs + block->run_count * sizeof *block->runs +
                   steps * (sizeof *block->deltas + sizeof *block->directions) + codes * ALB_BLOCK;
    if (!(block->pairs = malloc(block->bytes + 1)))
        return false;
    if (work->pair_count)
        memcpy(block->pairs, work->pairs, work->pair_count * sizeof *work->pairs);
    block->link_count = work->pair_count;
    block->runs = (alb_link_run *)(block->pairs + block->pair_count);
    block->deltas = (uint16_t *)(block->runs + block->run_count);
    block->codes = (uint8_t *)(block->deltas + steps);
    block->directions = (int8_t(*)[4])(block->codes + codes * ALB_BLOCK);
    return true;
}

// Where a run is written, or read.
typedef struct cursor {
    uint16_t *deltas;
    uint8_t *codes;
    int8_t (*directions)[4];
} cursor;

static void write_step(cursor *at, uint32_t delta, const link *next, const uint8_t *codes, size_t size)
{
    *at->deltas++ = (uint16_t)delta;
    if (next) {
        memcpy(at->codes, codes, size);
        memcpy(*at->directions, next->direction, sizeof next->direction);
    } else {
        memset(at->codes, ALB_NO_LINK, size);
        memset(*at->directions, 0, sizeof *at->directions);
    }
    at->codes += size;
    at->directions++;
}

static void write_run(alb_link_run *run, cursor *at, const workspace *work, uint32_t from, uint32_t to)
{
    const size_t size = (size_t)(ALB_BLOCK * alb_levels[run->level].parts);
    run->first = work->links[work->order[from]].node;
    uint32_t node = run->first;
    for (uint32_t k = from; k < to; k++) {
        const link *next = &work->links[work->order[k]];
        for (; next->node - node > UINT16_MAX; node += UINT16_MAX)
            write_step(at, UINT16_MAX, NULL, NULL, size);
        write_step(at, next->node - node, next, work->codes + next->codes, size);
        node = next->node;
    }
}

static void write_block(alb_link_block *block, const viewer *v, const uint16_t kernels[ALB_SIDES])
{
    uint32_t starts[BUCKETS + 1];
    workspace *work = v->work;
    work->order = grow(&work->failed, work->order, &work->order_capacity, 0, work->count, sizeof *work->order);
    if (work->failed)
        return;
    sort_links(work, starts);
    work->failed = !allocate_block(block, work, starts);
    if (work->failed)
        return;
    cursor at = {block->deltas, block->codes, block->directions};
    alb_link_run *run = block->runs;
    for (int bucket = 0; bucket < BUCKETS; bucket++) {
        const uint32_t from = starts[bucket], to = starts[bucket + 1];
        if (from == to)
            continue;
        *run = (alb_link_run){.count = (uint32_t)steps_of(v->work, from, to),
                              .kernel = kernels[bucket / (OCTAVES * ALB_LEVELS)],
                              .octave = (uint8_t)(bucket / ALB_LEVELS % OCTAVES),
                              .level = (uint8_t)(bucket % ALB_LEVELS)};
        write_run(run++, &at, work, from, to);
    }
    for (const uint8_t *code = block->codes; code < at.codes; code++)
        block->link_count += *code != ALB_NO_LINK;
}

static void link_block(alb_link_block *block, viewer *v, const uint16_t kernels[ALB_SIDES])
{
    v->work->count = v->work->code_count = v->work->pair_count = 0;
    place_rows(v);
    for (size_t t = 0; t < v->forest->tree_count; t++) {
        const alb_tree *tree = &v->forest->trees[t];
        if (tree->body == v->tree->body)
            visit(v, tree->first_node, tree->first_leaf, tree->leaf_count, side_between(tree, v->tree));
    }
    write_block(block, v, kernels);
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
                      const alb_scatter_kernel_needs *needs, double error_wanted, alb_error *error)
{
    bool failed = false;
    uint32_t *trees = NULL;
    *links = (alb_links){0};
    if (!lay_blocks(links, &trees, forest, error)) {
        alb_links_free(links);
        return false;
    }
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
                        .error_wanted = error_wanted,
                        .first_leaf = block->first_leaf,
                        .row_count = block->row_count,
                        .work = &work};
            link_block(block, &v, own);
        }
        failed = failed || work.failed;
        free(work.links);
        free(work.order);
        free(work.codes);
        free(work.pairs);
    }
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
