// At a receiver with the transfer P of its cosine through all occluders (shadow_block.h), for each sky with radiance L
//     E = integral P L
// and for each light with a surface what shadow_lamp.h says; negative sums of order 4's ringing become zero. P is
// scaled to the middle of a sky of finite radius, once for three colours.
#include "render/shadow_light.h"
#include "base/memory.h"
#include "base/progress.h"
#include "render/shadow_lamp.h"
#include <omp.h>
#include <stdlib.h>
#include <string.h>

enum { BLOCK = ALB_SHADOW_BLOCK, VALUES = ALB_SHADOW_VALUES };

// The bands of the lobe beyond order 4 fade with what the occluders leave of its mean.
static void add_sky(float (*irradiance)[3], const alb_shadow_block *b, const alb_shadow_world *world,
                    const alb_shadow_sky *sky)
{
    float transfer[ALB_SH_COUNT_MAX * BLOCK];
    alb_shadow_block_transfer(transfer, b, world, NULL, NULL);
    for (size_t r = 0; r < b->count; r++) {
        const float left = fminf(fmaxf(transfer[r] / b->lobe[r], 0), 1);
        for (size_t i = VALUES; i < ALB_SH_COUNT_MAX; i++)
            transfer[i * BLOCK + r] = left * b->lobe[i * BLOCK + r];
    }
    alb_shadow_sky_add(irradiance, sky, &world->laws->sky, transfer, b->points, b->count);
}

static bool check(const alb_shadow_world *world, const alb_vector *points, size_t count, alb_error *error)
{
    if (world->occluder_count > ALB_SHADOW_OCCLUDERS_MAX)
        return alb_fail(error, ALB_BAD_DATA, "%zu objects cast shadows; at most %d can", world->occluder_count,
                        ALB_SHADOW_OCCLUDERS_MAX);
    for (size_t s = 0; s < world->sky_count; s++) {
        const alb_shadow_sky *sky = &world->skies[s];
        for (size_t r = 0; r < (sky->radius_mm > 0 ? count : 0); r++) {
            const double k = alb_length(alb_sub(points[r], sky->centre_mm)) / sky->radius_mm;
            if (!(k < 0.99))
                return alb_fail(error, ALB_BAD_DATA,
                                "vertex %zu (%g, %g, %g) mm lies at %.3g of the radius of the environment; radius_mm "
                                "must be larger",
                                r, points[r].x, points[r].y, points[r].z, k);
        }
    }
    return true;
}

static void add_skies(float (*irradiance)[3], alb_shadow_block *b, const alb_shadow_world *world)
{
    for (int c = 0; c < (b->coloured ? 3 : 1); c++) {
        float sum[BLOCK][3] = {{0}};
        if (c)
            alb_shadow_transport_lobes(b->lobe, b->in_body, world->transport, c, b->first, b->count);
        for (size_t j = 0; j < world->sky_count; j++)
            add_sky(sum, b, world, &world->skies[j]);
        for (size_t r = 0; r < b->count; r++)
            for (int d = c; d < (b->coloured ? c + 1 : 3); d++)
                irradiance[r][d] += sum[r][d];
    }
}

static void light_block(float (*irradiance)[3], alb_shadow_block *b, const alb_shadow_world *world)
{
    memset(irradiance, 0, b->count * sizeof *irradiance);
    const double start_s = alb_clock_s();
    alb_shadow_block_begin(b, world);
    const double found_s = alb_clock_s();
    for (size_t j = 0; j < world->light_count; j++)
        alb_shadow_lamp_add(irradiance, b, world, j);
    add_skies(irradiance, b, world);
    b->seconds.scaling += found_s - start_s;
    b->seconds.products += alb_clock_s() - found_s;
}

bool alb_shadow_irradiance(float (*irradiance)[3], const alb_shadow_world *world, const alb_vector *points,
                           const alb_vector *normals, size_t count, alb_shadow_seconds *seconds, alb_error *error)
{
    const size_t threads = (size_t)omp_get_max_threads(), per_thread = world->occluder_count;
    if (!check(world, points, count, error))
        return false;
    alb_shadow_block *blocks = alb_allocate(threads, sizeof *blocks, error);
    float(*occlusion)[VALUES * BLOCK] = alb_allocate(threads * per_thread, sizeof *occlusion, error);
    const bool ok = blocks && occlusion;
    const size_t block_count = ok ? (count + BLOCK - 1) / BLOCK : 0;
#pragma omp parallel for schedule(dynamic, 1) num_threads((int)threads)
    for (size_t k = 0; k < block_count; k++) {
        const size_t thread = (size_t)omp_get_thread_num(), first = k * BLOCK;
        alb_shadow_block *b = &blocks[thread];
        b->occlusion = occlusion + thread * per_thread;
        b->first = first;
        b->count = count - first < BLOCK ? count - first : BLOCK;
        memcpy(b->points, points + first, b->count * sizeof *points);
        memcpy(b->normals, normals + first, b->count * sizeof *normals);
        light_block(irradiance + first, b, world);
    }
    for (size_t t = 0; seconds && t < (ok ? threads : 0); t++) {
        seconds->scaling += blocks[t].seconds.scaling;
        seconds->products += blocks[t].seconds.products;
    }
    free(blocks);
    free(occlusion);
    return ok;
}

double alb_shadow_small_lights(const alb_shadow_world *world, const alb_vector *points, const alb_vector *normals,
                               size_t count)
{
    const double sine = sin(M_PI / 180 * ALB_SHADOW_SMALL_DEG);
    size_t lit = 0, small = 0;
    for (size_t r = 0; r < count; r++) {
        bool any = false;
        size_t before = lit;
        for (size_t j = 0; j < world->light_count; j++) {
            const alb_shadow_sphere *sphere = &world->lights[j].sphere;
            const alb_vector to = alb_sub(sphere->centre_mm, points[r]);
            if (alb_dot(to, normals[r]) <= 0)
                continue;
            lit = before + 1;
            any |= sphere->radius_mm < sine * alb_length(to);
        }
        small += any;
    }
    return lit ? (double)small / (double)lit : 0;
}
