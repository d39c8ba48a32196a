// Precomputed transport: at every vertex of a rigid body the cosine times what the body itself leaves visible, as
// spherical harmonics. Irradiance from an environment is then one product of vectors, self-shadows included, without
// shadow fields. Sloan et al. 2002; for environments of finite size Wang et al. 2006, 3.2.
#pragma once
#include "render/scene.h"
#include "render/shadow_receivers.h"

typedef struct alb_shadow_transport {
    size_t vertex_count, row_count;         // of the scene, of the body
    bool *of_body;                          // of each object
    uint32_t *rows;                         // of each vertex; ALB_TRANSPORT_NONE: not of the body
    alb_vector *rest;                       // the vertices for which the vectors were made
    float (*vectors)[ALB_SH_COUNT_MAX];     // [row], in the frame of those
    size_t matrix_count;                    // of its vertices on translucent faces
    uint32_t *matrix_of;                    // of each row; ALB_TRANSPORT_NONE: opaque
    float (*matrices)[3][ALB_SH_COUNT_MAX]; // a vector for each colour: what scatters to the vertex from anywhere
    uint32_t corners[3];                    // of the body: vertices far from each other
    float quaternion[4];                    // from rest to now; 0, 0, 0, 1: not turned
} alb_shadow_transport;
#define ALB_TRANSPORT_NONE UINT32_MAX

// Of the objects of_body, together one body; those that receive only hide nothing. Normals: of the scene's vertices.
// The irradiance of an open sky errs by 0.004 of it where half is hidden, by nothing in the open. 256 bytes a row,
// 768 more where it is translucent. Fails as scattering does.
bool alb_shadow_transport_create(alb_shadow_transport *transport, const alb_scene *scene, const bool *of_body,
                                 const alb_vector *normals, alb_error *error);
// Makes the matrices from the vectors: internal to creation.
bool alb_shadow_transport_scatter(alb_shadow_transport *transport, const alb_scene *scene, alb_error *error);
void alb_shadow_transport_free(alb_shadow_transport *transport);
// Finds where the body is now. ALB_BAD_DATA: a vertex lies off where the motion of the others takes it, by more than
// 1e-4 of the body's extent.
bool alb_shadow_transport_follow(alb_shadow_transport *transport, const alb_vector *vertices, alb_error *error);
// Lobes of the vertices first .. first + count - 1 for one colour, [value][ALB_SHADOW_BLOCK], in the world's frame:
// those of the body are replaced, others left. in_body[r] says which. False where the three colours have the same
// lobes.
bool alb_shadow_transport_lobes(float *lobes, bool *in_body, const alb_shadow_transport *transport, int colour,
                                size_t first, size_t count);
