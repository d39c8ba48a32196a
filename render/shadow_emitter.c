// The pieces are sorted along the widest of nine axes (place in radii of their bounds, half the normal, colour over the
// brightest) and cut where half of the area is reached, and so on: 16 ranges are groups, 128 the few samples, 2048 the
// many. Sheets that shine on both sides are thus cut between their sides, and a sample's vector area, the sum of its
// pieces', does not cancel; of a ball the few have 1 % less than the surface.
//
// What a light hides of itself: from a piece of each of the few rays go towards the nodes of a grid of directions
// before it, of each group the share that gets away is kept. Parallel rays: right for receivers that see all of a group
// in one direction. Stops being true where a light deforms so far that what lay together in its first frame no longer
// does.
#include "render/shadow_emitter.h"
#include "base/memory.h"
#include <stdlib.h>
#include <string.h>

enum {
    GROUPS = ALB_SHADOW_EMITTER_GROUPS,
    FEW = ALB_SHADOW_EMITTER_FEW,
    MANY = ALB_SHADOW_EMITTER_MANY,
    AXES = 9,
    DIVISIONS_MAX = 5
};
static const alb_shadow_grid grid = {ALB_SHADOW_EMITTER_CELLS};

typedef struct alb_shadow_piece {
    float weights[3], share, radiance[3]; // of the corners in its middle; of the face's area
    uint32_t corners[3];
} piece;

typedef struct place {
    piece of;
    double axes[AXES], area_mm2, at;
    size_t index;
} place;

static int by_place(const void *a, const void *b)
{
    const place *p = a, *q = b;
    return p->at != q->at ? (p->at > q->at) - (p->at < q->at) : (p->index > q->index) - (p->index < q->index);
}

static int widest(const place *places, size_t count)
{
    int best = 0;
    double width = -1;
    for (int k = 0; k < AXES; k++) {
        double low = INFINITY, high = -INFINITY;
        for (size_t i = 0; i < count; i++) {
            low = fmin(low, places[i].axes[k]);
            high = fmax(high, places[i].axes[k]);
        }
        if (high - low > width)
            width = high - low, best = k;
    }
    return best;
}

static size_t halve(place *places, size_t count)
{
    const int axis = widest(places, count);
    double all = 0, sum = 0;
    for (size_t i = 0; i < count; i++) {
        places[i].at = places[i].axes[axis];
        all += places[i].area_mm2;
    }
    qsort(places, count, sizeof *places, by_place);
    size_t cut = 1;
    for (sum = places[0].area_mm2; cut + 1 < count && sum + 0.5 * places[cut].area_mm2 < 0.5 * all; cut++)
        sum += places[cut].area_mm2;
    return cut;
}

static void divide(alb_shadow_emitter *e, place *places, size_t first, size_t count, int samples)
{
    if (samples == MANY / GROUPS || (count == 1 && samples > MANY / GROUPS))
        e->first_few[e->group_count++] = e->few_count;
    if (samples == MANY / FEW || (count == 1 && samples > MANY / FEW))
        e->first_many[e->few_count++] = e->many_count;
    if (samples == 1 || count == 1) {
        e->first_pieces[e->many_count++] = (uint32_t)first;
        return;
    }
    const size_t cut = halve(places + first, count);
    divide(e, places, first, cut, samples / 2);
    divide(e, places, first + cut, count - cut, samples / 2);
}

// The triangle's middle, or those of its quarters, and theirs.
static void add_pieces(place *places, size_t *count, const place *whole, const double corners[3][3], int divisions)
{
    if (!divisions) {
        place *p = &places[*count];
        *p = *whole;
        p->index = (*count)++;
        for (int k = 0; k < 3; k++)
            p->of.weights[k] = (float)((corners[0][k] + corners[1][k] + corners[2][k]) / 3);
        return;
    }
    double halves[3][3], part[3][3];
    for (int k = 0; k < 9; k++)
        halves[k / 3][k % 3] = 0.5 * (corners[(k / 3 + 1) % 3][k % 3] + corners[(k / 3 + 2) % 3][k % 3]);
    add_pieces(places, count, whole, (const double(*)[3])halves, divisions - 1);
    for (int corner = 0; corner < 3; corner++) {
        for (int k = 0; k < 9; k++)
            part[k / 3][k % 3] = k / 3 == corner ? corners[corner][k % 3] : halves[k / 3][k % 3];
        add_pieces(places, count, whole, (const double(*)[3])part, divisions - 1);
    }
}

