// The table of profile forms.
//
// Sums of exponentials (Sheng et al. 2014, "Translucent Radiosity", sec. 6): S(r) = sum_j a_j e^(-b_j r)
//   integral_0^rho S r dr = sum_j a_j (1 - (1 + b_j rho) e^(-b_j rho)) / b_j^2,  total = 2 pi sum_j a_j / b_j^2.
//   Positive terms are log-convex with a cusp at r = 0. With one negative amplitude, b1 < b2 and a1 + a2 >= 0, S
//   stays positive (the negative term starts lower and dies first) and can be flat at r = 0, as transmission is.
// The other rows: buried.c, dipole.c (diffusion.c), tabulated.c.
#include "fit/form.h"
#include <math.h>
#include <string.h>

static double exponentials_value(double *gradient, const alb_form_row *row, const double *p, double r_mm)
{
    double sum = 0;
    for (int j = 0; j < row->term_count; j++) {
        const double a = p[2 * j], e = exp(-p[2 * j + 1] * r_mm);
        if (gradient) {
            gradient[2 * j] = e;
            gradient[2 * j + 1] = -a * r_mm * e;
        }
        sum += a * e;
    }
    return sum;
}

static double exponentials_total(double *gradient, const alb_form_row *row, const double *p)
{
    double sum = 0;
    for (int j = 0; j < row->term_count; j++) {
        const double a = p[2 * j], b = p[2 * j + 1];
        if (gradient) {
            gradient[2 * j] = 2 * M_PI / (b * b);
            gradient[2 * j + 1] = -4 * M_PI * a / (b * b * b);
        }
        sum += 2 * M_PI * a / (b * b);
    }
    return sum;
}

static double exponentials_disc(const alb_form_row *row, const double *p, double rho_mm)
{
    double sum = 0;
    for (int j = 0; j < row->term_count; j++) {
        const double b = p[2 * j + 1], x = b * rho_mm;
        // 1 - (1 + x) e^-x loses its digits to cancellation where x is small
        const double share = x < 1e-2 ? x * x * (1.0 / 2 - x * (1.0 / 3 - x * (1.0 / 8 - x * (1.0 / 30 - x / 144))))
                                      : -expm1(-x) - x * exp(-x);
        sum += p[2 * j] * share / (b * b);
    }
    return sum;
}

static double exponentials_slowest(const alb_form_row *row, const double *p)
{
    (void)row;
    return p[1];
}

static bool positive_sound(const alb_form_row *row, const double *p)
{
    double before = 0;
    for (int j = 0; j < row->term_count; j++) {
        if (!(p[2 * j] > 0 && p[2 * j + 1] > before))
            return false;
        before = p[2 * j + 1];
    }
    return true;
}

static bool signed_sound(const alb_form_row *row, const double *p)
{
    (void)row;
    return p[0] > 0 && p[1] > 0 && p[2] <= 0 && p[0] + p[2] >= -1e-12 * p[0] && p[3] > p[1];
}

