// Total reflection and transmission of a slab or a half-space by radiative transfer: adding-doubling. A collimated beam
// falls perpendicularly on one smooth face of a body of refractive index n in air that scatters by Henyey-Greenstein.
// Coefficients and thickness in any one unit of length. Nothing here fails.
#pragma once
#include <stdbool.h>

enum { ALB_STREAMS_MIN = 4, ALB_STREAMS_MAX = 32 };

typedef double alb_stream_matrix[ALB_STREAMS_MAX][ALB_STREAMS_MAX];

// Directions in which radiance is followed, and what index and phase function make of them. About 17 KiB.
typedef struct alb_streams {
    int count;                           // per hemisphere; the last one is the normal
    double refractive_index, anisotropy; // n, g
    double cosine[ALB_STREAMS_MAX], weight[ALB_STREAMS_MAX];
    double reflectance[ALB_STREAMS_MAX]; // of a face, from inside
    double scattering_per_reduced;       // truncated scattering coefficient / sigma_s'
    alb_stream_matrix even, odd;         // of the truncated phase function, scaled to be symmetric
} alb_streams;

// `count`: even, 4 to 32. n from 1 to 4, |g| <= 0.99.
void alb_streams_create(alb_streams *streams, int count, double refractive_index, double anisotropy);

// A layer without its faces, on radiances times sqrt(cosine weight): symmetric matrices.
typedef struct alb_layer {
    int count;
    alb_stream_matrix lost, odd; // 1 - transmission - reflection, transmission - reflection
} alb_layer;

// thickness > 0, absorption >= 0, scattering >= 0, finite.
void alb_layer_create(alb_layer *layer, const alb_streams *streams, double absorption, double reduced_scattering,
                      double thickness);
// Two of them, one upon the other.
void alb_layer_double(alb_layer *layer);

// Radiance that comes from within upon the lit face [0] and the other one [1] of a layer with its faces, in the
// streams, for a beam that brings the flux 1 through the lit face. The last stream, the normal, holds the beam besides.
void alb_streams_within(double radiance[2][ALB_STREAMS_MAX], const alb_streams *streams, const alb_layer *layer);

// Shares of the incident flux, all directions together. Reflection is without what the outside of the lit face turns
// back, ((n-1)/(n+1))^2; transmission is with the light that never scattered.
typedef struct alb_totals {
    double reflection, transmission;
} alb_totals;

// Worst error over n 1.3 to 1.6, g 0 and 0.9, sigma_s' d 0.5 to 40, in shares of the flux: 6e-4 with 8 streams, 2e-4
// with 12, 6e-5 with 16, 1.3e-6 with 32; with g = 0 a tenth to a half of that, thick slabs a tenth. thickness 0:
// half-space; where it neither absorbs nor scatters all that enters is counted as transmission.
alb_totals alb_adding_doubling(const alb_streams *streams, double absorption, double reduced_scattering,
                               double thickness);
