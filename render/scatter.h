// Scattering S': what leaves patch j per irradiance on patch i, without the matrix (scatter.c says which integral):
//     B_j = sum_i S'_ji E_i,    all of them per area, RGB; S' has no unit
#pragma once
#include "fit/material.h"
#include "render/optical_path.h"
#include <stdio.h>

// What a patch is made of.
typedef struct alb_surface {
    char name[ALB_GROUP_NAME];
    bool scatters;         // else opaque and diffuse
    bool slab;             // scatters as a slab: reflection on one face, transmission between the two; else as a solid
    double thickness_mm;   // of the slab that was measured; 0: not known
    double reflectance[3]; // opaque
    alb_exit exits[ALB_SIDES];          // which way light leaves, reflected and through a slab; zero: as Lambert says
    double exitance[3];                 // emitted, per area
    alb_profile profiles[ALB_SIDES][3]; // RGB; transmission for slabs only
} alb_surface;

// One scattering body.
typedef struct alb_scatter_body {
    size_t patch_count;
    bool closed, convex;
    alb_optical_kind paths; // ALB_OPTICAL_CONVEX, straight, also where the body is not closed
    double thickness_mm;    // of slabs that are not convex, the median
} alb_scatter_body;

typedef struct alb_scatter_parts alb_scatter_parts;

typedef struct alb_scatter {
    size_t patch_count;
    double (*local)[3]; // [patch] S'_jj: reflectance, or the exact integral over the patch itself
    // [patch] sum over sources i of S'_ji, what patch j sends out of even light of one; and sum_j A_j S'_ji / A_i, the
    // share of the flux into patch i that leaves again anywhere, by which the energy balances.
    double (*row_sums)[3], (*column_sums)[3];
    bool columns_known; // the column sums are those of the profiles as they are
    // By how much what a body or an opaque patch sends out of even light changed at the latest rewrite, over what it
    // was: the most by the totals of the profiles. INFINITY before, and where that cannot be told.
    double change;
    alb_scatter_body *bodies;
    size_t body_count;
    size_t link_count;        // an exit patch and a cluster, a patch or a part of a patch that lights it
    alb_scatter_parts *parts; // holds the workspace of a product: one at a time
} alb_scatter;

// materials[patch] indexes surfaces. The surfaces and patches are read, not kept; materials is borrowed for the life of
// the scatter. error_wanted, relative: of S' irradiance where that is smooth, 0.005 unless there is a reason. Row and
// column sums are known. Profiles that create light are not refused here (alb_radiosity_check). ALB_NO_MEMORY, *scatter
// then empty.
bool alb_scatter_create(alb_scatter *scatter, const alb_patches *patches, const uint16_t *materials,
                        const alb_surface *surfaces, double error_wanted, alb_error *error);
void alb_scatter_free(alb_scatter *scatter);
// The same bodies with other profiles or reflectances: tables, what patches send themselves and row sums anew, the
// links stay, stored weights go. The error holds for profiles as wide as those of the creation or wider; with narrower
// ones it grows as the ratio squared. Column sums stay those of before (alb_scatter_sum_columns). ALB_BAD_DATA where a
// surface scatters that was opaque or the other way round, or became a slab: create anew; the scatter is what it was.
bool alb_scatter_rewrite(alb_scatter *scatter, const alb_surface *surfaces, alb_error *error);
// The same, and quicker: row sums are what the profiles' totals let expect of the last ones, until the next
// alb_scatter_apply has found them beside its product, or alb_scatter_sum_rows.
bool alb_scatter_rewrite_tables(alb_scatter *scatter, const alb_surface *surfaces, alb_error *error);
bool alb_scatter_rows_known(const alb_scatter *scatter);
// The row sums of the profiles as they are, by a product with even light; nothing to do where they are known.
void alb_scatter_sum_rows(alb_scatter *scatter);
// The column sums of the profiles as they are, by a transposed product (scatter_columns.c); nothing to do where they
// are known. ALB_NO_MEMORY; they stay.
bool alb_scatter_sum_columns(alb_scatter *scatter, alb_error *error);
// out = S' irradiance, RGB, per area as the irradiance is; both have patch_count rows and are not the same. Where row
// sums are estimated they are found beside it.
void alb_scatter_apply(double (*out)[3], const alb_scatter *scatter, const double (*irradiance)[3]);
// For materials that stay: products as stored weights of five bits a channel, some six times as fast, up to the next
// rewrite, beside the links. error_wanted, relative: what they may miss of light that ends at a sharp edge, as a rule;
// of smooth light a third of it; of light on a single patch tens of times as much. 0.005, or 0.01 for less memory. The
// row sums stay. error_percent (NULL: not asked for): the largest found, |B - B'| / |B'| in the 2-norm weighted by
// area, over lights with sharp edges at random places. ALB_NO_MEMORY; weights that were kept stay.
bool alb_scatter_keep_weights(alb_scatter *scatter, double error_wanted, double *error_percent, alb_error *error);
// Products by links although weights are kept, up to use_links(..., false): for what asks how much weights miss.
void alb_scatter_use_links(const alb_scatter *scatter, bool links);
// out: the part of S' irradiance that crossed a slab or a sheet, by the links; zero elsewhere. Rows as in
// alb_scatter_apply.
void alb_scatter_apply_across(double (*out)[3], const alb_scatter *scatter, const double (*irradiance)[3]);
// sources[first[p] .. first[p + 1]): patches whose light leaves from patch p, as often as their share of what even
// light of the channel (0 to 2) sends out there; p itself where it is opaque. first has patch_count + 1 numbers,
// sources room for the last of them. Uses the row sums as they stand. ALB_NO_MEMORY.
bool alb_scatter_sample(uint32_t *sources, const alb_scatter *scatter, const uint32_t *first, int channel,
                        alb_error *error);
// One line for each way that light goes inside bodies that are not convex: how many are solids, how many sheets, how
// thick.
void alb_scatter_note(FILE *out, const char *prefix, const alb_scatter *scatter);
// What stays allocated, but for some bytes a material.
size_t alb_scatter_bytes(const alb_scatter *scatter);
