// The balance of light: B = S' (E + F B) + M, per channel R, G, B.
#pragma once
#include "render/form_factor.h"
#include "render/radiosity_clusters.h"
#include "render/radiosity_solver.h"
#include "render/scatter.h"

// The equations of a scene, for as many lights as one likes. What they are made of is borrowed and may be rewritten
// between solutions (alb_radiosity_refresh). One solution at a time.
typedef struct alb_radiosity {
    const alb_scatter *scatter;
    const alb_form_factors *factors;
    const double *areas_mm2;
    alb_clusters clusters;         // the coarse level of ALB_SOLVER_TWO_LEVEL
    alb_rgb *gathered, *scattered; // scratch of a product, of a Gauss-Seidel sweep
    uint32_t *row;                 // scratch: the longest row of the form factors
} alb_radiosity;

// Everything is borrowed for the life of the equations; clusters are made of it. The row sums of the scattering are
// known. ALB_NO_MEMORY, *equations then empty.
bool alb_radiosity_create(alb_radiosity *equations, const alb_patches *patches, const alb_scatter *scatter,
                          const alb_form_factors *factors, alb_error *error);
void alb_radiosity_free(alb_radiosity *equations);
// After the scattering was rewritten: takes its row sums, known or estimated.
void alb_radiosity_refresh(alb_radiosity *equations);
size_t alb_radiosity_bytes(const alb_radiosity *equations);

// Refuses a scattering that creates energy: ALB_BAD_DATA names the patch's material, channel and row sum when a row sum
// of S' is above 1, or at 1 or above in a closed scene (no ray reaches the sky). *largest (may be NULL) is the largest.
bool alb_radiosity_check(double *largest, const alb_scatter *scatter, bool closed_scene, const uint16_t *materials,
                         const alb_surface *surfaces, alb_error *error);

// K = S'F of the equations, as solvers see it. Valid as long as the equations are.
alb_bounce alb_radiosity_bounce(alb_radiosity *equations);

// Solves to the relative residual from the guess `start` (NULL: none). irradiance E: direct light; exitance M: emitted;
// NULL: nothing. All arrays have a row for each patch, RGB per area. Fails as alb_solver_run does. Call
// alb_radiosity_check first.
bool alb_radiosity_solve(alb_rgb *radiosity, alb_radiosity_report *report, alb_radiosity *equations, alb_solver solver,
                         const alb_rgb *irradiance, const alb_rgb *exitance, const alb_rgb *start, double residual,
                         alb_error *error);
// How far a solution may be from the exact one of its equations, as a share of its power: in flux, S sends on at most
// the share s of what it receives (the largest column sum) and F no more than all, so that an error is at most
//     s / (1 - s)  (mean |residual|) / (mean B)
// after the last bounce, in the worst channel. INFINITY where s is 1 or more.
double alb_radiosity_bound(const alb_radiosity *equations, const alb_radiosity_report *report,
                           const alb_rgb *radiosity);
