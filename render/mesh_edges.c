// Both half edges of an edge have its vertices in one 64-bit number, the lower one first, whichever way they run.
#include "render/mesh_edges.h"
#include "base/memory.h"
#include <stdlib.h>

static int by_ends(const void *a, const void *b)
{
    const alb_half_edge *p = a, *q = b;
    if (p->ends != q->ends)
        return p->ends < q->ends ? -1 : 1;
    return p->place < q->place ? -1 : p->place > q->place;
}

alb_half_edge *alb_half_edges_sorted(const uint32_t (*faces)[3], const uint32_t *which, size_t count, alb_error *error)
{
    alb_half_edge *edges = alb_allocate(3 * count, sizeof *edges, error);
    for (size_t i = 0; edges && i < 3 * count; i++) {
        const uint32_t *face = faces[which ? which[i / 3] : i / 3], a = face[i % 3], b = face[(i + 1) % 3];
        edges[i] = (alb_half_edge){(uint64_t)(a < b ? a : b) << 32 | (a < b ? b : a), (uint32_t)i, a < b};
    }
    if (edges)
        qsort(edges, 3 * count, sizeof *edges, by_ends);
    return edges;
}
