// T_i = integral of Y_i(d) max(0, n.d) V(d), V what the body leaves visible: the open half, known in closed form, less
// what N rays find hidden, spread as the cosine, one in each of N cells,
//     T_i = A_l Y_i(n) - pi / N sum over rays q that meet the body of Y_i(d_q)      A_l: the clamped cosine's
// so that only the hidden part has an error, which is random. A body that moves takes its vectors along, turned.
// Stops being true: beyond order ALB_SH_ORDER_MAX, shadows finer than some 20 degrees.
#include "render/shadow_transport.h"
#include "base/memory.h"
#include "base/progress.h"
#include "base/random.h"
#include "render/sh_rotate.h"
#include "render/sh_zonal.h"
#include "render/shadow_cut.h"
#include "render/tracer.h"
#include <omp.h>
#include <stdlib.h>
#include <string.h>

enum { STRATA = 24, RAYS = STRATA * STRATA, VALUES = ALB_SH_COUNT_MAX, SHARE = 1024 };

static void number_rows(alb_shadow_transport *t, const alb_scene *scene)
{
    for (size_t v = 0; v < t->vertex_count; v++)
        t->rows[v] = ALB_TRANSPORT_NONE;
    for (size_t o = 0; o < scene->object_count; o++)
        for (size_t v = 0; t->of_body[o] && v < scene->objects[o].vertex_count; v++)
            t->rows[scene->objects[o].first_vertex + v] = (uint32_t)t->row_count++;
}

static bool collect_casters(alb_mesh *casters, const alb_shadow_transport *t, const alb_scene *scene, alb_error *error)
{
    bool chosen[ALB_OBJECTS_MAX];
    for (size_t o = 0; o < scene->object_count; o++)
        chosen[o] = t->of_body[o] && !scene->objects[o].receives_only;
    return alb_shadow_cut(casters, NULL, scene, chosen, error);
}

// Three vertices that fix the body's motion: the first, the one farthest from it, the one farthest from their line.
static void find_corners(alb_shadow_transport *t)
{
    uint32_t *const c = t->corners;
    double best = -1;
    for (uint32_t v = 0; v < t->vertex_count; v++)
        if (t->rows[v] == 0)
            c[0] = c[1] = c[2] = v;
    for (int k = 1; k < 3; k++, best = -1)
        for (uint32_t v = 0; v < t->vertex_count; v++) {
            const alb_vector to = alb_sub(t->rest[v], t->rest[c[0]]);
            const double far = alb_length(k == 1 ? to : alb_cross(to, alb_unit(alb_sub(t->rest[c[1]], t->rest[c[0]]))));
            if (t->rows[v] != ALB_TRANSPORT_NONE && far > best)
                best = far, c[k] = v;
        }
}

typedef struct rays {
    float directions[3 * RAYS], basis[VALUES * RAYS];
} rays;

// The vector of one vertex from its rays; `far_mm` is beyond the body.
static void find_vector(float *out, rays *w, const alb_tracer *tracer, alb_vector point, alb_vector normal,
                        double far_mm, size_t row)
{
    alb_random random = alb_random_at(1, 0x7a4b, row);
    const alb_vector from = alb_add(point, alb_times(256 * tracer->slack_mm, normal));
    alb_vector x, y;
    size_t hidden = 0;
    double zonal[ALB_SH_ORDER_MAX], open[VALUES];
    alb_tangents(&x, &y, normal);
    for (int q = 0; q < RAYS; q++) {
        const double u = (q % STRATA + alb_random_uniform(&random)) / STRATA, r = sqrt(u);
        const double turn = 2 * M_PI * (q / STRATA + alb_random_uniform(&random)) / STRATA;
        const alb_vector flat = alb_add(alb_times(r * cos(turn), x), alb_times(r * sin(turn), y)),
                         d = alb_add(flat, alb_times(sqrt(1 - u), normal));
        if (!alb_tracer_blocked(tracer, from, alb_add(from, alb_times(far_mm, d))))
            continue;
        w->directions[hidden] = (float)d.x;
        w->directions[RAYS + hidden] = (float)d.y;
        w->directions[2 * RAYS + hidden++] = (float)d.z;
    }
    alb_sh_evaluate_batch(w->basis, ALB_SH_ORDER_MAX, w->directions, RAYS, hidden);
    alb_sh_zonal_cosine(zonal, ALB_SH_ORDER_MAX);
    alb_sh_zonal_turn(open, zonal, ALB_SH_ORDER_MAX, normal);
    for (size_t i = 0; i < VALUES; i++) {
        double sum = 0;
        for (size_t q = 0; q < hidden; q++)
            sum += (double)w->basis[i * RAYS + q];
        out[i] = (float)(open[i] - M_PI / RAYS * sum);
    }
}

