// The pieces are sorted along the widest of nine axes (place in radii of their bounds, half the normal, colour over the
// brightest) and cut where half of the area is reached, and so on: 32 ranges are groups, 128 the few samples, 2048 the
// many. Sheets that shine on both sides are thus cut between their sides, and a sample's vector area, the sum of its
// pieces', does not cancel; of a ball the few have 1 % less than the surface.
#include "render/shadow_emitter_cut.h"
#include "base/memory.h"
#include <stdlib.h>

enum {
    GROUPS = ALB_SHADOW_EMITTER_GROUPS,
    FEW = ALB_SHADOW_EMITTER_FEW,
    MANY = ALB_SHADOW_EMITTER_MANY,
    AXES = 9,
    DIVISIONS_MAX = 5
};

typedef struct place {
    alb_shadow_piece of;
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

static void set_axes(place *places, size_t count, const alb_vector *vertices, double most)
{
    alb_vector middle = {0};
    double radius_mm = 0;
    for (size_t i = 0; i < count; i++)
        middle = alb_add(middle, alb_times(1 / (double)count, alb_shadow_piece_at(&places[i].of, vertices)));
    for (size_t i = 0; i < count; i++)
        radius_mm = fmax(radius_mm, alb_length(alb_sub(alb_shadow_piece_at(&places[i].of, vertices), middle)));
    for (size_t i = 0; i < count; i++) {
        place *p = &places[i];
        const alb_vector area = alb_shadow_piece_area(&p->of, vertices), normal = alb_unit(area),
                         at = alb_times(radius_mm > 0 ? 1 / radius_mm : 0,
                                        alb_sub(alb_shadow_piece_at(&p->of, vertices), middle));
        const double axes[AXES] = {at.x, at.y, at.z, 0.5 * normal.x, 0.5 * normal.y, 0.5 * normal.z};
        p->area_mm2 = alb_length(area);
        for (int k = 0; k < AXES; k++)
            p->axes[k] = k < 6 ? axes[k] : (double)p->of.radiance[k - 6] / most;
    }
}

bool alb_shadow_emitter_cut(alb_shadow_emitter *e, const alb_mesh *mesh, const float (*face_radiance)[3],
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
