// Rays from one point to all sides: the occlusion of a place that an object may surround.
#pragma once
#include "render/tracer.h"

typedef struct alb_shadow_lattice {
    int count, order;
    alb_vector *directions;
    float *basis; // [ray][order^2], times 4 pi / count
} alb_shadow_lattice;

bool alb_shadow_lattice_create(alb_shadow_lattice *lattice, int count, int order, alb_error *error);
void alb_shadow_lattice_free(alb_shadow_lattice *lattice);
// out[order^2] of occlusion. False where the place is inside the object, as more than half of the rays meet a back
// first: *from is then just behind the nearest hit.
bool alb_shadow_lattice_look(float *out, alb_vector *from, const alb_shadow_lattice *lattice, const alb_tracer *tracer);
