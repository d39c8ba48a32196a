// Reflection of light from inside a smooth face of a body of refractive index n >= 1 in air.
#pragma once

// Fresnel reflectance of unpolarised light, mu: cosine to the normal inside, 0..1. 1 where it is total.
double alb_fresnel_inside(double n, double mu);

// Its moments over diffuse light, and the boundary constant of diffusion that they make.
typedef struct alb_fresnel_moments {
    double first;    // R1 = 2 int_0^1 F mu dmu: of isotropic light
    double second;   // R2 = 3 int_0^1 F mu^2 dmu
    double boundary; // A = (1 + R2) / (1 - R1)
} alb_fresnel_moments;

alb_fresnel_moments alb_fresnel_moments_at(double n);
