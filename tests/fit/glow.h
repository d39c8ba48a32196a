// Pictures of a slab of marble, 5 transport mean free paths thick, lit by a spot: the photons of capture/photon.c,
// spread over the spot and the pixels by sums that share nothing with fit's operator.
#pragma once
#include "base/random.h"
#include "capture/kernel.h"
#include "check.h"
#include "fit/observe.h"

enum { GLOW_TABLE = 1600 };
static const double glow_pi = 3.141592653589793, glow_end_mm = 16, glow_fine_mm = 0.004;
static const alb_medium glow_marble = {0.0041, 2.62, 0, 1.5, 1.9};
static const double glow_free_path_mm = 1 / 2.6241;

typedef struct glow_spot {
    bool gaussian;
    double radius_mm; // of the disc; 1/e^2 of the Gaussian
} glow_spot;

// What a small pixel sees at distances 0, 0.01, 0.02 ... mm of the spot's middle; and of a pencil beam.
typedef struct glow {
    double lit[GLOW_TABLE], pencil[GLOW_TABLE], total;
} glow;

// Traced once.
static inline const alb_kernel *glow_kernel(int face)
{
    static alb_photon_tally tally;
    static alb_kernel kernels[2];
    alb_error error = {0};
    if (!kernels[0].count) {
        check_ok(alb_photon_trace(&tally, &glow_marble, glow_end_mm, 4000000, 11, 0, &error), &error);
        for (int f = 0; f < 2; f++)
            check_ok(alb_kernel_from_photons(&kernels[f], &tally, f, 0.02, glow_end_mm, &error), &error);
    }
    return &kernels[face];
}

// Share of the directions from distance r, length rho, that end in the disc.
static inline double glow_disc_part(double r, double rho, double radius)
{
    if (r + rho <= radius)
        return 1;
    if (fabs(r - rho) >= radius)
        return 0;
    return acos(fmin(fmax((r * r + rho * rho - radius * radius) / (2 * r * rho), -1), 1)) / glow_pi;
}

// Mean of e^(-2 |r + rho u|^2 / w^2) over the directions u, about the direction in which it is largest.
static inline double glow_gaussian_part(double r, double rho, double w)
{
    enum { DIRECTIONS = 48 };
    const double most = fmin(glow_pi, 3 * w / sqrt(fmax(r * rho, 1e-12)));
    double sum = 0;
    for (int k = 0; k < DIRECTIONS; k++)
        sum += exp(-2 * (r * r + rho * rho - 2 * r * rho * cos(most * (k + 0.5) / DIRECTIONS)) / (w * w));
    return sum * most / (DIRECTIONS * glow_pi);
}

static inline void glow_make(glow *out, int face, glow_spot spot)
{
    const alb_kernel *kernel = glow_kernel(face);
    const double p = spot.radius_mm, reach = spot.gaussian ? 2.2 * p : p;
    out->total = kernel->total - kernel->unscattered;
#pragma omp parallel for schedule(dynamic, 32)
    for (int i = 0; i < GLOW_TABLE; i++) {
        const double r = i * glow_end_mm / GLOW_TABLE;
        double sum = 0;
        out->pencil[i] = alb_kernel_value(kernel, r);
        for (int k = (int)fmax(floor((r - reach) / glow_fine_mm), 0); k <= (r + reach) / glow_fine_mm; k++) {
            const double rho = (k + 0.5) * glow_fine_mm;
            const double mass = 2 * glow_pi * rho * glow_fine_mm * alb_kernel_value(kernel, rho);
            sum += mass * (spot.gaussian ? 2 / (glow_pi * p * p) * glow_gaussian_part(r, rho, p)
                                         : glow_disc_part(r, rho, p) / (glow_pi * p * p));
        }
        out->lit[i] = sum;
    }
}

static inline double glow_at(const double table[GLOW_TABLE], double r_mm)
{
    const double at = r_mm * GLOW_TABLE / glow_end_mm;
    const int i = (int)at;
    return i < GLOW_TABLE - 1 ? table[i] + (at - i) * (table[i + 1] - table[i]) : 0;
}

enum { GLOW_SIZE = 200 };

typedef struct glow_picture {
    alb_face face;
    double clean[GLOW_SIZE * GLOW_SIZE], value[GLOW_SIZE * GLOW_SIZE], variance[GLOW_SIZE * GLOW_SIZE];
} glow_picture;

// The spot's middle at (x, y) mm; every pixel averages 5 x 5 points of its square.
static inline void glow_paint(glow_picture *out, const glow *light, double pitch_mm, double x_mm, double y_mm)
{
    enum { ACROSS = 5 };
    alb_error error = {0};
    alb_face_free(&out->face);
    check_ok(alb_face_flat(&out->face, GLOW_SIZE, GLOW_SIZE, pitch_mm, &error), &error);
#pragma omp parallel for schedule(static)
    for (int i = 0; i < GLOW_SIZE * GLOW_SIZE; i++) {
        double sum = 0;
        for (int k = 0; k < ACROSS * ACROSS; k++)
            sum +=
                glow_at(light->lit, hypot(out->face.x_mm[i] - x_mm + pitch_mm * ((k % ACROSS + 0.5) / ACROSS - 0.5),
                                          out->face.y_mm[i] - y_mm + pitch_mm * ((k / ACROSS + 0.5) / ACROSS - 0.5)));
        out->clean[i] = sum / (ACROSS * ACROSS);
    }
}

// sd^2 = (relative value)^2 / 2 + relative^2 value top / 200: shot noise of a camera with a range of exposures.
static inline void glow_expose(glow_picture *out, double relative, unsigned stream)
{
    double top = 0;
    for (int i = 0; i < GLOW_SIZE * GLOW_SIZE; i++)
        top = fmax(top, out->clean[i]);
    for (int i = 0; i < GLOW_SIZE * GLOW_SIZE; i++) {
        alb_random random = alb_random_at(21, stream, (unsigned)i);
        const double v = out->clean[i];
        out->variance[i] = relative * relative * (v * v / 2 + v * top / 200 + top * top * 1e-10);
        out->value[i] = v + sqrt(out->variance[i]) * alb_random_normal(&random);
    }
}

static inline alb_channel glow_channel(const glow_picture *picture)
{
    return (alb_channel){&picture->face, picture->value, picture->variance, "glow"};
}
