// Rays against a triangle mesh. The only user of Embree.
#pragma once
#include "render/mesh.h"

typedef struct alb_tracer {
    void *device, *scene; // Embree handles
    int64_t bytes;        // memory Embree holds; its own count
    alb_vector middle;    // of the mesh: Embree's origin
} alb_tracer;

typedef struct alb_hit {
    uint32_t face;
    bool front;  // the ray met the side from which the corners run counter-clockwise
    double u, v; // barycentric weights of the corners 1 and 2
    double distance_mm;
} alb_hit;

// Copies the mesh. The tracer stays at its address (Embree counts bytes into it).
bool alb_tracer_create(alb_tracer *tracer, const alb_mesh *mesh, alb_error *error);
void alb_tracer_free(alb_tracer *tracer);
// The closest hit of the ray; false where there is none. `direction` is a unit vector. Safe from many threads.
bool alb_tracer_closest(alb_hit *hit, const alb_tracer *tracer, alb_vector origin, alb_vector direction);
// Whether anything lies on the segment between the points, ends included up to float rounding.
bool alb_tracer_blocked(const alb_tracer *tracer, alb_vector from, alb_vector to);