static bool find_vectors(alb_shadow_transport *t, const alb_tracer *tracer, const alb_vector *normals, alb_error *error)
{
    const int threads = omp_get_max_threads();
    rays *const works = alb_allocate((size_t)threads, sizeof *works, error);
    const double far_mm = 4 * alb_length(alb_sub(t->rest[t->corners[1]], t->rest[t->corners[0]]));
    alb_progress progress;
    if (!works)
        return false;
    alb_progress_begin(&progress, "transport", (long)t->vertex_count);
    for (size_t first = 0; first < t->vertex_count; first += SHARE) {
        const size_t end = first + SHARE < t->vertex_count ? first + SHARE : t->vertex_count;
#pragma omp parallel for schedule(dynamic, 16) num_threads(threads)
        for (size_t v = first; v < end; v++)
            if (t->rows[v] != ALB_TRANSPORT_NONE)
                find_vector(t->vectors[t->rows[v]], &works[omp_get_thread_num()], tracer, t->rest[v], normals[v],
                            far_mm, t->rows[v]);
        alb_progress_at(&progress, (long)end);
    }
    alb_progress_end(&progress);
    free(works);
    return true;
}

bool alb_shadow_transport_create(alb_shadow_transport *t, const alb_scene *scene, const bool *of_body,
                                 const alb_vector *normals, alb_error *error)
{
    alb_mesh casters = {0};
    alb_tracer tracer = {0};
    const size_t n = scene->mesh.vertex_count;
    *t = (alb_shadow_transport){.vertex_count = n, .quaternion = {0, 0, 0, 1}};
    bool ok = (t->of_body = alb_allocate(scene->object_count, sizeof *t->of_body, error)) &&
              (t->rows = alb_allocate(n, sizeof *t->rows, error)) &&
              (t->rest = alb_allocate(n, sizeof *t->rest, error));
    if (ok) {
        memcpy(t->of_body, of_body, scene->object_count * sizeof *of_body);
        memcpy(t->rest, scene->mesh.vertices, n * sizeof *t->rest);
        number_rows(t, scene);
        find_corners(t);
    }
    ok = ok && (t->vectors = alb_allocate(t->row_count, sizeof *t->vectors, error)) &&
         (!t->row_count || (collect_casters(&casters, t, scene, error) && alb_tracer_create(&tracer, &casters, error) &&
                            find_vectors(t, &tracer, normals, error) && alb_shadow_transport_scatter(t, scene, error)));
    alb_tracer_free(&tracer);
    alb_mesh_free(&casters);
    if (!ok)
        alb_shadow_transport_free(t);
    return ok;
}

void alb_shadow_transport_free(alb_shadow_transport *t)
{
    free(t->of_body);
    free(t->rows);
    free(t->rest);
    free(t->vectors);
    free(t->matrix_of);
    free(t->matrices);
    *t = (alb_shadow_transport){0};
}

// Columns: the line of the first two corners, its height, the normal of all three.
static void find_frame(double frame[3][3], const uint32_t corners[3], const alb_vector *vertices)
{
    const alb_vector a = vertices[corners[0]], x = alb_unit(alb_sub(vertices[corners[1]], a)),
                     z = alb_unit(alb_cross(x, alb_sub(vertices[corners[2]], a))), y = alb_cross(z, x);
    const alb_vector columns[3] = {x, y, z};
    for (int k = 0; k < 3; k++)
        frame[0][k] = columns[k].x, frame[1][k] = columns[k].y, frame[2][k] = columns[k].z;
}

