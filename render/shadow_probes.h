// Which vertices of a surface see for themselves, and how the others take from them.
#pragma once
#include "render/mesh.h"

enum { ALB_SHADOW_PROBE_NEIGHBOURS = 4 };

typedef struct alb_shadow_probes {
    size_t count;
    uint32_t *vertices;                                  // [count]
    uint32_t (*neighbours)[ALB_SHADOW_PROBE_NEIGHBOURS]; // of each vertex of the mesh: numbers of probes
    float (*weights)[ALB_SHADOW_PROBE_NEIGHBOURS];       // sum 1
} alb_shadow_probes;

// limit: at most so many vertices become one, but at least one of each connected part; with as many as vertices each
// sees for itself. Normals: of the vertices. False leaves what alb_shadow_probes_free can release.
bool alb_shadow_probes_create(alb_shadow_probes *probes, const alb_mesh *mesh, const alb_vector *normals, size_t limit,
                              alb_error *error);
void alb_shadow_probes_free(alb_shadow_probes *probes);
