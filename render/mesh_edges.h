// Triangles side by side: half edges sorted so that those of one edge follow each other.
#pragma once
#include "render/mesh.h"

typedef struct alb_half_edge {
    uint64_t ends;  // lower vertex << 32 | higher vertex
    uint32_t place; // 3 * triangle + the corner that it starts from
    bool up;        // runs from the lower vertex to the higher
} alb_half_edge;

// The 3 count half edges of the triangles faces[k], or faces[which[k]] where `which` is not NULL, by their ends, then
// by place. The caller frees them. NULL where there is no memory for it.
alb_half_edge *alb_half_edges_sorted(const uint32_t (*faces)[3], const uint32_t *which, size_t count, alb_error *error);
// The end of those, from `first` on, that have the ends of edges[first].
static inline size_t alb_half_edges_end(const alb_half_edge *edges, size_t count, size_t first)
{
    size_t next = first + 1;
    while (next < count && edges[next].ends == edges[first].ends)
        next++;
    return next;
}
