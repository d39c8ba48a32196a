// Direct light of lamps by sampling their area. With M the exitance, x uniform on the patch, y on the lamps with
// density p(y) = m / sum (A m), m the mean of M over the channels:
//     E = integral M cos cos' V / (pi d^2) dA' = mean over samples of  M cos cos' V / (pi d^2 p)
// Samples form a lattice over the lamps in the order of their patches. A small lamp is met by few of the R rays of a
// form-factor row, one of 256 for a solid angle of 1/80: its light then comes in specks.
// Stops being true nearer to a lamp than half the size of its patch, where d is held.
#include "render/lamp.h"
#include "base/memory.h"
#include "base/random.h"
#include <math.h>
#include <stdlib.h>

enum { SAMPLES = 64 };
static const double small_share = 0.02;

typedef struct lamps {
    uint32_t *patches;
    double *cumulative; // of area times mean exitance, up to and with each
    size_t count;
} lamps;

static double mean_of(const double rgb[3]) { return (rgb[0] + rgb[1] + rgb[2]) / 3; }

bool alb_lamps_are_small(const alb_patches *patches, const double (*exitance)[3])
{
    double emitting = 0, all = 0;
    for (size_t p = 0; p < patches->count; p++) {
        all += patches->areas_mm2[p];
        emitting += mean_of(exitance[p]) > 0 ? patches->areas_mm2[p] : 0;
    }
    return emitting > 0 && emitting < small_share * all;
}

static bool collect(lamps *out, const double (*exitance)[3], const alb_patches *patches, alb_error *error)
{
    out->patches = alb_allocate(patches->count, sizeof *out->patches, error);
    out->cumulative = alb_allocate(patches->count, sizeof *out->cumulative, error);
    if (!out->patches || !out->cumulative)
        return false;
    double sum = 0;
    for (size_t p = 0; p < patches->count; p++) {
        if (!(mean_of(exitance[p]) > 0))
            continue;
        sum += patches->areas_mm2[p] * mean_of(exitance[p]);
        out->patches[out->count] = (uint32_t)p;
        out->cumulative[out->count++] = sum;
    }
    return true;
}

// The lamp at which the running total reaches `flux`, and how far into it, 0..1.
static size_t lamp_at(double *into, const lamps *from, double flux)
{
    size_t low = 0, high = from->count - 1;
    while (low < high) {
        const size_t middle = (low + high) / 2;
        if (from->cumulative[middle] > flux)
            high = middle;
        else
            low = middle + 1;
    }
    const double before = low ? from->cumulative[low - 1] : 0;
    *into = (flux - before) / (from->cumulative[low] - before);
    return from->patches[low];
}

static void gather(double irradiance[3], size_t patch, const lamps *from, const double (*exitance)[3],
                   const alb_patches *patches, const alb_tracer *tracer, uint64_t seed, uint64_t stream)
{
    const double all = from->cumulative[from->count - 1];
    double sum[3] = {0};
    alb_random random = alb_random_at(seed, stream, patch);
    const double start = alb_random_uniform(&random), turn = alb_random_uniform(&random);
    for (int k = 0; k < SAMPLES; k++) {
        // the lattice of form_factor.c laid over the lamps: along their flux, and across each patch
        double into, across = 0.6180339887498949 * k + turn;
        const size_t lamp = lamp_at(&into, from, all * (k + start) / SAMPLES);
        const double u = alb_random_uniform(&random), v = alb_random_uniform(&random);
        const alb_vector x = alb_patch_point(patches, patch, u, v);
        const alb_vector y = alb_patch_point(patches, lamp, into, across - floor(across));
        const alb_vector to = alb_sub(y, x);
        const double distance2 = alb_dot(to, to), length = sqrt(distance2);
        const double here = alb_dot(to, patches->normals[patch]) / length;
        const double there = -alb_dot(to, patches->normals[lamp]) / length;
        if (lamp == patch || !(here > 0) || !(there > 0) || alb_tracer_blocked(tracer, x, y))
            continue;
        const double held = fmax(distance2, 0.25 * patches->areas_mm2[lamp]);
        for (int c = 0; c < 3; c++)
            sum[c] += exitance[lamp][c] / mean_of(exitance[lamp]) * here * there / (M_PI * held);
    }
    for (int c = 0; c < 3; c++)
        irradiance[c] += all * sum[c] / SAMPLES;
}

bool alb_lamps_add(double (*irradiance)[3], const double (*exitance)[3], const alb_patches *patches,
                   const alb_tracer *tracer, uint64_t seed, uint64_t stream, alb_error *error)
{
    lamps from = {0};
    const bool ok = collect(&from, exitance, patches, error);
#pragma omp parallel for schedule(dynamic, 64)
    for (size_t p = 0; p < (ok && from.count ? patches->count : 0); p++)
        gather(irradiance[p], p, &from, exitance, patches, tracer, seed, stream);
    free(from.patches);
    free(from.cumulative);
    return ok;
}
