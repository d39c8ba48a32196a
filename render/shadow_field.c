// Sampling: from each outer node a flat picture (shadow_view.h) gives the coefficients in the picture's frame, which
// are turned into the world's; from each inner node rays to all sides (shadow_lattice.h). A node inside the object
// would see its inner wall, which hides everything from the receivers around it. It takes the sample of the shell
// outside it instead, scaled (k < 1) as for a receiver there. Stops being true between nodes where what is seen changes
// faster than bilinearly: 11 degrees for 8 cells.
#include "render/shadow_field.h"
#include "base/memory.h"
#include "render/sh_rotate.h"
#include "render/sh_scale.h"
#include "render/shadow_lattice.h"
#include "render/shadow_shape.h"
#include <omp.h>
#include <stdlib.h>
#include <string.h>

const alb_shadow_settings alb_shadow_defaults = {
    .order = 4, .cells = 8, .pixels = 64, .distance = 1.1, .outer = 1, .rays = 256, .probes = 1200, .cluster = 0.04};
const alb_shadow_settings alb_shadow_light_settings = {
    .order = 4, .cells = 8, .pixels = 40, .distance = 1.1, .outer = 6};
// Radii of 1, 2, 3 inner shells from outside inwards; of the outer ones over the first one's; of the far one.
static const double inner_radii[ALB_SHADOW_INNER_MAX][ALB_SHADOW_INNER_MAX] = {{0.85}, {0.8, 0.55}, {0.88, 0.72, 0.55}},
                    outer_ratios[ALB_SHADOW_OUTER_MAX] = {1, 1.4, 2, 3.2, 6, 12}, far_radius = 2.9;

typedef struct alb_shadow_work { // of one thread
    alb_shadow_corners corners;
    float *nearest;
    uint32_t *seen;
} work;

typedef struct alb_shadow_nodes {
    size_t count;
    alb_vector *directions;
    float *axes;  // [3][nodes]: from each node to the middle
    float *local; // [channel][value][nodes]: in the pictures' frames
} nodes;

typedef struct alb_shadow_studio {
    alb_shadow_shape shape;
    alb_shadow_lens lenses[ALB_SHADOW_SHELLS_MAX]; // of the shells that are pictures
    alb_vector *vertices;                          // that the samples are of
    bool sampled;
    nodes near, far; // of all shells but the far one, and of that one
    work *works;
    int work_count;
    alb_shadow_lattice rays; // of inner nodes
} studio;

static size_t values_of(const alb_shadow_shell *shell) { return (size_t)(shell->order * shell->order); }

static const nodes *nodes_of(const alb_shadow_field *field, int shell)
{
    return field->settings.far && shell == field->shell_count - 1 ? &field->studio->far : &field->studio->near;
}

static float *sample_at(const alb_shadow_field *field, int shell, size_t node)
{
    const alb_shadow_shell *of = &field->shells[shell];
    return field->samples + of->first + node * (size_t)field->channels * values_of(of);
}

static bool check(const alb_shadow_settings *s, bool shines, const char *name, alb_error *error)
{
    if (s->order < 2 || s->order > ALB_SH_ORDER_MAX || s->cells < 1 || s->cells > ALB_SHADOW_CELLS_MAX ||
        s->outer < 1 || s->outer > ALB_SHADOW_OUTER_MAX || s->inner < 0 || s->inner > ALB_SHADOW_INNER_MAX ||
        (s->inner && (s->rays < 16 || s->rays > 65536)) || s->probes < 0 || s->probes > ALB_SHADOW_PROBES_MAX ||
        !(s->cluster >= 0 && s->cluster <= 0.5))
        return alb_fail(
            error, ALB_BAD_DATA,
            "%s: a shadow field of order %d with %d cells, %d shells outside, %d inside of %d rays, %d probes, "
            "clusters of "
            "%g radii: orders 2 to %d, cells 1 to %d, 1 to %d shells outside, up to %d inside of 16 to 65536 rays, up "
            "to %d probes, clusters to 0.5 exist",
            name, s->order, s->cells, s->outer, s->inner, s->rays, s->probes, s->cluster, ALB_SH_ORDER_MAX,
            ALB_SHADOW_CELLS_MAX, ALB_SHADOW_OUTER_MAX, ALB_SHADOW_INNER_MAX, ALB_SHADOW_PROBES_MAX);
    if (s->far && !(s->distance * outer_ratios[s->outer - 1] < far_radius))
        return alb_fail(error, ALB_BAD_DATA, "%s: %d shells outside from %g radii on reach the far one at %g", name,
                        s->outer, s->distance, far_radius);
    return !(shines && (s->inner || s->far)) ||
           alb_fail(error, ALB_BAD_DATA, "%s: a light's field has no inner and no far shells", name);
}

