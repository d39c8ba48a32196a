// Exact geodesics on a triangle surface: windows in the order of their distance.
//
// A window is the part of an edge that is reached from the source, or from a vertex where paths turn, through one
// sequence of triangles; unfolded into the plane of the edge, that source is a point, and distances across the window
// are straight (Mitchell, Mount & Papadimitriou 1987). Windows are carried across triangles nearest first (Chen & Han
// 1990; Xin & Wang 2009), and dropped when the way through one of the triangle's three vertices is shorter for all that
// they can reach (Xin & Wang, theorem 3.2). Paths turn only at boundary vertices and at those with more than 2 pi about
// them.
// A triangle without height is crossed like any other; the rounding of its unfolding is what limits exactness there.
#include "render/geodesic.h"
#include "base/memory.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { WINDOWS = 1 << 17, LOOK_AGAIN = 256 };

static inline double norm(double x, double y) { return sqrt(x * x + y * y); }

typedef struct alb_window {
    uint32_t place; // 3 * triangle + edge by which it enters the triangle
    double b0, b1;  // along the edge, from its first corner
    double x, y;    // the source, unfolded: along the edge, and how far behind it
    double sigma;   // from the true source to this one
} window;

bool alb_geodesic_memory_create(alb_geodesic_memory *m, const alb_geodesic_surface *surface, alb_error *error)
{
    *m = (alb_geodesic_memory){.heap.capacity = 2 * WINDOWS}; // ids: a window, or WINDOWS + vertex
    if ((m->windows = alb_allocate(WINDOWS, sizeof *m->windows, error)) &&
        (m->free = alb_allocate(WINDOWS, sizeof *m->free, error)) &&
        (m->heap.entries = alb_allocate(2 * WINDOWS, sizeof *m->heap.entries, error)) &&
        (m->heads = alb_allocate(surface->count, sizeof *m->heads, error)) &&
        (m->stamps = alb_allocate(surface->count, sizeof *m->stamps, error)) &&
        (m->vertex_stamps = alb_allocate(surface->vertex_count, sizeof *m->vertex_stamps, error)) &&
        (m->distances = alb_allocate(surface->vertex_count, sizeof *m->distances, error)))
        return true;
    alb_geodesic_memory_free(m);
    return false;
}

void alb_geodesic_memory_free(alb_geodesic_memory *m)
{
    free(m->windows);
    free(m->free);
    free(m->heap.entries);
    free(m->heads);
    free(m->stamps);
    free(m->vertex_stamps);
    free(m->distances);
    *m = (alb_geodesic_memory){0};
}

static double distance_of(const alb_geodesic_memory *m, uint32_t vertex)
{
    return m->vertex_stamps[vertex] == m->stamp ? m->distances[vertex] : (double)INFINITY;
}

typedef struct geodesic {
    alb_geodesic_target *targets;
    alb_geodesic_memory *memory;
    const alb_geodesic_surface *surface;
    double reach_mm;
} geodesic;

static void reach_vertex(geodesic *g, uint32_t vertex, double distance)
{
    alb_geodesic_memory *m = g->memory;
    if (!(distance < distance_of(m, vertex)))
        return;
    m->vertex_stamps[vertex] = m->stamp;
    m->distances[vertex] = distance;
    if (g->surface->turns[vertex] && distance <= g->reach_mm && !alb_heap_push(&m->heap, distance, WINDOWS + vertex))
        m->dropped++;
}

// The triangle unfolded: its edge on the x axis, the third corner above.
typedef struct unfolded {
    double length, x, y;
    uint32_t first, second, third; // vertices
    uint32_t triangle;
    int edge;
} unfolded;

static unfolded unfold(const alb_geodesic_surface *s, uint32_t place)
{
    const uint32_t t = place / 3;
    const int k = (int)(place % 3);
    const alb_vector a = s->triangles[t][k], e = alb_sub(s->triangles[t][(k + 1) % 3], a),
                     c = alb_sub(s->triangles[t][(k + 2) % 3], a);
    unfolded u = {.length = alb_length(e), .triangle = t, .edge = k};
    u.x = u.length > 0 ? alb_dot(c, e) / u.length : 0;
    u.y = u.length > 0 ? alb_length(alb_cross(e, c)) / u.length : alb_length(c);
    u.first = s->corners[t][k], u.second = s->corners[t][(k + 1) % 3], u.third = s->corners[t][(k + 2) % 3];
    return u;
}

