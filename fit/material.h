// A material: what fit leaves behind and render reads (material.json). Per channel and side a radially symmetric
// profile S(r): radiant exitance at distance r per unit incident flux, 1/mm^2.
#pragma once
#include "base/error.h"
#include "capture/session.h" // alb_side, alb_finish
#include "fit/exit_angle.h"  // alb_exit: how light leaves a face

enum { ALB_PARAMETERS_MAX = 6 };

typedef enum alb_form {
    ALB_FORM_NONE,
    ALB_FORM_EXPONENTIAL,          // a1 e^(-b1 r)
    ALB_FORM_TWO_EXPONENTIALS,     // a1 e^(-b1 r) + a2 e^(-b2 r), a > 0 (Sheng et al. 2014, sec. 6)
    ALB_FORM_SIGNED_EXPONENTIALS,  // the same with b1 < b2, a2 < 0, a1 + a2 >= 0: S >= 0 everywhere
    ALB_FORM_THREE_EXPONENTIALS,   // three terms, a > 0, b1 < b2 < b3
    ALB_FORM_DIPOLE,               // classic dipole of a half-space (Jensen et al. 2001)
    ALB_FORM_TWO_OVER_R,           // (a1 e^(-b1 r) + a2 e^(-b2 r)) / r, a > 0, b1 < b2
    ALB_FORM_BURLEY,               // A (e^(-r/d) + e^(-r/(3 d))) / (8 pi d r) (Christensen & Burley 2015)
    ALB_FORM_BURIED_SOURCE,        // a e^(-b (rho - z)) / rho, rho^2 = r^2 + z^2, all > 0: flat at r = 0
    ALB_FORM_BURIED_AND_OVER_R,    // one buried source and a2 e^(-b2 r) / r
    ALB_FORM_TWO_BURIED_SOURCES,   // two of them, b1 < b2
    ALB_FORM_BETTER_DIPOLE,        // of a half-space (d'Eon 2012), as diffusion.h
    ALB_FORM_MULTIPOLE_REFLECTION, // of a slab (Donner & Jensen 2005), as diffusion.h
    ALB_FORM_MULTIPOLE_TRANSMISSION,
    ALB_FORMS,                     // those above have parameters and a place in material.json
    ALB_FORM_TABULATED = ALB_FORMS // exponential from line to line of a table (tabulated.c)
} alb_form;

// Parameters, in order: of sums of exponentials a1, b1, a2, b2, a3, b3 (amplitude_1_per_mm2, decay_1_per_mm, ...), over
// r the same in amplitude_1_per_mm; of buried sources a1, b1, z1, a2, b2, z2 (depth_1_mm); of Burley's albedo (A) and
// length_mm (d); of the dipoles absorption_per_mm, reduced_scattering_per_mm, refractive_index; of
// the multipoles thickness_mm besides, more than a transport mean free path.
typedef struct alb_profile {
    alb_form form;
    double parameters[ALB_PARAMETERS_MAX];
} alb_profile;

int alb_form_parameter_count(alb_form form);
const char *alb_form_name(alb_form form);                  // "two_exponentials"
const char *alb_form_parameter_name(alb_form form, int i); // "amplitude_1_per_mm2"
bool alb_form_from_name(alb_form *form, const char *name);

// S(r), 1/mm^2; r >= 0 in mm. INFINITY at r = 0 where the form goes as 1/r; its mean over any ring is finite.
double alb_profile_value(const alb_profile *profile, double r_mm);
// 2 pi integral S r dr over the plane: the share of the incident flux that leaves. Closed form.
double alb_profile_total(const alb_profile *profile);
// P(rho) = integral_0^rho S(r) r dr: what the exact self-term of a patch needs. Closed form.
double alb_profile_disc(const alb_profile *profile, double rho_mm);
// Mean of S over the ring between two distances, 1/mm^2; outer > inner >= 0.
double alb_profile_ring(const alb_profile *profile, double inner_mm, double outer_mm);

// From a CSV file as `fit --table` takes it: at least two lines, no value negative, falling where it ends unless it
// ends with 0; at most a tenth of the total may lie before the first line and beyond the last, and the total is less
// than 1. ALB_BAD_DATA names the file and the line. Free with alb_profile_free; copies share the table.
bool alb_profile_read_table(alb_profile *profile, const char *path, alb_error *error);
// Frees what a tabulated profile holds; of other forms there is nothing to free.
void alb_profile_free(alb_profile *profile);

// The largest decay of its terms, 1/mm.
double alb_profile_fastest(const alb_profile *profile);

// A profile with what is known of it.
typedef struct alb_fitted {
    alb_profile profile;           // form NONE: not measured
    double sd[ALB_PARAMETERS_MAX]; // NaN, as total_sd, where the readings say nothing of it
    double covariance[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX];
    double total, total_sd;
    double chi_square;
    int degrees_of_freedom;
    bool identifiable;
} alb_fitted;

// Absorption sigma_a and reduced scattering sigma_s' of a channel, where they were measured.
typedef struct alb_optical_estimate {
    bool known;
    double absorption_per_mm, reduced_scattering_per_mm;
} alb_optical_estimate;

typedef struct alb_material {
    char name[ALB_NAME_SIZE];
    double thickness_mm;     // 0: not a slab or not known
    double refractive_index; // 0: not known
    bool finish_known;
    alb_finish finish; // of the faces
    int channels;
    char channel_names[3][8];
    alb_fitted fitted[ALB_SIDES][3];
    alb_optical_estimate optical[3];
} alb_material;

// How light leaves its faces: as Lambert says unless they are known to be smooth and of a known index.
alb_exit alb_material_exit(const alb_material *material, alb_side side);

bool alb_material_read(alb_material *material, const char *path, alb_error *error);
