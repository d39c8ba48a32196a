// Between nodes samples are interpolated bilinearly. In the world's frame that blurs an object by the angle between two
// nodes as seen from its middle; the far shell first turns each node's sample with the rotation that takes the node to
// the receiver along a great circle, and blurs only the parallax of the object's depth. In the frames of
// the two axes that rotation is a turn about z alone, by the angle between them: it varies without a seam, though
// frames have one at their poles.
//
// Stops being true where what is seen changes faster than bilinearly between nodes: 11 degrees for 8 cells.
#include "render/shadow_field.h"
#include "base/memory.h"
#include "render/shadow_studio.h"
#include <stdlib.h>
#include <string.h>

const alb_shadow_settings alb_shadow_defaults = {
    .order = 4, .cells = 8, .pixels = 64, .distance = 1.1, .outer = 1, .rays = 256, .probes = 1200, .cluster = 0.04};
const alb_shadow_settings alb_shadow_light_settings = {
    .order = 4, .cells = 8, .pixels = 40, .distance = 1.1, .outer = 6};
// Radii of 1 to 6 inner shells from outside inwards; of the outer ones over the first one's; of the far one.
static const double inner_radii[ALB_SHADOW_INNER_MAX][ALB_SHADOW_INNER_MAX] = {{0.85},
                                                                               {0.8, 0.55},
                                                                               {0.88, 0.72, 0.55},
                                                                               {0.94, 0.8, 0.66, 0.52},
                                                                               {0.96, 0.84, 0.72, 0.61, 0.51},
                                                                               {0.96, 0.86, 0.76, 0.67, 0.58, 0.5}},
                    outer_ratios[ALB_SHADOW_OUTER_MAX] = {1, 1.4, 2, 3.2, 6, 12}, far_radius = 2.9;

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

// The nodes of shells inside are nearer to each other: fewer do. The far shell takes few nodes and many bands.
static alb_shadow_shell shell_of(const alb_shadow_settings *s, int index)
{
    const int outer = index - s->inner;
    if (outer == s->outer)
        return (alb_shadow_shell){
            .radius = far_radius, .order = ALB_SH_ORDER_MAX, .cells = (s->cells + 1) / 2, .turns = true};
    const double radius = outer < 0 ? inner_radii[s->inner - 1][-1 - outer] : s->distance * outer_ratios[outer];
    const int cells = radius < 1 ? (int)ceil((0.5 + 0.5 * radius) * s->cells) : s->cells;
    return (alb_shadow_shell){.radius = radius, .order = s->order, .cells = cells};
}

static void place_shells(alb_shadow_field *field)
{
    field->shell_count = field->settings.inner + field->settings.outer + field->settings.far;
    for (int i = 0; i < field->shell_count; i++) {
        alb_shadow_shell *shell = &field->shells[i];
        *shell = shell_of(&field->settings, i);
        shell->first = field->sample_count;
        field->sample_count +=
            (size_t)alb_shadow_grid_count((alb_shadow_grid){shell->cells}) * alb_shadow_sample_size(field, shell);
    }
}

static size_t values_of(const alb_shadow_field *field, const alb_shadow_shell *shell)
{
    return (size_t)field->channels * alb_shadow_shell_values(shell);
}

size_t alb_shadow_sample_size(const alb_shadow_field *field, const alb_shadow_shell *shell)
{
    const size_t values = values_of(field, shell);
    return field->settings.packed ? 1 + (values + sizeof(float) - 1) / sizeof(float) : values;
}

static float *find_sample(const alb_shadow_field *field, int shell, size_t node)
{
    const alb_shadow_shell *of = &field->shells[shell];
    return field->samples + of->first + node * alb_shadow_sample_size(field, of);
}

void alb_shadow_sample_put(const alb_shadow_field *field, int shell, size_t node, const float *sample)
{
    const size_t values = values_of(field, &field->shells[shell]);
    float *out = find_sample(field, shell, node), largest = 0;
    if (!field->settings.packed) {
        memcpy(out, sample, values * sizeof *out);
        return;
    }
    for (size_t i = 0; i < values; i++)
        largest = fmaxf(largest, fabsf(sample[i]));
    *out = largest / 127;
    int8_t *bytes = (int8_t *)(out + 1);
    for (size_t i = 0; i < values; i++)
        bytes[i] = (int8_t)(largest > 0 ? lrintf(sample[i] / largest * 127) : 0);
}

