// What renderers are told of a material.
//
// Burley's normalised diffusion (Christensen and Burley, "Approximate Reflectance Profiles for Efficient Subsurface
// Scattering", 2015), B(r) = A (e^(-r/d) + e^(-r/3d)) / (8 pi d r), A the total of the measured reflection, d where
//   mean over the middle 90 % of the light that leaves of ln^2(B(r) / R(r))
// is least: every part of the light counts alike, at whatever distance it leaves. The mean free path is s(A) d with
//   s = 1.85 - A + 7 |A - 0.8|^3 where light enters as a beam, as it does on the bench,
//   s = 1.9 - A + 3.5 (A - 0.8)^2 where it enters from everywhere, which is what Cycles divides by.
// A medium is taken from the material where it holds one; else its albedo alpha' = sigma_s' / (sigma_a + sigma_s') is
// that of a half-space with the measured total (the dipole's, Jensen et al. 2001) and its mean free path s(A) d.
//
// Albedo of a medium from the colour that a renderer is given: Chiang, Kutz and Burley 2016 (Arnold's inversion),
//   alpha = 1 - exp(-5.09406 C + 2.61188 C^2 - 4.31805 C^3);
// OpenPBR 1.1 (isotropic), alpha = 1 - s^2, s = 4.09712 + 4.20863 C - sqrt(9.59217 + 41.6808 C + 17.7126 C^2).
// Stops being true for slabs so thin that light leaves behind, for alpha' below 0.8, where diffusion no longer holds,
// and within a mean free path of the beam.
#include "fit/appearance.h"
#include <math.h>

enum { QUANTILES = 180, STEPS = 80 };
static const double index_where_unknown = 1.5;

double alb_burley_beam_ratio(double albedo)
{
    const double x = fabs(albedo - 0.8);
    return 1.85 - albedo + 7 * x * x * x;
}

double alb_burley_diffuse_ratio(double albedo) { return 1.9 - albedo + 3.5 * (albedo - 0.8) * (albedo - 0.8); }

double alb_chiang_albedo(double colour) { return -expm1(colour * (-5.09406 + colour * (2.61188 - 4.31805 * colour))); }

static double openpbr_s(double colour)
{
    return 4.09712 + 4.20863 * colour - sqrt(9.59217 + colour * (41.6808 + 17.7126 * colour));
}

double alb_openpbr_albedo(double colour)
{
    const double s = openpbr_s(colour);
    return 1 - s * s;
}

// Where a rising function on [0, 1] reaches `wanted`, to the last digit.
static double invert(double (*rising)(double x, double context), double context, double wanted)
{
    double low = 0, high = 1;
    for (int i = 0; i < STEPS; i++) {
        const double middle = 0.5 * (low + high);
        *(rising(middle, context) < wanted ? &low : &high) = middle;
    }
    return high;
}

// -s rises with the colour, where alpha itself would lose half of the digits near 1.
static double minus_openpbr_s(double colour, double context)
{
    (void)context;
    return -openpbr_s(colour);
}

double alb_openpbr_colour(double albedo) { return invert(minus_openpbr_s, 0, -sqrt(1 - albedo)); }

static double dipole_total(double albedo, double refractive_index)
{
    return alb_profile_total(&(alb_profile){ALB_FORM_DIPOLE, {1 - albedo, albedo, refractive_index}});
}

double alb_albedo_invert(double total, double refractive_index)
{
    return invert(dipole_total, refractive_index, total);
}

static bool is_dipole(const alb_profile *profile)
{
    return profile->form == ALB_FORM_DIPOLE || profile->form == ALB_FORM_BETTER_DIPOLE;
}

// Distances within which 5 to 95 % of the light of the profile leaves, evenly spaced in light.
static void light_quantiles(double r_mm[QUANTILES], const alb_profile *profile)
{
    const double all = alb_profile_total(profile) / (2 * M_PI);
    double reach = 1;
    while (alb_profile_disc(profile, reach) > 0.05 * all && reach > 1e-150)
        reach /= 2;
    for (int i = 0; i < QUANTILES; i++) {
        const double wanted = (0.05 + 0.9 * (i + 0.5) / QUANTILES) * all;
        double low = reach;
        while (alb_profile_disc(profile, reach) < wanted && reach < 1e150)
            low = reach, reach *= 2;
        double high = reach;
        for (int k = 0; k < STEPS; k++) {
            const double middle = 0.5 * (low + high);
            *(alb_profile_disc(profile, middle) < wanted ? &low : &high) = middle;
        }
        r_mm[i] = reach = high;
    }
}

// Mean square and largest of ln(B / R) at the distances.
static double mean_square_deviation(double *largest, alb_burley burley, const alb_profile *profile,
                                    const double r_mm[QUANTILES])
{
    double sum = 0;
    const alb_profile approximation = {ALB_FORM_BURLEY, {burley.albedo, burley.length_mm}};
    *largest = 0;
    for (int i = 0; i < QUANTILES; i++) {
        const double x = log(alb_profile_value(&approximation, r_mm[i]) / alb_profile_value(profile, r_mm[i]));
        sum += x * x;
        *largest = fmax(*largest, fabs(x));
    }
    return sum / QUANTILES;
}

