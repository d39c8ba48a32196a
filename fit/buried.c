// Forms in which light falls off as from sources under the face: of each term
//   s(r) = a e^(-b (rho - z)) / rho,   rho^2 = r^2 + z^2,
// the fluence of a point source at the depth z in a medium that diffuses light (a screened potential). rho drho = r dr:
//   integral_0^r s r' dr' = a (1 - e^(-b (rho - z))) / b,   total 2 pi a / b.
// z > 0 is flat at r = 0 and follows the transmission of a slab; z = 0 is a e^(-b r) / r, near the beam what light that
// has scattered isotropically once or twice does. The depths are those of a fit, not of a source.
//
// Burley's normalised diffusion (Christensen & Burley 2015): S(r) = A (e^(-r/d) + e^(-r/(3 d))) / (8 pi d r), total A;
// for half-spaces only.
//
// Stops being true: z = 0 is infinite at the beam (its disc is not), where real light ends at the width of the beam and
// the mean free path.
#include "fit/form.h"
#include <math.h>

// Parameters of a term: a, b and, but for terms over r, z.
static bool has_depth(const alb_form_row *row, int term)
{
    return row->stride * term + 2 < row->parameter_count && row->stride == 3;
}

static double sources_value(double *gradient, const alb_form_row *row, const double *p, double r_mm)
{
    double sum = 0;
    for (int j = 0; j < row->term_count; j++, p += row->stride) {
        const double z = has_depth(row, j) ? p[2] : 0, rho = sqrt(r_mm * r_mm + z * z);
        const double further = rho > 0 ? r_mm * r_mm / (rho + z) : 0, unit = exp(-p[1] * further) / rho;
        sum += p[0] * unit;
        if (!gradient)
            continue;
        gradient[0] = unit;
        gradient[1] = -further * p[0] * unit;
        if (has_depth(row, j))
            gradient[2] = p[0] * unit * (p[1] * further - z / rho) / rho;
        gradient += row->stride;
    }
    return sum;
}

static double sources_total(double *gradient, const alb_form_row *row, const double *p)
{
    double sum = 0;
    for (int j = 0; j < row->term_count; j++, p += row->stride) {
        sum += 2 * M_PI * p[0] / p[1];
        if (!gradient)
            continue;
        gradient[0] = 2 * M_PI / p[1];
        gradient[1] = -2 * M_PI * p[0] / (p[1] * p[1]);
        if (has_depth(row, j))
            gradient[2] = 0;
        gradient += row->stride;
    }
    return sum;
}

static double sources_disc(const alb_form_row *row, const double *p, double rho_mm)
{
    double sum = 0;
    for (int j = 0; j < row->term_count; j++, p += row->stride) {
        const double z = has_depth(row, j) ? p[2] : 0;
        const double further = rho_mm > 0 ? rho_mm * rho_mm / (sqrt(rho_mm * rho_mm + z * z) + z) : 0;
        sum += -p[0] * expm1(-p[1] * further) / p[1];
    }
    return sum;
}

static double sources_slowest(const alb_form_row *row, const double *p)
{
    return row->term_count == 2 ? fmin(p[1], p[1 + row->stride]) : p[1];
}

static bool sources_sound(const alb_form_row *row, const double *p)
{
    const bool alike = has_depth(row, 0) == has_depth(row, row->term_count - 1); // then in order
    double before = 0;
    for (int j = 0; j < row->term_count; j++, p += row->stride) {
        if (!(p[0] > 0 && p[1] > before && (!has_depth(row, j) || p[2] > 0)))
            return false;
        before = alike ? p[1] : 0;
    }
    return true;
}

static double burley_value(double *gradient, const alb_form_row *row, const double *p, double r_mm)
{
    (void)row;
    const double d = p[1], near = exp(-r_mm / d), far = exp(-r_mm / (3 * d)), unit = 1 / (8 * M_PI * d * r_mm);
    if (gradient) {
        gradient[0] = unit * (near + far);
        gradient[1] = p[0] * unit / d * (near * (r_mm / d - 1) + far * (r_mm / (3 * d) - 1));
    }
    return p[0] * unit * (near + far);
}

static double burley_total(double *gradient, const alb_form_row *row, const double *p)
{
    (void)row;
    if (gradient)
        gradient[0] = 1, gradient[1] = 0;
    return p[0];
}

static double burley_disc(const alb_form_row *row, const double *p, double rho_mm)
{
    (void)row;
    return p[0] / (2 * M_PI) * (-0.25 * expm1(-rho_mm / p[1]) - 0.75 * expm1(-rho_mm / (3 * p[1])));
}

static double burley_slowest(const alb_form_row *row, const double *p)
{
    (void)row;
    return 1 / (3 * p[1]);
}

static bool burley_sound(const alb_form_row *row, const double *p)
{
    (void)row;
    return p[0] > 0 && p[1] > 0;
}

#define SOURCE(n)                                                                                                      \
    {"amplitude_" #n "_per_mm", 1, -1}, { "decay_" #n "_per_mm", 0, -1 }
#define SOURCES                                                                                                        \
    .value = sources_value, .total = sources_total, .disc = sources_disc, .slowest = sources_slowest,                  \
    .sound = sources_sound

const alb_form_row alb_two_over_r_row = {.name = "two_exponentials_over_r",
                                         .parameter_count = 4,
                                         .term_count = 2,
                                         .stride = 2,
                                         .singular = true,
                                         .parameters = {SOURCE(1), SOURCE(2)},
                                         SOURCES};
const alb_form_row alb_buried_source_row = {.name = "buried_source",
                                            .parameter_count = 3,
                                            .term_count = 1,
                                            .stride = 3,
                                            .parameters = {SOURCE(1), {"depth_1_mm", 0, 1}},
                                            SOURCES};
const alb_form_row alb_two_buried_sources_row = {
    .name = "two_buried_sources",
    .parameter_count = 6,
    .term_count = 2,
    .stride = 3,
    .parameters = {SOURCE(1), {"depth_1_mm", 0, 1}, SOURCE(2), {"depth_2_mm", 0, 1}},
    SOURCES};
const alb_form_row alb_buried_and_over_r_row = {.name = "buried_source_and_over_r",
                                                .parameter_count = 5,
                                                .term_count = 2,
                                                .stride = 3,
                                                .singular = true,
                                                .parameters = {SOURCE(1), {"depth_1_mm", 0, 1}, SOURCE(2)},
                                                SOURCES};
const alb_form_row alb_burley_row = {.name = "burley",
                                     .parameter_count = 2,
                                     .singular = true,
                                     .parameters = {{"albedo", 1, 0}, {"length_mm", 0, 1}},
                                     .value = burley_value,
                                     .total = burley_total,
                                     .disc = burley_disc,
                                     .slowest = burley_slowest,
                                     .sound = burley_sound};
