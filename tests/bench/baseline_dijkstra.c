// Dijkstra's algorithm with a binary heap that can lower keys. Edges of length 1, sqrt 2 and sqrt 3 voxels overestimate
// straight lines by 8.8 % on average over all directions, by 12.8 % at most.
#include "baseline_dijkstra.h"
#include "base/memory.h"
#include <math.h>
#include <stdlib.h>

static size_t count_of(const alb_voxels *v) { return (size_t)v->n[0] * (size_t)v->n[1] * (size_t)v->n[2]; }

bool baseline_dijkstra_create(baseline_dijkstra *d, const alb_voxels *voxels, alb_error *error)
{
    const size_t n = count_of(voxels);
    *d = (baseline_dijkstra){.voxels = voxels};
    if ((d->lengths = alb_allocate(n, sizeof *d->lengths, error)) &&
        (d->heap = alb_allocate(n, sizeof *d->heap, error)) && (d->places = alb_allocate(n, sizeof *d->places, error)))
        return true;
    baseline_dijkstra_free(d);
    return false;
}

void baseline_dijkstra_free(baseline_dijkstra *d)
{
    free(d->lengths);
    free(d->heap);
    free(d->places);
    *d = (baseline_dijkstra){0};
}

static void put(baseline_dijkstra *d, size_t at, size_t voxel)
{
    d->heap[at] = voxel;
    d->places[voxel] = at + 1; // 0: not in the heap
}

static void rise(baseline_dijkstra *d, size_t at)
{
    const size_t voxel = d->heap[at];
    for (; at > 0 && d->lengths[voxel] < d->lengths[d->heap[(at - 1) / 2]]; at = (at - 1) / 2)
        put(d, at, d->heap[(at - 1) / 2]);
    put(d, at, voxel);
}

static size_t take(baseline_dijkstra *d)
{
    const size_t top = d->heap[0], last = d->heap[--d->heap_count];
    size_t at = 0;
    for (size_t child; (child = 2 * at + 1) < d->heap_count; at = child) {
        if (child + 1 < d->heap_count && d->lengths[d->heap[child + 1]] < d->lengths[d->heap[child]])
            child++;
        if (!(d->lengths[d->heap[child]] < d->lengths[last]))
            break;
        put(d, at, d->heap[child]);
    }
    if (d->heap_count > 0)
        put(d, at, last);
    d->places[top] = 0;
    return top;
}

static size_t voxel_of(const alb_voxels *v, alb_vector point)
{
    const alb_vector p = alb_times(1 / v->size_mm, alb_sub(point, v->low));
    const size_t i = (size_t)fmin(fmax(p.x, 0), v->n[0] - 1), j = (size_t)fmin(fmax(p.y, 0), v->n[1] - 1),
                 k = (size_t)fmin(fmax(p.z, 0), v->n[2] - 1);
    return (k * (size_t)v->n[1] + j) * (size_t)v->n[0] + i;
}

void baseline_dijkstra_run(baseline_dijkstra *d, alb_vector from)
{
    const alb_voxels *v = d->voxels;
    const size_t n = count_of(v), x = (size_t)v->n[0], y = (size_t)v->n[1], source = voxel_of(v, from);
    for (size_t i = 0; i < n; i++)
        d->lengths[i] = (double)INFINITY, d->places[i] = 0;
    d->heap_count = 1;
    d->lengths[source] = 0;
    put(d, 0, source);
    while (d->heap_count > 0) {
        const size_t at = take(d);
        const int place[3] = {(int)(at % x), (int)(at / x % y), (int)(at / (x * y))};
        for (int k = 0; k < 27; k++) {
            const int step[3] = {k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1};
            const int i = place[0] + step[0], j = place[1] + step[1], l = place[2] + step[2];
            if (k == 13 || i < 0 || j < 0 || l < 0 || i >= v->n[0] || j >= v->n[1] || l >= v->n[2])
                continue;
            const size_t next = ((size_t)l * y + (size_t)j) * x + (size_t)i;
            const double length = d->lengths[at] + v->size_mm * sqrt(abs(step[0]) + abs(step[1]) + abs(step[2]));
            if (v->state[next] == ALB_VOXEL_OUTSIDE || !(length < d->lengths[next]))
                continue;
            d->lengths[next] = length;
            if (!d->places[next])
                put(d, d->heap_count++, next);
            rise(d, d->places[next] - 1);
        }
    }
}

double baseline_dijkstra_length(const baseline_dijkstra *d, alb_vector to)
{
    return d->lengths[voxel_of(d->voxels, to)];
}
