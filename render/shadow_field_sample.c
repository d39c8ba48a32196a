// From each outer node a flat picture (shadow_view.h) gives the coefficients in the picture's frame, which is that of
// the axis to the middle; from each inner node rays to all sides (shadow_lattice.h). A node inside the object sees its
// inner wall, which hides everything from the receivers around it: it is marked as buried and holds the sample of the
// shell outside it, scaled (k < 1) as for a receiver there, in case all around a receiver are buried.
#include "render/sh_rotate.h"
#include "render/sh_scale.h"
#include "render/shadow_studio.h"
#include <omp.h>
#include <string.h>

// The picture from node n of a shell outside: its sample, or column n of local.
static void take_picture(const alb_shadow_field *field, int shell, size_t n)
{
    const alb_shadow_studio *s = field->studio;
    const alb_shadow_lens *lens = &s->lenses[shell];
    const alb_shadow_nodes *of = &s->nodes[shell];
    alb_shadow_work *w = &s->works[omp_get_thread_num()];
    float out[3 * ALB_SH_COUNT_MAX];
    double world_from_picture[3][3];
    alb_sh_axis_rotation(world_from_picture, alb_times(-1, of->directions[n]));
    alb_shadow_project(&w->corners, s->shape.x, s->shape.y, s->shape.z, (const double(*)[3])world_from_picture, lens);
    if (s->shape.face_colours)
        alb_shadow_view_radiance(out, &w->corners, (const uint32_t(*)[3])s->shape.drawn, s->shape.drawn_count,
                                 s->shape.face_colours, (const float(*)[3])s->shape.colours, lens, w->nearest, w->seen);
    else
        alb_shadow_view_occlusion(out, &w->corners, (const uint32_t(*)[3])s->shape.drawn, s->shape.drawn_count,
                                  s->shape.closed, lens);
    const size_t values = (size_t)(field->channels * lens->values);
    if (field->shells[shell].along)
        memcpy(alb_shadow_sample_at(field, shell, n), out, values * sizeof *out);
    for (size_t i = 0; !field->shells[shell].along && i < values; i++)
        s->local[i * of->count + n] = out[i];
}

static void sample_outside(const alb_shadow_field *field, int shell)
{
    const alb_shadow_studio *s = field->studio;
    const alb_shadow_nodes *of = &s->nodes[shell];
    const size_t values = alb_shadow_shell_values(&field->shells[shell]), count = of->count;
#pragma omp parallel for schedule(dynamic, 8) num_threads(s->work_count)
    for (size_t n = 0; n < count; n++)
        take_picture(field, shell, n);
    for (size_t c = 0; !field->shells[shell].along && c < (size_t)field->channels; c++) {
        float *local = s->local + c * values * count;
        alb_sh_from_axis_batch(local, local, field->shells[shell].order, of->axes, count, count);
        for (size_t n = 0; n < count; n++)
            for (size_t i = 0; i < values; i++)
                alb_shadow_sample_at(field, shell, n)[c * values + i] = local[i * count + n];
    }
}

// What the shell outside gives at the node, scaled inwards.
static void replace(float *out, const alb_shadow_field *field, int shell, size_t n, const alb_sh_scaling *scaling)
{
    const alb_shadow_nodes *of = &field->studio->nodes[shell];
    const alb_shadow_shell *outside = &field->shells[shell + 1];
    const float axis[3] = {of->axes[n], of->axes[of->count + n], of->axes[2 * of->count + n]};
    float turned[ALB_SH_COUNT_MAX];
    double sample[ALB_SH_COUNT_MAX], scaled[ALB_SH_COUNT_MAX];
    alb_shadow_field_at(turned, field, shell + 1, of->directions[n]);
    if (!outside->along)
        alb_sh_to_axis_batch(turned, turned, outside->order, axis, 1, 1);
    for (size_t i = 0; i < alb_shadow_shell_values(outside); i++)
        sample[i] = (double)turned[i];
    alb_sh_scaling_apply(scaled, scaling, sample);
    for (size_t i = 0; i < alb_shadow_shell_values(&field->shells[shell]); i++)
        turned[i] = (float)scaled[i];
    alb_sh_from_axis_batch(out, turned, field->shells[shell].order, axis, 1, 1);
}

static bool sample_shell_inside(alb_shadow_field *field, int shell, const alb_tracer *tracer, alb_error *error)
{
    const alb_shadow_studio *s = field->studio;
    const alb_shadow_nodes *of = &s->nodes[shell];
    const alb_sh_law law = {ALB_SH_LAW_OCCLUSION, ALB_SH_MAP_CONE, 45, field->shells[shell].order,
                            field->shells[shell + 1].order};
    const double away_mm = field->shells[shell].radius * field->sphere.radius_mm;
    bool *buried = field->buried + (size_t)shell * of->count;
    alb_sh_scaling scaling;
    if (!alb_sh_law_at(&scaling, &law, field->shells[shell].radius / field->shells[shell + 1].radius, error))
        return false;
#pragma omp parallel for schedule(dynamic, 8)
    for (size_t n = 0; n < of->count; n++) {
        const alb_vector at = alb_add(field->sphere.centre_mm, alb_times(away_mm, of->directions[n]));
        float *out = alb_shadow_sample_at(field, shell, n);
        buried[n] = !alb_shadow_lattice_look(out, &s->rays, tracer, at);
        if (buried[n])
            replace(out, field, shell, n, &scaling);
    }
    for (size_t n = 0; n < of->count; n++)
        field->replaced += buried[n];
    return true;
}

static bool sample_inside(alb_shadow_field *field, const alb_vector *vertices, alb_error *error)
{
    const alb_shadow_studio *s = field->studio;
    const alb_mesh mesh = {.vertices = (alb_vector *)(uintptr_t)vertices,
                           .vertex_count = s->shape.vertex_count,
                           .faces = s->shape.faces,
                           .face_count = s->shape.face_count};
    alb_tracer tracer;
    bool ok = alb_tracer_create(&tracer, &mesh, error);
    field->replaced = 0;
    for (int shell = field->settings.inner - 1; ok && shell >= 0; shell--)
        ok = sample_shell_inside(field, shell, &tracer, error);
    alb_tracer_free(&tracer);
    return ok;
}

bool alb_shadow_field_sample(alb_shadow_field *field, const alb_vector *vertices, alb_error *error)
{
    alb_shadow_studio *s = field->studio;
    if (!alb_shadow_sphere_follow(&field->sphere, vertices, s->shape.vertex_count, s->shape.name, error))
        return false;
    const size_t bytes = s->shape.vertex_count * sizeof *vertices;
    if (s->sampled && !memcmp(s->vertices, vertices, bytes)) // what stands still keeps its samples
        return true;
    memcpy(s->vertices, vertices, bytes);
    alb_shadow_shape_place(&s->shape, vertices, &field->sphere);
    for (int shell = field->settings.inner; shell < field->shell_count; shell++)
        sample_outside(field, shell);
    s->sampled = field->settings.inner == 0 || sample_inside(field, vertices, error);
    return s->sampled;
}
