// The search from one node: Lazy Theta* (Nash, Koenig & Tovey 2010) without a goal, until the reach.
//
// A node's parent is the parent of the neighbour that reached it, if it can be seen, so that paths are straight where
// the body lets them and not tied to the directions of the grid. Whether it can be seen is asked when the node is
// taken from the heap: one segment a node. Where it cannot, the parent becomes the best that can be seen of the settled
// neighbours and of their parents. Pieces of surface that share an edge are joined even where none is seen.
#include "base/memory.h"
#include "render/optical_solid.h"
#include <stdlib.h>
#include <string.h>

enum { OPEN = 1, SEEN = 2, CLOSED = 4, CANDIDATES = 160, TRIES = 12 };

bool alb_search_create(alb_search *search, size_t nodes, alb_error *error)
{
    *search = (alb_search){.source = UINT32_MAX, .heap.capacity = 16 * nodes + 4096};
    if ((search->parents = alb_allocate(nodes, sizeof *search->parents, error)) &&
        (search->stamps = alb_allocate(nodes, sizeof *search->stamps, error)) &&
        (search->lengths = alb_allocate(nodes, sizeof *search->lengths, error)) &&
        (search->states = alb_allocate(nodes, 1, error)) &&
        (search->heap.entries = alb_allocate(search->heap.capacity, sizeof *search->heap.entries, error)))
        return true;
    alb_search_free(search);
    return false;
}

void alb_search_free(alb_search *search)
{
    free(search->parents);
    free(search->stamps);
    free(search->lengths);
    free(search->states);
    free(search->heap.entries);
    *search = (alb_search){0};
}

static float distance(const alb_turns *turns, uint32_t a, uint32_t b)
{
    const float *p = turns->at[a], *q = turns->at[b], x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
    return sqrtf(x * x + y * y + z * z);
}

static alb_vector at(const alb_turns *turns, uint32_t node)
{
    return (alb_vector){(double)turns->at[node][0], (double)turns->at[node][1], (double)turns->at[node][2]};
}

static bool sees(const alb_optical_solid *solid, uint32_t a, uint32_t b)
{
    return alb_voxels_inside(&solid->voxels, at(&solid->turns, a), at(&solid->turns, b));
}

static unsigned char state_of(const alb_search *s, uint32_t node)
{
    return s->stamps[node] == s->stamp ? s->states[node] : 0;
}

// Calls for each neighbour: the nodes of the 27 voxels around, then the joined pieces of surface.
typedef struct neighbours {
    const alb_turns *turns;
    int low[3], high[3], place[3];
    uint32_t next, end;
    bool joined;
} neighbours;

static neighbours around(const alb_turns *turns, uint32_t node)
{
    neighbours it = {.turns = turns};
    for (int a = 0; a < 3; a++) {
        const double low = a == 0 ? turns->low.x : a == 1 ? turns->low.y : turns->low.z;
        const int i = (int)floor(((double)turns->at[node][a] - low) / turns->size_mm);
        it.low[a] = i > 0 ? i - 1 : 0, it.high[a] = i + 1 < turns->n[a] ? i + 1 : turns->n[a] - 1;
        it.place[a] = it.low[a];
    }
    it.place[0]--;
    return it;
}

static bool step(neighbours *it, uint32_t node, uint32_t *neighbour)
{
    const alb_turns *t = it->turns;
    while (it->next == it->end) {
        if (it->joined)
            return false;
        if (++it->place[0] > it->high[0]) {
            it->place[0] = it->low[0];
            if (++it->place[1] > it->high[1]) {
                it->place[1] = it->low[1];
                if (++it->place[2] > it->high[2]) {
                    it->joined = true;
                    if (node >= t->surface_count)
                        return false;
                    it->next = t->adjacent_starts[node], it->end = t->adjacent_starts[node + 1];
                    continue;
                }
            }
        }
        const size_t voxel =
            ((size_t)it->place[2] * (size_t)t->n[1] + (size_t)it->place[1]) * (size_t)t->n[0] + (size_t)it->place[0];
        it->next = t->voxel_starts[voxel], it->end = t->voxel_starts[voxel + 1];
    }
    *neighbour = it->joined ? t->adjacent[it->next] : t->voxel_nodes[it->next];
    it->next++;
    return true;
}

