// Radiative transport in a slab at one spatial frequency: how light of a pencil beam that falls perpendicularly leaves
// through both faces, Fourier transformed along them. No noise, about a millisecond. Units: mm and 1/mm.
#pragma once
#include <stdbool.h>

// A slab in air with smooth faces. The phase function is Henyey and Greenstein's.
typedef struct alb_slab {
    double absorption_per_mm, scattering_per_mm; // > 0
    double anisotropy;                           // g, 0..0.95
    double refractive_index;                     // 1..3
    double thickness_mm;
} alb_slab;

enum {
    ALB_HARMONICS_ORDER = 11,                                                       // highest N; orders are odd
    ALB_HARMONICS = (ALB_HARMONICS_ORDER + 1) * (ALB_HARMONICS_ORDER + 2) / 2,      // (l, m), 0 <= m <= l <= N
    ALB_HARMONIC_MODES = (ALB_HARMONICS_ORDER + 1) * (ALB_HARMONICS_ORDER + 1) / 4, // and their odd l + m
    ALB_HARMONIC_HALF = (ALB_HARMONICS_ORDER + 1) / 2,
};

// What a face does to each harmonic: integrals over the cosine 0..1 of (1 - F) odd even and (1 + F) odd odd, F
// Fresnel's reflectance from inside, odd and even the normalised Legendre functions of one m with odd and even l + m.
typedef struct alb_harmonic_faces {
    double passed[ALB_HARMONICS_ORDER + 1][ALB_HARMONIC_HALF][ALB_HARMONIC_HALF];
    double turned[ALB_HARMONICS_ORDER + 1][ALB_HARMONIC_HALF][ALB_HARMONIC_HALF];
    double leaving[ALB_HARMONIC_HALF]; // (1 - F) odd, m = 0
} alb_harmonic_faces;

void alb_harmonic_faces_prepare(alb_harmonic_faces *faces, double refractive_index);

// The beam that has not scattered, bouncing between the faces: at depth z its flux is down e^(-extinction z) towards
// the far face and up e^(-extinction (d - z)) back, per incident flux.
typedef struct alb_folded_beam {
    double extinction, thickness, down, up;
    double leaving[2]; // through the lit face (without what the outside of it turns back) and the far one
} alb_folded_beam;

// The slab with the part of the phase function that order N cannot hold, g^(N+1), taken as not scattered (delta-M,
// Wiscombe 1977): scattering_per_mm and the moments 1, g1, g2, ... of what is left.
typedef struct alb_scaled_slab {
    int order;
    double absorption_per_mm, scattering_per_mm, moments[ALB_HARMONICS_ORDER + 1];
    alb_folded_beam beam;
} alb_scaled_slab;

alb_scaled_slab alb_slab_scale(const alb_slab *slab, int order);

// Plane-wave modes of the order-N equations.
typedef struct alb_harmonic_modes {
    alb_scaled_slab slab;
    int first[ALB_HARMONICS_ORDER + 2];                            // modes of rank M: first[M] .. first[M + 1] - 1
    double length_mm[ALB_HARMONIC_MODES];                          // xi
    double amplitude[ALB_HARMONIC_MODES][ALB_HARMONICS_ORDER + 1]; // of harmonic l about the mode's own axis
} alb_harmonic_modes;

// once: only light that scatters once (the medium absorbs what scatters again).
void alb_harmonic_modes_prepare(alb_harmonic_modes *modes, const alb_scaled_slab *slab, bool once);
// leaving[side]: the Hankel transform 2 pi integral S(r) J0(k r) r dr of the scattered light that leaves; at k = 0 its
// share of the incident flux. NaN where the system cannot be solved in double precision (k far above the extinction).
void alb_harmonic_modes_leaving(double leaving[2], const alb_harmonic_modes *modes, const alb_harmonic_faces *faces,
                                double k_per_mm);
