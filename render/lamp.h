// Lamps: patches that emit. Where they are small against the scene their direct light is worth rays of its own.
#pragma once
#include "render/patch.h"
#include "render/tracer.h"
#include <stdint.h>

// Whether lamps are so small (under a fiftieth of the scene's area) that the rays of the form factors would meet them
// too seldom. False where nothing emits.
bool alb_lamps_are_small(const alb_patches *patches, const double (*exitance)[3]);
// Adds the irradiance that the emitting patches send directly: 64 shadow-tested pairs of points a patch.
bool alb_lamps_add(double (*irradiance)[3], const double (*exitance)[3], const alb_patches *patches,
                   const alb_tracer *tracer, uint64_t seed, uint64_t stream, alb_error *error);