static bool create_works(studio *s, const alb_shadow_settings *settings, alb_error *error)
{
    const size_t n = s->shape.cluster_count, pixels = (size_t)(settings->pixels * settings->pixels);
    s->work_count = omp_get_max_threads();
    if (!(s->works = alb_allocate((size_t)s->work_count, sizeof *s->works, error)))
        return false;
    for (int t = 0; t < s->work_count; t++) {
        work *w = &s->works[t];
        w->corners.count = n;
        if (!(w->corners.x = alb_allocate(n, sizeof(float), error)) ||
            !(w->corners.y = alb_allocate(n, sizeof(float), error)))
            return false;
        if (s->shape.face_colours && (!(w->corners.depth = alb_allocate(n, sizeof(float), error)) ||
                                      !(w->nearest = alb_allocate(pixels, sizeof *w->nearest, error)) ||
                                      !(w->seen = alb_allocate(pixels, sizeof *w->seen, error))))
            return false;
    }
    return true;
}

static bool create_nodes(nodes *out, int cells, size_t per_node, alb_error *error)
{
    const alb_shadow_grid grid = {cells};
    const size_t count = out->count = (size_t)alb_shadow_grid_count(grid);
    if (!(out->directions = alb_allocate(count, sizeof *out->directions, error)) ||
        !(out->axes = alb_allocate(3 * count, sizeof *out->axes, error)) ||
        !(out->local = alb_allocate(per_node * count, sizeof *out->local, error)))
        return false;
    for (size_t n = 0; n < count; n++) {
        const alb_vector d = out->directions[n] = alb_shadow_grid_direction(grid, (int)n);
        out->axes[n] = (float)-d.x;
        out->axes[count + n] = (float)-d.y;
        out->axes[2 * count + n] = (float)-d.z;
    }
    return true;
}

static void free_nodes(nodes *n)
{
    free(n->directions);
    free(n->axes);
    free(n->local);
}

static void place_shells(alb_shadow_field *field)
{
    const alb_shadow_settings *s = &field->settings;
    field->shell_count = s->inner + s->outer + s->far;
    for (int i = 0; i < field->shell_count; i++) {
        const int outer = i - s->inner;
        alb_shadow_shell *shell = &field->shells[i];
        *shell = (alb_shadow_shell){.order = s->order, .cells = s->cells, .first = field->sample_count};
        if (outer < 0)
            shell->radius = inner_radii[s->inner - 1][-1 - outer];
        else if (outer < s->outer)
            shell->radius = s->distance * outer_ratios[outer];
        else
            *shell = (alb_shadow_shell){far_radius, ALB_SHADOW_FAR_ORDER, ALB_SHADOW_FAR_CELLS, field->sample_count};
        field->sample_count +=
            (size_t)alb_shadow_grid_count((alb_shadow_grid){shell->cells}) * (size_t)field->channels * values_of(shell);
    }
}

static bool create_studio(alb_shadow_field *field, const alb_mesh *mesh, const float (*face_radiance)[3],
                          const char *name, alb_error *error)
{
    studio *s = field->studio;
    const alb_shadow_settings *settings = &field->settings;
    const size_t near_values = (size_t)(field->channels * settings->order * settings->order),
                 far_values = (size_t)(field->channels * ALB_SHADOW_FAR_ORDER * ALB_SHADOW_FAR_ORDER);
    for (int i = settings->inner; i < field->shell_count; i++)
        if (!alb_shadow_lens_create(&s->lenses[i], settings->pixels, field->shells[i].order, field->shells[i].radius,
                                    error))
            return false;
    return (s->vertices = alb_allocate(mesh->vertex_count, sizeof *s->vertices, error)) &&
           alb_shadow_shape_create(&s->shape, mesh, face_radiance, settings->cluster * field->sphere.radius_mm, name,
                                   error) &&
           create_nodes(&s->near, settings->cells, near_values, error) &&
           (!settings->far || create_nodes(&s->far, ALB_SHADOW_FAR_CELLS, far_values, error)) &&
           create_works(s, settings, error) &&
           (!settings->inner || alb_shadow_lattice_create(&s->rays, settings->rays, settings->order, error));
}

bool alb_shadow_field_create(alb_shadow_field *field, const alb_shadow_settings *settings, const alb_mesh *mesh,
                             const float (*face_radiance)[3], const char *name, alb_error *error)
{
    *field = (alb_shadow_field){.settings = *settings, .channels = face_radiance ? 3 : 1};
    if (!check(settings, face_radiance, name, error) ||
        !alb_shadow_sphere_follow(&field->sphere, mesh->vertices, mesh->vertex_count, name, error) ||
        !(field->studio = alb_allocate(1, sizeof *field->studio, error)))
        return false;
    place_shells(field);
    if ((field->samples = alb_allocate(field->sample_count, sizeof *field->samples, error)) &&
        create_studio(field, mesh, face_radiance, name, error))
        return true;
    alb_shadow_field_free(field);
    return false;
}

void alb_shadow_field_free(alb_shadow_field *field)
{
    studio *s = field->studio;
    if (s) {
        for (int t = 0; t < s->work_count && s->works; t++) {
            free(s->works[t].corners.x);
            free(s->works[t].corners.y);
            free(s->works[t].corners.depth);
            free(s->works[t].nearest);
            free(s->works[t].seen);
        }
        free(s->works);
        for (int i = 0; i < ALB_SHADOW_SHELLS_MAX; i++)
            alb_shadow_lens_free(&s->lenses[i]);
        alb_shadow_shape_free(&s->shape);
        free(s->vertices);
        free_nodes(&s->near);
        free_nodes(&s->far);
        alb_shadow_lattice_free(&s->rays);
        free(s);
    }
    free(field->samples);
    *field = (alb_shadow_field){0};
}

