// Spots of a grid: the connected patches of pixels above a level, at the first of falling levels (a fifth lower each)
// at which there are as many as spots. Pixels that were not measured count as bright: saturated cores. A spot is where
// the centroid of its patch is. Stops being true where a spot is dimmer than what lies between two others.
#include "fit/site.h"
#include "base/memory.h"
#include <math.h>
#include <stdlib.h>

enum { LEVELS = 40, PATCH_LEAST = 4 };

typedef struct patches {
    const alb_channel *channel;
    double level;
    unsigned char *seen;
    size_t *stack;
    int found, room; // room: sites that fit
    alb_site *sites;
} patches;

static bool is_bright(const patches *p, size_t i)
{
    const double value = p->channel->value[i];
    return !p->seen[i] && isfinite(p->channel->face->x_mm[i]) && (isnan(value) || value > p->level);
}

// The patch that holds pixel `start`, four-connected.
static void take_patch(patches *p, size_t start)
{
    const alb_face *face = p->channel->face;
    const size_t width = (size_t)face->width, height = (size_t)face->height;
    double x = 0, y = 0;
    size_t depth = 0, count = 0;
    p->stack[depth++] = start;
    p->seen[start] = 1;
    while (depth) {
        const size_t i = p->stack[--depth], column = i % width, row = i / width;
        const size_t next[4] = {column ? i - 1 : i, column + 1 < width ? i + 1 : i, row ? i - width : i,
                                row + 1 < height ? i + width : i};
        x += face->x_mm[i], y += face->y_mm[i], count++;
        for (int k = 0; k < 4; k++)
            if (is_bright(p, next[k])) {
                p->seen[next[k]] = 1;
                p->stack[depth++] = next[k];
            }
    }
    if (count < PATCH_LEAST)
        return;
    if (p->found < p->room)
        p->sites[p->found] = (alb_site){x / (double)count, y / (double)count, 0};
    p->found++;
}

static int by_y(const void *a, const void *b)
{
    const double p = ((const alb_site *)a)->y_mm, q = ((const alb_site *)b)->y_mm;
    return (p < q) - (p > q);
}

static int by_x(const void *a, const void *b)
{
    const double p = ((const alb_site *)a)->x_mm, q = ((const alb_site *)b)->x_mm;
    return (p > q) - (p < q);
}

static bool sort_sites(alb_site *sites, int columns, int rows, bool mirrored, const char *name, alb_error *error)
{
    qsort(sites, (size_t)(columns * rows), sizeof *sites, by_y);
    for (int row = 0; row < rows; row++) {
        alb_site *line = sites + row * columns;
        if (row && !(line[-1].y_mm - line->y_mm > line->y_mm - line[columns - 1].y_mm))
            return alb_fail(error, ALB_BAD_DATA,
                            "%s: the rows of the grid cannot be told apart; turn projector or board so that the grid "
                            "runs along the board",
                            name);
    }
    for (int row = 0; row < rows; row++) {
        alb_site *line = sites + row * columns;
        qsort(line, (size_t)columns, sizeof *line, by_x);
        for (int c = 0; mirrored && c < columns / 2; c++) {
            const alb_site kept = line[c];
            line[c] = line[columns - 1 - c];
            line[columns - 1 - c] = kept;
        }
    }
    return true;
}

// Half the distance to the nearest other spot or, for a lone one, half the extent of the face.
static void find_reach(alb_site *sites, int count, const alb_face *face)
{
    double extent = 0;
    for (size_t i = 0; count == 1 && i < (size_t)face->width * (size_t)face->height; i++)
        extent = fmax(extent, hypot(face->x_mm[i] - sites->x_mm, face->y_mm[i] - sites->y_mm));
    for (int i = 0; i < count; i++) {
        sites[i].reach_mm = count == 1 ? extent : (double)INFINITY;
        for (int j = 0; j < count; j++)
            if (j != i)
                sites[i].reach_mm =
                    fmin(sites[i].reach_mm, 0.5 * hypot(sites[i].x_mm - sites[j].x_mm, sites[i].y_mm - sites[j].y_mm));
    }
}

