// A light's surface as samples that move with it, few and many, in groups that an occluder hides as one.
#pragma once
#include "base/error.h"
#include "render/shadow_grid.h"
#include "render/shadow_sphere.h"
#include "render/tracer.h"

enum {
    ALB_SHADOW_EMITTER_GROUPS = 32,
    ALB_SHADOW_EMITTER_FEW = 128,   // 4 a group
    ALB_SHADOW_EMITTER_MANY = 2048, // 16 of each of the few: for receivers so near that those are seen apart
    ALB_SHADOW_EMITTER_CELLS = 5    // of the directions in which it is known what the light hides of itself
};

typedef struct alb_shadow_emitter_sample {
    float at[3], area[3], radiance[3]; // in radii of the light's sphere about its centre; area along the normal
    float size;                        // of the area, over pi
} alb_shadow_emitter_sample;

typedef struct alb_shadow_emitter {
    struct alb_shadow_piece *pieces; // faces that shine, or parts of them, sample after sample
    size_t piece_count, many_count, few_count, group_count;
    uint32_t *first_pieces; // of each of the many, and their end
    alb_shadow_emitter_sample *many, few[ALB_SHADOW_EMITTER_FEW];
    size_t first_many[ALB_SHADOW_EMITTER_FEW + 1], first_few[ALB_SHADOW_EMITTER_GROUPS + 1]; // and their ends
    float middles[ALB_SHADOW_EMITTER_GROUPS][3];                                             // as samples' places
    alb_shadow_sphere groups[ALB_SHADOW_EMITTER_GROUPS]; // in mm: about the middle, of a disc of the area
    float *seen;                                         // [group][node]: share that the light itself leaves of it
    bool hidden[ALB_SHADOW_EMITTER_GROUPS];              // somewhere the share is below 1
    bool moved;                                          // when last placed
    alb_vector *vertices;                                // for which
    size_t vertex_count;
    alb_tracer tracer; // stays at its address
} alb_shadow_emitter;

// Cuts the faces that shine into samples of about equal area, each of what lies together, faces the same way and has
// the same colour in the mesh as it is; few large faces are divided first. face_radiance of each face. The emitter
// stays at its address.
bool alb_shadow_emitter_create(alb_shadow_emitter *emitter, const alb_mesh *mesh, const float (*face_radiance)[3],
                               alb_error *error);
void alb_shadow_emitter_free(alb_shadow_emitter *emitter);
// The samples of the mesh with other vertices; the sphere is that of the light.
bool alb_shadow_emitter_place(alb_shadow_emitter *emitter, const alb_vector *vertices, const alb_shadow_sphere *sphere,
                              alb_error *error);
// The share of a group that the light's own parts leave towards a direction of any length but zero.
float alb_shadow_emitter_seen(const alb_shadow_emitter *emitter, size_t group, alb_vector direction);
