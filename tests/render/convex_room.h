// Rooms with nothing in them, where every irradiance is known without a ray: all fronts see each other whole, so
//     I_p = sum_j B_j F_pj,    F_pj = mean over points x of p of Lambert's factor from x to the triangle j
#pragma once
#include "base/random.h"
#include "check.h"
#include "render/form_factor.h"
#include "render/form_factor_exact.h"
#include "render/shape.h"

typedef struct world {
    alb_mesh mesh;
    alb_patches patches;
    alb_tracer tracer;
} world;

static inline void world_of(world *w) // of the mesh that is there
{
    alb_error error = {0};
    check_ok(alb_patches_create(&w->patches, &w->mesh, &error), &error);
    check_ok(alb_tracer_create(&w->tracer, &w->mesh, &error), &error);
}

static inline void world_of_box(world *w, const alb_box *box)
{
    alb_error error = {0};
    *w = (world){0};
    check_ok(alb_shape_box(&w->mesh, box, &error), &error);
    world_of(w);
}

static inline void world_free(world *w)
{
    alb_tracer_free(&w->tracer);
    alb_patches_free(&w->patches);
    alb_mesh_free(&w->mesh);
}

static inline void cast(alb_form_factors *f, const world *w, int rays, uint64_t seed)
{
    alb_error error = {0};
    check_ok(alb_form_factors_create(f, &w->patches, &w->tracer, rays, seed, ALB_SAMPLING_LATTICE, &error), &error);
}

// Channel 0 smooth, 1 the same turned, 2 two spots of 3.5 % of the area, at places that the number draws.
static inline void random_radiosity(double (*radiosity)[3], const world *w, double size, uint64_t number)
{
    double at[8];
    for (uint64_t k = 0; k < 8; k++) {
        alb_random random = alb_random_at(41, number, k);
        at[k] = alb_random_uniform(&random);
    }
    for (size_t p = 0; p < w->patches.count; p++) {
        const alb_vector c = alb_times(4 / size, w->patches.centroids[p]), n = w->patches.normals[p];
        const double phase = 2 * M_PI * at[0];
        radiosity[p][0] = 0.5 + 0.5 * sin((1 + 2 * at[1]) * c.x + phase) * cos((1 + at[2]) * c.y + c.z);
        radiosity[p][1] = 0.5 + 0.5 * sin((1 + 2 * at[3]) * c.z + phase) * cos((1 + at[4]) * c.x + c.y);
        const bool disc = n.z > 0.9 && hypot(c.x - 4 * (at[5] - 0.5), c.y - 4 * (at[6] - 0.5)) < 0.85;
        const bool corner = n.z < -0.9 && c.x < -1 && c.y < -1;
        radiosity[p][2] = disc || corner;
    }
}

// truth[p] for every `stride`-th patch, to ~1e-4: Lambert's factor is smooth over a patch but for those it abuts.
static inline void room_irradiance(double (*truth)[3], const world *w, const double (*radiosity)[3], size_t stride)
{
    enum { SIDE = 4 };
    const size_t n = w->patches.count;
#pragma omp parallel for schedule(dynamic)
    for (size_t p = 0; p < n; p += stride) {
        memset(truth[p], 0, sizeof truth[p]);
        for (int k = 0; k < SIDE * SIDE; k++) {
            const double u = (k % SIDE + 0.5) / SIDE, v = (k / SIDE + 0.5) / SIDE;
            alb_vector triangle[3], x = {0};
            const double root = sqrt(u), weights[3] = {1 - root, root * (1 - v), root * v};
            alb_patch_triangle(triangle, &w->patches, p);
            for (int i = 0; i < 3; i++)
                x = alb_add(x, alb_times(weights[i], triangle[i]));
            for (size_t j = 0; j < n; j++) {
                if (radiosity[j][0] + radiosity[j][1] + radiosity[j][2] == 0)
                    continue;
                alb_patch_triangle(triangle, &w->patches, j);
                const double factor = alb_form_factor_point(x, w->patches.normals[p], triangle, 3) / (SIDE * SIDE);
                for (int c = 0; c < 3; c++)
                    truth[p][c] += factor * radiosity[j][c];
            }
        }
    }
}

// rms over every `stride`-th patch of found - truth, in percent of the truth's rms; one channel.
static inline double rms_percent(const double (*found)[3], const double (*truth)[3], size_t n, size_t stride, int c)
{
    double difference = 0, whole = 0;
    for (size_t p = 0; p < n; p += stride) {
        difference += (found[p][c] - truth[p][c]) * (found[p][c] - truth[p][c]);
        whole += truth[p][c] * truth[p][c];
    }
    return 100 * sqrt(difference / whole);
}