size_t alb_shadow_field_bytes(const alb_shadow_field *field) { return field->sample_count * sizeof(float); }

// The picture from node n of a shell outside, as column n of local.
static void take_picture(const alb_shadow_field *field, const alb_shadow_lens *lens, const nodes *of, size_t n)
{
    const studio *s = field->studio;
    work *w = &s->works[omp_get_thread_num()];
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
    for (size_t i = 0; i < (size_t)(field->channels * lens->values); i++)
        of->local[i * of->count + n] = out[i];
}

static void sample_outside(const alb_shadow_field *field, int shell)
{
    const studio *s = field->studio;
    const nodes *of = nodes_of(field, shell);
    const size_t values = values_of(&field->shells[shell]), count = of->count;
#pragma omp parallel for schedule(dynamic, 8) num_threads(s->work_count)
    for (size_t n = 0; n < count; n++)
        take_picture(field, &s->lenses[shell], of, n);
    for (size_t c = 0; c < (size_t)field->channels; c++) {
        float *local = of->local + c * values * count;
        alb_sh_from_axis_batch(local, local, field->shells[shell].order, of->axes, count, count);
        for (size_t n = 0; n < count; n++)
            for (size_t i = 0; i < values; i++)
                sample_at(field, shell, n)[c * values + i] = local[i * count + n];
    }
}

// What the shell outside gives at the node, scaled inwards.
static void replace(float *out, const alb_shadow_field *field, int shell, size_t n, const alb_sh_scaling *scaling)
{
    const int order = field->settings.order;
    const size_t values = (size_t)(order * order), count = field->studio->near.count;
    const float *axes = field->studio->near.axes, axis[3] = {axes[n], axes[count + n], axes[2 * count + n]};
    float turned[ALB_SH_COUNT_MAX];
    double sample[ALB_SH_COUNT_MAX], scaled[ALB_SH_COUNT_MAX];
    alb_sh_to_axis_batch(turned, sample_at(field, shell + 1, n), order, axis, 1, 1);
    for (size_t i = 0; i < values; i++)
        sample[i] = (double)turned[i];
    alb_sh_scaling_apply(scaled, scaling, sample);
    for (size_t i = 0; i < values; i++)
        turned[i] = (float)scaled[i];
    alb_sh_from_axis_batch(out, turned, order, axis, 1, 1);
}

static bool sample_inside(alb_shadow_field *field, const alb_vector *vertices, alb_error *error)
{
    const studio *s = field->studio;
    const alb_mesh mesh = {.vertices = (alb_vector *)(uintptr_t)vertices,
                           .vertex_count = s->shape.vertex_count,
                           .faces = s->shape.faces,
                           .face_count = s->shape.face_count};
    const alb_sh_law law = {ALB_SH_LAW_OCCLUSION, ALB_SH_MAP_CONE, 45, field->settings.order, field->settings.order};
    alb_tracer tracer;
    size_t replaced = 0;
    bool ok = alb_tracer_create(&tracer, &mesh, error);
    for (int shell = field->settings.inner - 1; ok && shell >= 0; shell--) {
        alb_sh_scaling scaling;
        ok = alb_sh_law_at(&scaling, &law, field->shells[shell].radius / field->shells[shell + 1].radius, error);
#pragma omp parallel for schedule(dynamic, 8) reduction(+ : replaced)
        for (size_t n = 0; n < (ok ? s->near.count : 0); n++) {
            const double away_mm = field->shells[shell].radius * field->sphere.radius_mm;
            const alb_vector at = alb_add(field->sphere.centre_mm, alb_times(away_mm, s->near.directions[n]));
            float *out = sample_at(field, shell, n);
            if (!alb_shadow_lattice_look(out, &s->rays, &tracer, at)) {
                replace(out, field, shell, n, &scaling);
                replaced++;
            }
        }
    }
    field->replaced = replaced;
    alb_tracer_free(&tracer);
    return ok;
}

bool alb_shadow_field_sample(alb_shadow_field *field, const alb_vector *vertices, alb_error *error)
{
    studio *s = field->studio;
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

void alb_shadow_field_at(float *out, const alb_shadow_field *field, int shell, alb_vector direction)
{
    const alb_shadow_place place = alb_shadow_grid_place((alb_shadow_grid){field->shells[shell].cells}, direction);
    const size_t values = (size_t)field->channels * values_of(&field->shells[shell]);
    const float *from[4];
    for (int k = 0; k < 4; k++)
        from[k] = sample_at(field, shell, (size_t)place.nodes[k]);
    for (size_t i = 0; i < values; i++)
        out[i] = place.weights[0] * from[0][i] + place.weights[1] * from[1][i] + place.weights[2] * from[2][i] +
                 place.weights[3] * from[3][i];
}
