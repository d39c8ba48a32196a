// The table of profile forms.
//
// Sums of exponentials (Sheng et al. 2014, "Translucent Radiosity", sec. 6): S(r) = sum_j a_j e^(-b_j r)
//   integral_0^rho S r dr = sum_j a_j (1 - (1 + b_j rho) e^(-b_j rho)) / b_j^2,  total = 2 pi sum_j a_j / b_j^2.
//   Positive terms are log-convex with a cusp at r = 0. With one negative amplitude, b1 < b2 and a1 + a2 >= 0, S
//   stays positive (the negative term starts lower and dies first) and can be flat at r = 0, as transmission is.
//
// Classic dipole of a half-space (Jensen et al. 2001, eq. 4): alpha' = s'/(a + s'), l = 1/(a + s'), sigma = sqrt(3 a (a
// + s')),
//   S(r) = alpha'/(4 pi) sum_i z_i (1 + sigma d_i) e^(-sigma d_i) / d_i^3,  d_i^2 = r^2 + z_i^2,  z = l, l (1 + 4 A /
//   3) A = (1 + F) / (1 - F), F = -1.440/n^2 + 0.710/n + 0.668 + 0.0636 n; A = 1 for n = 1. d(-e^(-sigma d)/d) = (1 +
//   sigma d) e^(-sigma d)/d^2 dd and r dr = d dd give disc and total in closed form. Not true within one mean free path
//   of the beam, for alpha' below 0.8, or for slabs thinner than 8 mean free paths.
#include "fit/profile.h"
#include <assert.h>
#include <math.h>
#include <string.h>

static const struct {
    const char *name;
    int parameter_count, term_count;
    const char *parameters[ALB_PARAMETERS_MAX];
} forms[ALB_FORMS] = {
    [ALB_FORM_NONE] = {"none", 0, 0, {NULL}},
    [ALB_FORM_EXPONENTIAL] = {"exponential", 2, 1, {"amplitude_1_per_mm2", "decay_1_per_mm"}},
    [ALB_FORM_TWO_EXPONENTIALS] = {"two_exponentials",
                                   4,
                                   2,
                                   {"amplitude_1_per_mm2", "decay_1_per_mm", "amplitude_2_per_mm2", "decay_2_per_mm"}},
    [ALB_FORM_SIGNED_EXPONENTIALS] = {"signed_exponentials",
                                      4,
                                      2,
                                      {"amplitude_1_per_mm2", "decay_1_per_mm", "amplitude_2_per_mm2",
                                       "decay_2_per_mm"}},
    [ALB_FORM_THREE_EXPONENTIALS] = {"three_exponentials",
                                     6,
                                     3,
                                     {"amplitude_1_per_mm2", "decay_1_per_mm", "amplitude_2_per_mm2", "decay_2_per_mm",
                                      "amplitude_3_per_mm2", "decay_3_per_mm"}},
    [ALB_FORM_DIPOLE] = {"dipole", 3, 0, {"absorption_per_mm", "reduced_scattering_per_mm", "refractive_index"}},
};

int alb_form_parameter_count(alb_form form) { return forms[form].parameter_count; }
int alb_form_term_count(alb_form form) { return forms[form].term_count; }
const char *alb_form_name(alb_form form) { return forms[form].name; }
const char *alb_form_parameter_name(alb_form form, int i) { return forms[form].parameters[i]; }

bool alb_form_from_name(alb_form *form, const char *name)
{
    for (int i = ALB_FORM_NONE + 1; i < ALB_FORMS; i++)
        if (strcmp(forms[i].name, name) == 0) {
            *form = (alb_form)i;
            return true;
        }
    return false;
}

typedef struct dipole {
    double weight, transport_per_mm, depth_mm[2]; // alpha'/(4 pi), sigma, z
} dipole;

static dipole dipole_of(const double *parameters)
{
    const double absorption = parameters[0], scattering = parameters[1], index = parameters[2];
    const double extinction = absorption + scattering;
    if (!(extinction > 0))
        return (dipole){.depth_mm = {1, 1}};
    const double fresnel = -1.440 / (index * index) + 0.710 / index + 0.668 + 0.0636 * index;
    const double a = index == 1 ? 1 : (1 + fresnel) / (1 - fresnel);
    return (dipole){.weight = scattering / extinction / (4 * M_PI),
                    .transport_per_mm = sqrt(3 * absorption * extinction),
                    .depth_mm = {1 / extinction, (1 + 4 * a / 3) / extinction}};
}

