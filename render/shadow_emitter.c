// A sample is the sum of its pieces' vector areas, in the mean place and of the mean radiance by area; the few are sums
// of the many, groups of the few.
//
// What a light hides of itself: from a piece of each of the few rays go towards the nodes of a grid of directions
// before it, of each group the share that gets away is kept. Parallel rays: right for receivers that see all of a group
// in one direction. Stops being true where a light deforms so far that what lay together in its first frame no longer
// does.
#include "render/shadow_emitter.h"
#include "base/memory.h"
#include "render/shadow_emitter_cut.h"
#include <stdlib.h>
#include <string.h>

enum { GROUPS = ALB_SHADOW_EMITTER_GROUPS, MANY = ALB_SHADOW_EMITTER_MANY };
static const alb_shadow_grid grid = {ALB_SHADOW_EMITTER_CELLS};

bool alb_shadow_emitter_create(alb_shadow_emitter *emitter, const alb_mesh *mesh, const float (*face_radiance)[3],
                               alb_error *error)
{
    alb_shadow_emitter *e = emitter;
    *e = (alb_shadow_emitter){.vertex_count = mesh->vertex_count};
    const size_t nodes = (size_t)alb_shadow_grid_count(grid);
    if ((e->first_pieces = alb_allocate(MANY + 1, sizeof *e->first_pieces, error)) &&
        (e->many = alb_allocate(MANY, sizeof *e->many, error)) &&
        (e->seen = alb_allocate(GROUPS * nodes, sizeof *e->seen, error)) &&
        (e->vertices = alb_allocate(mesh->vertex_count, sizeof *e->vertices, error)) &&
        alb_shadow_emitter_cut(e, mesh, face_radiance, error) && alb_tracer_create_moving(&e->tracer, mesh, error))
        return true;
    alb_shadow_emitter_free(e);
    return false;
}

void alb_shadow_emitter_free(alb_shadow_emitter *emitter)
{
    free(emitter->pieces);
    free(emitter->first_pieces);
    free(emitter->many);
    free(emitter->seen);
    free(emitter->vertices);
    alb_tracer_free(&emitter->tracer);
    *emitter = (alb_shadow_emitter){0};
}

static void set(float out[3], alb_vector a)
{
    out[0] = (float)a.x;
    out[1] = (float)a.y;
    out[2] = (float)a.z;
}

// Sums, and means by area.
typedef struct sum {
    alb_vector at, area;
    double radiance[3], weight;
} sum;

static void add(sum *s, double weight, alb_vector at, alb_vector area, const float radiance[3])
{
    s->weight += weight;
    s->at = alb_add(s->at, alb_times(weight, at));
    s->area = alb_add(s->area, area);
    for (int c = 0; c < 3; c++)
        s->radiance[c] += weight * (double)radiance[c];
}

static void add_sample(sum *s, const alb_shadow_emitter_sample *of)
{
    add(s, (double)of->size, (alb_vector){(double)of->at[0], (double)of->at[1], (double)of->at[2]},
        (alb_vector){(double)of->area[0], (double)of->area[1], (double)of->area[2]}, of->radiance);
}

static void finish(alb_shadow_emitter_sample *out, const sum *s)
{
    const double share = s->weight > 0 ? 1 / s->weight : 0;
    set(out->at, alb_times(share, s->at));
    set(out->area, s->area);
    set(out->radiance, alb_times(share, (alb_vector){s->radiance[0], s->radiance[1], s->radiance[2]}));
    out->size = (float)(alb_length(s->area) / M_PI);
}

