// Readings of slabs as a camera would take them, from photons that share no formula with what is fitted: Monte Carlo
// rings of a pencil beam, spread over an evenly lit disc and read on rings about its centre.
#pragma once
#include "base/statistics.h"
#include "capture/photon.h"
#include "fit/choose.h"
#include <math.h>

enum { SLABS_RINGS_MAX = 64, SLABS_PARTS = 24 };
static const double slabs_spot_mm = 0.5, slabs_range = 3000;

typedef struct slab {
    const char *name;
    double absorption_per_mm, reduced_scattering_per_mm, anisotropy, thickness_mm;
    double radius_mm; // of the tally: beyond 3000:1 on both sides
    long photons;
} slab;

// Marble (Jensen et al. 2001, green), skim milk (green, blue), wax-like, thin and dark; thickness 200 mm: half-space.
static const slab slabs[] = {
    {"marble 2 mm", 0.0041, 2.62, 0, 2, 10, 600000},
    {"marble 5 mm", 0.0041, 2.62, 0, 5, 19, 500000},
    {"marble 10 mm", 0.0041, 2.62, 0, 10, 27, 500000},
    {"marble half-space", 0.0041, 2.62, 0, 200, 15, 200000},
    {"marble 2 mm g 0.9", 0.0041, 2.62, 0.9, 2, 10, 200000},
    {"marble 5 mm g 0.9", 0.0041, 2.62, 0.9, 5, 19, 120000},
    {"milk 5 mm", 0.0025, 1.22, 0, 5, 21, 800000},
    {"milk 10 mm", 0.0025, 1.22, 0, 10, 36, 600000},
    {"milk 10 mm g 0.9", 0.0025, 1.22, 0.9, 10, 36, 120000},
    {"milk 20 mm", 0.0142, 1.90, 0, 20, 31, 400000},
    {"milk half-space", 0.0142, 1.90, 0, 200, 14, 400000},
    {"wax 5 mm", 0.02, 0.8, 0, 5, 20, 1000000},
    {"wax 10 mm", 0.02, 0.8, 0, 10, 30, 800000},
    {"wax 5 mm g 0.9", 0.02, 0.8, 0.9, 5, 22, 200000},
    {"wax 10 mm g 0.9", 0.02, 0.8, 0.9, 10, 34, 150000},
    {"wax half-space", 0.05, 1.0, 0, 200, 14, 800000},
    {"thin 2 mm", 0.01, 0.5, 0, 2, 19, 1000000},
    {"thin 5 mm", 0.01, 0.5, 0, 5, 25, 1000000},
    {"thin 5 mm g 0.9", 0.01, 0.5, 0.9, 5, 25, 200000},
    {"dark 5 mm", 0.4, 1.0, 0, 5, 8.5, 6000000},
    {"dark half-space", 0.4, 1.0, 0, 200, 6, 1000000},
};
enum { SLABS = sizeof slabs / sizeof slabs[0] };

static inline bool slabs_trace(alb_photon_tally *tally, const slab *body, double more)
{
    const alb_medium medium = {body->absorption_per_mm, body->reduced_scattering_per_mm / (1 - body->anisotropy),
                               body->anisotropy, 1.5, body->thickness_mm};
    return alb_photon_trace(tally, &medium, body->radius_mm, (long)(more * (double)body->photons), 1, 1, NULL);
}

// Share of a circle of radius rho about a point at distance r that lies in the disc of light.
static inline double slabs_lit(double r, double rho)
{
    const double c = r > 0 ? (r * r + rho * rho - slabs_spot_mm * slabs_spot_mm) / (2 * r * rho) : 0;
    return r > 0 ? acos(fmin(fmax(c, -1), 1)) / M_PI : rho < slabs_spot_mm;
}