#define EXPONENTIAL(n)                                                                                                 \
    {"amplitude_" #n "_per_mm2", 1, -2}, { "decay_" #n "_per_mm", 0, -1 }
#define EXPONENTIALS                                                                                                   \
    .stride = 2, .value = exponentials_value, .total = exponentials_total, .disc = exponentials_disc,                  \
    .slowest = exponentials_slowest

static const alb_form_row none = {.name = "none"};
static const alb_form_row exponential = {.name = "exponential",
                                         .parameter_count = 2,
                                         .term_count = 1,
                                         .parameters = {EXPONENTIAL(1)},
                                         EXPONENTIALS,
                                         .sound = positive_sound};
static const alb_form_row two_exponentials = {.name = "two_exponentials",
                                              .parameter_count = 4,
                                              .term_count = 2,
                                              .parameters = {EXPONENTIAL(1), EXPONENTIAL(2)},
                                              EXPONENTIALS,
                                              .sound = positive_sound};
static const alb_form_row signed_exponentials = {.name = "signed_exponentials",
                                                 .parameter_count = 4,
                                                 .term_count = 2,
                                                 .parameters = {EXPONENTIAL(1), EXPONENTIAL(2)},
                                                 EXPONENTIALS,
                                                 .sound = signed_sound};
static const alb_form_row three_exponentials = {.name = "three_exponentials",
                                                .parameter_count = 6,
                                                .term_count = 3,
                                                .parameters = {EXPONENTIAL(1), EXPONENTIAL(2), EXPONENTIAL(3)},
                                                EXPONENTIALS,
                                                .sound = positive_sound};

static const alb_form_row *const rows[ALB_FORMS + 1] = {
    [ALB_FORM_NONE] = &none,
    [ALB_FORM_EXPONENTIAL] = &exponential,
    [ALB_FORM_TWO_EXPONENTIALS] = &two_exponentials,
    [ALB_FORM_SIGNED_EXPONENTIALS] = &signed_exponentials,
    [ALB_FORM_THREE_EXPONENTIALS] = &three_exponentials,
    [ALB_FORM_DIPOLE] = &alb_dipole_row,
    [ALB_FORM_BETTER_DIPOLE] = &alb_better_dipole_row,
    [ALB_FORM_MULTIPOLE_REFLECTION] = &alb_multipole_reflection_row,
    [ALB_FORM_MULTIPOLE_TRANSMISSION] = &alb_multipole_transmission_row,
    [ALB_FORM_TABULATED] = &alb_tabulated_row,
    [ALB_FORM_TWO_OVER_R] = &alb_two_over_r_row,
    [ALB_FORM_BURLEY] = &alb_burley_row,
    [ALB_FORM_BURIED_SOURCE] = &alb_buried_source_row,
    [ALB_FORM_BURIED_AND_OVER_R] = &alb_buried_and_over_r_row,
    [ALB_FORM_TWO_BURIED_SOURCES] = &alb_two_buried_sources_row,
};

int alb_form_parameter_count(alb_form form) { return rows[form]->parameter_count; }
int alb_form_term_count(alb_form form) { return rows[form]->value == exponentials_value ? rows[form]->term_count : 0; }
bool alb_form_singular(alb_form form) { return rows[form]->singular; }
bool alb_form_ordered(alb_form form) // where the terms are alike
{
    return rows[form]->term_count * rows[form]->stride == rows[form]->parameter_count;
}
const char *alb_form_name(alb_form form) { return rows[form]->name; }
const alb_parameter *alb_form_parameter(alb_form form, int i) { return &rows[form]->parameters[i]; }
const char *alb_form_parameter_name(alb_form form, int i) { return rows[form]->parameters[i].name; }

bool alb_form_from_name(alb_form *form, const char *name)
{
    for (int i = ALB_FORM_NONE + 1; i < ALB_FORMS; i++)
        if (strcmp(rows[i]->name, name) == 0) {
            *form = (alb_form)i;
            return true;
        }
    return false;
}

double alb_profile_value(const alb_profile *profile, double r_mm)
{
    const alb_form_row *row = rows[profile->form];
    if (row->singular && r_mm <= 0)
        return (double)INFINITY;
    return row->value ? row->value(NULL, row, profile->parameters, r_mm) : 0;
}

double alb_profile_total(const alb_profile *profile)
{
    const alb_form_row *row = rows[profile->form];
    return row->total ? row->total(NULL, row, profile->parameters) : 0;
}

double alb_profile_disc(const alb_profile *profile, double rho_mm)
{
    const alb_form_row *row = rows[profile->form];
    return row->disc ? row->disc(row, profile->parameters, rho_mm) : 0;
}

double alb_profile_ring(const alb_profile *profile, double inner_mm, double outer_mm)
{
    return 2 * (alb_profile_disc(profile, outer_mm) - alb_profile_disc(profile, inner_mm)) /
           ((outer_mm - inner_mm) * (outer_mm + inner_mm));
}

double alb_profile_gradient(double gradient[ALB_PARAMETERS_MAX], const alb_profile *profile, double r_mm)
{
    const alb_form_row *row = rows[profile->form];
    return row->value(gradient, row, profile->parameters, r_mm);
}

double alb_profile_total_gradient(double gradient[ALB_PARAMETERS_MAX], const alb_profile *profile)
{
    const alb_form_row *row = rows[profile->form];
    return row->total(gradient, row, profile->parameters);
}

double alb_profile_slowest(const alb_profile *profile)
{
    const alb_form_row *row = rows[profile->form];
    return row->slowest(row, profile->parameters);
}

double alb_profile_fastest(const alb_profile *profile)
{
    if (profile->form == ALB_FORM_TABULATED)
        return alb_tabulated_fastest(profile);
    double fastest = alb_profile_slowest(profile);
    for (int p = 0; p < alb_form_parameter_count(profile->form); p++) {
        const alb_parameter *parameter = alb_form_parameter(profile->form, p);
        if (!parameter->flux && parameter->length < 0)
            fastest = fmax(fastest, profile->parameters[p]);
    }
    return fastest;
}

bool alb_profile_sound(const alb_profile *profile)
{
    const alb_form_row *row = rows[profile->form];
    for (int p = 0; p < row->parameter_count; p++)
        if (!isfinite(profile->parameters[p]))
            return false;
    return row->sound && row->sound(row, profile->parameters);
}

bool alb_profile_vanishes(const alb_profile *profile)
{
    for (int p = 0; p < alb_form_parameter_count(profile->form); p++)
        if (profile->parameters[p] == 0)
            return true;
    return false;
}

void alb_profile_order(alb_profile *profile)
{
    const alb_form_row *row = rows[profile->form];
    if (row->sound == signed_sound || !alb_form_ordered(profile->form)) // the signed pair is in order by its bounds
        return;
    const int stride = row->stride;
    for (int i = 1; i < row->term_count; i++)
        for (double *p = profile->parameters + i * stride; p > profile->parameters && p[1] < p[1 - stride]; p -= stride)
            for (int k = 0; k < stride; k++) {
                const double moved = p[k];
                p[k] = p[k - stride];
                p[k - stride] = moved;
            }
}