static void place_samples(alb_shadow_emitter *e, const alb_vector *vertices, const alb_shadow_sphere *sphere)
{
    const double scale = 1 / sphere->radius_mm;
    for (size_t m = 0; m < e->many_count; m++) {
        sum s = {0};
        for (size_t i = e->first_pieces[m]; i < e->first_pieces[m + 1]; i++) {
            const alb_vector area = alb_times(scale * scale, alb_shadow_piece_area(&e->pieces[i], vertices)),
                             at = alb_times(scale,
                                            alb_sub(alb_shadow_piece_at(&e->pieces[i], vertices), sphere->centre_mm));
            add(&s, alb_length(area), at, area, e->pieces[i].radiance);
        }
        finish(&e->many[m], &s);
    }
    for (size_t g = 0; g < e->group_count; g++) {
        sum all = {0};
        for (size_t f = e->first_few[g]; f < e->first_few[g + 1]; f++) {
            sum s = {0};
            for (size_t m = e->first_many[f]; m < e->first_many[f + 1]; m++)
                add_sample(&s, &e->many[m]);
            finish(&e->few[f], &s);
            add_sample(&all, &e->few[f]);
        }
        const alb_vector middle = alb_times(all.weight > 0 ? 1 / all.weight : 0, all.at);
        set(e->middles[g], middle);
        e->groups[g].centre_mm = alb_add(sphere->centre_mm, alb_times(sphere->radius_mm, middle));
        e->groups[g].radius_mm = sphere->radius_mm * sqrt(all.weight);
    }
}

// From one piece of each of the group's samples.
static float share_seen(const alb_shadow_emitter *e, size_t group, alb_vector d, double far_mm)
{
    const double off_mm = 256 * e->tracer.slack_mm;
    int before = 0, seen = 0;
    for (size_t f = e->first_few[group]; f < e->first_few[group + 1]; f++) {
        const alb_shadow_piece *p = &e->pieces[e->first_pieces[(e->first_many[f] + e->first_many[f + 1]) / 2]];
        const alb_vector normal = alb_unit(alb_shadow_piece_area(p, e->vertices)),
                         from = alb_add(alb_shadow_piece_at(p, e->vertices), alb_times(off_mm, normal));
        if (!(alb_dot(normal, d) > 0))
            continue;
        before++;
        seen += !alb_tracer_blocked(&e->tracer, from, alb_add(from, alb_times(far_mm, d)));
    }
    return before ? (float)seen / (float)before : 1;
}

static void find_seen(alb_shadow_emitter *e, double far_mm)
{
    const size_t nodes = (size_t)alb_shadow_grid_count(grid), count = nodes * e->group_count;
#pragma omp parallel for schedule(dynamic, 16)
    for (size_t i = 0; i < count; i++)
        e->seen[i] = share_seen(e, i / nodes, alb_shadow_grid_direction(grid, (int)(i % nodes)), far_mm);
    memset(e->hidden, 0, sizeof e->hidden);
    for (size_t i = 0; i < count; i++)
        e->hidden[i / nodes] |= e->seen[i] < 1;
}

bool alb_shadow_emitter_place(alb_shadow_emitter *emitter, const alb_vector *vertices, const alb_shadow_sphere *sphere,
                              alb_error *error)
{
    const size_t bytes = emitter->vertex_count * sizeof *vertices;
    place_samples(emitter, vertices, sphere);
    emitter->moved = memcmp(emitter->vertices, vertices, bytes) != 0;
    if (!emitter->moved)
        return true;
    memcpy(emitter->vertices, vertices, bytes);
    if (!alb_tracer_move(&emitter->tracer, vertices, emitter->vertex_count, error))
        return false;
    find_seen(emitter, 4 * sphere->radius_mm);
    return true;
}

float alb_shadow_emitter_seen(const alb_shadow_emitter *emitter, size_t group, alb_vector direction)
{
    if (!emitter->hidden[group])
        return 1;
    const float *seen = emitter->seen + group * (size_t)alb_shadow_grid_count(grid);
    const alb_shadow_place at = alb_shadow_grid_place(grid, direction);
    float share = 0;
    for (int k = 0; k < 4; k++)
        share += at.weights[k] * seen[at.nodes[k]];
    return share;
}
