// Sampling: from each outer node a flat picture (shadow_view.h) gives the coefficients in the picture's frame, which
// are turned into the world's; from each inner node rays, even over the sphere (a Fibonacci lattice of N):
//     S_i = 4 pi / N sum over rays q that meet something of Y_i(d_q)
// A node is inside the object where more than half of its rays meet a back first; what it would see is the object's
// inner wall, which hides everything from the receivers around it. It takes the sample of the shell outside it instead,
// scaled (k < 1) as for a receiver there.
// Stops being true between nodes where what is seen changes faster than bilinearly: 11 degrees for 8 cells.
#include "render/shadow_field.h"
#include "base/memory.h"
#include "render/sh_rotate.h"
#include "render/sh_scale.h"
#include "render/shadow_shape.h"
#include "render/tracer.h"
#include <omp.h>
#include <stdlib.h>
#include <string.h>

const alb_shadow_settings alb_shadow_defaults = {
    .order = 4, .cells = 8, .pixels = 64, .distance = 1.1, .outer = 1, .rays = 512, .cluster = 0.04};
const alb_shadow_settings alb_shadow_light_settings = {
    .order = 4, .cells = 8, .pixels = 40, .distance = 1.1, .outer = 6};
const double alb_shadow_inner_radii[ALB_SHADOW_INNER_MAX] = {0.85, 0.6, 0.4},
             alb_shadow_outer_ratios[ALB_SHADOW_OUTER_MAX] = {1, 1.4, 2, 3.2, 6, 12};

typedef struct alb_shadow_work { // of one thread
    alb_shadow_corners corners;
    float *nearest;
    uint32_t *seen;
} work;

typedef struct alb_shadow_studio {
    alb_shadow_shape shape;
    alb_shadow_lens lenses[ALB_SHADOW_OUTER_MAX];
    alb_vector *vertices; // that the samples are of
    bool sampled;
    alb_vector *directions; // of the nodes
    float *axes;            // [3][nodes]: from each node to the middle
    float *local;           // [channel][value][nodes]: in the pictures' frames
    work *works;
    int work_count;
    alb_vector *rays; // of inner nodes
    float *ray_basis; // [ray][value]
} studio;

static size_t count_of(const alb_shadow_field *field)
{
    return (size_t)alb_shadow_grid_count((alb_shadow_grid){field->settings.cells});
}

static size_t values_of(const alb_shadow_field *field)
{
    return (size_t)(field->settings.order * field->settings.order);
}

static float *sample_at(const alb_shadow_field *field, int shell, size_t node)
{
    return field->samples + ((size_t)shell * count_of(field) + node) * (size_t)field->channels * values_of(field);
}

