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

// Floats that a node's sample takes up.
size_t alb_shadow_sample_size(const alb_shadow_field *field, const alb_shadow_shell *shell);
// Keeps the sample[channel][order^2] of a node: as it is, or packed: the largest coefficient / 127, then a signed byte
// for each.
void alb_shadow_sample_put(const alb_shadow_field *field, int shell, size_t node, const float *sample);
// The sample: in place, or unpacked to `space`, which holds 3 ALB_SH_COUNT_MAX.
const float *alb_shadow_sample_get(float *space, const alb_shadow_field *field, int shell, size_t node);
