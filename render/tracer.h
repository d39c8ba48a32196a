// Rays against a triangle mesh. The only user of Embree.
#pragma once
#include "render/mesh.h"

typedef struct alb_tracer {
    void *device, *scene, *geometry; // Embree handles; geometry NULL: no faces
    int64_t bytes;                   // memory Embree holds; its own count
    alb_vector middle;               // of the mesh's bounds: Embree's origin
    double slack_mm;                 // nearer than this along a ray two surfaces may come in either order
} alb_tracer;

typedef struct alb_hit {
    uint32_t face;
    bool front;  // the ray met the side from which the corners run counter-clockwise
    double u, v; // barycentric weights of the corners 1 and 2
    double distance_mm;
} alb_hit;

// Copies the mesh, which may be empty. The tracer stays at its address (Embree counts bytes into it).
bool alb_tracer_create(alb_tracer *tracer, const alb_mesh *mesh, alb_error *error);
// For a mesh that moves: made and moved in a tenth of the time or less, rays take longer.
bool alb_tracer_create_moving(alb_tracer *tracer, const alb_mesh *mesh, alb_error *error);
// The mesh's vertices, as many as it was created with, elsewhere. What fails leaves a tracer to be freed.
bool alb_tracer_move(alb_tracer *tracer, const alb_vector *vertices, size_t count, alb_error *error);
void alb_tracer_free(alb_tracer *tracer);
// The closest hit of the ray; false where there is none. `direction` is a unit vector. Safe from many threads. Where a
// front and a back lie within slack_mm (a sheet of two faces back to back) the front is what the ray meets.
bool alb_tracer_closest(alb_hit *hit, const alb_tracer *tracer, alb_vector origin, alb_vector direction);
// Whether anything lies on the segment between the points, ends included up to float rounding.
bool alb_tracer_blocked(const alb_tracer *tracer, alb_vector from, alb_vector to);
// How many more fronts than backs the whole ray passes: the winding number of its origin, negated, where the mesh is
// closed. 0 in the open, 1 inside a room, one less inside a body than around it.
int alb_tracer_crossings(const alb_tracer *tracer, alb_vector origin, alb_vector direction);
