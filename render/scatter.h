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
    alb_exit exits[ALB_SIDES];          // which way light leaves, reflected and through a slab; zero: as Lambert says
    double exitance[3];                 // emitted, per area
    alb_profile profiles[ALB_SIDES][3]; // RGB; transmission for slabs only
} alb_surface;

// The three profiles of one side, tabulated over distance; where a table is NULL the closed form is used.
enum { ALB_SCATTER_TABLE = 16384 };
typedef struct alb_radial {
    const alb_profile *profiles; // R, G, B
    double entries_per_mm;
    float (*values)[4];    // S(r) of R, G, B and a zero; ALB_SCATTER_TABLE + 2 entries
    double (*discs)[3][2]; // P(r) / r^2 and its derivative times the spacing, P(r) = integral_0^r S r dr; as many
} alb_radial;

// Patches as sources, side by side: three runs, the faces +1, the edge 0 (all of a solid), the faces -1.
typedef struct alb_sources {
    size_t count, starts[4];
    float *x_mm, *y_mm, *z_mm;   // relative to the body's middle
    float *near2_mm2[ALB_SIDES]; // squared distance below which the patch, as a source, is integrated exactly
    double (*amounts)[4];        // R, G, B and a zero: area, or area times irradiance
} alb_sources;

// One scattering body with what its far pairs need.
typedef struct alb_scatter_body {
    uint32_t *patches;             // in the order of the runs
    alb_sources sources, lit;      // all; workspace of a product (one at a time): those that light falls on
    float axis[3];                 // slab: normal of the faces
    alb_radial radials[ALB_SIDES]; // transmission for slabs only; values alone
    bool closed, convex;
} alb_scatter_body;

typedef struct alb_scatter {
    size_t patch_count;
    double (*local)[3];  // S'_jj: reflectance, or the exact self-term
    size_t *row_starts;  // patch_count + 1: near pairs of exit patch j
    uint32_t *sources;   // source patch i
    float (*weights)[3]; // S'_ji
    // Sum over sources i of S'_ji, what patch j sends out of even light; and the share of the flux into patch i that
    // leaves again anywhere, sum_j A_j S'_ji / A_i: the energy balance's own row.
    double (*row_sums)[3], (*column_sums)[3];
    alb_scatter_body *bodies;
    size_t body_count;
} alb_scatter;

// materials[patch] indexes surfaces. Both are read, not kept.
bool alb_scatter_create(alb_scatter *scatter, const alb_patches *patches, const uint16_t *materials,
                        const alb_surface *surfaces, alb_error *error);
void alb_scatter_free(alb_scatter *scatter);
// out = S' irradiance, RGB; out and irradiance have patch_count rows and are not the same.
void alb_scatter_apply(double (*out)[3], const alb_scatter *scatter, const double (*irradiance)[3]);
// The part of S' irradiance that crossed a slab: zero elsewhere. Same rows. Fails for want of memory alone.
bool alb_scatter_apply_across(double (*out)[3], const alb_scatter *scatter, const double (*irradiance)[3],
                              alb_error *error);
size_t alb_scatter_bytes(const alb_scatter *scatter);

// Tables over 0 .. end_mm; that of P is left out where it would be wrong by more than 1e-6 of P.
bool alb_radial_create(alb_radial *radial, const alb_profile profiles[3], double end_mm, alb_error *error);
void alb_radial_free(alb_radial *radial);

double alb_longest_edge(const alb_vector triangle[3]);
// Integral of S(|x - p|) over the triangle for three profiles, 1 = all that leaves the plane at most.
void alb_scatter_triangle(double integral[3], const alb_radial *radial, const alb_vector triangle[3], alb_vector p);
// The same by seven points, for p further from the triangle's middle than 1.25 of its longest edge.
void alb_scatter_triangle_from_afar(double integral[3], const alb_radial *radial, const alb_vector triangle[3],
                                    alb_vector p);
