// One side of a material's scattering, by distance: what the products look up, and what the choice of links needs.
#pragma once
#include "render/scatter.h"

enum {
    ALB_CODES = 256,
    ALB_NO_LINK = ALB_CODES - 1, // a code of weight zero
    ALB_KERNEL_BINS = 96,        // four to the octave
    ALB_DISC_KNOTS = 1024,
};

// Distances stand as codes of eight bits: code q of octave k is q / 254 of 2^(first + k) mm.
typedef struct alb_scatter_kernel {
    uint16_t surface;
    alb_side side;
    int first_octave, octave_count, first_used; // tables begin at first_used
    float largest_spread_mm2;                   // of a patch
    // [octave - first_used][code], of R, G, B and a zero: s(d), 1/mm^2, and then s' / s, 1/mm, and s'' / 2 s, 1/mm^2
    float (*values)[4], (*bends)[8];
    // P(r) / r of R, G, B, P(r) = integral_0^r s r dr, at r = (knot / ALB_DISC_KNOTS)^2 near_mm
    double near_mm;
    float (*discs)[4];
} alb_scatter_kernel;

// What the profiles ask of links, by distance. Bin b begins at 2^((b / 4) + first) mm, and quarters of the octave.
typedef struct alb_scatter_kernel_needs {
    int first_octave;
    float size2_mm2[ALB_KERNEL_BINS]; // squared size that a cluster may have at this distance and further out
    float shares[ALB_KERNEL_BINS][3]; // s / total, 1/mm^2
    float slopes[ALB_KERNEL_BINS][3]; // |s'| / s, 1/mm
    float leans[ALB_KERNEL_BINS];     // s'' / 2 s', 1/mm, of the channels' sum, each over its total
} alb_scatter_kernel_needs;

// Sets the octaves for distances up to reach_mm, and how far exact rules go, near_mm; no tables yet.
void alb_scatter_kernel_span(alb_scatter_kernel *kernel, double reach_mm, double near_mm);
// Allocates the tables, zero, from octave first_used on. ALB_NO_MEMORY, the kernel then empty.
bool alb_scatter_kernel_create(alb_scatter_kernel *kernel, int first_used, alb_error *error);
void alb_scatter_kernel_free(alb_scatter_kernel *kernel);
// Fills the tables from the profiles of R, G and B, 1/mm^2 (formulas: scatter_kernel.c). Where a profile is infinite at
// distance zero its mean over half a code stands there.
void alb_scatter_kernel_write(alb_scatter_kernel *kernel, const alb_profile profiles[3]);
// Of the tables.
size_t alb_scatter_kernel_bytes(const alb_scatter_kernel *kernel);

// What the profiles ask for at the kernel's distances; `links`: how many links a row may have on an infinite plane
// (formula: scatter_kernel.c).
void alb_scatter_kernel_needs_find(alb_scatter_kernel_needs *needs, const alb_scatter_kernel *kernel,
                                   const alb_profile profiles[3], double links);
// The bin of a distance; those beyond the first or the last are taken there.
static inline int alb_scatter_kernel_bin(const alb_scatter_kernel_needs *needs, float r_mm)
{
    union {
        float value;
        int32_t bits;
    } number = {r_mm};
    const int bin = (number.bits >> 21) - ((127 + needs->first_octave) << 2);
    return bin < 0 ? 0 : bin < ALB_KERNEL_BINS ? bin : ALB_KERNEL_BINS - 1;
}
