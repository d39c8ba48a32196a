// Optical properties from totals: (reflection, transmission) of a slab -> (sigma_a, sigma_s') by radiative transfer,
// without start values; of a half-space -> their ratio. Henyey-Greenstein's g is an assumption.
#pragma once
#include "fit/adding_doubling.h"
#include "fit/diffusion.h"

// What does not depend on the totals; about 35 KiB, read-only in use: one serves many threads.
typedef struct alb_optical_model {
    alb_streams coarse, fine;
    alb_diffusion_face face;
} alb_optical_model;

enum { ALB_OPTICAL_STREAMS = 24 }; // 0.5 % down to sigma_s' d = 0.15 at g = 0.9 (docs/optical_properties.svg)

// `streams` of the transport solution. n from 1 to 4, |g| <= 0.99.
void alb_optical_model_create(alb_optical_model *model, int streams, double refractive_index, double anisotropy);

// Shares of the incident flux: reflection without what the outside of the face turns back, transmission with the light
// that never scattered. Their sds are independent of each other; scale_sd, relative, is common to both.
typedef struct alb_measured_totals {
    double reflection, reflection_sd;
    double transmission, transmission_sd;
    double scale_sd;
    double thickness_mm, thickness_sd_mm; // 0: half-space, transmission is not used
} alb_measured_totals;

typedef enum alb_optical_flag {
    ALB_OPTICAL_THIN = 1,           // sigma_s' d < 1 or thinner than 8 transport mean free paths: outside diffusion
    ALB_OPTICAL_LOW_ALBEDO = 2,     // alpha' < 0.8: outside diffusion
    ALB_OPTICAL_BALLISTIC = 4,      // (sigma_a + sigma_s) d < 8: unscattered light shows in transmission
    ALB_OPTICAL_RATIO_ONLY = 8,     // half-space, or nothing comes through: sigma_a / sigma_s' alone is known
    ALB_OPTICAL_NO_ABSORPTION = 16, // what is lost is not told from nothing: sigma_a is less than 2 sd from 0
    ALB_OPTICAL_FLAGS = 5
} alb_optical_flag;

// "outside diffusion: thin", ... for bit i.
const char *alb_optical_flag_text(int i);

typedef struct alb_optical {
    double absorption_per_mm, absorption_sd;                 // sigma_a; NaN where only the ratio is known
    double reduced_scattering_per_mm, reduced_scattering_sd; // sigma_s'; likewise
    double correlation;                                      // of the two
    double reduced_albedo, reduced_albedo_sd;                // alpha' = sigma_s' / (sigma_a + sigma_s')
    double by_scale[2];     // relative change of sigma_a, sigma_s' by a relative change of both totals
    double by_thickness[2]; // likewise of the thickness
    double diffusion[2];    // sigma_a, sigma_s' by the multipole (Grosjean); NaN outside diffusion
    unsigned flags;         // of alb_optical_flag
} alb_optical;

// ALB_BAD_DATA, with the numbers, where no such slab exists: more light leaves than enters (by more than 3 sd), or less
// is reflected than by a clear slab of that transmission.
bool alb_optical_from_totals(alb_optical *optical, const alb_optical_model *model, const alb_measured_totals *totals,
                             alb_error *error);

// (sigma_a, sigma_s') of totals by diffusion alone: the slab's multipole. False where none gives these totals.
bool alb_optical_from_diffusion(double properties[2], const alb_diffusion_face *face, double refractive_index,
                                double reflection, double transmission, double thickness_mm);
