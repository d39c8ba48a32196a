// F_kj, the share of the flux leaving k that arrives at j, by R cosine-weighted rays from every patch:
//     F_kj = (number of rays of k that hit j) / R
// Ray q of a patch with normal n, tangents t, b and one uniform pair s1, s2 a patch (Cranley-Patterson rotation):
//     u = frac((q + 1/2)/R + s1),  v = frac(0.6180339887498949 q + s2)        Fibonacci (golden-ratio) lattice
//     d = sqrt(1-u) n + sqrt(u) (cos 2 pi v t + sin 2 pi v b)                 cosine-weighted hemisphere
// The origin is a uniform point of the triangle, fresh for each ray. Random numbers are a function of (seed, patch, q).
// A row of F only ever integrates a bounded function over the hemisphere, which is why a few hundred equal weights do
// for any number of patches. The rows hold exactly (they sum to 1 with the sky); reciprocity A_k F_kj = A_j F_jk holds
// only statistically. Never symmetrised or normalised: that raises the error.
// Where it stops being true: sources that cover less than ~1/R of a hemisphere (a small bright lamp) are seen by few
// rays; patches large against the scene would need their origins stratified too.
#include "render/form_factor.h"
#include "base/memory.h"
#include "base/random.h"
#include <stdlib.h>

enum { HITS_MAX = 1 << 29 };

static double fraction(double x) { return x - floor(x); }

static alb_vector direction_of(const alb_form_factors *factors, alb_vector normal, size_t patch, int q)
{
    alb_random random =
        alb_random_at(factors->seed, 2 * patch, factors->sampling == ALB_SAMPLING_RANDOM ? (uint64_t)q : 0);
    const double s1 = alb_random_uniform(&random), s2 = alb_random_uniform(&random);
    double u = s1, v = s2;
    if (factors->sampling == ALB_SAMPLING_LATTICE) {
        u = fraction((q + 0.5) / factors->rays + s1);
        v = fraction(0.6180339887498949 * q + s2);
    }
    alb_vector t, b;
    alb_tangents(&t, &b, normal);
    const double side = sqrt(u), angle = 2 * M_PI * v;
    const alb_vector in_plane = alb_add(alb_times(cos(angle), t), alb_times(sin(angle), b));
    return alb_add(alb_times(sqrt(1 - u), normal), alb_times(side, in_plane));
}

alb_vector alb_form_factors_direction(const alb_form_factors *factors, const alb_patches *patches, size_t patch, int q)
{
    return direction_of(factors, patches->normals[patch], patch, q);
}

static uint32_t cast(const alb_form_factors *factors, const alb_patches *patches, const alb_tracer *tracer,
                     size_t patch, int q)
{
    if (alb_patch_buried(patches, patch))
        return (uint32_t)patches->count + 1;
    alb_random random = alb_random_at(factors->seed, 2 * patch + 1, (uint64_t)q);
    const double u = alb_random_uniform(&random), v = alb_random_uniform(&random);
    const alb_vector origin = alb_patch_point(patches, patch, u, v);
    alb_hit hit;
    if (!alb_tracer_closest(&hit, tracer, origin, direction_of(factors, patches->normals[patch], patch, q)))
        return (uint32_t)patches->count;
    return hit.front ? hit.face : (uint32_t)patches->count + 1;
}

bool alb_form_factors_create(alb_form_factors *factors, const alb_patches *patches, const alb_tracer *tracer, int rays,
                             uint64_t seed, alb_sampling sampling, alb_error *error)
{
    const size_t n = patches->count;
    *factors = (alb_form_factors){.patch_count = n, .rays = rays, .seed = seed, .sampling = sampling};
    if (n > HITS_MAX / (size_t)rays)
        return alb_fail(error, ALB_BAD_DATA,
                        "%zu patches with %d rays each need %.1f GiB, more than the 2 GiB that form factors may take; "
                        "use a coarser mesh or fewer rays_per_patch",
                        n, rays, (double)n * rays * sizeof *factors->hits / 0x1p30);
    if (!(factors->hits = alb_allocate(n * (size_t)rays, sizeof *factors->hits, error)))
        return false;
#pragma omp parallel for schedule(dynamic, 64)
    for (size_t patch = 0; patch < n; patch++)
        for (int q = 0; q < rays; q++)
            factors->hits[patch * (size_t)rays + (size_t)q] = cast(factors, patches, tracer, patch, q);
    for (size_t i = 0; i < n * (size_t)rays; i++) {
        factors->sky_rays += factors->hits[i] == n;
        factors->back_rays += factors->hits[i] == n + 1;
    }
    return true;
}

void alb_form_factors_free(alb_form_factors *factors)
{
    free(factors->hits);
    *factors = (alb_form_factors){0};
}

void alb_form_factors_apply(double (*out)[3], const alb_form_factors *factors, const double (*radiosity)[3])
{
    const size_t n = factors->patch_count, rays = (size_t)factors->rays;
#pragma omp parallel for schedule(static)
    for (size_t patch = 0; patch < n; patch++) {
        double sum[3] = {0};
        for (size_t q = 0; q < rays; q++) {
            const uint32_t hit = factors->hits[patch * rays + q];
            if (hit < n)
                for (int c = 0; c < 3; c++)
                    sum[c] += radiosity[hit][c];
        }
        for (int c = 0; c < 3; c++)
            out[patch][c] = sum[c] / (double)rays;
    }
}
