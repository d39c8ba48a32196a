// What a shadow field is sampled with. Internal to render/shadow_field*.c and render/shadow_studio.c.
#pragma once
#include "render/shadow_field.h"
#include "render/shadow_lattice.h"
#include "render/shadow_shape.h"

typedef struct alb_shadow_work { // of one thread
    alb_shadow_corners corners;
    float *nearest;
    uint32_t *seen;
} alb_shadow_work;

typedef struct alb_shadow_nodes {
    size_t count;
    alb_vector *directions;
    float *axes; // [3][node]: from each node to the middle
} alb_shadow_nodes;

typedef struct alb_shadow_studio {
    alb_shadow_shape shape;
    alb_shadow_lens lenses[ALB_SHADOW_SHELLS_MAX]; // of the shells that are pictures
    alb_shadow_nodes nodes[ALB_SHADOW_SHELLS_MAX];
    alb_vector *vertices; // that the samples are of
    bool sampled;
    float *local; // [channel][value][node] of the shell at work: in the pictures' frames
    alb_shadow_work *works;
    int work_count;
    alb_shadow_lattice rays; // of inner nodes
} alb_shadow_studio;

// Of a field whose shells are placed. False leaves what alb_shadow_studio_free can release.
bool alb_shadow_studio_create(alb_shadow_studio *studio, const alb_shadow_field *field, const alb_mesh *mesh,
                              const float (*face_radiance)[3], const char *name, alb_error *error);
void alb_shadow_studio_free(alb_shadow_studio *studio);

static inline size_t alb_shadow_shell_values(const alb_shadow_shell *shell)
{
    return (size_t)(shell->order * shell->order);
}

static inline float *alb_shadow_sample_at(const alb_shadow_field *field, int shell, size_t node)
{
    const alb_shadow_shell *of = &field->shells[shell];
    return field->samples + of->first + node * (size_t)field->channels * alb_shadow_shell_values(of);
}