// A window about to be: on an edge of a triangle, in that edge's own measure, with the triangle's third corner.
typedef struct offer {
    uint32_t triangle, third;
    int edge;
    bool third_beyond_b1; // the third corner's shortcut is judged at b0 (false) or b1
    double length, b0, b1, x, y, sigma, third_x, third_y;
} offer;

// Whether the way through a corner of the edge or the third corner is shorter for the whole window.
static bool is_beaten(const alb_geodesic_memory *m, const offer *o, uint32_t v1, uint32_t v2)
{
    const double slack = 1e-12 * (o->sigma + o->length + o->y);
    const double to_b0 = o->sigma + norm(o->x - o->b0, o->y) - slack,
                 to_b1 = o->sigma + norm(o->x - o->b1, o->y) - slack;
    const double b = o->third_beyond_b1 ? o->b1 : o->b0, to_b = o->third_beyond_b1 ? to_b1 : to_b0;
    return to_b1 > distance_of(m, v1) + o->b1 || to_b0 > distance_of(m, v2) + (o->length - o->b0) ||
           to_b > distance_of(m, o->third) + norm(b - o->third_x, o->third_y);
}

// Enters the window into the triangle across its edge.
static void take(geodesic *g, offer *o)
{
    const alb_geodesic_surface *s = g->surface;
    alb_geodesic_memory *m = g->memory;
    const double tiny = 1e-12 * o->length;
    o->b0 = o->b0 > 0 ? o->b0 : 0, o->b1 = o->b1 < o->length ? o->b1 : o->length;
    if (!(o->b1 - o->b0 > tiny))
        return;
    const uint32_t v1 = s->corners[o->triangle][o->edge], v2 = s->corners[o->triangle][(o->edge + 1) % 3];
    if (is_beaten(m, o, v1, v2))
        return;
    if (o->b0 <= tiny)
        reach_vertex(g, v1, o->sigma + norm(o->x, o->y));
    if (o->b1 >= o->length - tiny)
        reach_vertex(g, v2, o->sigma + norm(o->x - o->length, o->y));
    const double past = o->x < o->b0 ? o->b0 - o->x : o->x > o->b1 ? o->x - o->b1 : 0;
    const double nearest = o->sigma + norm(past, o->y);
    const uint32_t across = s->neighbours[o->triangle][o->edge];
    if (across == UINT32_MAX || nearest > g->reach_mm)
        return;
    const alb_vector from = s->triangles[o->triangle][o->edge], there = s->triangles[across / 3][across % 3];
    const bool same = from.x == there.x && from.y == there.y && from.z == there.z; // one of the two is turned over
    const window w = {.place = across,
                      .b0 = same ? o->b0 : o->length - o->b1,
                      .b1 = same ? o->b1 : o->length - o->b0,
                      .x = same ? o->x : o->length - o->x,
                      .y = o->y,
                      .sigma = o->sigma};
    const uint32_t id = m->free_count > 0 ? m->free[m->free_count - 1] : m->used;
    if (id == WINDOWS || !alb_heap_push(&m->heap, nearest, id)) {
        m->dropped++;
        return;
    }
    if (m->free_count > 0)
        m->free_count--;
    else
        m->used++;
    m->windows[id] = w;
}

typedef struct point {
    double x, y;
} point;

static double cross(point a, point b) { return a.x * b.y - a.y * b.x; }