static double dipole_value(const double *parameters, double r_mm)
{
    const dipole d = dipole_of(parameters);
    double sum = 0;
    for (int i = 0; i < 2; i++) {
        const double distance = hypot(r_mm, d.depth_mm[i]), optical = d.transport_per_mm * distance;
        sum += d.depth_mm[i] * (1 + optical) * exp(-optical) / (distance * distance * distance);
    }
    return d.weight * sum;
}

static double dipole_disc(const double *parameters, double rho_mm)
{
    const dipole d = dipole_of(parameters);
    double sum = 0;
    for (int i = 0; i < 2; i++) {
        // e^(-sigma z) - (z/d) e^(-sigma d), written so that small discs keep their digits
        const double z = d.depth_mm[i], distance = hypot(rho_mm, z), further = rho_mm * rho_mm / (distance + z);
        const double u = further / distance, lost = -expm1(-d.transport_per_mm * further);
        sum += exp(-d.transport_per_mm * z) * (u + (1 - u) * lost);
    }
    return d.weight * sum;
}

static double dipole_total(const double *parameters)
{
    const dipole d = dipole_of(parameters);
    return 2 * M_PI * d.weight * (exp(-d.transport_per_mm * d.depth_mm[0]) + exp(-d.transport_per_mm * d.depth_mm[1]));
}

double alb_profile_value(const alb_profile *profile, double r_mm)
{
    if (profile->form == ALB_FORM_DIPOLE)
        return dipole_value(profile->parameters, r_mm);
    double sum = 0;
    for (int j = 0; j < forms[profile->form].term_count; j++)
        sum += profile->parameters[2 * j] * exp(-profile->parameters[2 * j + 1] * r_mm);
    return sum;
}

double alb_profile_total(const alb_profile *profile)
{
    if (profile->form == ALB_FORM_DIPOLE)
        return dipole_total(profile->parameters);
    double gradient[ALB_PARAMETERS_MAX];
    return profile->form == ALB_FORM_NONE ? 0 : alb_profile_total_gradient(gradient, profile);
}

double alb_profile_disc(const alb_profile *profile, double rho_mm)
{
    if (profile->form == ALB_FORM_DIPOLE)
        return dipole_disc(profile->parameters, rho_mm);
    double sum = 0;
    for (int j = 0; j < forms[profile->form].term_count; j++) {
        const double b = profile->parameters[2 * j + 1], x = b * rho_mm;
        // 1 - (1 + x) e^-x loses its digits to cancellation where x is small
        const double share = x < 1e-2 ? x * x * (1.0 / 2 - x * (1.0 / 3 - x * (1.0 / 8 - x * (1.0 / 30 - x / 144))))
                                      : -expm1(-x) - x * exp(-x);
        sum += profile->parameters[2 * j] * share / (b * b);
    }
    return sum;
}

double alb_profile_gradient(double gradient[ALB_PARAMETERS_MAX], const alb_profile *profile, double r_mm)
{
    assert(forms[profile->form].term_count > 0);
    double sum = 0;
    for (int j = 0; j < forms[profile->form].term_count; j++) {
        const double a = profile->parameters[2 * j], e = exp(-profile->parameters[2 * j + 1] * r_mm);
        gradient[2 * j] = e;
        gradient[2 * j + 1] = -a * r_mm * e;
        sum += a * e;
    }
    return sum;
}

double alb_profile_total_gradient(double gradient[ALB_PARAMETERS_MAX], const alb_profile *profile)
{
    assert(forms[profile->form].term_count > 0);
    double sum = 0;
    for (int j = 0; j < forms[profile->form].term_count; j++) {
        const double a = profile->parameters[2 * j], b = profile->parameters[2 * j + 1];
        gradient[2 * j] = 2 * M_PI / (b * b);
        gradient[2 * j + 1] = -4 * M_PI * a / (b * b * b);
        sum += 2 * M_PI * a / (b * b);
    }
    return sum;
}