bool alb_sites_find(alb_site *sites, int columns, int rows, bool mirrored, const alb_channel *channel, alb_error *error)
{
    const size_t size = (size_t)channel->face->width * (size_t)channel->face->height;
    patches p = {.channel = channel, .room = columns * rows, .sites = sites};
    double peak = 0;
    int nearest = 0;
    bool ok = false;
    for (size_t i = 0; i < size; i++)
        peak = channel->value[i] > peak ? channel->value[i] : peak;
    p.seen = alb_allocate(size, 1, error);
    p.stack = alb_allocate(size, sizeof *p.stack, error);
    if (!p.seen || !p.stack)
        goto done;
    p.level = peak;
    for (int k = 0; k < LEVELS && nearest != p.room; k++) {
        p.level *= 0.8;
        p.found = 0;
        for (size_t i = 0; i < size; i++)
            p.seen[i] = 0;
        for (size_t i = 0; i < size; i++)
            if (is_bright(&p, i))
                take_patch(&p, i);
        if (abs(p.found - p.room) < abs(nearest - p.room))
            nearest = p.found;
    }
    ok = nearest == p.room || alb_fail(error, ALB_BAD_DATA, "%s: %d spots of the grid's %d x %d are seen",
                                       channel->name, nearest, columns, rows);
    ok = ok && sort_sites(sites, columns, rows, mirrored, channel->name, error);
    if (ok)
        find_reach(sites, p.room, channel->face);
done:
    free(p.seen);
    free(p.stack);
    return ok;
}

// Least squares: theta = atan2(sum k x s, sum k . s) about the centroids.
void alb_sites_align(alb_site *seen, const alb_site *known, int count)
{
    double from[2] = {0}, to[2] = {0}, dot = 0, cross = 0;
    for (int i = 0; i < count; i++) {
        from[0] -= known[i].x_mm / count, from[1] += known[i].y_mm / count;
        to[0] += seen[i].x_mm / count, to[1] += seen[i].y_mm / count;
    }
    for (int i = 0; i < count; i++) {
        const double kx = -known[i].x_mm - from[0], ky = known[i].y_mm - from[1];
        const double sx = seen[i].x_mm - to[0], sy = seen[i].y_mm - to[1];
        dot += kx * sx + ky * sy;
        cross += kx * sy - ky * sx;
    }
    const double angle = atan2(cross, dot), c = cos(angle), s = sin(angle);
    for (int i = 0; i < count; i++) {
        const double kx = -known[i].x_mm - from[0], ky = known[i].y_mm - from[1];
        seen[i] = (alb_site){to[0] + c * kx - s * ky, to[1] + s * kx + c * ky, known[i].reach_mm};
    }
}

// The rows and columns of the face that hold its pixels within the reach of the site: first column and row, last column
// and row.
static void bounding_box(int box[4], const alb_site *site, const alb_face *face)
{
    box[0] = face->width, box[1] = face->height, box[2] = box[3] = -1;
    for (int y = 0; y < face->height; y++)
        for (int x = 0; x < face->width; x++) {
            const size_t i = (size_t)y * (size_t)face->width + (size_t)x;
            if (hypot(face->x_mm[i] - site->x_mm, face->y_mm[i] - site->y_mm) <= site->reach_mm) {
                box[0] = x < box[0] ? x : box[0], box[2] = x > box[2] ? x : box[2];
                box[1] = y < box[1] ? y : box[1], box[3] = y > box[3] ? y : box[3];
            }
        }
}

bool alb_site_cut(alb_face *face, double **value, double **variance, const alb_site *site, double factor,
                  const alb_channel *channel, alb_error *error)
{
    const alb_face *whole = channel->face;
    int box[4];
    *face = (alb_face){0};
    *value = *variance = NULL;
    bounding_box(box, site, whole);
    const int width = box[2] - box[0] + 1, height = box[3] - box[1] + 1;
    if (width <= 0 || height <= 0)
        return alb_fail(error, ALB_BAD_DATA, "%s: a spot of the grid lies outside the picture", channel->name);
    const size_t count = (size_t)width * (size_t)height;
    if (!alb_face_flat(face, width, height, 1, error) || !(*value = alb_allocate(count, sizeof(double), error)) ||
        (channel->variance && !(*variance = alb_allocate(count, sizeof(double), error)))) {
        alb_face_free(face);
        free(*value);
        *value = NULL;
        return false;
    }
    for (size_t k = 0; k < count; k++) {
        const size_t x = k % (size_t)width + (size_t)box[0], y = k / (size_t)width + (size_t)box[1];
        const size_t i = y * (size_t)whole->width + x;
        face->x_mm[k] = whole->x_mm[i], face->y_mm[k] = whole->y_mm[i];
        face->area_mm2[k] = whole->area_mm2[i], face->cosine[k] = whole->cosine[i];
        const bool within = hypot(face->x_mm[k] - site->x_mm, face->y_mm[k] - site->y_mm) <= site->reach_mm;
        (*value)[k] = within ? factor * channel->value[i] : (double)NAN;
        if (*variance)
            (*variance)[k] = factor * factor * channel->variance[i];
    }
    return true;
}
