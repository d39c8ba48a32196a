// The balance of light: B = S' (E + F B) + M, per channel R, G, B.
#pragma once
#include "render/form_factor.h"
#include "render/scatter.h"

typedef struct alb_radiosity_report {
    int iterations;  // products with S' F
    double residual; // |S'E + M - (I - S'F) B| / |S'E + M|, area-weighted 2-norm, worst channel, recomputed at the end
} alb_radiosity_report;

// Refuses a scattering that creates energy: ALB_BAD_DATA names the patch's material, channel and row sum when a row sum
// of S' is above 1, or at 1 or above in a closed scene (no ray reaches the sky). *largest (may be NULL) is the largest.
bool alb_radiosity_check(double *largest, const alb_scatter *scatter, bool closed_scene, const uint16_t *materials,
                         const alb_surface *surfaces, alb_error *error);

// Solves to the relative residual. irradiance E: direct light; exitance M: emitted. All arrays have patch_count rows.
// ALB_INTERNAL with the numbers where 500 products do not reach it. Call alb_radiosity_check first.
bool alb_radiosity_solve(double (*radiosity)[3], alb_radiosity_report *report, const double (*irradiance)[3],
                         const double (*exitance)[3], const alb_scatter *scatter, const alb_form_factors *factors,
                         const double *areas_mm2, double residual, alb_error *error);
