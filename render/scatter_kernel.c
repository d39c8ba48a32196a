// Profiles tabulated over coded distances.
//
// Code q of the octave that ends at R means q R / 254: half a step is R / 508, so that a distance in the upper half of
// its octave is right to 0.2 % rms of itself and e^(-b d) to 0.11 % of b R. The code ALB_NO_LINK has weight zero.
// Beside s stands s'' / 2 by central differences, which a cluster of variance v along the line of sight adds v times;
// where a patch is wide against the bend, no less than leaves half of s and no more than makes it five times as much.
// At code 0 a form that is infinite at r = 0 takes its mean over half a step.
//
// How large a cluster may be: what the links of one row miss of the light of one point is, squared,
//     sum over links (A s'(r))^2 size^2 / 24,   size^2 = area, uniform over it
// and their number is N = integral 2 pi r / size^2 dr. For a given N it is least where
//     size^2 = 2 pi M / (N |s'(r)|),   M = integral |s'| r dr = integral s dr
// (Lagrange; checked: e^(-b r) leaves sqrt(pi / (3 N)) of the rms of s). |s'| is taken as the largest of its values
// from r outwards, and the channel that asks for most counts.
#include "render/scatter_kernel.h"
#include "base/memory.h"
#include <stdlib.h>
#include <string.h>

bool alb_scatter_kernel_create(alb_scatter_kernel *kernel, double reach_mm, double near_mm, alb_error *error)
{
    const int last = (int)ceil(log2(fmax(reach_mm, 1e-30)));
    kernel->octave_count = ALB_KERNEL_BINS / 4;
    kernel->first_octave = last - kernel->octave_count + 1;
    kernel->near_mm = near_mm;
    kernel->storage = alb_allocate((size_t)(kernel->octave_count * ALB_CODES + 2), sizeof *kernel->values, error);
    if (!kernel->storage || !(kernel->discs = alb_allocate(ALB_DISC_KNOTS + 1, sizeof *kernel->discs, error))) {
        alb_scatter_kernel_free(kernel);
        return false;
    }
    const uintptr_t line = 64, at = (uintptr_t)kernel->storage; // entries of half a cache line
    kernel->values = (float(*)[8])((at + line - 1) / line * line);
    return true;
}

void alb_scatter_kernel_free(alb_scatter_kernel *kernel)
{
    free(kernel->storage);
    free(kernel->discs);
    *kernel = (alb_scatter_kernel){0};
}

size_t alb_scatter_kernel_bytes(const alb_scatter_kernel *kernel)
{
    return (size_t)kernel->octave_count * ALB_CODES * sizeof *kernel->values +
           (kernel->discs ? (ALB_DISC_KNOTS + 1) * sizeof *kernel->discs : 0);
}

static double finite_value(const alb_profile *profile, double r_mm, double step_mm)
{
    const double s = alb_profile_value(profile, r_mm);
    return isfinite(s) ? s : alb_profile_ring(profile, 0, 0.5 * step_mm);
}

static void write_octave(float (*values)[8], const alb_profile profiles[3], double end_mm, double spread_mm2)
{
    const double step = end_mm / (ALB_CODES - 2);
    memset(values, 0, ALB_CODES * sizeof *values);
    for (int c = 0; c < 3; c++) {
        double s[ALB_CODES];
        for (int q = 0; q < ALB_CODES; q++)
            s[q] = finite_value(&profiles[c], q * step, step);
        for (int q = 0; q < ALB_NO_LINK; q++) {
            const int at = q ? q : 1;
            const double bend = 0.5 * (s[at - 1] - 2 * s[at] + s[at + 1]) / (step * step);
            values[q][c] = (float)s[q];
            values[q][4 + c] = (float)fmin(fmax(bend, -0.5 * s[q] / spread_mm2), 4 * s[q] / spread_mm2);
        }
    }
}

void alb_scatter_kernel_write(alb_scatter_kernel *kernel, const alb_profile profiles[3])
{
#pragma omp parallel for schedule(dynamic, 1)
    for (int k = 0; k < kernel->octave_count; k++)
        write_octave(kernel->values + k * ALB_CODES, profiles, ldexp(1, kernel->first_octave + k),
                     (double)kernel->largest_spread_mm2);
#pragma omp parallel for schedule(static)
    for (int k = 0; k <= ALB_DISC_KNOTS; k++) {
        const double u = fmax(k, 1e-3) / ALB_DISC_KNOTS, r = u * u * kernel->near_mm;
        for (int c = 0; c < 3; c++)
            kernel->discs[k][c] = (float)(alb_profile_disc(&profiles[c], r) / r);
    }
}

static double bin_start(const alb_scatter_kernel_needs *needs, int bin)
{
    return ldexp(1 + 0.25 * (bin % 4), needs->first_octave + bin / 4);
}

void alb_scatter_kernel_needs_find(alb_scatter_kernel_needs *needs, const alb_scatter_kernel *kernel,
                                   const alb_profile profiles[3], double links)
{
    *needs = (alb_scatter_kernel_needs){.first_octave = kernel->first_octave};
    for (int bin = 0; bin < ALB_KERNEL_BINS; bin++)
        needs->size2_mm2[bin] = INFINITY;
    for (int c = 0; c < 3; c++) {
        const double total = alb_profile_total(&profiles[c]);
        double falls[ALB_KERNEL_BINS], all = 0, steepest = 0;
        if (!(total > 0))
            continue;
        for (int bin = 0; bin < ALB_KERNEL_BINS; bin++) {
            const double r = bin_start(needs, bin), next = bin_start(needs, bin + 1);
            const double s = alb_profile_value(&profiles[c], r);
            falls[bin] = fabs(alb_profile_value(&profiles[c], 0.999 * r) - alb_profile_value(&profiles[c], 1.001 * r)) /
                         (0.002 * r);
            all += s * (next - r);
            needs->shares[bin][c] = (float)(s / total);
            needs->slopes[bin][c] = (float)(s > 0 ? falls[bin] / s : 0);
        }
        for (int bin = ALB_KERNEL_BINS - 1; bin >= 0; bin--) {
            steepest = fmax(steepest, falls[bin]);
            needs->size2_mm2[bin] = fminf(needs->size2_mm2[bin], (float)(2 * M_PI * all / (links * steepest)));
        }
    }
}
