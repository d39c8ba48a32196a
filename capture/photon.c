// Light transport in a slab by Monte Carlo, after Wang, Jacques & Zheng 1995 (MCML): packets of weight w travel
// -ln(u) / sigma_t between events, lose the share sigma_a / sigma_t of their weight at each, turn by the
// Henyey-Greenstein phase function, and at a face leave or turn back by Fresnel's law for unpolarised light.
//
// Two things are exact instead of sampled. The light that never scatters bounces between the faces as a geometric
// series with the ratio q = r e^-tau, r = ((n-1)/(n+1))^2, tau = sigma_t d; of it leave
//   reflection (1-r)^2 r e^-2tau / (1-q^2),   transmission (1-r)^2 e^-tau / (1-q^2),
// and the rest, (1-r)(1-e^-tau)/(1-q), is where the packets start: their first event is drawn along that folded beam.
// The roulette's gains and losses are booked as absorption, so that energy adds up to rounding and stays unbiased.
//
// Stops being true: for rough faces (internal reflection is of smooth ones), for polarisation, and for beams that do
// not fall perpendicularly.
#include "capture/photon.h"
#include "base/memory.h"
#include "base/random.h"
#include <math.h>
#include <stdlib.h>

static const double roulette_weight = 1e-2, roulette_survival = 0.1;

typedef struct photon_block {
    double ring[2][ALB_PHOTON_BINS], beyond[2], cosine[2][ALB_PHOTON_COSINES], absorbed;
} photon_block;

typedef struct photon_slab {
    double thickness, mean_free_path, albedo, g, n;
    double survive_pass; // e^-tau
    double up_share;     // of first events on an upward pass: q / (1 + q)
    double bin_scale;    // bin = bin_scale * sqrt(r)
} photon_slab;

typedef struct packet {
    double x, y, z, ux, uy, uz, weight;
} packet;

// Fresnel reflectance from the inside, unpolarised; c = |cosine| inside. 1 where it is total.
static double fresnel_inside(double n, double c)
{
    const double s2 = n * n * (1 - c * c);
    if (s2 >= 1)
        return 1;
    const double t = sqrt(1 - s2), s = (n * c - t) / (n * c + t), p = (c - n * t) / (c + n * t);
    return 0.5 * (s * s + p * p);
}

// A point uniform in the unit disc; returns its squared radius, in (0, 1).
static inline double disc(double *a, double *b, alb_random *random)
{
    double s;
    do {
        *a = 2 * alb_random_uniform(random) - 1;
        *b = 2 * alb_random_uniform(random) - 1;
        s = *a * *a + *b * *b;
    } while (s >= 1 || s == 0);
    return s;
}

// Turns the packet by an angle drawn from the Henyey-Greenstein phase function.
static inline void scatter(packet *p, double g, alb_random *random)
{
    double a, b;
    const double s = disc(&a, &b, random);
    if (g == 0) { // isotropic: Marsaglia 1972
        const double f = 2 * sqrt(1 - s);
        p->ux = a * f, p->uy = b * f, p->uz = 1 - 2 * s;
        return;
    }
    const double k = (1 - g * g) / (1 - g + 2 * g * alb_random_uniform(random));
    const double cosine = (1 + g * g - k * k) / (2 * g), sine = sqrt(fmax(0, 1 - cosine * cosine));
    const double norm = 1 / sqrt(s), cos_phi = a * norm, sin_phi = b * norm;
    const double across = sqrt(fmax(0, 1 - p->uz * p->uz)), ux = p->ux, uy = p->uy, uz = p->uz;
    if (across < 1e-6) {
        p->ux = sine * cos_phi, p->uy = sine * sin_phi, p->uz = copysign(cosine, uz * cosine);
        return;
    }
    p->ux = sine * (ux * uz * cos_phi - uy * sin_phi) / across + ux * cosine;
    p->uy = sine * (uy * uz * cos_phi + ux * sin_phi) / across + uy * cosine;
    p->uz = -sine * cos_phi * across + uz * cosine;
}

// All of a step between faces that reflect totally: z on the path unfolded, folded back. A loop over the bounces would
// not end where the mean free path is long.
static inline void travel_trapped(packet *p, double step, double thickness)
{
    const double period = 2 * thickness, unfolded = fmod(p->z + p->uz * step, period);
    const double z = unfolded < 0 ? unfolded + period : unfolded;
    p->x += step * p->ux, p->y += step * p->uy;
    p->z = fmin(z, period - z);
    p->uz = z <= thickness ? p->uz : -p->uz;
}

// Moves to the next event; true when the packet left through a face (0 lit, 1 far).
static inline bool travel(packet *p, int *face, const photon_slab *slab, alb_random *random)
{
    double step = -log(1 - alb_random_uniform(random)) * slab->mean_free_path;
    const double reflectance = fresnel_inside(slab->n, fabs(p->uz));
    if (reflectance >= 1) {
        travel_trapped(p, step, slab->thickness);
        return false;
    }
    for (;;) {
        const double to_face = p->uz > 0 ? (slab->thickness - p->z) / p->uz : -p->z / p->uz;
        const double go = fmin(step, to_face);
        p->x += go * p->ux, p->y += go * p->uy, p->z += go * p->uz;
        if (step <= to_face)
            return false;
        step -= to_face;
        *face = p->uz > 0;
        if (alb_random_uniform(random) >= reflectance)
            return true;
        p->z = *face ? slab->thickness : 0;
        p->uz = -p->uz;
    }
}

