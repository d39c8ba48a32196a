// What an object hides from its own surface as it is now: probes on the surface see by rays, vertices take from the
// probes near them. Where a field of few shells around the object's middle stops being true, between the object's
// parts.
#pragma once
#include "render/shadow_laws.h"
#include "render/shadow_probes.h"
#include "render/tracer.h"

typedef struct alb_shadow_surface {
    alb_mesh mesh; // faces; vertices as the probes last saw them
    alb_shadow_probes probes;
    bool sampled;
    float (*hidden)[ALB_SHADOW_VALUES]; // of each vertex: coefficients of max(0, n.d) where the object hides d
    float *seen, *axes;                 // of the probes: [value][probe], [3][probe]
    bool *buried;                       // of the probes: all they see is the object
    alb_tracer tracer;                  // the surface stays at its address
} alb_shadow_surface;

// The mesh is copied; probes as for alb_shadow_probes_create.
bool alb_shadow_surface_create(alb_shadow_surface *surface, const alb_mesh *mesh, const alb_vector *normals,
                               size_t probes, alb_error *error);
void alb_shadow_surface_free(alb_shadow_surface *surface);
// Sets `hidden` for the mesh with other vertices; what stands still keeps it. Bytes independent of threads.
bool alb_shadow_surface_sample(alb_shadow_surface *surface, const alb_vector *vertices, const alb_vector *normals,
                               alb_error *error);