static bool check(const alb_shadow_settings *s, bool shines, const char *name, alb_error *error)
{
    if (s->order < 2 || s->order > ALB_SH_ORDER_MAX || s->cells < 1 || s->cells > ALB_SHADOW_CELLS_MAX ||
        s->inner < 0 || s->inner > ALB_SHADOW_INNER_MAX || (s->inner && (s->rays < 16 || s->rays > 65536)) ||
        !(s->cluster >= 0 && s->cluster <= 0.5))
        return alb_fail(
            error, ALB_BAD_DATA,
            "%s: a shadow field of order %d with %d cells, %d shells outside, %d inside of %d rays, clusters of %g "
            "radii: orders 2 to %d, cells 1 to %d, 1 to %d shells outside, up to %d inside of 16 to 65536 rays, "
            "clusters to 0.5 exist",
            name, s->order, s->cells, s->outer, s->inner, s->rays, s->cluster, ALB_SH_ORDER_MAX, ALB_SHADOW_CELLS_MAX,
            ALB_SHADOW_OUTER_MAX, ALB_SHADOW_INNER_MAX);
    return !(shines && s->inner) || alb_fail(error, ALB_BAD_DATA, "%s: a light's field has no inner shells", name);
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

static bool create_rays(studio *s, int rays, int order, alb_error *error)
{
    const size_t values = (size_t)(order * order);
    double basis[ALB_SH_COUNT_MAX];
    if (!(s->rays = alb_allocate((size_t)rays, sizeof *s->rays, error)) ||
        !(s->ray_basis = alb_allocate((size_t)rays * values, sizeof *s->ray_basis, error)))
        return false;
    for (int q = 0; q < rays; q++) {
        const double z = 1 - (2 * q + 1.0) / rays, turn = M_PI * (3 - sqrt(5)) * q, r = sqrt(1 - z * z);
        s->rays[q] = (alb_vector){r * cos(turn), r * sin(turn), z};
        alb_sh_evaluate(basis, order, s->rays[q]);
        for (size_t i = 0; i < values; i++)
            s->ray_basis[(size_t)q * values + i] = (float)(4 * M_PI / rays * basis[i]);
    }
    return true;
}

static bool create_nodes(studio *s, alb_shadow_grid grid, size_t per_node, alb_error *error)
{
    const size_t nodes = (size_t)alb_shadow_grid_count(grid);
    if (!(s->directions = alb_allocate(nodes, sizeof *s->directions, error)) ||
        !(s->axes = alb_allocate(3 * nodes, sizeof *s->axes, error)) ||
        !(s->local = alb_allocate(per_node * nodes, sizeof *s->local, error)))
        return false;
    for (size_t n = 0; n < nodes; n++) {
        const alb_vector d = s->directions[n] = alb_shadow_grid_direction(grid, (int)n);
        s->axes[n] = (float)-d.x;
        s->axes[nodes + n] = (float)-d.y;
        s->axes[2 * nodes + n] = (float)-d.z;
    }
    return true;
}

bool alb_shadow_field_create(alb_shadow_field *field, const alb_shadow_settings *settings, const alb_mesh *mesh,
                             const float (*face_radiance)[3], const char *name, alb_error *error)
{
    const int inner = settings->inner;
    *field = (alb_shadow_field){.settings = *settings, .channels = face_radiance ? 3 : 1};
    if (!check(settings, face_radiance, name, error) ||
        !alb_shadow_sphere_follow(&field->sphere, mesh->vertices, mesh->vertex_count, name, error) ||
        !(field->studio = alb_allocate(1, sizeof *field->studio, error)))
        return false;
    studio *s = field->studio;
    field->shells = inner + settings->outer;
    for (int i = 0; i < inner; i++)
        field->radii[i] = alb_shadow_inner_radii[inner - 1 - i];
    const size_t per_node = (size_t)field->channels * values_of(field);
    field->samples = alb_allocate((size_t)field->shells * count_of(field) * per_node, sizeof *field->samples, error);
    s->vertices = alb_allocate(mesh->vertex_count, sizeof *s->vertices, error);
    bool ok = field->samples && s->vertices;
    for (int i = 0; ok && i < settings->outer; i++) {
        const double radius = field->radii[inner + i] = settings->distance * alb_shadow_outer_ratios[i];
        ok = alb_shadow_lens_create(&s->lenses[i], settings->pixels, settings->order, radius, error);
    }
    ok = ok &&
         alb_shadow_shape_create(&s->shape, mesh, face_radiance, settings->cluster * field->sphere.radius_mm, name,
                                 error) &&
         create_nodes(s, (alb_shadow_grid){settings->cells}, per_node, error) && create_works(s, settings, error) &&
         (!inner || create_rays(s, settings->rays, settings->order, error));
    if (!ok)
        alb_shadow_field_free(field);
    return ok;
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
        for (int i = 0; i < ALB_SHADOW_OUTER_MAX; i++)
            alb_shadow_lens_free(&s->lenses[i]);
        alb_shadow_shape_free(&s->shape);
        free(s->vertices);
        free(s->directions);
        free(s->axes);
        free(s->local);
        free(s->rays);
        free(s->ray_basis);
        free(s);
    }
    free(field->samples);
    *field = (alb_shadow_field){0};
}

size_t alb_shadow_field_bytes(const alb_shadow_field *field)
{
    return (size_t)field->shells * count_of(field) * (size_t)field->channels * values_of(field) * sizeof(float);
}

// The picture from node n of a shell outside, as column n of local.
static void take_picture(const alb_shadow_field *field, const alb_shadow_lens *lens, size_t n)
{
    const studio *s = field->studio;
    const size_t values = values_of(field), nodes = count_of(field);
    work *w = &s->works[omp_get_thread_num()];
    float out[3 * ALB_SH_COUNT_MAX];
    double world_from_picture[3][3];
    alb_sh_axis_rotation(world_from_picture, alb_times(-1, s->directions[n]));
    alb_shadow_project(&w->corners, s->shape.x, s->shape.y, s->shape.z, (const double(*)[3])world_from_picture, lens);
    if (s->shape.face_colours)
        alb_shadow_view_radiance(out, &w->corners, (const uint32_t(*)[3])s->shape.drawn, s->shape.drawn_count,
                                 s->shape.face_colours, (const float(*)[3])s->shape.colours, lens, w->nearest, w->seen);
    else
        alb_shadow_view_occlusion(out, &w->corners, (const uint32_t(*)[3])s->shape.drawn, s->shape.drawn_count,
                                  s->shape.closed, lens);
    for (size_t i = 0; i < (size_t)field->channels * values; i++)
        s->local[i * nodes + n] = out[i];
}

