// Form factors by lattice rays: each patch keeps the list of what its rays hit, one 16-bit index a ray and no value.
#pragma once
#include "render/form_factor_cast.h"
#include "render/form_factor_rows.h"
#include "render/form_factor_share.h"

enum { ALB_RAYS_MAX = 1 << 16 }; // a patch

typedef struct alb_form_factors {
    size_t patch_count;
    const double *areas_mm2; // borrowed
    int rays;                // a patch, where a stated error has not asked for more
    uint64_t seed;
    alb_sampling sampling;
    size_t memory_bytes;   // hits beyond it lie in a file; 0: no limit
    alb_hit_rows rows;     // of each patch: patch index; patch_count: the sky; patch_count + 1: the back of a patch
    alb_row_shares shares; // what neighbours gather in common
    float *sky_shares, *back_shares;         // of each patch's rays and of those it shares; NULL: none
    uint8_t *phases;                         // of the patches' lattices; NULL: turned at random
    uint64_t *sky_mask;                      // of the rays in order, one bit each; NULL: no sky
    size_t sky_rays, back_rays, reshot_rays; // in all; reshot: slipped through a crack, and cast again
    float (*gathered)[4]; // scratch of the products: radiosity of the patches, the sky and backs; areas
} alb_form_factors;

// Casts `rays` rays (1..ALB_RAYS_MAX) from every patch. A ray that leaves the scene points to the sky. One that meets
// the back of a patch gets nothing from there: a back is black. Closed bodies and rooms have no visible backs; open
// meshes may, and back_rays counts them so that the caller can warn.
bool alb_form_factors_create(alb_form_factors *factors, const alb_patches *patches, const alb_tracer *tracer, int rays,
                             uint64_t seed, alb_sampling sampling, alb_error *error);
// The same, with at most memory_bytes (0: no limit) of hits in memory and otherwise all of them in an unlinked file
// that is mapped: the same answers to the bit. ALB_ACCESS names the folder where the disk has no room.
bool alb_form_factors_create_within(alb_form_factors *factors, const alb_patches *patches, const alb_tracer *tracer,
                                    int rays, uint64_t seed, alb_sampling sampling, size_t memory_bytes,
                                    alb_error *error);
// Casts all rows again with lengths[patch] rays; where it fails they are what they were.
bool alb_form_factors_cast_again(alb_form_factors *factors, const alb_patches *patches, const alb_tracer *tracer,
                                 const uint32_t *lengths, alb_error *error);
void alb_form_factors_free(alb_form_factors *factors);
size_t alb_form_factors_bytes(const alb_form_factors *factors);

// Rays of the patch.
static inline int alb_form_factors_rays(const alb_form_factors *factors, size_t patch)
{
    return (int)alb_hit_rows_length(&factors->rows, patch);
}
static inline double alb_form_factors_sky_share(const alb_form_factors *factors, size_t patch)
{
    return factors->sky_shares ? (double)factors->sky_shares[patch] : 0;
}
static inline double alb_form_factors_back_share(const alb_form_factors *factors, size_t patch)
{
    return factors->back_shares ? (double)factors->back_shares[patch] : 0;
}
// What they hit: the even rays, ascending, then the odd ones, ascending. `hits` has room for all of them.
void alb_form_factors_row(uint32_t *hits, const alb_form_factors *factors, size_t patch);
// hits[0 .. length): one list for a group of patches, at equal steps through their area and through the list of each.
// row: scratch for the longest list.
void alb_form_factors_group_row(uint32_t *hits, uint32_t length, const alb_form_factors *factors,
                                const uint32_t *patches, size_t count, uint32_t *row);
// Whether ray q of the patch leaves the scene, and its direction: what lights the sky are asked for.
bool alb_form_factors_sees_sky(const alb_form_factors *factors, size_t patch, int q);
alb_vector alb_form_factors_direction(const alb_form_factors *factors, const alb_patches *patches, size_t patch, int q);

// out = F radiosity, RGB: the irradiance that patches send to each other, by their own rays and those of neighbours
// that see nearly the same (form_factor_share.h). out and radiosity have patch_count rows. Gathered in single precision
// (1e-7 relative); one product at a time for one alb_form_factors, its scratch is shared.
void alb_form_factors_apply(double (*out)[3], const alb_form_factors *factors, const double (*radiosity)[3]);
// The same by their own rays alone.
void alb_form_factors_apply_rows(double (*out)[3], const alb_form_factors *factors, const double (*radiosity)[3]);
// values, of each patch by its own rays, become what patches that share rays have in common.
void alb_form_factors_share(double (*values)[3], const alb_form_factors *factors);

// --- the error of the rows -------------------------------------------------------------------------------------------
// out = (F_even - F_odd) radiosity / 2, the halves of the rays apart: its rms over the patches is the rms
// error of F radiosity, or a little above it. sky (may be NULL) is the sky's even radiosity, pi times its radiance.
void alb_form_factors_half_difference(double (*out)[3], const alb_form_factors *factors, const double (*radiosity)[3],
                                      const double sky[3]);
// rms error over the patches in percent of the rms irradiance, the worst channel and the worse of two means, of the
// patches and over their area, as a bound that holds in 95 % of draws of the rays; 0 where all is black. NAN where a
// patch has a single ray and so no halves.
bool alb_form_factors_error(double *percent, const alb_form_factors *factors, const double (*radiosity)[3],
                            const double sky[3], alb_error *error);
// Casts rows again with as many rays as bring that error to `percent`, for light like `radiosity` (a first solution),
// more where the halves differ more, and never fewer than `rays` or more than rays_max. *reached (may be NULL) is
// the error that the new rows state. It fails as create does; the rows are then what they were.
bool alb_form_factors_refine(double *reached, alb_form_factors *factors, const alb_patches *patches,
                             const alb_tracer *tracer, const double (*radiosity)[3], const double sky[3],
                             double percent, int rays_max, alb_error *error);
