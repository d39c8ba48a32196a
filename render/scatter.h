// Scattering S': what leaves patch j per irradiance on patch i, in density form, without the matrix.
#pragma once
#include "fit/material.h"
#include "render/patch.h"

// What a patch is made of.
typedef struct alb_surface {
    char name[ALB_GROUP_NAME];
    bool scatters;         // else opaque and diffuse
    bool slab;             // scatters as a slab: reflection on one face, transmission between the two; else as a solid
    double reflectance[3]; // opaque
    double exitance[3];    // emitted, per area
    alb_profile profiles[ALB_SIDES][3]; // RGB; transmission for slabs only
} alb_surface;

enum { ALB_SCATTER_TABLE = 16384 };

// One scattering body with what its far pairs need, in the order of body.patches.
typedef struct alb_scatter_body {
    uint32_t *patches;
    size_t count;
    float (*centres)[3]; // mm, relative to the body's middle
    float *areas_mm2;
    float *near2_mm2;              // squared distance below which the patch, as a source, is integrated exactly
    signed char *sides;            // slab: +1 and -1 on the two faces, 0 at the edge; solid: all 0
    float axis[3];                 // slab: normal of the faces
    float entries_per_mm;          // of the tables
    float (*tables[ALB_SIDES])[3]; // S(r) per RGB, ALB_SCATTER_TABLE + 2 entries; transmission NULL for solids
    double (*amounts)[3];          // workspace of a product: one at a time
    bool closed, convex;
} alb_scatter_body;

typedef struct alb_scatter {
    size_t patch_count;
    double (*local)[3];  // S'_jj: reflectance, or the exact self-term
    size_t *row_starts;  // patch_count + 1: near pairs of exit patch j
    uint32_t *sources;   // source patch i
    float (*weights)[3]; // S'_ji
    alb_scatter_body *bodies;
    size_t body_count;
} alb_scatter;

// materials[patch] indexes surfaces. Both are read, not kept.
bool alb_scatter_create(alb_scatter *scatter, const alb_patches *patches, const uint16_t *materials,
                        const alb_surface *surfaces, alb_error *error);
void alb_scatter_free(alb_scatter *scatter);
// out = S' irradiance, RGB; out and irradiance have patch_count rows and are not the same.
void alb_scatter_apply(double (*out)[3], const alb_scatter *scatter, const double (*irradiance)[3]);
// Share of the flux into patch i that leaves again anywhere: sum_j A_j S'_ji / A_i. The energy balance's own row.
void alb_scatter_column_sums(double (*out)[3], const alb_scatter *scatter, const alb_patches *patches);
size_t alb_scatter_bytes(const alb_scatter *scatter);

// Integral of S(|x - p|) over the triangle for three profiles, 1 = all that leaves the plane at most.
void alb_scatter_triangle(double integral[3], const alb_profile profiles[3], const alb_vector triangle[3],
                          alb_vector p);
// The same by seven points, for p further from the triangle's middle than 1.25 of its longest edge.
void alb_scatter_triangle_from_afar(double integral[3], const alb_profile profiles[3], const alb_vector triangle[3],
                                    alb_vector p);