const float *alb_shadow_sample_get(float *space, const alb_shadow_field *field, int shell, size_t node)
{
    const float *kept = find_sample(field, shell, node);
    if (!field->settings.packed)
        return kept;
    const int8_t *bytes = (const int8_t *)(kept + 1);
    const size_t values = values_of(field, &field->shells[shell]);
    for (size_t i = 0; i < values; i++)
        space[i] = *kept * (float)bytes[i];
    return space;
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
        alb_shadow_studio_create(field->studio, field, mesh, face_radiance, name, error))
        return true;
    alb_shadow_field_free(field);
    return false;
}

void alb_shadow_field_free(alb_shadow_field *field)
{
    if (field->studio)
        alb_shadow_studio_free(field->studio);
    free(field->studio);
    free(field->samples);
    *field = (alb_shadow_field){0};
}

size_t alb_shadow_field_bytes(const alb_shadow_field *field) { return field->sample_count * sizeof(float); }

// The directions x and y of the frame of an axis, found as rotations of batches find them.
static void frame_of(alb_vector *x, alb_vector *y, alb_vector axis)
{
    const float u = (float)axis.x, v = (float)axis.y, sine = sqrtf(u * u + v * v);
    const double p = sine > 0 ? (double)(u / sine) : 1, q = sine > 0 ? (double)(v / sine) : 0;
    *x = (alb_vector){p * axis.z, q * axis.z, -(double)sine};
    *y = (alb_vector){-q, p, 0};
}

// out += weight sample, turned about z by the angle between the frame of `to` and that of `from`, laid flat there: for
// 20 degrees between them that is within half a degree of carried along the great circle.
static void add_turned(float *out, const float *sample, int order, float weight, alb_vector from, alb_vector to)
{
    alb_vector x, y, flat;
    frame_of(&x, &flat, from);
    frame_of(&x, &y, to);
    const double across = alb_dot(flat, x), along = alb_dot(flat, y), length = hypot(across, along);
    const float c = (float)(along / length), s = (float)(-across / length);
    float wc = weight, ws = 0;
    for (int m = 0; m < order; m++) {
        for (int l = m; l < order; l++) {
            const int plus = alb_sh_index(l, m), minus = alb_sh_index(l, -m);
            const float p = sample[plus], q = sample[minus];
            out[plus] += wc * p - ws * q;
            if (m)
                out[minus] += ws * p + wc * q;
        }
        const float next = wc * c - ws * s;
        ws = wc * s + ws * c;
        wc = next;
    }
}

static void at_turned(float *out, const alb_shadow_field *field, int shell, const alb_shadow_place *place,
                      alb_vector direction)
{
    const alb_shadow_shell *of = &field->shells[shell];
    const alb_vector *nodes = field->studio->nodes[shell].directions, axis = alb_times(-1, alb_unit(direction));
    memset(out, 0, alb_shadow_shell_values(of) * sizeof *out);
    for (int k = 0; k < 4; k++) {
        const size_t n = (size_t)place->nodes[k];
        float space[ALB_SH_COUNT_MAX];
        add_turned(out, alb_shadow_sample_get(space, field, shell, n), of->order, place->weights[k],
                   alb_times(-1, nodes[n]), axis);
    }
}

void alb_shadow_field_at(float *out, const alb_shadow_field *field, int shell, alb_vector direction)
{
    const alb_shadow_shell *of = &field->shells[shell];
    const alb_shadow_place place = alb_shadow_grid_place((alb_shadow_grid){of->cells}, direction);
    if (of->turns) {
        at_turned(out, field, shell, &place, direction);
        return;
    }
    const size_t values = values_of(field, of);
    float space[4][3 * ALB_SH_COUNT_MAX];
    const float *from[4];
    for (int k = 0; k < 4; k++)
        from[k] = alb_shadow_sample_get(space[k], field, shell, (size_t)place.nodes[k]);
    for (size_t i = 0; i < values; i++)
        out[i] = place.weights[0] * from[0][i] + place.weights[1] * from[1][i] + place.weights[2] * from[2][i] +
                 place.weights[3] * from[3][i];
}
