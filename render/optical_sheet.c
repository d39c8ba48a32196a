// Paths along thin sheets.
//
// In a sheet thinner than light tells, paths follow the faces: exact geodesics (geodesic.c). Each triangle has a foot,
// where its normal inwards meets the opposing face. A target is on the other face if the geodesic to its foot is
// shorter than that to itself, which must go around the rim. Wrong where the thickness changes within a path's length.
#include "base/memory.h"
#include "render/optical_solid.h"
#include <stdlib.h>

enum { CROSSINGS = 16 };

typedef struct weighted {
    double value, weight;
} weighted;

static int by_value(const void *a, const void *b)
{
    const weighted *p = a, *q = b;
    return p->value < q->value ? -1 : p->value > q->value;
}

static double area_of(const alb_surface_net *net, size_t i)
{
    const alb_vector *t = net->triangles[i];
    return 0.5 * alb_length(alb_cross(alb_sub(t[1], t[0]), alb_sub(t[2], t[0])));
}

// Doubles the distance looked at until the other side is met.
static void look(alb_optical_sheet *sheet, const alb_optical_solid *solid, size_t i, double longest_mm)
{
    const alb_surface_net *net = &solid->net;
    const alb_vector start = solid->starts[i], inwards = alb_times(-1, net->normals[i]);
    sheet->facing[i] = UINT32_MAX;
    sheet->thickness[i] = (double)INFINITY;
    for (double far = 4 * solid->voxels.size_mm;; far *= 4) {
        alb_crossing crossings[CROSSINGS];
        const double length = far < longest_mm ? far : longest_mm;
        const size_t found = alb_voxels_crossings(crossings, CROSSINGS, &solid->voxels, start,
                                                  alb_add(start, alb_times(length, inwards)));
        for (size_t k = 0; k < found && k < CROSSINGS; k++) {
            if (!crossings[k].leaves)
                continue;
            sheet->feet[i] = alb_add(start, alb_times(crossings[k].at * length, inwards));
            sheet->thickness[i] = alb_length(alb_sub(sheet->feet[i], net->middles[i]));
            if (alb_dot(net->normals[crossings[k].triangle], inwards) > 0.5)
                sheet->facing[i] = crossings[k].triangle;
            return;
        }
        if (length >= longest_mm)
            return;
    }
}

bool alb_optical_sheet_create(alb_optical_sheet *sheet, const alb_optical_solid *solid, double longest_mm,
                              alb_error *error)
{
    const size_t n = solid->net.count;
    *sheet = (alb_optical_sheet){0};
    weighted *sorted = alb_allocate(n, sizeof *sorted, error);
    if (!sorted || !(sheet->facing = alb_allocate(n, sizeof *sheet->facing, error)) ||
        !(sheet->feet = alb_allocate(n, sizeof *sheet->feet, error)) ||
        !(sheet->thickness = alb_allocate(n, sizeof *sheet->thickness, error))) {
        free(sorted);
        alb_optical_sheet_free(sheet);
        return false;
    }
#pragma omp parallel for schedule(dynamic, 256)
    for (size_t i = 0; i < n; i++)
        look(sheet, solid, i, longest_mm);
    double total = 0, below = 0;
    for (size_t i = 0; i < n; i++) {
        sorted[i] = (weighted){sheet->thickness[i], area_of(&solid->net, i)};
        total += sorted[i].weight;
    }
    qsort(sorted, n, sizeof *sorted, by_value);
    for (size_t i = 0; i < n && below < 0.5 * total; i++) {
        below += sorted[i].weight;
        sheet->median_mm = sorted[i].value;
    }
    free(sorted);
    return true;
}

void alb_optical_sheet_free(alb_optical_sheet *sheet)
{
    free(sheet->facing);
    free(sheet->face);
    free(sheet->sides);
    free(sheet->feet);
    free(sheet->thickness);
    alb_geodesic_surface_free(&sheet->surface);
    *sheet = (alb_optical_sheet){0};
}

double alb_optical_sheet_share(const alb_optical_sheet *sheet, const alb_surface_net *net, double limit_mm)
{
    double thin = 0, total = 0;
    for (size_t i = 0; i < net->count; i++) {
        const double area = area_of(net, i);
        total += area;
        if (sheet->facing[i] != UINT32_MAX && sheet->thickness[i] <= limit_mm)
            thin += area;
    }
    return total > 0 ? thin / total : 0;
}

// Numbers the faces: triangles with a foot joined over edges that bend by less than a right angle.
static bool find_faces(alb_optical_sheet *sheet, const alb_surface_net *net, alb_error *error)
{
    uint32_t *stack = alb_allocate(net->count, sizeof *stack, error);
    if (!stack || !(sheet->face = alb_allocate(net->count, sizeof *sheet->face, error))) {
        free(stack);
        return false;
    }
    uint32_t faces = 0; // 0: none
    for (uint32_t seed = 0; seed < net->count; seed++) {
        size_t depth = 0;
        if (sheet->face[seed] || sheet->facing[seed] == UINT32_MAX)
            continue;
        sheet->face[seed] = ++faces;
        stack[depth++] = seed;
        while (depth > 0) {
            const uint32_t at = stack[--depth];
            for (int k = 0; k < 3; k++) {
                const uint32_t next = net->neighbours[at][k] / 3;
                if (net->neighbours[at][k] == UINT32_MAX || sheet->face[next] || sheet->facing[next] == UINT32_MAX ||
                    !(alb_dot(net->normals[at], net->normals[next]) > 0))
                    continue;
                sheet->face[next] = faces;
                stack[depth++] = next;
            }
        }
    }
    free(stack);
    return true;
}