static double brightest(const float (*face_radiance)[3], size_t count, size_t *shining)
{
    float most = 0;
    *shining = 0;
    for (size_t f = 0; f < count; f++) {
        const float *l = face_radiance[f], top = fmaxf(l[0], fmaxf(l[1], l[2]));
        *shining += top > 0;
        most = fmaxf(most, top);
    }
    return (double)most;
}

static alb_vector piece_at(const piece *p, const alb_vector *vertices)
{
    alb_vector at = {0};
    for (int k = 0; k < 3; k++)
        at = alb_add(at, alb_times((double)p->weights[k], vertices[p->corners[k]]));
    return at;
}

static alb_vector piece_area(const piece *p, const alb_vector *vertices)
{
    const alb_vector a = vertices[p->corners[0]];
    return alb_times(0.5 * (double)p->share,
                     alb_cross(alb_sub(vertices[p->corners[1]], a), alb_sub(vertices[p->corners[2]], a)));
}

static void set_axes(place *places, size_t count, const alb_vector *vertices, double most)
{
    alb_vector middle = {0};
    double radius_mm = 0;
    for (size_t i = 0; i < count; i++)
        middle = alb_add(middle, alb_times(1 / (double)count, piece_at(&places[i].of, vertices)));
    for (size_t i = 0; i < count; i++)
        radius_mm = fmax(radius_mm, alb_length(alb_sub(piece_at(&places[i].of, vertices), middle)));
    for (size_t i = 0; i < count; i++) {
        place *p = &places[i];
        const alb_vector area = piece_area(&p->of, vertices), normal = alb_unit(area),
                         at = alb_times(radius_mm > 0 ? 1 / radius_mm : 0, alb_sub(piece_at(&p->of, vertices), middle));
        const double axes[AXES] = {at.x, at.y, at.z, 0.5 * normal.x, 0.5 * normal.y, 0.5 * normal.z};
        p->area_mm2 = alb_length(area);
        for (int k = 0; k < AXES; k++)
            p->axes[k] = k < 6 ? axes[k] : (double)p->of.radiance[k - 6] / most;
    }
}

static bool create_samples(alb_shadow_emitter *e, const alb_mesh *mesh, const float (*face_radiance)[3],
                           alb_error *error)
{
    static const double whole[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    size_t shining, parts = 1, count = 0;
    const double most = brightest(face_radiance, mesh->face_count, &shining);
    int divisions = 0;
    for (; shining * parts < MANY && divisions < DIVISIONS_MAX; divisions++)
        parts *= 4;
    place *places = alb_allocate(shining * parts, sizeof *places, error);
    const bool ok = places && (e->pieces = alb_allocate(shining * parts, sizeof *e->pieces, error));
    for (size_t f = 0; f < (ok ? mesh->face_count : 0); f++) {
        const float *l = face_radiance[f];
        const uint32_t *v = mesh->faces[f];
        const place one = {
            .of = {.share = 1 / (float)parts, .radiance = {l[0], l[1], l[2]}, .corners = {v[0], v[1], v[2]}}};
        if (fmaxf(l[0], fmaxf(l[1], l[2])) > 0)
            add_pieces(places, &count, &one, whole, divisions);
    }
    if (count) {
        set_axes(places, count, mesh->vertices, most);
        divide(e, places, 0, count, MANY);
        e->first_pieces[e->many_count] = (uint32_t)count;
    }
    e->piece_count = count;
    e->first_many[e->few_count] = e->many_count;
    e->first_few[e->group_count] = e->few_count;
    for (size_t i = 0; i < count; i++)
        e->pieces[i] = places[i].of;
    free(places);
    return ok;
}

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
        create_samples(e, mesh, face_radiance, error) && alb_tracer_create_moving(&e->tracer, mesh, error))
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
            const alb_vector area = alb_times(scale * scale, piece_area(&e->pieces[i], vertices)),
                             at = alb_times(scale, alb_sub(piece_at(&e->pieces[i], vertices), sphere->centre_mm));
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
        const piece *p = &e->pieces[e->first_pieces[(e->first_many[f] + e->first_many[f + 1]) / 2]];
        const alb_vector normal = alb_unit(piece_area(p, e->vertices)),
                         from = alb_add(piece_at(p, e->vertices), alb_times(off_mm, normal));
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
