// Patches sorted by material, main direction and place along a Morton curve are cut into clusters: 16 patches each, or
// fewer where its patches see few others. In a gap narrower than a patch light goes from patch to patch, stays for
// long, and clusters would hold it back. F_c takes 256 of the rays of a cluster's patches, by a lattice over area and
// over the sorted row of each patch; S_c 32 sources a channel, drawn from the rows of S' likewise.
#include "base/memory.h"
#include "base/morton.h"
#include "render/radiosity_clusters.h"
#include <stdlib.h>

enum { MEMBERS = 16, CLUSTERS_MAX = 60000 };
static const double seen_share = 0.03; // no cluster is more than that of the patches that one of its own sees

typedef struct placed {
    uint64_t key; // material, main direction, place along a Morton curve
    uint32_t patch;
    float sees; // about so many patches
} placed;

static int by_key(const void *a, const void *b)
{
    const placed *x = a, *y = b;
    if (x->key != y->key)
        return x->key < y->key ? -1 : 1;
    return (x->patch > y->patch) - (x->patch < y->patch);
}

static uint64_t main_direction(alb_vector n)
{
    const double x = fabs(n.x), y = fabs(n.y), z = fabs(n.z);
    return x >= y && x >= z ? n.x > 0 : y >= z ? 2 + (n.y > 0) : 4 + (n.z > 0);
}

// One over the chance that two of its rays hit the same patch; INFINITY where none do.
static float patches_seen(uint32_t *row, const alb_form_factors *factors, uint32_t patch)
{
    const int rays = alb_form_factors_rays(factors, patch), even = (rays + 1) / 2;
    double pairs = 0;
    alb_form_factors_row(row, factors, patch); // two lists in order
    for (int i = 0, k = even; i < even || k < rays;) {
        const uint32_t hit = k == rays || (i < even && row[i] <= row[k]) ? row[i] : row[k];
        double same = 0;
        for (; i < even && row[i] == hit; i++)
            same++;
        for (; k < rays && row[k] == hit; k++)
            same++;
        pairs += hit < factors->patch_count ? same * (same - 1) : 0;
    }
    return (float)(pairs > 0 ? (double)rays * (rays - 1) / pairs : (double)INFINITY);
}

static void place(placed *out, const alb_patches *patches, const alb_form_factors *factors, uint32_t *row)
{
    const alb_morton curve = alb_morton_of(patches->centroids, patches->count);
    for (uint32_t p = 0; p < patches->count; p++) {
        const uint64_t group = patches->mesh->groups[p];
        out[p].key = group << 36 | main_direction(patches->normals[p]) << 32 |
                     alb_morton_place(&curve, patches->centroids[p], 10);
        out[p].patch = p;
        out[p].sees = patches_seen(row, factors, p);
    }
}

// Numbers the clusters in the order of the sorted patches, none across materials or directions; `times` as large as
// they should be.
static size_t cut(uint16_t *cluster, const placed *sorted, size_t n, double times)
{
    size_t count = 0, held = 0;
    double room = 0;
    for (size_t k = 0; k < n; k++) {
        const double here = times * fmin(seen_share * (double)sorted[k].sees, MEMBERS);
        room = held ? fmin(room, here) : here;
        if (held && ((double)held >= room || sorted[k].key >> 32 != sorted[k - 1].key >> 32)) {
            count += count < CLUSTERS_MAX - 1;
            held = 0;
            room = here;
        }
        cluster[sorted[k].patch] = (uint16_t)count;
        held++;
    }
    return n ? count + 1 : 0;
}

// A coarse product costs a quarter of a fine one at most.
static size_t cut_few(uint16_t *cluster, const placed *sorted, size_t n)
{
    const size_t most = n / 4 + 2048 < CLUSTERS_MAX ? n / 4 + 2048 : CLUSTERS_MAX - 1;
    double times = 1;
    size_t count = cut(cluster, sorted, n, times);
    while (count > most && times < (double)n)
        count = cut(cluster, sorted, n, times *= 2);
    return count;
}

// What the cluster's rays hit, the sky and backs left out.
static void take_hits(alb_clusters *out, size_t which, const alb_form_factors *factors, uint32_t *row)
{
    uint32_t found[ALB_CLUSTER_RAYS];
    uint16_t *hits = out->hits + out->first_hit[which];
    alb_form_factors_group_row(found, ALB_CLUSTER_RAYS, factors, out->members + out->first[which],
                               out->first[which + 1] - out->first[which], row);
    for (size_t q = 0; q < ALB_CLUSTER_RAYS; q++)
        if (found[q] < out->patch_count)
            *hits++ = out->cluster[found[q]];
    out->first_hit[which + 1] = (uint32_t)(hits - out->hits);
}