// Light of the tally's rings as thin ones: within a ring its logarithm is linear in r between ring means.
static inline void slabs_thin(double *radius, double *light, const double *edges, const double *ring)
{
    double mean[ALB_PHOTON_BINS], value[ALB_PHOTON_BINS];
    for (int i = 0; i < ALB_PHOTON_BINS; i++) {
        mean[i] = (edges[i] + edges[i + 1]) / 2;
        value[i] = log(fmax(ring[i], 1e-300) / (edges[i + 1] * edges[i + 1] - edges[i] * edges[i]));
    }
    for (int i = 0, k = 0; i < ALB_PHOTON_BINS; i++) {
        double sum = 0;
        for (int j = 0; j < SLABS_PARTS; j++) {
            const double width = (edges[i + 1] - edges[i]) / SLABS_PARTS, r = edges[i] + (j + 0.5) * width;
            const int low = r < mean[i] ? i - 1 : i, from = low < 0                     ? 0
                                                            : low > ALB_PHOTON_BINS - 2 ? ALB_PHOTON_BINS - 2
                                                                                        : low;
            const double t = fmin(fmax((r - mean[from]) / (mean[from + 1] - mean[from]), 0), 1);
            radius[k + j] = r;
            sum += light[k + j] = r * exp(value[from] + t * (value[from + 1] - value[from]));
        }
        for (int j = 0; j < SLABS_PARTS; j++, k++)
            light[k] *= ring[i] / sum;
    }
}

// Relative sd that the photons give a reading.
static inline double slabs_noise(const alb_readings *readings, int i)
{
    const double relative = readings->sd[i] / readings->value[i];
    return sqrt(fmax(0, relative * relative - 1e-4));
}

// Whether enough light left through the face for its rings to be worth a fit.
static inline bool slabs_seen(const alb_photon_tally *tally, const slab *body, double more, alb_side side)
{
    return (tally->leaving[side] - tally->unscattered[side]) * more * (double)body->photons > 4e4;
}

// Readings of one face from 0 out to 1/3000 of that at the spot's edge (reflection) or the middle (transmission): rings
// 0.1 mm wide to 1 mm, then growing by a sixteenth; sd 1 % and that of the photons. What has not scattered is left out
// where `ballistic` is false (a camera would mask it), and is in the lit rings where it is true.
static inline bool slabs_readings(alb_readings *readings, const alb_photon_tally *tally, alb_side side, bool ballistic)
{
    enum { THIN = ALB_PHOTON_BINS * SLABS_PARTS };
    static double radius[THIN], light[THIN];
    double edge[SLABS_RINGS_MAX + 1], reference = 0;
    slabs_thin(radius, light, tally->edges_mm, tally->ring[side]);
    for (int i = 0; i <= SLABS_RINGS_MAX; i++)
        edge[i] = i <= 10 ? 0.1 * i : pow(1.0625, i - 10);
    if (!alb_readings_create(readings, SLABS_RINGS_MAX, NULL))
        return false;
    int n = 0;
    for (; n < SLABS_RINGS_MAX && edge[n + 1] + slabs_spot_mm < tally->edges_mm[ALB_PHOTON_BINS]; n++) {
        double value = 0, r_mean = 0, area = 0;
        for (int k = 0; k < ALB_RING_SAMPLES; k++) {
            const double r = edge[n] + (edge[n + 1] - edge[n]) * (k + 0.5) / ALB_RING_SAMPLES;
            double here = ballistic && r < slabs_spot_mm ? tally->unscattered[side] : 0;
            for (int i = 0; i < THIN; i++)
                here += light[i] * slabs_lit(r, radius[i]);
            area += r;
            r_mean += r * r;
            value += r * here / (M_PI * slabs_spot_mm * slabs_spot_mm);
            readings->sample_r_mm[n][k] = r;
            readings->sample_share[n][k] = r;
            readings->sample_value[n][k] = here / (M_PI * slabs_spot_mm * slabs_spot_mm);
        }
        for (int k = 0; k < ALB_RING_SAMPLES; k++)
            readings->sample_share[n][k] /= area;
        readings->r_mm[n] = r_mean / area;
        readings->value[n] = value / area;
        readings->area_mm2[n] = M_PI * (edge[n + 1] * edge[n + 1] - edge[n] * edge[n]);
        int bin = 0;
        while (bin < ALB_PHOTON_BINS - 1 && tally->edges_mm[bin + 1] < readings->r_mm[n])
            bin++;
        const double noise = tally->ring_sd[side][bin] / fmax(tally->ring[side][bin], 1e-300);
        readings->sd[n] = readings->value[n] * hypot(0.01, noise);
        if (n == (side == ALB_REFLECTION ? 5 : 0))
            reference = readings->value[n];
        if (reference > 0 && readings->value[n] < reference / slabs_range)
            break;
    }
    readings->count = n;
    readings->outer_mm = readings->complete_mm = edge[n];
    return true;
}