// The face that stands for those whose sides are known relative to it, and whether this one is turned against that.
static uint32_t root_of(uint32_t *parents, uint8_t *turned, uint32_t face, uint8_t *against)
{
    for (*against = 0; parents[face] != face; face = parents[face]) {
        const uint32_t parent = parents[face];
        turned[face] ^= turned[parent]; // halves the path; the root is not turned
        parents[face] = parents[parent];
        *against ^= turned[face];
    }
    return face;
}

// Faces that lie opposite are front and back; where that is at odds with itself the first word counts.
static bool find_sides(alb_optical_sheet *sheet, const alb_surface_net *net, alb_error *error)
{
    const size_t n = net->count;
    uint32_t *parents = alb_allocate(n + 1, sizeof *parents, error);
    uint8_t *turned = alb_allocate(n + 1, sizeof *turned, error), here, there;
    const bool ok = parents && turned && (sheet->sides = alb_allocate(n, sizeof *sheet->sides, error));
    for (uint32_t i = 0; ok && i <= n; i++)
        parents[i] = i;
    for (size_t i = 0; ok && i < n; i++) {
        const uint32_t face = sheet->face[i], other = face ? sheet->face[sheet->facing[i]] : 0;
        if (!other)
            continue;
        const uint32_t a = root_of(parents, turned, face, &here), b = root_of(parents, turned, other, &there);
        if (a != b)
            parents[a > b ? a : b] = a > b ? b : a, turned[a > b ? a : b] = here ^ there ^ 1;
    }
    for (size_t i = 0; ok && i < n; i++) {
        root_of(parents, turned, sheet->face[i], &here);
        sheet->sides[i] = (uint8_t)(!sheet->face[i] ? ALB_RIM : here ? ALB_BACK : ALB_FRONT);
    }
    free(parents);
    free(turned);
    return ok;
}

bool alb_optical_sheet_prepare(alb_optical_sheet *sheet, const alb_surface_net *net, double limit_mm, alb_error *error)
{
    for (size_t i = 0; i < net->count;
         i++) // a rim that looks into a bend sees a face that sees its own opposite nearer
        if (sheet->thickness[i] > limit_mm ||
            (sheet->facing[i] != UINT32_MAX && sheet->thickness[i] > 1.5 * sheet->thickness[sheet->facing[i]]))
            sheet->facing[i] = UINT32_MAX;
    if (!find_faces(sheet, net, error) || !find_sides(sheet, net, error))
        return false;
    return alb_geodesic_surface_create(&sheet->surface, (const alb_vector(*)[3])net->triangles,
                                       (const uint32_t(*)[3])net->neighbours, net->count, error);
}

typedef enum reached { SELF, ACROSS, NEARER } reached;

static reached reached_at(const alb_optical_sheet *sheet, uint32_t from, uint32_t to)
{
    const uint32_t facing = sheet->facing[to];
    if (facing == UINT32_MAX || (sheet->face[from] && sheet->face[from] == sheet->face[to]))
        return SELF;
    return sheet->face[from] && sheet->face[from] == sheet->face[facing] ? ACROSS : NEARER;
}

void alb_optical_sheet_measure(float *distances_mm, unsigned char *opposite, alb_sheet_memory *memory,
                               const alb_optical_sheet *sheet, const alb_surface_net *net, uint32_t from,
                               const uint32_t *to, const alb_vector *points, size_t count, double reach_mm)
{
    for (size_t k = 0; k < count; k++) {
        const uint32_t t = to[k];
        const alb_vector middle = net->middles[t], beside = alb_sub(points[k], middle), foot = sheet->feet[t];
        const alb_geodesic_target self = {.triangle = t, .at = middle, .end = points[k]},
                                  across = {.triangle = sheet->facing[t], .at = foot, .end = alb_add(foot, beside)};
        const reached how = reached_at(sheet, from, t);
        memory->targets[2 * k] = how == ACROSS ? across : self;
        memory->targets[2 * k + 1] = how == SELF ? self : across;
    }
    alb_geodesic_run(memory->targets, 2 * count, 2, &memory->geodesic, &sheet->surface, from, net->middles[from],
                     reach_mm);
    for (size_t k = 0; k < count; k++) {
        const alb_geodesic_target *pair = &memory->targets[2 * k];
        const bool second = pair[1].to_at_mm < pair[0].to_at_mm;
        const reached how = reached_at(sheet, from, to[k]);
        distances_mm[k] = (float)pair[second].distance_mm;
        if (opposite)
            opposite[k] = how == ACROSS || (how == NEARER && second);
    }
}