// Gives back what rays into the sky do not need.
static void trim_hits(alb_clusters *clusters)
{
    const size_t kept = clusters->first_hit[clusters->count];
    uint16_t *smaller = realloc(clusters->hits, (kept ? kept : 1) * sizeof *smaller);
    if (smaller)
        clusters->hits = smaller;
}

static void fill(alb_clusters *out, const placed *sorted, const alb_form_factors *factors, uint32_t *row)
{
    const size_t n = out->patch_count;
    for (size_t k = 0; k < n; k++) {
        const uint16_t which = out->cluster[sorted[k].patch];
        out->members[k] = sorted[k].patch;
        out->first[which + 1] = (uint32_t)k + 1;
        out->areas_mm2[which] += out->patch_areas_mm2[sorted[k].patch];
    }
    for (size_t which = 0; which < out->count; which++)
        take_hits(out, which, factors, row);
    trim_hits(out);
}

// How many sources each patch has a say in, at equal steps through the area of its cluster's members; as places of the
// first ones, in the order of the patches.
static void share_sources(uint32_t *first, const alb_clusters *clusters)
{
    for (size_t which = 0; which < clusters->count; which++) {
        const double scale = ALB_CLUSTER_SOURCES / clusters->areas_mm2[which];
        const uint32_t end = clusters->first[which + 1];
        double before = 0;
        for (uint32_t m = clusters->first[which]; m < end; m++) {
            const double after = before + clusters->patch_areas_mm2[clusters->members[m]];
            first[clusters->members[m] + 1] = (m + 1 == end ? ALB_CLUSTER_SOURCES : (uint32_t)(after * scale + 0.5)) -
                                              (uint32_t)(before * scale + 0.5);
            before = after;
        }
    }
    for (size_t p = 0; p < clusters->patch_count; p++)
        first[p + 1] += first[p];
}

static bool take_sources(alb_clusters *clusters, const alb_scatter *scatter, alb_error *error)
{
    const size_t n = clusters->patch_count, count = clusters->count * ALB_CLUSTER_SOURCES;
    uint32_t *first = alb_allocate(n + 1, sizeof *first, error),
             *patches = first ? alb_allocate(count, sizeof *patches, error) : NULL;
    bool ok = patches != NULL;
    if (ok)
        share_sources(first, clusters);
    for (int c = 0; ok && c < 3; c++) {
        uint16_t *out = clusters->sources[c] = alb_allocate(count, sizeof *out, error);
        ok = out && alb_scatter_sample(patches, scatter, first, c, error);
        for (size_t m = 0; ok && m < n; m++) {
            const uint32_t patch = clusters->members[m];
            const uint16_t which = clusters->cluster[patch];
            for (uint32_t q = first[patch]; q < first[patch + 1]; q++) {
                *out = clusters->cluster[patches[q]];
                clusters->spreads[which] |= *out++ != which;
            }
        }
    }
    free(first);
    free(patches);
    return ok;
}

bool alb_clusters_create(alb_clusters *clusters, const alb_patches *patches, const alb_form_factors *factors,
                         const alb_scatter *scatter, uint32_t *row, alb_error *error)
{
    const size_t n = patches->count;
    *clusters = (alb_clusters){.patch_count = n, .patch_areas_mm2 = patches->areas_mm2};
    placed *sorted = alb_allocate(n, sizeof *sorted, error);
    bool ok = sorted && (clusters->cluster = alb_allocate(n, sizeof *clusters->cluster, error));
    if (ok) {
        place(sorted, patches, factors, row);
        qsort(sorted, n, sizeof *sorted, by_key);
        clusters->count = cut_few(clusters->cluster, sorted, n);
        const size_t count = clusters->count;
        ok = (clusters->members = alb_allocate(n, sizeof *clusters->members, error)) &&
             (clusters->first = alb_allocate(count + 1, sizeof *clusters->first, error)) &&
             (clusters->areas_mm2 = alb_allocate(count, sizeof *clusters->areas_mm2, error)) &&
             (clusters->first_hit = alb_allocate(count + 1, sizeof *clusters->first_hit, error)) &&
             (clusters->hits = alb_allocate(count * ALB_CLUSTER_RAYS, sizeof *clusters->hits, error)) &&
             (clusters->kept = alb_allocate(count, sizeof *clusters->kept, error)) &&
             (clusters->values = alb_allocate(count, sizeof *clusters->values, error)) &&
             (clusters->spreads = alb_allocate(count, sizeof *clusters->spreads, error)) &&
             (clusters->right = alb_allocate(count, sizeof *clusters->right, error)) &&
             (clusters->bounced = alb_allocate(count, sizeof *clusters->bounced, error));
    }
    if (ok) {
        fill(clusters, sorted, factors, row);
        alb_clusters_refresh(clusters, scatter);
        ok = take_sources(clusters, scatter, error);
    }
    if (!ok)
        alb_clusters_free(clusters);
    free(sorted);
    return ok;
}
