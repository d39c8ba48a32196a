// Form factors by lattice rays: each patch keeps the list of what its rays hit, one index a ray and no value.
#pragma once
#include "render/patch.h"
#include "render/tracer.h"

typedef enum alb_sampling { ALB_SAMPLING_LATTICE, ALB_SAMPLING_RANDOM } alb_sampling;

typedef struct alb_form_factors {
    size_t patch_count;
    int rays; // a patch
    uint64_t seed;
    alb_sampling sampling;
    uint32_t *hits; // [patch * rays + q]: patch index; patch_count: the sky; patch_count + 1: the back of a patch
    size_t sky_rays, back_rays;
} alb_form_factors;

// Casts `rays` rays from every patch. A ray that leaves the scene points to the sky. One that meets the back of a patch
// gets nothing from there: a back is black. Closed bodies and rooms have no visible backs; open meshes may, and
// back_rays counts them so that the caller can warn.
bool alb_form_factors_create(alb_form_factors *factors, const alb_patches *patches, const alb_tracer *tracer, int rays,
                             uint64_t seed, alb_sampling sampling, alb_error *error);
void alb_form_factors_free(alb_form_factors *factors);
// Direction of ray q of the patch: what lights the sky entries are asked for.
alb_vector alb_form_factors_direction(const alb_form_factors *factors, const alb_patches *patches, size_t patch, int q);
// out = F radiosity, RGB: the irradiance that patches send to each other. out and radiosity have patch_count rows.
void alb_form_factors_apply(double (*out)[3], const alb_form_factors *factors, const double (*radiosity)[3]);
