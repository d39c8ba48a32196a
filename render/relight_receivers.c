// Patches of a cluster, in the order of a space-filling curve, in groups of about four. Where the light that they get
// from other patches differs over a group, each stands for itself. A group's list is drawn from those of its patches.
//
// Where it stops being true: light of other kinds than that which the groups were taken apart for may differ elsewhere,
// such as that of a lamp in a corner that no light shone into.
#include "render/relight_receivers.h"
#include "base/memory.h"
#include <stdlib.h>
#include <string.h>

typedef struct group {
    uint32_t first, count, index; // members of the clusters
    double missed;                // squared, over |B|, rms over the lights
    bool apart;
} group;

static size_t cut_groups(group *groups, const alb_clusters *clusters)
{
    size_t count = 0;
    for (size_t k = 0; k < clusters->count; k++) {
        const uint32_t begin = clusters->first[k], size = clusters->first[k + 1] - begin,
                       parts = (size + ALB_RECEIVER_PATCHES - 1) / ALB_RECEIVER_PATCHES;
        for (uint32_t part = 0; part < parts; part++, count++) {
            const uint32_t from = begin + size * part / parts, to = begin + size * (part + 1) / parts;
            groups[count] = (group){.first = from, .count = to - from, .index = (uint32_t)count};
        }
    }
    return count;
}

// What the group's mean misses of one light, in the worst channel.
static double missed_of(const group *g, const alb_radiosity *equations, const alb_rgb *light, const double length[3])
{
    const uint32_t *members = equations->clusters.members + g->first;
    double worst = 0;
    for (int c = 0; c < 3 && length[c] > 0; c++) {
        double area = 0, sum = 0, missed = 0;
        for (uint32_t i = 0; i < g->count; i++) {
            area += equations->areas_mm2[members[i]];
            sum += equations->areas_mm2[members[i]] * light[members[i]][c];
        }
        for (uint32_t i = 0; i < g->count; i++) {
            const double off = equations->scatter->row_sums[members[i]][c] * (light[members[i]][c] - sum / area);
            missed += equations->areas_mm2[members[i]] * off * off;
        }
        worst = fmax(worst, missed / (length[c] * length[c]));
    }
    return worst;
}

static int by_missed(const void *a, const void *b)
{
    const group *p = a, *q = b;
    return p->missed != q->missed ? (p->missed > q->missed ? -1 : 1) : p->index < q->index ? -1 : p->index > q->index;
}

static int by_index(const void *a, const void *b)
{
    const group *p = a, *q = b;
    return p->index < q->index ? -1 : p->index > q->index;
}

// Which groups are to be taken apart: those that miss most.
static void choose(group *groups, size_t count, const alb_radiosity *equations, alb_rgb *const *bounced,
                   const double (*lengths)[3], size_t light_count, double error_wanted)
{
    double missed = 0, total_mm2 = 0;
    for (size_t k = 0; k < equations->clusters.count; k++)
        total_mm2 += equations->clusters.areas_mm2[k];
#pragma omp parallel for schedule(static)
    for (size_t g = 0; g < count; g++)
        for (size_t k = 0; k < light_count; k++)
            groups[g].missed += missed_of(&groups[g], equations, (const alb_rgb *)bounced[k], lengths[k]) /
                                ((double)light_count * total_mm2);
    qsort(groups, count, sizeof *groups, by_missed);
    for (size_t g = count; g-- > 0;) {
        missed += groups[g].missed;
        groups[g].apart = missed > error_wanted * error_wanted;
    }
    qsort(groups, count, sizeof *groups, by_index);
}

static void make_receivers(alb_receivers *out, const group *groups, size_t count, const alb_clusters *clusters)
{
    memcpy(out->members, clusters->members, clusters->patch_count * sizeof *out->members);
    for (size_t g = 0; g < count; g++)
        for (uint32_t i = 0; i < groups[g].count; i++)
            if (groups[g].apart || i + 1 == groups[g].count)
                out->first[++out->count] = groups[g].first + i + 1;
}

static bool fill_rows(alb_receivers *out, const alb_form_factors *factors, alb_error *error)
{
    const size_t n = factors->patch_count;
    uint32_t *lengths = alb_allocate(out->count, sizeof *lengths, error), *hits = NULL;
    for (size_t r = 0; lengths && r < out->count; r++) {
        long rays = 0;
        for (uint32_t i = out->first[r]; i < out->first[r + 1]; i++)
            rays += alb_form_factors_rays(factors, out->members[i]);
        lengths[r] = (uint32_t)(rays < ALB_RECEIVER_RAYS ? rays : ALB_RECEIVER_RAYS);
    }
    bool ok = lengths && alb_hit_rows_create(&out->rows, lengths, out->count, n + 2, (uint32_t)n, 0, error);
    const size_t largest = ok ? alb_hit_rows_largest_chunk(&out->rows) : 0;
    ok = ok && (hits = alb_allocate(largest + ALB_RAYS_MAX, sizeof *hits, error));
    for (size_t chunk = 0; ok && chunk < out->rows.chunks; chunk++) {
        uint32_t *to = hits;
        for (size_t r = chunk * ALB_CHUNK_ROWS; r < out->count && r < (chunk + 1) * ALB_CHUNK_ROWS; to += lengths[r++])
            alb_form_factors_group_row(to, lengths[r], factors, out->members + out->first[r],
                                       out->first[r + 1] - out->first[r], hits + largest);
        alb_hit_rows_fill(&out->rows, chunk, hits, hits + largest);
    }
    if (ok)
        alb_hit_rows_trim(&out->rows);
    free(hits);
    free(lengths);
    return ok;
}

bool alb_receivers_create(alb_receivers *receivers, const alb_radiosity *equations, alb_rgb *const *bounced,
                          const double (*lengths)[3], size_t light_count, double error_wanted, alb_error *error)
{
    const alb_clusters *clusters = &equations->clusters;
    const size_t n = clusters->patch_count;
    group *groups = alb_allocate(n, sizeof *groups, error);
    *receivers = (alb_receivers){0};
    bool ok = groups && (receivers->first = alb_allocate(n + 1, sizeof *receivers->first, error)) &&
              (receivers->members = alb_allocate(n, sizeof *receivers->members, error)) &&
              (receivers->values = alb_allocate(n + 2, sizeof *receivers->values, error));
    if (ok) {
        const size_t count = cut_groups(groups, clusters);
        choose(groups, count, equations, bounced, lengths, light_count, error_wanted);
        make_receivers(receivers, groups, count, clusters);
        ok = fill_rows(receivers, equations->factors, error) &&
             (receivers->gathered = alb_allocate(receivers->count, sizeof *receivers->gathered, error));
    }
    free(groups);
    if (!ok)
        alb_receivers_free(receivers);
    return ok;
}

void alb_receivers_free(alb_receivers *receivers)
{
    alb_hit_rows_free(&receivers->rows);
    free(receivers->first);
    free(receivers->members);
    free(receivers->values);
    free(receivers->gathered);
    *receivers = (alb_receivers){0};
}

size_t alb_receivers_bytes(const alb_receivers *receivers)
{
    const size_t n = receivers->count ? receivers->first[receivers->count] : 0;
    return receivers->count ? alb_hit_rows_bytes(&receivers->rows) + n * sizeof *receivers->members +
                                  (n + 2) * sizeof *receivers->values +
                                  receivers->count * (sizeof *receivers->first + sizeof *receivers->gathered)
                            : 0;
}

void alb_receivers_gather(const alb_receivers *receivers)
{
    alb_hit_rows_gather(receivers->gathered, &receivers->rows, (const float(*)[4])receivers->values);
}
