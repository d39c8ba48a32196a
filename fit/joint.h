// Absorption and scattering of a slab from the images of its two faces: R(r) and T(r) by radiative transport (slab.h),
// fitted together, with one unknown factor common to all readings.
#pragma once
#include "fit/operator.h"
#include "fit/slab.h"

typedef struct alb_joint_known {
    double thickness_mm, refractive_index;
    double anisotropy;          // g of Henyey and Greenstein's phase function
    double anisotropy_sd;       // 0: known; above: fitted as well, within 0 to 0.9
    double scale_relative_sd;   // of the readings' common factor: what the calibration leaves open; > 0
    double balance_relative_sd; // of the transmission's factor over the reflection's; 0: they share it
} alb_joint_known;

// Readings of one face and how a profile makes them; NULL: not measured.
typedef struct alb_joint_side {
    const alb_readings *readings;
    const alb_operator *forward;
} alb_joint_side;

enum {
    ALB_JOINT_ABSORPTION,
    ALB_JOINT_SCATTERING,
    ALB_JOINT_ANISOTROPY,
    ALB_JOINT_SCALE,
    ALB_JOINT_BALANCE,
    ALB_JOINT_PARAMETERS
};

typedef struct alb_joint {
    double absorption_per_mm, reduced_scattering_per_mm, scale, balance; // readings = scale * model; of T: * balance
    double anisotropy;
    double relative_sd[ALB_JOINT_PARAMETERS];    // of each; wider than the bound where chi-square asks for it
    double relative_bound[ALB_JOINT_PARAMETERS]; // Cramer and Rao's, of the readings' sd and the model's accuracy alone
    double covariance[ALB_JOINT_PARAMETERS]
                     [ALB_JOINT_PARAMETERS]; // of the logarithms and of g itself, as are relative_sd and relative_bound
    double chi_square;                       // by the noise alone, of the fit to the noise alone
    int degrees_of_freedom;
    double discrepancy_relative;  // t: the slab misses the readings by so much of itself; 0: within the noise
    int used[ALB_SIDES];          // readings
    double from_mm[ALB_SIDES];    // the nearest of them to the beam
    double unscattered;           // share of the incident flux that passes straight through, at r = 0: never used
    double albedo, thickness_mfp; // sigma_s' / (sigma_a + sigma_s'), (sigma_a + sigma_s') d
    char undecided[288];          // why the readings do not decide; empty where they do
} alb_joint;

// Reflection alone will do, with wider intervals. ALB_UNDECIDED where the readings cannot tell absorption from
// scattering at all: transmission alone, or fewer than 4 readings far enough from the beam. ALB_BAD_DATA where what is
// known is no slab.
bool alb_joint_fit(alb_joint *joint, const alb_joint_side sides[ALB_SIDES], const alb_joint_known *known,
                   alb_error *error);