static void sample_outside(const alb_shadow_field *field, int outer)
{
    const studio *s = field->studio;
    const size_t values = values_of(field), nodes = count_of(field), channels = (size_t)field->channels;
#pragma omp parallel for schedule(dynamic, 8) num_threads(s->work_count)
    for (size_t n = 0; n < nodes; n++)
        take_picture(field, &s->lenses[outer], n);
    for (size_t c = 0; c < channels; c++) {
        float *local = s->local + c * values * nodes;
        alb_sh_from_axis_batch(local, local, field->settings.order, s->axes, nodes, nodes);
        for (size_t n = 0; n < nodes; n++)
            for (size_t i = 0; i < values; i++)
                sample_at(field, field->settings.inner + outer, n)[c * values + i] = local[i * nodes + n];
    }
}

// What the shell outside gives at the node, scaled inwards.
static void replace(float *out, const alb_shadow_field *field, int shell, size_t n, const alb_sh_scaling *scaling)
{
    const int order = field->settings.order;
    const size_t values = values_of(field);
    const float *from = sample_at(field, shell + 1, n);
    double world_from_axis[3][3], axis_from_world[3][3], sample[ALB_SH_COUNT_MAX], scaled[ALB_SH_COUNT_MAX];
    alb_sh_axis_rotation(world_from_axis, alb_times(-1, field->studio->directions[n]));
    for (int i = 0; i < 9; i++)
        axis_from_world[i % 3][i / 3] = world_from_axis[i / 3][i % 3];
    for (size_t i = 0; i < values; i++)
        sample[i] = (double)from[i];
    alb_sh_rotate(sample, sample, order, (const double(*)[3])axis_from_world);
    alb_sh_scaling_apply(scaled, scaling, sample);
    alb_sh_rotate(scaled, scaled, order, (const double(*)[3])world_from_axis);
    for (size_t i = 0; i < values; i++)
        out[i] = (float)scaled[i];
}

// Whether the node is outside the object, and then its sample.
static bool look_around(float *out, const alb_shadow_field *field, const alb_tracer *tracer, alb_vector at)
{
    const studio *s = field->studio;
    const size_t values = values_of(field);
    int backs = 0;
    memset(out, 0, values * sizeof *out);
    for (int q = 0; q < field->settings.rays; q++) {
        alb_hit hit;
        if (!alb_tracer_closest(&hit, tracer, at, s->rays[q]))
            continue;
        backs += !hit.front;
        for (size_t i = 0; i < values; i++)
            out[i] += s->ray_basis[(size_t)q * values + i];
    }
    return 2 * backs <= field->settings.rays;
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
        ok = alb_sh_law_at(&scaling, &law, field->radii[shell] / field->radii[shell + 1], error);
#pragma omp parallel for schedule(dynamic, 8) reduction(+ : replaced)
        for (size_t n = 0; n < (ok ? count_of(field) : 0); n++) {
            const double away_mm = field->radii[shell] * field->sphere.radius_mm;
            const alb_vector at = alb_add(field->sphere.centre_mm, alb_times(away_mm, s->directions[n]));
            float *out = sample_at(field, shell, n);
            if (!look_around(out, field, &tracer, at)) {
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
    for (int outer = 0; outer < field->settings.outer; outer++)
        sample_outside(field, outer);
    s->sampled = field->settings.inner == 0 || sample_inside(field, vertices, error);
    return s->sampled;
}

void alb_shadow_field_at(float *out, const alb_shadow_field *field, int shell, alb_vector direction)
{
    const alb_shadow_place place = alb_shadow_grid_place((alb_shadow_grid){field->settings.cells}, direction);
    const size_t values = (size_t)field->channels * values_of(field);
    const float *from[4];
    for (int k = 0; k < 4; k++)
        from[k] = sample_at(field, shell, (size_t)place.nodes[k]);
    for (size_t i = 0; i < values; i++)
        out[i] = place.weights[0] * from[0][i] + place.weights[1] * from[1][i] + place.weights[2] * from[2][i] +
                 place.weights[3] * from[3][i];
}
