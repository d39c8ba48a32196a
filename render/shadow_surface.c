// At a probe with normal n, N directions spread as the cosine over its hemisphere, the same in every probe's frame
// (heights sqrt(1 - (q + 1/2) / N), each turned on by the golden angle):
//     D_i = integral of Y_i(d) max(0, n.d) O(d)  =  pi / N sum over rays q that meet the object of Y_i(d_q)
// Vertices take D from the probes near them (shadow_probes.h). A probe whose rays are all blocked lies inside another
// part of the object, where nothing is seen of it; vertices around, which may be outside, leave it out. Stops being
// true where what is hidden changes between neighbouring probes.
#include "render/shadow_surface.h"
#include "base/memory.h"
#include "render/sh_rotate.h"
#include <stdlib.h>
#include <string.h>

enum { RAYS = 32, VALUES = ALB_SHADOW_VALUES, NEIGHBOURS = ALB_SHADOW_PROBE_NEIGHBOURS };

bool alb_shadow_surface_create(alb_shadow_surface *s, const alb_mesh *mesh, const alb_vector *normals, size_t probes,
                               alb_error *error)
{
    *s = (alb_shadow_surface){0};
    if (alb_mesh_append(&s->mesh, mesh, 1, (alb_vector){0}, error) &&
        alb_shadow_probes_create(&s->probes, mesh, normals, probes, error) &&
        (s->hidden = alb_allocate(mesh->vertex_count, sizeof *s->hidden, error)) &&
        alb_tracer_create_moving(&s->tracer, &s->mesh, error) &&
        (s->seen = alb_allocate(VALUES * s->probes.count, sizeof *s->seen, error)) &&
        (s->axes = alb_allocate(3 * s->probes.count, sizeof *s->axes, error)) &&
        (s->buried = alb_allocate(s->probes.count, sizeof *s->buried, error)))
        return true;
    alb_shadow_surface_free(s);
    return false;
}

void alb_shadow_surface_free(alb_shadow_surface *s)
{
    alb_mesh_free(&s->mesh);
    alb_tracer_free(&s->tracer);
    alb_shadow_probes_free(&s->probes);
    free(s->hidden);
    free(s->seen);
    free(s->axes);
    free(s->buried);
    *s = (alb_shadow_surface){0};
}

typedef struct rays {
    alb_vector directions[RAYS];
    float basis[RAYS][VALUES]; // times pi / N
} rays;

static void set_rays(rays *r)
{
    double basis[VALUES];
    for (int q = 0; q < RAYS; q++) {
        const double u = (q + 0.5) / RAYS, turn = M_PI * (3 - sqrt(5)) * q;
        r->directions[q] = (alb_vector){sqrt(u) * cos(turn), sqrt(u) * sin(turn), sqrt(1 - u)};
        alb_sh_evaluate(basis, ALB_SHADOW_ORDER, r->directions[q]);
        for (int i = 0; i < VALUES; i++)
            r->basis[q][i] = (float)(M_PI / RAYS * basis[i]);
    }
}

static void look(alb_shadow_surface *s, size_t p, const rays *r, alb_vector normal, double far_mm)
{
    const alb_vector from =
        alb_add(s->mesh.vertices[s->probes.vertices[p]], alb_times(256 * s->tracer.slack_mm, normal));
    const size_t count = s->probes.count;
    float sum[VALUES] = {0};
    double world_from_axis[3][3];
    alb_sh_axis_rotation(world_from_axis, normal);
    int blocked = 0;
    for (int q = 0; q < RAYS; q++) {
        const alb_vector d = r->directions[q];
        double to[3];
        for (int k = 0; k < 3; k++)
            to[k] = world_from_axis[k][0] * d.x + world_from_axis[k][1] * d.y + world_from_axis[k][2] * d.z;
        const alb_vector end = alb_add(from, alb_times(far_mm, (alb_vector){to[0], to[1], to[2]}));
        if (!alb_tracer_blocked(&s->tracer, from, end))
            continue;
        blocked++;
        for (int i = 0; i < VALUES; i++)
            sum[i] += r->basis[q][i];
    }
    s->buried[p] = blocked == RAYS;
    for (size_t i = 0; i < VALUES; i++)
        s->seen[i * count + p] = sum[i];
    s->axes[p] = (float)normal.x, s->axes[count + p] = (float)normal.y, s->axes[2 * count + p] = (float)normal.z;
}

// The weights of a vertex without its buried probes; where those are all that count, the others among the four alike.
static void leave_out_buried(float out[NEIGHBOURS], const alb_shadow_surface *s, size_t vertex)
{
    float sum = 0, open = 0;
    for (int k = 0; k < NEIGHBOURS; k++) {
        const bool buried = s->buried[s->probes.neighbours[vertex][k]];
        out[k] = s->probes.weights[vertex][k];
        sum += buried ? 0 : out[k];
        open += buried ? 0 : 1;
    }
    for (int k = 0; k < NEIGHBOURS && open > 0; k++)
        out[k] = s->buried[s->probes.neighbours[vertex][k]] ? 0 : sum > 0 ? out[k] / sum : 1 / open;
}

static void interpolate(alb_shadow_surface *s)
{
    const size_t count = s->probes.count;
    alb_sh_from_axis_batch(s->seen, s->seen, ALB_SHADOW_ORDER, s->axes, count, count);
#pragma omp parallel for schedule(static)
    for (size_t v = 0; v < s->mesh.vertex_count; v++) {
        float weights[NEIGHBOURS];
        leave_out_buried(weights, s, v);
        for (size_t i = 0; i < VALUES; i++) {
            float sum = 0;
            for (int k = 0; k < NEIGHBOURS; k++)
                sum += weights[k] * s->seen[i * count + s->probes.neighbours[v][k]];
            s->hidden[v][i] = sum;
        }
    }
}

bool alb_shadow_surface_sample(alb_shadow_surface *s, const alb_vector *vertices, const alb_vector *normals,
                               alb_error *error)
{
    const size_t bytes = s->mesh.vertex_count * sizeof *vertices;
    rays r;
    if (s->sampled && !memcmp(s->mesh.vertices, vertices, bytes))
        return true;
    memcpy(s->mesh.vertices, vertices, bytes);
    s->sampled = false;
    if (!alb_tracer_move(&s->tracer, vertices, s->mesh.vertex_count, error))
        return false;
    const double far_mm = 0x1p24 / 8 * s->tracer.slack_mm; // four times the half of the longest extent
    set_rays(&r);
#pragma omp parallel for schedule(dynamic, 8)
    for (size_t p = 0; p < s->probes.count; p++)
        look(s, p, &r, normals[s->probes.vertices[p]], far_mm);
    interpolate(s);
    s->sampled = true;
    return true;
}
