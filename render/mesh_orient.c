// Two faces that share an edge face the same way where they run along it in opposite directions. From face to face over
// edges that have exactly two faces, each component is coloured in two: those that face with the first and those that
// face against it. The colour with less area is turned over. Where the colours contradict each other (a Moebius strip)
// the component has no two sides and is left.
#include "render/mesh_orient.h"
#include "base/memory.h"
#include "render/mesh_edges.h"
#include <stdlib.h>

typedef struct link {
    uint32_t face;
    bool against;
} link; // 3 a face; face UINT32_MAX: none

enum { UNSEEN, WITH, AGAINST };

static void put_link(link *links, uint32_t from, uint32_t to, bool against)
{
    for (int k = 0; k < 3; k++)
        if (links[3 * (size_t)from + (size_t)k].face == UINT32_MAX) {
            links[3 * (size_t)from + (size_t)k] = (link){to, against};
            return;
        }
}

static void find_links(link *links, const alb_half_edge *edges, const alb_mesh *mesh)
{
    const size_t count = 3 * mesh->face_count;
    for (size_t i = 0; i < count; i++)
        links[i] = (link){UINT32_MAX, false};
    for (size_t i = 0, next; i < count; i = next) {
        next = alb_half_edges_end(edges, count, i);
        const uint32_t a = edges[i].place / 3, b = edges[next - 1].place / 3;
        if (next - i != 2 || a == b)
            continue;
        const bool against = edges[i].up == edges[i + 1].up;
        put_link(links, a, b, against);
        put_link(links, b, a, against);
    }
}

static double area_of(const alb_mesh *mesh, size_t face)
{
    const alb_vector *v = mesh->vertices, a = v[mesh->faces[face][0]];
    return 0.5 * alb_length(alb_cross(alb_sub(v[mesh->faces[face][1]], a), alb_sub(v[mesh->faces[face][2]], a)));
}

// Colours the component of queue[0] and lists it. Returns its size; *sided is false where it has no two sides.
static size_t colour(uint32_t *queue, unsigned char *colours, bool *sided, const link *links)
{
    size_t count = 1;
    *sided = true;
    colours[queue[0]] = WITH;
    for (size_t i = 0; i < count; i++)
        for (size_t k = 0; k < 3; k++) {
            const link to = links[3 * (size_t)queue[i] + k];
            if (to.face == UINT32_MAX)
                continue;
            const unsigned char wanted = to.against ? WITH + AGAINST - colours[queue[i]] : colours[queue[i]];
            if (colours[to.face] == UNSEEN) {
                colours[to.face] = wanted;
                queue[count++] = to.face;
            } else if (colours[to.face] != wanted)
                *sided = false;
        }
    return count;
}

bool alb_mesh_orient(alb_mesh *mesh, alb_error *error)
{
    const size_t n = mesh->face_count;
    alb_half_edge *edges = alb_half_edges_sorted((const uint32_t(*)[3])mesh->faces, NULL, n, error);
    link *links = alb_allocate(3 * n, sizeof *links, error);
    uint32_t *queue = alb_allocate(n, sizeof *queue, error);
    unsigned char *colours = alb_allocate(n, sizeof *colours, error);
    const bool ok = edges && links && queue && colours;
    if (ok)
        find_links(links, edges, mesh);
    for (size_t first = 0; ok && first < n; first++) {
        if (colours[first] != UNSEEN)
            continue;
        bool sided;
        queue[0] = (uint32_t)first;
        const size_t count = colour(queue, colours, &sided, links);
        double areas[3] = {0};
        for (size_t i = 0; i < count; i++)
            areas[colours[queue[i]]] += area_of(mesh, queue[i]);
        const unsigned char fewer = areas[AGAINST] > areas[WITH] ? WITH : AGAINST;
        for (size_t i = 0; sided && i < count; i++)
            if (colours[queue[i]] == fewer) {
                uint32_t *face = mesh->faces[queue[i]], swap = face[1];
                face[1] = face[2], face[2] = swap;
                mesh->turned++;
            }
    }
    free(edges);
    free(links);
    free(queue);
    free(colours);
    return ok;
}
