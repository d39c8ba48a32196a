// Dipoles of a half-space and multipoles of a slab as profile forms (diffusion.c): the classic ones per flux that has
// entered (Jensen et al. 2001; Donner & Jensen 2005), and the better dipole (d'Eon 2012) times what a smooth face lets
// in, 1 - ((n-1)/(n+1))^2. Fitted together with totals and the other side elsewhere; the derivatives by the index and
// the thickness are central differences.
#include "fit/diffusion.h"
#include "fit/form.h"
#include <math.h>
#include <string.h>

enum { ABSORPTION, SCATTERING, INDEX, THICKNESS };

static alb_side side_of(const alb_form_row *row)
{
    return row == &alb_multipole_transmission_row ? ALB_TRANSMISSION : ALB_REFLECTION;
}

static alb_diffusion body_of(double *entered, const alb_form_row *row, const double *p)
{
    const bool better = row == &alb_better_dipole_row;
    const double mirrored = (p[INDEX] - 1) / (p[INDEX] + 1);
    const alb_diffusion_face face =
        alb_diffusion_face_at(better ? ALB_DIFFUSION_GROSJEAN : ALB_DIFFUSION_CLASSIC, p[INDEX]);
    *entered = better ? 1 - mirrored * mirrored : 1;
    return alb_diffusion_at(&face, p[ABSORPTION], p[SCATTERING], row->parameter_count > THICKNESS ? p[THICKNESS] : 0);
}

// Value at r, or the total where r is negative.
static double found_at(double *gradient, const alb_form_row *row, const double *p, double r_mm)
{
    double entered;
    const alb_diffusion body = body_of(&entered, row, p);
    const double found = r_mm < 0 ? alb_diffusion_total(gradient, &body, side_of(row))
                                  : alb_diffusion_value(gradient, &body, side_of(row), r_mm);
    for (int k = 0; gradient && k < INDEX; k++)
        gradient[k] *= entered;
    return entered * fmax(found, 0); // far out the sum of images is rounding
}

static double with_gradient(double *gradient, const alb_form_row *row, const double *p, double r_mm)
{
    for (int k = INDEX; gradient && k < row->parameter_count; k++) {
        double more[ALB_PARAMETERS_MAX], less[ALB_PARAMETERS_MAX];
        const double h = 1e-5 * p[k];
        memcpy(more, p, sizeof more), memcpy(less, p, sizeof less);
        more[k] += h, less[k] -= h;
        gradient[k] = (found_at(NULL, row, more, r_mm) - found_at(NULL, row, less, r_mm)) / (2 * h);
    }
    return found_at(gradient, row, p, r_mm);
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
    const alb_diffusion body = body_of(&entered, row, p);
    return entered * alb_diffusion_disc(&body, side_of(row), rho_mm);
}

// Of a slab that of the slowest wave between its faces.
static double dipole_slowest(const alb_form_row *row, const double *p)
{
    double entered;
    const alb_diffusion body = body_of(&entered, row, p);
    return body.thickness > 0 ? hypot(body.attenuation, M_PI / (body.thickness + 2 * body.beyond)) : body.attenuation;
}

// A slab is thicker than its source is deep.
static bool dipole_sound(const alb_form_row *row, const double *p)
{
    return p[ABSORPTION] > 0 && p[SCATTERING] > 0 && p[INDEX] >= 1 && p[INDEX] <= 3 &&
           (row->parameter_count <= THICKNESS || p[THICKNESS] * (p[ABSORPTION] + p[SCATTERING]) > 1);
}

#define MEDIUM                                                                                                         \
    {"absorption_per_mm", 0, -1}, {"reduced_scattering_per_mm", 0, -1}, { "refractive_index", 0, 0 }
#define DIPOLE                                                                                                         \
    .value = dipole_value, .total = dipole_total, .disc = dipole_disc, .slowest = dipole_slowest, .sound = dipole_sound

const alb_form_row alb_dipole_row = {.name = "dipole", .parameter_count = 3, .parameters = {MEDIUM}, DIPOLE};
const alb_form_row alb_better_dipole_row = {
    .name = "better_dipole", .parameter_count = 3, .parameters = {MEDIUM}, DIPOLE};
const alb_form_row alb_multipole_reflection_row = {
    .name = "multipole_reflection", .parameter_count = 4, .parameters = {MEDIUM, {"thickness_mm", 0, 1}}, DIPOLE};
const alb_form_row alb_multipole_transmission_row = {
    .name = "multipole_transmission", .parameter_count = 4, .parameters = {MEDIUM, {"thickness_mm", 0, 1}}, DIPOLE};
