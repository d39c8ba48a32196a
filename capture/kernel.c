// The radial kernel K(r) as thin rings of known light, and its convolution with a Gaussian of standard deviation s:
//   k(r) = sum_rings m_i / (2 pi s^2) exp(-(r - r_i)^2 / 2 s^2) I0e(r r_i / s^2),   I0e(x) = e^-x I0(x),
// I0 by the polynomials of Abramowitz & Stegun 9.8.1 and 9.8.2 (relative error 2e-7).
//
// Rings are at most s/16 wide, so that their width does not show. A traced kernel knows the light of wide rings only:
// between their mean radii its logarithm is taken as linear in r, and the thin rings of a wide one are scaled to hold
// exactly its light. The noise of the photons stays in the kernel: this is the rig's truth, and truth.json says how
// noisy it is. Stops being true where K bends strongly within one of the traced rings (they grow with r: radius
// (i/64)^2).
#include "capture/kernel.h"
#include "base/memory.h"
#include <math.h>
#include <stdlib.h>

enum { PARTS_OF_SD = 16, REACH_SD = 7 }; // e^(-7^2/2) = 2e-11

typedef struct thin_rings {
    size_t count;
    double *radius, *mass;
} thin_rings;

// Mean radius of a ring: where a function that is linear in r takes its mean over the area.
static double mean_radius(double inner, double outer)
{
    return 2.0 / 3 * (inner * inner + inner * outer + outer * outer) / (inner + outer);
}

static double bessel_i0e(double x)
{
    if (x < 3.75) {
        const double t = x / 3.75 * (x / 3.75);
        return exp(-x) *
               (1 + t * (3.5156229 +
                         t * (3.0899424 + t * (1.2067492 + t * (0.2659732 + t * (0.0360768 + t * 0.0045813))))));
    }
    const double t = 3.75 / x;
    return (0.39894228 +
            t * (0.01328592 +
                 t * (0.00225319 +
                      t * (-0.00157565 +
                           t * (0.00916281 +
                                t * (-0.02057706 + t * (0.02635537 + t * (-0.01647633 + t * 0.00392377)))))))) /
           sqrt(x);
}

// 2 pi a int_0^r e^(-b t) t dt
static double profile_disc(const alb_stated_profile *profile, double r)
{
    double sum = 0;
    for (int i = 0; i < profile->terms; i++) {
        const double b = profile->decay_per_mm[i], x = b * r;
        sum += 2 * M_PI * profile->amplitude_per_mm2[i] / (b * b) * (-expm1(-x) - x * exp(-x));
    }
    return sum;
}

void alb_response_from_profile(alb_response *response, const alb_stated_profile *profile, double radius_mm)
{
    *response = (alb_response){.total = profile_disc(profile, 1e9)};
    for (int i = 0; i < ALB_PHOTON_BINS; i++) {
        const double bins = ALB_PHOTON_BINS, inner = radius_mm * (i / bins) * (i / bins);
        const double outer = radius_mm * ((i + 1) / bins) * ((i + 1) / bins);
        response->r_mm[i] = mean_radius(inner, outer);
        response->value_per_mm2[i] =
            (profile_disc(profile, outer) - profile_disc(profile, inner)) / (M_PI * (outer * outer - inner * inner));
    }
}

void alb_response_from_photons(alb_response *response, const alb_photon_tally *tally, int face)
{
    *response = (alb_response){.total = tally->leaving[face], .total_sd = tally->leaving_sd[face]};
    for (int i = 0; i < ALB_PHOTON_BINS; i++) {
        const double inner = tally->edges_mm[i], outer = tally->edges_mm[i + 1];
        const double area = M_PI * (outer * outer - inner * inner);
        response->r_mm[i] = mean_radius(inner, outer);
        response->value_per_mm2[i] = tally->ring[face][i] / area;
        response->sd_per_mm2[i] = tally->ring_sd[face][i] / area;
    }
}

// log-linear in r between the means; linear where one of them is zero; constant outside.
static double between_means(const alb_response *response, double r)
{
    const double *x = response->r_mm, *v = response->value_per_mm2;
    int i = 0;
    while (i < ALB_PHOTON_BINS - 1 && r > x[i + 1])
        i++;
    if (r <= x[0] || i == ALB_PHOTON_BINS - 1)
        return v[r <= x[0] ? 0 : i];
    const double t = (r - x[i]) / (x[i + 1] - x[i]);
    return v[i] > 0 && v[i + 1] > 0 ? v[i] * pow(v[i + 1] / v[i], t) : v[i] + t * (v[i + 1] - v[i]);
}