// q = x, y, z, w of a rotation, from its largest component on (Shepperd 1978).
static void to_quaternion(float q[4], const double r[3][3])
{
    const double trace = r[0][0] + r[1][1] + r[2][2], of[4] = {r[0][0], r[1][1], r[2][2], trace};
    int k = 3;
    for (int i = 0; i < 3; i++)
        k = of[i] > of[k] ? i : k;
    const int a = (k + 1) % 3, b = (k + 2) % 3;
    double p[4];
    if (k == 3) {
        p[3] = 1 + trace;
        for (int i = 0; i < 3; i++)
            p[i] = r[(i + 2) % 3][(i + 1) % 3] - r[(i + 1) % 3][(i + 2) % 3];
    } else {
        p[k] = 1 + 2 * r[k][k] - trace;
        p[a] = r[a][k] + r[k][a], p[b] = r[b][k] + r[k][b];
        p[3] = r[b][a] - r[a][b];
    }
    const double length = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3]);
    for (int i = 0; i < 4; i++)
        q[i] = (float)(p[i] / length);
}

bool alb_shadow_transport_follow(alb_shadow_transport *t, const alb_vector *vertices, alb_error *error)
{
    double then[3][3], now[3][3];
    alb_transform motion = {0};
    if (!t->row_count)
        return true;
    find_frame(then, t->corners, t->rest);
    find_frame(now, t->corners, vertices);
    for (int i = 0; i < 9; i++)
        for (int k = 0; k < 3; k++)
            motion.rotation[i / 3][i % 3] += now[i / 3][k] * then[i % 3][k];
    const alb_vector from = t->rest[t->corners[0]], to = vertices[t->corners[0]];
    motion.translation = alb_sub(to, alb_rotate(&motion, from));
    const double extent = alb_length(alb_sub(t->rest[t->corners[1]], from));
    for (size_t v = 0; v < t->vertex_count; v++) {
        const double off = alb_length(alb_sub(alb_apply(&motion, t->rest[v]), vertices[v]));
        if (t->rows[v] != ALB_TRANSPORT_NONE && !(off <= 1e-4 * extent))
            return alb_fail(error, ALB_BAD_DATA,
                            "vertex %zu of the rigid objects lies %.3g mm off where the others' motion takes it: they "
                            "must move as one body; leave \"rigid\" out for what moves otherwise",
                            v, off);
    }
    to_quaternion(t->quaternion, (const double(*)[3])motion.rotation);
    return true;
}

bool alb_shadow_transport_lobes(float *lobes, bool *in_body, const alb_shadow_transport *t, int colour, size_t first,
                                size_t count)
{
    enum { BLOCK = ALB_SHADOW_BLOCK };
    const float *q = t->quaternion;
    bool coloured = false;
    for (size_t r = 0; r < count; r++) {
        const uint32_t row = t->rows[first + r];
        if (!(in_body[r] = row != ALB_TRANSPORT_NONE))
            continue;
        const bool translucent = t->matrix_of[row] != ALB_TRANSPORT_NONE;
        const float *vector = translucent ? t->matrices[t->matrix_of[row]][colour] : t->vectors[row];
        for (size_t i = 0; i < VALUES; i++)
            lobes[i * BLOCK + r] = vector[i];
        coloured |= translucent;
    }
    if (fabsf(q[0]) + fabsf(q[1]) + fabsf(q[2]) > 1e-7F) {
        float turned[VALUES * BLOCK], turns[4 * BLOCK];
        for (size_t i = 0; i < 4 * BLOCK; i++)
            turns[i] = q[i / BLOCK];
        alb_sh_rotate_batch(turned, lobes, ALB_SH_ORDER_MAX, turns, BLOCK, count);
        for (size_t i = 0; i < VALUES; i++)
            for (size_t r = 0; r < count; r++)
                lobes[i * BLOCK + r] = in_body[r] ? turned[i * BLOCK + r] : lobes[i * BLOCK + r];
    }
    return coloured;
}