static void trace(photon_block *block, const photon_slab *slab, alb_random random)
{
    const double s = -log(1 - alb_random_uniform(&random) * (1 - slab->survive_pass)) * slab->mean_free_path;
    const bool up = alb_random_uniform(&random) < slab->up_share;
    packet p = {.z = up ? slab->thickness - s : s, .uz = up ? -1 : 1, .weight = 1};
    for (;;) {
        const double kept = p.weight * slab->albedo;
        block->absorbed += p.weight - kept;
        p.weight = kept;
        if (p.weight < roulette_weight) {
            const bool lives = p.weight > 0 && alb_random_uniform(&random) < roulette_survival;
            const double after = lives ? p.weight / roulette_survival : 0;
            block->absorbed += p.weight - after;
            p.weight = after;
            if (!lives)
                return;
        }
        scatter(&p, slab->g, &random);
        int face;
        if (travel(&p, &face, slab, &random)) {
            const double bin = slab->bin_scale * sqrt(sqrt(p.x * p.x + p.y * p.y));
            *(bin < ALB_PHOTON_BINS ? &block->ring[face][(int)bin] : &block->beyond[face]) += p.weight;
            const double outside = sqrt(fmax(0, 1 - slab->n * slab->n * (1 - p.uz * p.uz)));
            block->cosine[face][(int)fmin(outside * ALB_PHOTON_COSINES, ALB_PHOTON_COSINES - 1)] += p.weight;
            return;
        }
    }
}

// Mean of a quantity over the blocks, in order, and the standard deviation of that mean.
static void over_blocks(double *mean, double *sd, const photon_block *blocks, const double *quantity, double factor)
{
    const size_t offset = (size_t)((const char *)quantity - (const char *)blocks);
    double sum = 0, squares = 0;
    for (int i = 0; i < ALB_PHOTON_BLOCKS; i++)
        sum += *(const double *)((const char *)&blocks[i] + offset);
    const double middle = sum / ALB_PHOTON_BLOCKS;
    for (int i = 0; i < ALB_PHOTON_BLOCKS; i++) {
        const double d = *(const double *)((const char *)&blocks[i] + offset) - middle;
        squares += d * d;
    }
    *mean = factor * middle;
    *sd = factor * sqrt(squares / (ALB_PHOTON_BLOCKS - 1.0) / ALB_PHOTON_BLOCKS);
}

// `factor` turns the weight of a block into a share of the incident flux.
static void summarise(alb_photon_tally *tally, photon_block *blocks, double factor)
{
    double sd;
    over_blocks(&tally->absorbed, &sd, blocks, &blocks->absorbed, factor);
    for (int face = 0; face < 2; face++) {
        for (int i = 0; i < ALB_PHOTON_BINS; i++)
            over_blocks(&tally->ring[face][i], &tally->ring_sd[face][i], blocks, &blocks->ring[face][i], factor);
        for (int i = 0; i < ALB_PHOTON_COSINES; i++)
            over_blocks(&tally->cosine[face][i], &sd, blocks, &blocks->cosine[face][i], factor);
        for (int b = 0; b < ALB_PHOTON_BLOCKS; b++) // the beyond becomes the total
            for (int i = 0; i < ALB_PHOTON_BINS; i++)
                blocks[b].beyond[face] += blocks[b].ring[face][i];
        over_blocks(&tally->leaving[face], &tally->leaving_sd[face], blocks, &blocks->beyond[face], factor);
        tally->leaving[face] += tally->unscattered[face];
    }
}

bool alb_photon_trace(alb_photon_tally *tally, const alb_medium *medium, double radius_mm, long photons, uint64_t seed,
                      uint64_t stream, alb_error *error)
{
    const double sigma_t = medium->absorption_per_mm + medium->scattering_per_mm, n = medium->refractive_index;
    const double r = (n - 1) * (n - 1) / ((n + 1) * (n + 1)), e = exp(-sigma_t * medium->thickness_mm), q = r * e;
    const double started = (1 - r) * (1 - e) / (1 - q);
    *tally = (alb_photon_tally){.specular = r};
    for (int i = 0; i <= ALB_PHOTON_BINS; i++)
        tally->edges_mm[i] = radius_mm * i * i / ((double)ALB_PHOTON_BINS * ALB_PHOTON_BINS);
    for (int face = 0; face < 2; face++) {
        tally->unscattered[face] = (1 - r) * (1 - r) * (face ? e : r * e * e) / (1 - q * q);
        tally->leaving[face] = tally->unscattered[face];
    }
    if (!(started > 0))
        return true;
    photon_block *blocks = alb_allocate(ALB_PHOTON_BLOCKS, sizeof *blocks, error);
    if (!blocks)
        return false;
    const photon_slab slab = {.thickness = medium->thickness_mm,
                              .mean_free_path = 1 / sigma_t,
                              .albedo = medium->scattering_per_mm / sigma_t,
                              .g = medium->anisotropy,
                              .n = n,
                              .survive_pass = e,
                              .up_share = q / (1 + q),
                              .bin_scale = ALB_PHOTON_BINS / sqrt(radius_mm)};
    const long each = (photons + ALB_PHOTON_BLOCKS - 1) / ALB_PHOTON_BLOCKS;
#pragma omp parallel for schedule(dynamic)
    for (int b = 0; b < ALB_PHOTON_BLOCKS; b++)
        for (long i = 0; i < each; i++)
            trace(&blocks[b], &slab, alb_random_at(seed, stream, (uint64_t)(b * each + i)));
    summarise(tally, blocks, started / (double)each);
    free(blocks);
    return true;
}