static bool rings_create(thin_rings *out, size_t count, alb_error *error)
{
    *out = (thin_rings){.count = count, .radius = alb_allocate(2 * count, sizeof(double), error)};
    out->mass = out->radius + count;
    return out->radius != NULL;
}

// Splits every traced ring into thin ones that together hold its light.
static bool rings_from_photons(thin_rings *out, const alb_photon_tally *tally, int face, double width, alb_error *error)
{
    alb_response means;
    alb_response_from_photons(&means, tally, face);
    size_t count = 0, at = 0, parts[ALB_PHOTON_BINS];
    for (int i = 0; i < ALB_PHOTON_BINS; i++)
        count += parts[i] = (size_t)ceil((tally->edges_mm[i + 1] - tally->edges_mm[i]) / width);
    if (!rings_create(out, count, error))
        return false;
    for (int i = 0; i < ALB_PHOTON_BINS; at += parts[i++]) {
        const double inner = tally->edges_mm[i], thin = (tally->edges_mm[i + 1] - inner) / (double)parts[i];
        double sum = 0;
        for (size_t j = 0; j < parts[i]; j++) {
            const double a = inner + (double)j * thin, b = a + thin, r = mean_radius(a, b);
            out->radius[at + j] = r;
            sum += out->mass[at + j] = between_means(&means, r) * M_PI * (b * b - a * a);
        }
        for (size_t j = 0; j < parts[i] && sum > 0; j++)
            out->mass[at + j] *= tally->ring[face][i] / sum;
    }
    return true;
}

static bool rings_from_profile(thin_rings *out, const alb_stated_profile *profile, double width, double radius_mm,
                               alb_error *error)
{
    if (!rings_create(out, (size_t)ceil(radius_mm / width), error))
        return false;
    for (size_t i = 0; i < out->count; i++) {
        const double a = (double)i * width, b = a + width;
        out->radius[i] = mean_radius(a, b);
        out->mass[i] = profile_disc(profile, b) - profile_disc(profile, a);
    }
    return true;
}

static bool blur(alb_kernel *kernel, const thin_rings *rings, double sd, double radius_mm, alb_error *error)
{
    kernel->step_mm = sd / PARTS_OF_SD;
    kernel->count = (int)ceil(radius_mm / kernel->step_mm) + 2;
    kernel->value_per_mm2 = alb_allocate((size_t)kernel->count, sizeof(double), error);
    if (!kernel->value_per_mm2)
        return false;
#pragma omp parallel for schedule(dynamic, 64)
    for (int j = 0; j < kernel->count; j++) {
        const double r = j * kernel->step_mm;
        size_t low = 0, high = rings->count; // first ring within reach
        while (low < high) {
            const size_t middle = (low + high) / 2;
            if (rings->radius[middle] < r - REACH_SD * sd)
                low = middle + 1;
            else
                high = middle;
        }
        double sum = 0;
        for (size_t i = low; i < rings->count && rings->radius[i] <= r + REACH_SD * sd; i++) {
            const double d = (r - rings->radius[i]) / sd;
            if (rings->mass[i] != 0)
                sum += rings->mass[i] * exp(-0.5 * d * d) * bessel_i0e(r * rings->radius[i] / (sd * sd));
        }
        kernel->value_per_mm2[j] = sum / (2 * M_PI * sd * sd);
    }
    return true;
}

bool alb_kernel_from_photons(alb_kernel *kernel, const alb_photon_tally *tally, int face, double blur_sd_mm,
                             double radius_mm, alb_error *error)
{
    thin_rings rings = {0};
    *kernel = (alb_kernel){.unscattered = tally->unscattered[face], .total = tally->leaving[face]};
    const bool ok = rings_from_photons(&rings, tally, face, blur_sd_mm / PARTS_OF_SD, error) &&
                    blur(kernel, &rings, blur_sd_mm, radius_mm, error);
    free(rings.radius);
    return ok;
}

bool alb_kernel_from_profile(alb_kernel *kernel, const alb_stated_profile *profile, double blur_sd_mm, double radius_mm,
                             alb_error *error)
{
    thin_rings rings = {0};
    *kernel = (alb_kernel){.total = profile_disc(profile, 1e9)};
    const bool ok =
        rings_from_profile(&rings, profile, blur_sd_mm / PARTS_OF_SD, radius_mm + REACH_SD * blur_sd_mm, error) &&
        blur(kernel, &rings, blur_sd_mm, radius_mm, error);
    free(rings.radius);
    return ok;
}

void alb_kernel_free(alb_kernel *kernel)
{
    free(kernel->value_per_mm2);
    *kernel = (alb_kernel){0};
}
