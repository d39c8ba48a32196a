// Classic dipole of a half-space (Jensen et al. 2001, eq. 4): alpha' = s'/(a + s'), l = 1/(a + s'),
// sigma = sqrt(3 a (a + s')),
//   S(r) = alpha'/(4 pi) sum_i z_i (1 + sigma d_i) e^(-sigma d_i) / d_i^3,  d_i^2 = r^2 + z_i^2,  z = l, l (1 + 4 A /
//   3) A = (1 + F) / (1 - F), F = -1.440/n^2 + 0.710/n + 0.668 + 0.0636 n; A = 1 for n = 1.
// d(-e^(-sigma d)/d) = (1 + sigma d) e^(-sigma d)/d^2 dd and r dr = d dd give disc and total in closed form.
// Stops being true within one mean free path of the beam, for alpha' below 0.8, and for slabs thinner than 8 mean free
// paths.
#include "fit/form.h"
#include <math.h>

typedef struct dipole {
    double weight, transport_per_mm, depth_mm[2]; // alpha'/(4 pi), sigma, z
    double by[3][4];                              // derivatives of the four by the parameters
} dipole;

static dipole dipole_of(const double *p)
{
    const double absorption = p[0], scattering = p[1], n = p[2], extinction = absorption + scattering;
    if (!(extinction > 0))
        return (dipole){.depth_mm = {1, 1}};
    const double fresnel = -1.440 / (n * n) + 0.710 / n + 0.668 + 0.0636 * n;
    const double a = n == 1 ? 1 : (1 + fresnel) / (1 - fresnel), apart = 1 + 4 * a / 3;
    const double a_by_n =
        n == 1 ? 0 : 2 * (2.880 / (n * n * n) - 0.710 / (n * n) + 0.0636) / ((1 - fresnel) * (1 - fresnel));
    const double w = scattering / extinction / (4 * M_PI), sigma = sqrt(3 * absorption * extinction);
    const double shrink = -1 / (extinction * extinction);
    return (dipole){
        .weight = w,
        .transport_per_mm = sigma,
        .depth_mm = {1 / extinction, apart / extinction},
        .by = {{-w / extinction, 1.5 * (2 * absorption + scattering) / sigma, shrink, apart * shrink},
               {absorption / (4 * M_PI * extinction * extinction), 1.5 * absorption / sigma, shrink, apart * shrink},
               {0, 0, 0, 4 * a_by_n / (3 * extinction)}}};
}

static void chain(double *gradient, const dipole *d, const double by[4])
{
    for (int p = 0; p < 3; p++)
        gradient[p] = d->by[p][0] * by[0] + d->by[p][1] * by[1] + d->by[p][2] * by[2] + d->by[p][3] * by[3];
}

static double dipole_value(double *gradient, const double *p, int terms, double r_mm)
{
    (void)terms;
    const dipole sources = dipole_of(p);
    const double w = sources.weight, sigma = sources.transport_per_mm;
    double sum = 0, by[4] = {0}; // by weight, transport, depths
    for (int i = 0; i < 2; i++) {
        const double z = sources.depth_mm[i], d = hypot(r_mm, z), optical = sigma * d;
        const double e = exp(-optical) / (d * d * d);
        sum += z * (1 + optical) * e;
        by[1] -= w * z * sigma * d * d * e;
        by[2 + i] = w * e * (1 + optical - z * z * (sigma * sigma + 3 * (1 + optical) / (d * d)));
    }
    by[0] = sum;
    if (gradient)
        chain(gradient, &sources, by);
    return w * sum;
}

static double dipole_total(double *gradient, const double *p, int terms)
{
    (void)terms;
    const dipole d = dipole_of(p);
    double sum = 0, by[4] = {0};
    for (int i = 0; i < 2; i++) {
        const double share = exp(-d.transport_per_mm * d.depth_mm[i]);
        sum += share;
        by[1] -= 2 * M_PI * d.weight * d.depth_mm[i] * share;
        by[2 + i] = -2 * M_PI * d.weight * d.transport_per_mm * share;
    }
    by[0] = 2 * M_PI * sum;
    if (gradient)
        chain(gradient, &d, by);
    return 2 * M_PI * d.weight * sum;
}

static double dipole_disc(const double *p, int terms, double rho_mm)
{
    (void)terms;
    const dipole d = dipole_of(p);
    double sum = 0;
    for (int i = 0; i < 2; i++) {
        // e^(-sigma z) - (z/d) e^(-sigma d), written so that small discs keep their digits
        const double z = d.depth_mm[i], distance = hypot(rho_mm, z), further = rho_mm * rho_mm / (distance + z);
        const double u = further / distance, lost = -expm1(-d.transport_per_mm * further);
        sum += exp(-d.transport_per_mm * z) * (u + (1 - u) * lost);
    }
    return d.weight * sum;
}

static double dipole_slowest(const double *p, int terms)
{
    (void)terms;
    return dipole_of(p).transport_per_mm;
}

static bool dipole_sound(const double *p, int terms)
{
    (void)terms;
    return p[0] > 0 && p[1] > 0 && p[2] >= 1 && p[2] <= 3;
}

const alb_form_row alb_dipole_row = {
    .name = "dipole",
    .parameter_count = 3,
    .parameters = {{"absorption_per_mm", 0, -1}, {"reduced_scattering_per_mm", 0, -1}, {"refractive_index", 0, 0}},
    .value = dipole_value,
    .total = dipole_total,
    .disc = dipole_disc,
    .slowest = dipole_slowest,
    .sound = dipole_sound,
};
