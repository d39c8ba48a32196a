// S' of one material on a mesh, and profiles to make it of.
#pragma once
#include "check.h"
#include "exact_triangle.h"
#include "render/radiosity.h"
#include "render/shape.h"

static const alb_profile one = {ALB_FORM_EXPONENTIAL, {0.02, 0.3}};
static const alb_profile two = {ALB_FORM_TWO_EXPONENTIALS, {0.05, 1.2, 0.01, 0.25}};
static const alb_profile marble = {ALB_FORM_DIPOLE, {0.0041, 2.62, 1.5}};

typedef struct world {
    alb_mesh mesh;
    alb_patches patches;
    alb_scatter scatter;
    double (*sums)[3];
} world;

// S' of the mesh, of one material, and its row sums.
static inline void world_of_mesh(world *w, const alb_surface *surface)
{
    alb_error error = {0};
    check_ok(alb_patches_create(&w->patches, &w->mesh, &error), &error);
    check_ok(alb_scatter_create(&w->scatter, &w->patches, w->mesh.groups, surface, 0.005, &error), &error);
    double(*ones)[3] = calloc(w->patches.count, sizeof *ones);
    w->sums = calloc(w->patches.count, sizeof *w->sums);
    for (size_t p = 0; p < w->patches.count; p++)
        ones[p][0] = ones[p][1] = ones[p][2] = 1;
    alb_scatter_apply(w->sums, &w->scatter, (const double(*)[3])ones);
    free(ones);
}

static inline void world_of_box(world *w, const alb_box *box, const alb_surface *surface)
{
    alb_error error = {0};
    *w = (world){0};
    check_ok(alb_shape_box(&w->mesh, box, &error), &error);
    world_of_mesh(w, surface);
}

static inline void world_of_sphere(world *w, double radius_mm, int subdivisions, const alb_surface *surface)
{
    alb_error error = {0};
    const alb_sphere sphere = {.radius_mm = radius_mm, .subdivisions = subdivisions};
    *w = (world){0};
    check_ok(alb_shape_sphere(&w->mesh, &sphere, &error), &error);
    world_of_mesh(w, surface);
}

static inline void world_free(world *w)
{
    free(w->sums);
    alb_scatter_free(&w->scatter);
    alb_patches_free(&w->patches);
    alb_mesh_free(&w->mesh);
}
