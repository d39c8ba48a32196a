// Profiles tabulated over coded distances.
//
// Code q of the octave that ends at R means q R / 254: half a step is R / 508, so that a distance in the upper half of
// its octave is right to 0.2 % rms of itself and e^(-b d) to 0.11 % of b R. The code ALB_NO_LINK has weight zero.
// Beside s stand its derivatives by central differences: what a cluster's light off its middle adds, and its extent.
// Where s bends, and a patch is wide against the bend, no less of it than leaves half of s and no more than makes it
// five times as much.
// At code 0 a form that is infinite at r = 0 takes its mean over half a step.
//
// How large a cluster may be. With the light's first moment in place, what a link misses of the light of one point is
// of second order, up to B(r) size^2 / 12 of what a cluster of that light sends, B = |s''| + |s'| / r. Weighed against
// the root of B, so that what is faint stays right to a few per cent of itself and what is bright to less, a given
// number of links N = integral 2 pi r / size^2 dr goes furthest where
//     size^2 = B^(-1/2) integral 2 pi r B^(1/2) dr / N
// B is taken as the largest of its values from r outwards, and the channel that asks for most counts.
#include "render/scatter_kernel.h"
#include "base/memory.h"
#include <stdlib.h>
#include <string.h>

void alb_scatter_kernel_span(alb_scatter_kernel *kernel, double reach_mm, double near_mm)
{
    const int last = (int)ceil(log2(fmax(reach_mm, 1e-30)));
    kernel->octave_count = ALB_KERNEL_BINS / 4;
    kernel->first_octave = last - kernel->octave_count + 1;
    kernel->near_mm = near_mm;
}

bool alb_scatter_kernel_create(alb_scatter_kernel *kernel, int first_used, alb_error *error)
{
    kernel->first_used = first_used;
    const size_t codes = (size_t)(kernel->octave_count - first_used) * ALB_CODES;
    if (!(kernel->values = alb_allocate(codes, sizeof *kernel->values, error)) ||
        !(kernel->bends = alb_allocate(codes, sizeof *kernel->bends, error)) ||
        !(kernel->discs = alb_allocate(ALB_DISC_KNOTS + 1, sizeof *kernel->discs, error))) {
        alb_scatter_kernel_free(kernel);
        return false;
    }
    return true;
}

void alb_scatter_kernel_free(alb_scatter_kernel *kernel)
{
    free(kernel->values);
    free(kernel->bends);
    free(kernel->discs);
    *kernel = (alb_scatter_kernel){0};
}

size_t alb_scatter_kernel_bytes(const alb_scatter_kernel *kernel)
{
    return (size_t)(kernel->octave_count - kernel->first_used) * ALB_CODES *
               (sizeof *kernel->values + sizeof *kernel->bends) +
           (kernel->discs ? (ALB_DISC_KNOTS + 1) * sizeof *kernel->discs : 0);
}

// Relative change over a step: steeper ones, of five decay lengths, are not resolved and may overflow.
static const double steepest = 64;

static double finite_value(const alb_profile *profile, double r_mm, double step_mm)
{
    const double s = alb_profile_value(profile, r_mm);
    return isfinite(s) ? s : alb_profile_ring(profile, 0, 0.5 * step_mm);
}

static void write_octave(float (*values)[4], float (*bends)[8], const alb_profile profiles[3], double end_mm,
                         double spread_mm2)
{
    const double step = end_mm / (ALB_CODES - 2);
    memset(values, 0, ALB_CODES * sizeof *values);
    memset(bends, 0, ALB_CODES * sizeof *bends);
    for (int c = 0; c < 3; c++) {
        double s[ALB_CODES];
        for (int q = 0; q < ALB_CODES; q++)
            s[q] = finite_value(&profiles[c], q * step, step);
        for (int q = 0; q < ALB_NO_LINK; q++) {
            const int at = q ? q : 1;
            const double bend = 0.5 * (s[at - 1] - 2 * s[at] + s[at + 1]) / (step * step);
            values[q][c] = (float)s[q];
            if (!(values[q][c] > 0)) // what underflows has no slope either
                continue;
            const double slope = q ? (s[q + 1] - s[q - 1]) / (2 * s[q]) : 0;
            bends[q][c] = (float)(fmin(fmax(slope, -steepest), steepest) / step);
            bends[q][4 + c] = (float)fmin(fmax(bend / s[q], -0.5 / spread_mm2), 4 / spread_mm2);
        }
    }
}

void alb_scatter_kernel_write(alb_scatter_kernel *kernel, const alb_profile profiles[3])
{
#pragma omp parallel for schedule(dynamic, 1)
    for (int k = kernel->first_used; k < kernel->octave_count; k++)
        write_octave(kernel->values + (k - kernel->first_used) * ALB_CODES,
                     kernel->bends + (k - kernel->first_used) * ALB_CODES, profiles, ldexp(1, kernel->first_octave + k),
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
    double firsts[ALB_KERNEL_BINS] = {0}, seconds[ALB_KERNEL_BINS] = {0};
    for (int c = 0; c < 3; c++) {
        const double total = alb_profile_total(&profiles[c]);
        double bends[ALB_KERNEL_BINS], all = 0, most = 0;
        if (!(total > 0))
            continue;
        for (int bin = ALB_KERNEL_BINS - 1; bin >= 0; bin--) {
            const double r = bin_start(needs, bin), next = bin_start(needs, bin + 1), h = 0.02 * r;
            const double s = alb_profile_value(&profiles[c], r), before = alb_profile_value(&profiles[c], r - h),
                         after = alb_profile_value(&profiles[c], r + h), slope = fabs(after - before) / (2 * h);
            most = fmax(most, fabs(before - 2 * s + after) / (h * h) + slope / r);
            bends[bin] = sqrt(most);
            all += M_PI * (next * next - r * r) * bends[bin];
            needs->shares[bin][c] = (float)(s / total);
            needs->slopes[bin][c] = (float)(s > 0 ? slope / s : 0);
            firsts[bin] += (after - before) / (2 * h * total);
            seconds[bin] += (before - 2 * s + after) / (h * h * total);
        }
        for (int bin = 0; bin < ALB_KERNEL_BINS; bin++)
            needs->size2_mm2[bin] = fminf(needs->size2_mm2[bin], (float)(all / (links * bends[bin])));
    }
    for (int bin = 0; bin < ALB_KERNEL_BINS; bin++)
        needs->leans[bin] = firsts[bin] != 0 ? (float)(0.5 * seconds[bin] / firsts[bin]) : 0;
}
