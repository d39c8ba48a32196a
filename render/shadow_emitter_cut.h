// Which faces of a light make which samples. Internal to render/shadow_emitter.c.
#pragma once
#include "render/shadow_emitter.h"

// A face that shines, or a part of one.
typedef struct alb_shadow_piece {
    float weights[3], share, radiance[3]; // of the corners in its middle; of the face's area
    uint32_t corners[3];
} alb_shadow_piece;

static inline alb_vector alb_shadow_piece_at(const alb_shadow_piece *p, const alb_vector *vertices)
{
    // from one corner on: the weights of all three add up to 1 but for rounding, which far from the origin is a
    // distance
    const alb_vector first = vertices[p->corners[0]];
    alb_vector at = first;
    for (int k = 1; k < 3; k++)
        at = alb_add(at, alb_times((double)p->weights[k], alb_sub(vertices[p->corners[k]], first)));
    return at;
}

// Along the normal, mm^2.
static inline alb_vector alb_shadow_piece_area(const alb_shadow_piece *p, const alb_vector *vertices)
{
    const alb_vector a = vertices[p->corners[0]];
    return alb_times(0.5 * (double)p->share,
                     alb_cross(alb_sub(vertices[p->corners[1]], a), alb_sub(vertices[p->corners[2]], a)));
}

// Sets the pieces and which are of which sample and group; first_pieces is there.
bool alb_shadow_emitter_cut(alb_shadow_emitter *emitter, const alb_mesh *mesh, const float (*face_radiance)[3],
                            alb_error *error);
