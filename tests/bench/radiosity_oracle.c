// The oracle of bench.radiosity: 65,536 rays from each of some hundred patches.
#include "base/memory.h"
#include "base/random.h"
#include "radiosity_bench.h"
#include <stdlib.h>
#include <string.h>

// pi times the radiance of an even sky.
static void sky_of(double sky[3], const alb_scene *scene)
{
    memset(sky, 0, sizeof(rgb));
    for (size_t i = 0; i < scene->light_count; i++)
        for (int c = 0; scene->lights[i].kind == ALB_LIGHT_ENVIRONMENT && c < 3; c++)
            sky[c] += M_PI * scene->lights[i].radiance[c];
}

static void gather(double out[3], const uint32_t *hits, size_t count, const rgb *radiosity, const double sky[3],
                   size_t patches)
{
    memset(out, 0, sizeof(rgb));
    for (size_t k = 0; k < count; k++) {
        const double *from = hits[k] < patches ? radiosity[hits[k]] : sky;
        for (int c = 0; hits[k] <= patches && c < 3; c++)
            out[c] += from[c] / (double)count;
    }
}

// What some patches, drawn at random, receive.
bool make_oracle(bench *b, const alb_scene *scene, const alb_solution *s, const rgb *radiosity, alb_error *error)
{
    const alb_ray_pattern pattern = {b->oracle_rays, 99, ALB_SAMPLING_LATTICE, NULL};
    double sky[3];
    bool ok = true;
    sky_of(sky, scene);
#pragma omp parallel for schedule(dynamic, 1) reduction(&& : ok)
    for (size_t k = 0; k < b->oracle_rows; k++) {
        alb_random random = alb_random_at(98, 0, k);
        uint32_t *hits = malloc((size_t)pattern.rays * sizeof *hits);
        const size_t patch = b->rows[k] = (size_t)(alb_random_uniform(&random) * (double)s->patches.count);
        ok = ok && hits != NULL;
        if (hits) {
            alb_rays_cast(hits, &pattern, &s->patches, &s->tracer, patch);
            gather(b->truth[k], hits, (size_t)pattern.rays, radiosity, sky, s->patches.count);
        }
        for (int c = 0; c < 3; c++)
            b->direct[k][c] = s->irradiance[patch][c] - alb_form_factors_sky_share(&s->factors, patch) * sky[c];
        free(hits);
    }
    return ok || alb_fail(error, ALB_NO_MEMORY, "out of memory for the oracle's rays");
}

// F B and the sky by the form factors, of all patches.
void gather_all(rgb *out, const alb_scene *scene, const alb_solution *s, const alb_form_factors *factors,
                const rgb *radiosity)
{
    double sky[3];
    sky_of(sky, scene);
    alb_form_factors_apply(out, factors, radiosity);
    for (size_t p = 0; p < s->patches.count; p++)
        for (int c = 0; c < 3; c++)
            out[p][c] += alb_form_factors_sky_share(factors, p) * sky[c];
}

// rms of what was found on the oracle's rows against it, relative to all that falls there or to what comes by rays.
// found[row] or, by patch, found[rows[row]].
double error_of(const bench *b, const rgb *found, bool by_patch, bool whole)
{
    double difference = 0, all = 0;
    for (size_t k = 0; k < b->oracle_rows; k++)
        for (int c = 0; c < 3; c++) {
            difference += pow(found[by_patch ? b->rows[k] : k][c] - b->truth[k][c], 2);
            all += pow(b->truth[k][c] + (whole ? b->direct[k][c] : 0), 2);
        }
    return 100 * sqrt(difference / all);
}

// B without what small lamps send directly, which is in E.
rgb *bounced(const alb_solution *s, alb_error *error)
{
    rgb *out = alb_allocate(s->patches.count, sizeof *out, error);
    for (size_t p = 0; out && p < s->patches.count; p++)
        for (int c = 0; c < 3; c++)
            out[p][c] = s->radiosity[p][c] - (s->lamps_direct ? s->exitance[p][c] : 0);
    return out;
}
