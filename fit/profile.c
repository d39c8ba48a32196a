// The table of profile forms.
//
// Sums of exponentials (Sheng et al. 2014, "Translucent Radiosity", sec. 6): S(r) = sum_j a_j e^(-b_j r)
//   integral_0^rho S r dr = sum_j a_j (1 - (1 + b_j rho) e^(-b_j rho)) / b_j^2,  total = 2 pi sum_j a_j / b_j^2.
//   Positive terms are log-convex with a cusp at r = 0. With one negative amplitude, b1 < b2 and a1 + a2 >= 0, S
//   stays positive (the negative term starts lower and dies first) and can be flat at r = 0, as transmission is.
//
// Classic dipole of a half-space (Jensen et al. 2001): diffusion.c.
#include "fit/profile.h"
#include "fit/diffusion.h"
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

static alb_diffusion dipole_of(const double *parameters)
{
    const alb_diffusion_face face = alb_diffusion_face_at(ALB_DIFFUSION_CLASSIC, parameters[2]);
    return alb_diffusion_at(&face, parameters[0], parameters[1], 0);
}

double alb_profile_value(const alb_profile *profile, double r_mm)
{
    if (profile->form == ALB_FORM_DIPOLE) {
        const alb_diffusion body = dipole_of(profile->parameters);
        return alb_diffusion_value(NULL, &body, ALB_REFLECTION, r_mm);
    }
    double sum = 0;
    for (int j = 0; j < forms[profile->form].term_count; j++)
        sum += profile->parameters[2 * j] * exp(-profile->parameters[2 * j + 1] * r_mm);
    return sum;
}

double alb_profile_total(const alb_profile *profile)
{
    if (profile->form == ALB_FORM_DIPOLE) {
        const alb_diffusion body = dipole_of(profile->parameters);
        return alb_diffusion_total(NULL, &body, ALB_REFLECTION);
    }
    double gradient[ALB_PARAMETERS_MAX];
    return profile->form == ALB_FORM_NONE ? 0 : alb_profile_total_gradient(gradient, profile);
}

double alb_profile_disc(const alb_profile *profile, double rho_mm)
{
    if (profile->form == ALB_FORM_DIPOLE) {
        const alb_diffusion body = dipole_of(profile->parameters);
        return alb_diffusion_disc(&body, ALB_REFLECTION, rho_mm);
    }
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
