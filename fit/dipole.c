// Dipoles of a half-space as profile forms (diffusion.c): the classic one per flux that has entered (Jensen et al.
// 2001), and the better one (d'Eon 2012) times what a smooth face lets in, 1 - ((n-1)/(n+1))^2. Fitted together with
// totals and the other side elsewhere; the derivative by the index is a central difference.
#include "fit/diffusion.h"
#include "fit/form.h"
#include <math.h>

static alb_diffusion body_of(double *entered, const alb_form_row *row, const double *p, double index)
{
    const bool better = row == &alb_better_dipole_row;
    const double mirrored = (index - 1) / (index + 1);
    const alb_diffusion_face face =
        alb_diffusion_face_at(better ? ALB_DIFFUSION_GROSJEAN : ALB_DIFFUSION_CLASSIC, index);
    *entered = better ? 1 - mirrored * mirrored : 1;
    return alb_diffusion_at(&face, p[0], p[1], 0);
}

// Value at r, or the total where r is negative.
static double at_index(double *gradient, const alb_form_row *row, const double *p, double index, double r_mm)
{
    double entered;
    const alb_diffusion body = body_of(&entered, row, p, index);
    const double found = r_mm < 0 ? alb_diffusion_total(gradient, &body, ALB_REFLECTION)
                                  : alb_diffusion_value(gradient, &body, ALB_REFLECTION, r_mm);
    for (int k = 0; gradient && k < 2; k++)
        gradient[k] *= entered;
    return entered * found;
}

static double with_gradient(double *gradient, const alb_form_row *row, const double *p, double r_mm)
{
    const double h = 1e-5 * p[2];
    if (gradient)
        gradient[2] = (at_index(NULL, row, p, p[2] + h, r_mm) - at_index(NULL, row, p, p[2] - h, r_mm)) / (2 * h);
    return at_index(gradient, row, p, p[2], r_mm);
}

static double dipole_value(double *gradient, const alb_form_row *row, const double *p, double r_mm)
{
    return with_gradient(gradient, row, p, r_mm);
}

static double dipole_total(double *gradient, const alb_form_row *row, const double *p)
{
    return with_gradient(gradient, row, p, -1);
}

static double dipole_disc(const alb_form_row *row, const double *p, double rho_mm)
{
    double entered;
    const alb_diffusion body = body_of(&entered, row, p, p[2]);
    return entered * alb_diffusion_disc(&body, ALB_REFLECTION, rho_mm);
}

static double dipole_slowest(const alb_form_row *row, const double *p)
{
    double entered;
    return body_of(&entered, row, p, p[2]).attenuation;
}

static bool dipole_sound(const alb_form_row *row, const double *p)
{
    (void)row;
    return p[0] > 0 && p[1] > 0 && p[2] >= 1 && p[2] <= 3;
}

#define DIPOLE                                                                                                         \
    .parameter_count = 3,                                                                                              \
    .parameters = {{"absorption_per_mm", 0, -1}, {"reduced_scattering_per_mm", 0, -1}, {"refractive_index", 0, 0}},    \
    .value = dipole_value, .total = dipole_total, .disc = dipole_disc, .slowest = dipole_slowest,                      \
    .sound = dipole_sound

const alb_form_row alb_dipole_row = {.name = "dipole", DIPOLE};
const alb_form_row alb_better_dipole_row = {.name = "better_dipole", DIPOLE};