// The window's light on the edge from p to q of the triangle, between its rays through `left` and `right`; where a ray
// ends in p or q, `at_p` and `at_q` say so.
static void cast(geodesic *g, const unfolded *u, const window *w, bool right, double ray_p, double ray_q, bool to_third)
{
    const point a = {0, 0}, b = {u->length, 0}, c = {u->x, u->y}, s = {w->x, -w->y};
    const point p = right ? b : c, q = right ? c : a, third = right ? a : b;
    offer o = {.triangle = u->triangle,
               .third = right ? u->first : u->second,
               .edge = (u->edge + (right ? 1 : 2)) % 3,
               .third_beyond_b1 = !right,
               .length = norm(q.x - p.x, q.y - p.y),
               .sigma = w->sigma};
    if (!(o.length > 0))
        return;
    const point along = {(q.x - p.x) / o.length, (q.y - p.y) / o.length}, from = {s.x - p.x, s.y - p.y},
                other = {third.x - p.x, third.y - p.y};
    const point way_p = {ray_p - s.x, w->y}, way_q = {ray_q - s.x, w->y};
    o.b0 = !right && to_third ? 0 : cross(from, way_p) / cross(along, way_p);
    o.b1 = right && to_third ? o.length : cross(from, way_q) / cross(along, way_q);
    if (!isfinite(o.b0) || !isfinite(o.b1))
        return;
    o.x = from.x * along.x + from.y * along.y, o.y = fabs(cross(along, from));
    o.third_x = other.x * along.x + other.y * along.y, o.third_y = fabs(cross(along, other));
    take(g, &o);
}

// Carries the window across the triangle that it enters.
static void carry(geodesic *g, const unfolded *u, const window *w)
{
    const double tall = w->y + u->y, at = tall > 0 ? w->x + (u->x - w->x) * w->y / tall : w->x;
    if (at >= w->b0 && at <= w->b1)
        reach_vertex(g, u->third, w->sigma + norm(u->x - w->x, tall));
    if (w->b1 > at)
        cast(g, u, w, true, w->b1, fmax(w->b0, at), w->b0 <= at);
    if (w->b0 < at)
        cast(g, u, w, false, fmin(w->b1, at), w->b0, w->b1 >= at);
}

// Windows on the edge opposite a corner, from that corner; or, for a source within, on any edge.
static void emit(geodesic *g, uint32_t triangle, int edge, alb_vector source, double sigma)
{
    const unfolded u = unfold(g->surface, 3 * triangle + (uint32_t)edge);
    const alb_vector a = g->surface->triangles[triangle][edge],
                     e = alb_unit(alb_sub(g->surface->triangles[triangle][(edge + 1) % 3], a)),
                     from = alb_sub(source, a);
    offer o = {.triangle = triangle,
               .third = u.third,
               .edge = edge,
               .length = u.length,
               .b0 = 0,
               .b1 = u.length,
               .x = alb_dot(from, e),
               .y = alb_length(alb_cross(e, from)),
               .sigma = sigma,
               .third_x = u.x,
               .third_y = u.y};
    take(g, &o);
}

static void turn(geodesic *g, uint32_t vertex)
{
    const alb_geodesic_surface *s = g->surface;
    const double sigma = distance_of(g->memory, vertex);
    for (uint32_t i = s->around_starts[vertex]; i < s->around_starts[vertex + 1]; i++) {
        const uint32_t triangle = s->around[i] / 3;
        const int corner = (int)(s->around[i] % 3);
        for (int k = 1; k < 3; k++)
            reach_vertex(
                g, s->corners[triangle][(corner + k) % 3],
                sigma + alb_length(alb_sub(s->triangles[triangle][(corner + k) % 3], s->triangles[triangle][corner])));
        emit(g, triangle, (corner + 1) % 3, s->triangles[triangle][corner], sigma);
    }
}

// The window's light on the targets of the triangle that it enters.
static void shine(geodesic *g, const unfolded *u, const window *w)
{
    const alb_geodesic_memory *m = g->memory;
    if (m->stamps[u->triangle] != m->stamp || !(u->y > 0))
        return;
    const alb_vector *t = g->surface->triangles[u->triangle], a = t[u->edge],
                     e = alb_unit(alb_sub(t[(u->edge + 1) % 3], a)), c = alb_sub(t[(u->edge + 2) % 3], a),
                     up = alb_unit(alb_sub(c, alb_times(alb_dot(c, e), e)));
    for (uint32_t i = m->heads[u->triangle]; i != UINT32_MAX; i = g->targets[i].next) {
        alb_geodesic_target *target = &g->targets[i];
        const alb_vector at = alb_sub(target->at, a), end = alb_sub(target->end, a);
        const double px = alb_dot(at, e), py = fmax(alb_dot(at, up), 0), tall = w->y + py;
        const double ray = tall > 0 ? w->x + (px - w->x) * w->y / tall : px, slack = 1e-9 * u->length;
        const double length = w->sigma + norm(px - w->x, tall);
        if (ray < w->b0 - slack || ray > w->b1 + slack || !(length < target->to_at_mm))
            continue;
        target->to_at_mm = length;
        target->distance_mm = w->sigma + norm(alb_dot(end, e) - w->x, alb_dot(end, up) + w->y);
    }
}