// The best length, by golden sections of its logarithm. ln B rises with d where d is small and falls where it is large:
// a coarse walk first finds the deepest valley.
static void fit_burley(alb_appearance_channel *out, const alb_profile *profile)
{
    double r_mm[QUANTILES], largest, best = 0, least = INFINITY;
    light_quantiles(r_mm, profile);
    const double middle = log(r_mm[QUANTILES / 2]), golden = 0.5 * (sqrt(5) - 1);
    for (double x = middle - 5; x < middle + 5; x += 0.125) {
        const double score = mean_square_deviation(&largest, (alb_burley){out->burley.albedo, exp(x)}, profile, r_mm);
        if (score < least)
            least = score, best = x;
    }
    double low = best - 0.125, high = best + 0.125;
    for (int i = 0; i < STEPS; i++) {
        const double a = high - golden * (high - low), b = low + golden * (high - low);
        const double at_a = mean_square_deviation(&largest, (alb_burley){out->burley.albedo, exp(a)}, profile, r_mm);
        const double at_b = mean_square_deviation(&largest, (alb_burley){out->burley.albedo, exp(b)}, profile, r_mm);
        *(at_a < at_b ? &high : &low) = at_a < at_b ? b : a;
    }
    out->burley.length_mm = exp(0.5 * (low + high));
    out->deviation_rms = sqrt(mean_square_deviation(&out->deviation_maximum, out->burley, profile, r_mm));
}

// Where nothing is reflected (a dipole that only absorbs) the length is that of its mean free path.
static void fit_black(alb_appearance_channel *out, const alb_profile *profile)
{
    out->burley.length_mm = 1 / (alb_burley_beam_ratio(0) * (profile->parameters[0] + profile->parameters[1]));
}

static void take_medium(alb_appearance_channel *out, const alb_profile *profile, const alb_optical_estimate *measured,
                        double refractive_index)
{
    if (measured->known) {
        out->medium_source = ALB_MEDIUM_MEASURED;
        out->absorption_per_mm = measured->absorption_per_mm;
        out->reduced_scattering_per_mm = measured->reduced_scattering_per_mm;
        return;
    }
    if (is_dipole(profile)) {
        out->medium_source = ALB_MEDIUM_MEASURED;
        out->absorption_per_mm = profile->parameters[0];
        out->reduced_scattering_per_mm = profile->parameters[1];
        return;
    }
    const double albedo = alb_albedo_invert(out->burley.albedo, refractive_index);
    const double path_mm = alb_burley_beam_ratio(out->burley.albedo) * out->burley.length_mm;
    out->medium_source = ALB_MEDIUM_INVERTED;
    out->absorption_per_mm = (1 - albedo) / path_mm;
    out->reduced_scattering_per_mm = albedo / path_mm;
}

bool alb_appearance_derive(alb_appearance *appearance, const alb_material *material, alb_error *error)
{
    *appearance = (alb_appearance){
        .material = material, .refractive_index = material->refractive_index, .channels = material->channels};
    for (int c = 0; c < material->channels; c++)
        if (is_dipole(&material->fitted[ALB_REFLECTION][c].profile))
            appearance->refractive_index = material->fitted[ALB_REFLECTION][c].profile.parameters[2];
    if (!(appearance->refractive_index > 0)) {
        appearance->refractive_index = index_where_unknown;
        appearance->index_assumed = true;
    }
    for (int c = 0; c < material->channels; c++) {
        const alb_fitted *reflection = &material->fitted[ALB_REFLECTION][c];
        alb_appearance_channel *out = &appearance->channel[c];
        if (reflection->profile.form == ALB_FORM_NONE)
            return alb_fail(error, ALB_BAD_DATA,
                            "%s: channel %s has no reflection, which a renderer wants; csv takes either side",
                            *material->name ? material->name : "the material", material->channel_names[c]);
        const bool black = is_dipole(&reflection->profile) && reflection->profile.parameters[0] > 0;
        if (!(black || reflection->total > 0) || !(reflection->total <= 1 + 1e-9))
            return alb_fail(error, ALB_BAD_DATA,
                            "%s: channel %s reflects %.4g of the light, which no renderer takes: fit a calibrated "
                            "session, whose scale is absolute; csv takes any scale",
                            *material->name ? material->name : "the material", material->channel_names[c],
                            reflection->total);
        out->burley.albedo = fmin(reflection->total, 1);
        out->albedo_sd = reflection->identifiable ? reflection->total_sd : (double)NAN;
        if (out->burley.albedo > 0)
            fit_burley(out, &reflection->profile);
        else
            fit_black(out, &reflection->profile);
        take_medium(out, &reflection->profile, &material->optical[c], appearance->refractive_index);
    }
    return true;
}
