// From each outer node a flat picture (shadow_view.h) gives the coefficients in the picture's frame, which is that of
// the axis to the middle; from each inner node rays to all sides (shadow_lattice.h). A node inside the object would see
// its inner wall, which hides everything from the receivers around it. It sees from just behind the nearest wall, where
// receivers between the surface and the nodes outside it are; where parts of an object overlap, behind the next one.
// Stops being true for receivers on the other side of a part thinner than the distance of the nodes.
#include "render/sh_rotate.h"
#include "render/shadow_studio.h"
#include <omp.h>
#include <string.h>

enum { MOVES = 4 };

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
    if (field->shells[shell].turns)
        alb_shadow_sample_put(field, shell, n, out);
    for (size_t i = 0; !field->shells[shell].turns && i < values; i++)
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
    if (field->shells[shell].turns)
        return;
    for (size_t c = 0; c < (size_t)field->channels; c++) {
        float *local = s->local + c * values * count;
        alb_sh_from_axis_batch(local, local, field->shells[shell].order, of->axes, count, count);
    }
    for (size_t n = 0; n < count; n++) {
        float sample[3 * ALB_SH_COUNT_MAX];
        for (size_t i = 0; i < values * (size_t)field->channels; i++)
            sample[i] = s->local[i * count + n];
        alb_shadow_sample_put(field, shell, n, sample);
    }
}

static void sample_shell_inside(alb_shadow_field *field, int shell, const alb_tracer *tracer)
{
    const alb_shadow_studio *s = field->studio;
    const alb_shadow_nodes *of = &s->nodes[shell];
    const double away_mm = field->shells[shell].radius * field->sphere.radius_mm;
    size_t moved = 0;
#pragma omp parallel for schedule(dynamic, 8) reduction(+ : moved)
    for (size_t n = 0; n < of->count; n++) {
        alb_vector at = alb_add(field->sphere.centre_mm, alb_times(away_mm, of->directions[n]));
        float sample[ALB_SH_COUNT_MAX];
        int moves = 0;
        while (!alb_shadow_lattice_look(sample, &at, &s->rays, tracer) && moves < MOVES)
            moves++;
        alb_shadow_sample_put(field, shell, n, sample);
        moved += moves > 0;
    }
    field->moved += moved;
}

static bool sample_inside(alb_shadow_field *field, const alb_vector *vertices, alb_error *error)
{
    const alb_shadow_studio *s = field->studio;
    const alb_mesh mesh = {.vertices = (alb_vector *)(uintptr_t)vertices,
                           .vertex_count = s->shape.vertex_count,
                           .faces = s->shape.faces,
                           .face_count = s->shape.face_count};
    alb_tracer tracer;
    const bool ok = alb_tracer_create(&tracer, &mesh, error);
    field->moved = 0;
    for (int shell = 0; shell < (ok ? field->settings.inner : 0); shell++)
        sample_shell_inside(field, shell, &tracer);
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