static void start(geodesic *g, size_t count, uint32_t triangle, alb_vector from)
{
    alb_geodesic_memory *m = g->memory;
    const alb_geodesic_surface *s = g->surface;
    if (++m->stamp == 0) {
        memset(m->stamps, 0, s->count * sizeof *m->stamps);
        memset(m->vertex_stamps, 0, s->vertex_count * sizeof *m->vertex_stamps);
        m->stamp = 1;
    }
    m->heap.count = 0;
    m->free_count = 0, m->used = 0;
    for (uint32_t i = 0; i < count; i++) {
        alb_geodesic_target *t = &g->targets[i];
        const bool here = t->triangle == triangle;
        t->to_at_mm = here ? alb_length(alb_sub(t->at, from)) : (double)INFINITY;
        t->distance_mm = here ? alb_length(alb_sub(t->end, from)) : (double)INFINITY;
        t->next = m->stamps[t->triangle] == m->stamp ? m->heads[t->triangle] : UINT32_MAX;
        m->heads[t->triangle] = i;
        m->stamps[t->triangle] = m->stamp;
    }
    for (int k = 0; k < 3; k++)
        reach_vertex(g, s->corners[triangle][k], alb_length(alb_sub(s->triangles[triangle][k], from)));
    for (int k = 0; k < 3; k++)
        emit(g, triangle, k, from, 0);
}

// The furthest group so far: nothing beyond it is worth a look.
static double furthest(const alb_geodesic_target *targets, size_t count, size_t alternatives)
{
    double most = 0;
    for (size_t i = 0; i < count; i += alternatives) {
        double nearest = (double)INFINITY;
        for (size_t k = 0; k < alternatives; k++)
            nearest = targets[i + k].to_at_mm < nearest ? targets[i + k].to_at_mm : nearest;
        most = nearest > most ? nearest : most;
    }
    return most;
}

void alb_geodesic_run(alb_geodesic_target *targets, size_t count, size_t alternatives, alb_geodesic_memory *memory,
                      const alb_geodesic_surface *surface, uint32_t triangle, alb_vector from, double reach_mm)
{
    geodesic g = {targets, memory, surface, reach_mm};
    double limit = (double)INFINITY;
    start(&g, count, triangle, from);
    for (size_t step = 0; memory->heap.count > 0; step++) {
        const alb_heap_entry top = alb_heap_pop(&memory->heap);
        if (step % LOOK_AGAIN == 0)
            limit = fmin(reach_mm, furthest(targets, count, alternatives));
        if (top.key > limit)
            break;
        if (top.id >= WINDOWS) {
            if (top.key <= distance_of(memory, top.id - WINDOWS))
                turn(&g, top.id - WINDOWS);
            continue;
        }
        const window w = memory->windows[top.id];
        memory->free[memory->free_count++] = top.id;
        const unfolded u = unfold(surface, w.place);
        const offer again = {.length = u.length,
                             .b0 = w.b0,
                             .b1 = w.b1,
                             .x = w.x,
                             .y = w.y,
                             .sigma = w.sigma,
                             .third = u.first,
                             .third_x = -1e30};
        if (is_beaten(memory, &again, u.first, u.second))
            continue;
        shine(&g, &u, &w);
        carry(&g, &u, &w);
    }
    for (size_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            alb_geodesic_target *t = &targets[i];
            const alb_vector corner = surface->triangles[t->triangle][k];
            const double to = distance_of(memory, surface->corners[t->triangle][k]),
                         length = to + alb_length(alb_sub(t->at, corner));
            if (!(length < t->to_at_mm))
                continue;
            t->to_at_mm = length;
            t->distance_mm = to + alb_length(alb_sub(t->end, corner));
        }
}
