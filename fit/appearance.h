// What a renderer is told of a material: per channel Burley's normalised diffusion (albedo and length) and a medium
// behind a smooth face, with how far they are from what was measured.
#pragma once
#include "fit/material.h"

// Burley's profile A (e^(-r/d) + e^(-r/3d)) / (8 pi d r): a half-space, reflection only.
typedef struct alb_burley {
    double albedo, length_mm; // A, d
} alb_burley;

// Mean free path over d: for light that enters as a beam, and for light that enters from everywhere.
double alb_burley_beam_ratio(double albedo);
double alb_burley_diffuse_ratio(double albedo);

typedef enum alb_medium_source {
    ALB_MEDIUM_MEASURED, // of the material: from its totals by radiative transfer, or its dipole's
    ALB_MEDIUM_INVERTED  // from the albedo and the length of Burley's profile
} alb_medium_source;

typedef struct alb_appearance_channel {
    alb_burley burley;
    double albedo_sd; // NaN where the data do not decide
    // ln(Burley / measured) over the middle 90 % of the light that leaves: rms, and largest
    double deviation_rms, deviation_maximum;
    double absorption_per_mm, reduced_scattering_per_mm;
    alb_medium_source medium_source;
} alb_appearance_channel;

typedef struct alb_appearance {
    const alb_material *material; // borrowed
    double refractive_index;      // of the medium
    bool index_assumed;           // the material does not say: 1.5
    int channels;
    alb_appearance_channel channel[3];
} alb_appearance;

// ALB_BAD_DATA where a channel has no reflection, or one of more light than came in (a picture without absolute scale).
bool alb_appearance_derive(alb_appearance *appearance, const alb_material *material, alb_error *error);

// sigma_s' / (sigma_a + sigma_s') of a half-space of the index whose reflection has the total; total in [0, 1].
double alb_albedo_invert(double total, double refractive_index);
// Albedo of a medium for the colour that a renderer is given, and back. Chiang et al. 2016 (Arnold), and OpenPBR 1.1.
double alb_chiang_albedo(double colour);
double alb_openpbr_albedo(double colour);
double alb_openpbr_colour(double albedo);
