// Diffusion theory of a pencil beam that falls perpendicularly on a slab or a half-space: radiant exitance by distance,
// and its totals, per flux that has entered through the face (times 1 - ((n-1)/(n+1))^2: per incident flux). The light
// enters as one point source, one transport mean free path deep. Units: mm and 1/mm.
#pragma once
#include "capture/session.h" // alb_side

typedef enum alb_diffusion_theory {
    ALB_DIFFUSION_CLASSIC,  // Jensen et al. 2001, Donner & Jensen 2005: exitance is the flux through the face
    ALB_DIFFUSION_GROSJEAN, // d'Eon 2012, Kienle & Patterson 1997: Grosjean's D, exitance from fluence and flux
} alb_diffusion_theory;

// What the theory and the index n of the body in air make of a face.
typedef struct alb_diffusion_face {
    alb_diffusion_theory theory;
    double boundary;            // A: the fluence is zero 2 A D outside the face
    double of_fluence, of_flux; // exitance = of_fluence * fluence + of_flux * flux towards the face
} alb_diffusion_face;

alb_diffusion_face alb_diffusion_face_at(alb_diffusion_theory theory, double refractive_index);

typedef struct alb_diffusion {
    alb_diffusion_face face;
    double absorption, scattering, thickness; // sigma_a, sigma_s'; thickness 0: half-space
    double albedo, diffusivity, attenuation;  // alpha', D, sigma_tr
    double source_depth, beyond;              // z0, zb = 2 A D
} alb_diffusion;

// absorption >= 0, scattering > 0, thickness >= 0. With no absorption only the totals are finite for every r.
alb_diffusion alb_diffusion_at(const alb_diffusion_face *face, double absorption_per_mm,
                               double reduced_scattering_per_mm, double thickness_mm);

// Exitance at distance r, 1/mm^2, and, where `gradient` is not NULL, its derivatives by sigma_a and sigma_s'. Side
// transmission of a half-space is 0. The gradient wants absorption > 0.
double alb_diffusion_value(double gradient[2], const alb_diffusion *diffusion, alb_side side, double r_mm);
// integral_0^rho S r dr.
double alb_diffusion_disc(const alb_diffusion *diffusion, alb_side side, double rho_mm);
// 2 pi integral S r dr over the plane, in closed form; `gradient` as above; a slab's also without
// absorption.
double alb_diffusion_total(double gradient[2], const alb_diffusion *diffusion, alb_side side);