typedef struct candidate {
    float length;
    uint32_t parent;
} candidate;

// The parent by which the node is nearest: the best seen of its settled neighbours and their parents.
static bool find_parent(alb_search *s, const alb_optical_solid *solid, uint32_t node)
{
    const alb_turns *turns = &solid->turns;
    candidate candidates[CANDIDATES], joined = {INFINITY, node};
    int count = 0;
    uint32_t n;
    for (neighbours it = around(turns, node); step(&it, node, &n);) {
        if (n == node || !(state_of(s, n) & CLOSED))
            continue;
        const candidate own = {s->lengths[n] + distance(turns, n, node), n};
        if (it.joined && own.length < joined.length)
            joined = own;
        const candidate options[2] = {
            own, {s->lengths[s->parents[n]] + distance(turns, s->parents[n], node), s->parents[n]}};
        for (int k = 0; k < 2 && count < CANDIDATES; k++)
            candidates[count++] = options[k];
    }
    for (int tries = 0; tries < TRIES && count > 0; tries++) {
        int best = 0;
        for (int i = 1; i < count; i++)
            if (candidates[i].length < candidates[best].length)
                best = i;
        const candidate c = candidates[best];
        if (sees(solid, c.parent, node)) {
            s->lengths[node] = c.length, s->parents[node] = c.parent;
            return true;
        }
        int kept = 0;
        for (int i = 0; i < count; i++)
            if (candidates[i].parent != c.parent)
                candidates[kept++] = candidates[i];
        count = kept;
    }
    if (!(joined.length < INFINITY))
        return false;
    s->lengths[node] = joined.length, s->parents[node] = joined.parent;
    return true;
}

bool alb_search_found(const alb_search *search, uint32_t node) { return state_of(search, node) & CLOSED; }

static void relax(alb_search *s, const alb_optical_solid *solid, uint32_t node)
{
    const uint32_t parent = s->parents[node];
    uint32_t n;
    for (neighbours it = around(&solid->turns, node); step(&it, node, &n);) {
        const unsigned char state = state_of(s, n);
        if (state & CLOSED)
            continue;
        const float length = s->lengths[parent] + distance(&solid->turns, parent, n);
        if (state && !(length < s->lengths[n]))
            continue;
        s->stamps[n] = s->stamp, s->states[n] = OPEN;
        s->lengths[n] = length, s->parents[n] = parent;
        alb_heap_push(&s->heap, (double)length, n);
    }
}

void alb_search_run(alb_search *search, const alb_optical_solid *solid, uint32_t source)
{
    const double limit = solid->reach_mm + 2 * solid->turns.size_mm;
    search->source = source;
    if (++search->stamp == 0) {
        memset(search->stamps, 0, solid->turns.count * sizeof *search->stamps);
        search->stamp = 1;
    }
    search->heap.count = 0;
    search->stamps[source] = search->stamp, search->states[source] = OPEN | SEEN;
    search->lengths[source] = 0, search->parents[source] = source;
    alb_heap_push(&search->heap, 0, source);
    while (search->heap.count > 0) {
        const alb_heap_entry top = alb_heap_pop(&search->heap);
        const uint32_t node = top.id;
        if (search->states[node] & CLOSED || top.key > (double)search->lengths[node])
            continue;
        if (top.key > limit)
            break;
        if (!(search->states[node] & SEEN)) {
            if (!sees(solid, search->parents[node], node)) {
                if (!find_parent(search, solid, node)) {
                    search->states[node] = 0; // until another neighbour finds it
                    continue;
                }
                search->states[node] |= SEEN;
                if (search->heap.count > 0 && (double)search->lengths[node] > search->heap.entries[0].key) {
                    alb_heap_push(&search->heap, (double)search->lengths[node], node);
                    continue;
                }
            }
        }
        search->states[node] |= CLOSED;
        relax(search, solid, node);
    }
}
