// A scattering is made: bodies, the paths inside them, their patches in clusters, a kernel for each material and side,
// links, rules for the patches themselves. All of it is geometry; what follows from the profiles is written by
// scatter_rewrite.c.
#include "base/memory.h"
#include "render/scatter_state.h"
#include <stdlib.h>

// Links of one row on a plane: so many that smooth light leaves within half the error wanted or less (render.scatter).
static double links_for(double error_wanted) { return fmin(fmax(0.28 / error_wanted, 20), 3000); }

// How much light comes from beyond where paths are measured: all that is there counts as just there, or where it is if
// that is further.
static const double far_light = 0.01;

static double radius_of(const alb_patches *patches, uint32_t patch)
{
    double radius = 0;
    alb_vector t[3];
    alb_patch_triangle(t, patches, patch);
    for (int k = 0; k < 3; k++)
        radius = fmax(radius, alb_length(alb_sub(t[k], patches->centroids[patch])));
    return radius;
}

// A kernel for each material and side that scatters, far enough for the bodies of it.
static bool make_kernels(alb_scatter *scatter, const alb_patches *patches, const alb_surface *surfaces,
                         alb_error *error)
{
    alb_scatter_parts *p = scatter->parts;
    const size_t bodies = scatter->body_count;
    bool ok = (p->kernels = alb_allocate(ALB_SIDES * bodies, sizeof *p->kernels, error)) &&
              (p->of_bodies = alb_allocate(bodies, sizeof *p->of_bodies, error));
    double *reaches = alb_allocate(ALB_SIDES * bodies, sizeof *reaches, error),
           *selves = alb_allocate(ALB_SIDES * bodies, sizeof *selves, error);
    ok = ok && reaches && selves;
    for (size_t t = 0; ok && t < p->forest.tree_count; t++) {
        const alb_tree *tree = &p->forest.trees[t];
        for (int side = 0; side < ALB_SIDES; side++) {
            const alb_side as = surfaces[tree->surface].slab ? (alb_side)side : ALB_REFLECTION;
            size_t k = 0;
            while (k < p->kernel_count && (p->kernels[k].surface != tree->surface || p->kernels[k].side != as))
                k++;
            if (k == p->kernel_count)
                p->kernels[p->kernel_count++] = (alb_scatter_kernel){.surface = tree->surface, .side = as};
            p->of_bodies[tree->body].index[side] = (uint16_t)k;
            for (uint32_t leaf = tree->first_leaf; leaf < tree->first_leaf + tree->leaf_count; leaf++) {
                const uint32_t patch = p->forest.patches[leaf];
                const double self = radius_of(patches, patch);
                const double out = alb_length(alb_sub(patches->centroids[patch], tree->middle_mm));
                selves[k] = fmax(selves[k], self);
                reaches[k] =
                    fmax(reaches[k], (scatter->bodies[tree->body].convex ? 2.02 : 8) * (out + self)); // detours
            }
        }
    }
    for (size_t k = 0; ok && k < p->kernel_count; k++) {
        p->kernels[k].largest_spread_mm2 = (float)(selves[k] * selves[k] / 8); // corners no further: at most this
        alb_scatter_kernel_span(&p->kernels[k], reaches[k], 6 * selves[k]);
    }
    free(reaches);
    free(selves);
    return ok;
}

static void free_paths(alb_scatter_parts *p)
{
    for (size_t b = 0; p->paths && b < p->found.count; b++)
        alb_optical_paths_free(&p->paths[b]);
    free(p->paths);
    p->paths = NULL;
    alb_bodies_free(&p->found);
}

// Where only far_light of the widest profile's light is further off.
static double reach_of(const alb_profile profiles[3])
{
    double reach = 0;
    for (int c = 0; c < 3; c++) {
        const double total = alb_profile_total(&profiles[c]);
        double r = 1e-6;
        while (total > 0 && 2 * M_PI * alb_profile_disc(&profiles[c], r) < (1 - far_light) * total && r < 1e6)
            r *= 1.1;
        reach = fmax(reach, r);
    }
    return reach;
}

// The transport mean free path, as far as a profile tells: that of its fastest decay. A slab is a sheet where it is
// thin for that, or not much thicker than what was measured.
static double mean_free_path_of(const alb_surface *surface)
{
    double longest = 0.15 * surface->thickness_mm;
    for (int c = 0; c < 3; c++)
        if (alb_profile_total(&surface->profiles[ALB_REFLECTION][c]) > 0)
            longest = fmax(longest, 1 / alb_profile_fastest(&surface->profiles[ALB_REFLECTION][c]));
    return longest;
}

// Of bodies that are not convex; the others go straight.
static bool make_paths(alb_scatter *scatter, const alb_patches *patches, const alb_surface *surfaces, alb_error *error)
{
    alb_scatter_parts *p = scatter->parts;
    if (!(p->paths = alb_allocate(p->found.count, sizeof *p->paths, error)))
        return false;
    for (size_t b = 0; b < p->found.count; b++) {
        const alb_body *body = &p->found.bodies[b];
        const alb_surface *surface = &surfaces[p->materials[body->patches[0]]];
        alb_optical_options options = {.reach_mm = reach_of(surface->profiles[ALB_REFLECTION])};
        if (surface->slab) {
            options.reach_mm = fmax(options.reach_mm, reach_of(surface->profiles[ALB_TRANSMISSION]));
            options.mean_free_path_mm = mean_free_path_of(surface);
        }
        if (!body->closed || body->convex)
            continue;
        if (!alb_optical_paths_create(&p->paths[b], body, patches, &options, error))
            return false;
        scatter->bodies[b].paths = p->paths[b].kind;
        scatter->bodies[b].thickness_mm = p->paths[b].thickness_mm;
    }
    return true;
}

static bool make_links(alb_scatter *scatter, const alb_patches *patches, const alb_surface *surfaces,
                       double error_wanted, alb_error *error)
{
    alb_scatter_parts *p = scatter->parts;
    alb_scatter_kernel_needs *needs = alb_allocate(p->kernel_count, sizeof *needs, error);
    if (!needs)
        return false;
    for (size_t k = 0; k < p->kernel_count; k++)
        alb_scatter_kernel_needs_find(&needs[k], &p->kernels[k],
                                      surfaces[p->kernels[k].surface].profiles[p->kernels[k].side],
                                      links_for(error_wanted));
    bool ok = alb_links_create(&p->links, &p->forest, patches, p->of_bodies, p->kernels, needs, p->paths, error_wanted,
                               error);
    free_paths(p);
    free(needs);
    for (size_t k = 0; k < p->kernel_count; k++)
        p->kernels[k].first_used = p->kernels[k].octave_count - 1;
    for (size_t b = 0; b < p->links.block_count; b++) {
        const alb_link_block *block = &p->links.blocks[b];
        scatter->link_count += block->link_count;
        for (const alb_link_run *run = block->runs; run < block->runs + block->run_count; run++)
            if (run->octave < p->kernels[run->kernel].first_used)
                p->kernels[run->kernel].first_used = run->octave;
    }
    for (size_t k = 0; ok && k < p->kernel_count; k++)
        ok = alb_scatter_kernel_create(&p->kernels[k], p->kernels[k].first_used, error);
    return ok;
}

static bool make_self_rules(alb_scatter *scatter, const alb_patches *patches, alb_error *error)
{
    alb_scatter_parts *p = scatter->parts;
    if (!(p->totals = alb_allocate(p->kernel_count, sizeof *p->totals, error)) ||
        !(p->self = alb_allocate(p->forest.leaf_count, sizeof *p->self, error)))
        return false;
    for (size_t i = 0; i < p->forest.tree_count; i++) {
        const alb_tree *tree = &p->forest.trees[i];
        const alb_scatter_kernel *kernel = &p->kernels[p->of_bodies[tree->body].index[ALB_REFLECTION]];
#pragma omp parallel for schedule(static)
        for (uint32_t leaf = tree->first_leaf; leaf < tree->first_leaf + tree->leaf_count; leaf++) {
            const uint32_t patch = p->forest.patches[leaf];
            alb_vector t[3];
            alb_patch_triangle(t, patches, patch);
            alb_rule_find(&p->self[leaf], t, patches->centroids[patch], kernel->near_mm);
        }
    }
    return true;
}

static bool find_bodies(alb_scatter *scatter, const alb_patches *patches, const alb_surface *surfaces, alb_error *error)
{
    const size_t n = patches->count;
    const uint16_t *materials = scatter->parts->materials;
    alb_bodies *found = &scatter->parts->found;
    alb_scatter_parts *p = scatter->parts;
    int *labels = alb_allocate(n, sizeof *labels, error);
    p->opaque = labels ? alb_allocate(n, sizeof *p->opaque, error) : NULL;
    for (size_t i = 0; p->opaque && i < n; i++) {
        labels[i] = surfaces[materials[i]].scatters ? materials[i] : -1;
        if (labels[i] < 0)
            p->opaque[p->opaque_count++] = (uint32_t)i;
    }
    bool ok = p->opaque && alb_bodies_find(found, patches, labels, error) &&
              (scatter->bodies = alb_allocate(found->count, sizeof *scatter->bodies, error));
    for (size_t b = 0; ok && b < found->count; b++)
        scatter->bodies[scatter->body_count++] = (alb_scatter_body){.patch_count = found->bodies[b].count,
                                                                    .closed = found->bodies[b].closed,
                                                                    .convex = found->bodies[b].convex};
    ok = ok && make_paths(scatter, patches, surfaces, error) &&
         alb_forest_create(&scatter->parts->forest, found, patches, materials, surfaces, scatter->parts->paths, error);
    free(labels);
    return ok;
}

bool alb_scatter_create(alb_scatter *scatter, const alb_patches *patches, const uint16_t *materials,
                        const alb_surface *surfaces, double error_wanted, alb_error *error)
{
    const size_t n = patches->count;
    *scatter = (alb_scatter){.patch_count = n, .parts = alb_allocate(1, sizeof *scatter->parts, error)};
    if (scatter->parts)
        scatter->parts->materials = materials;
    if (!scatter->parts || !(scatter->local = alb_allocate(n, sizeof *scatter->local, error)) ||
        !(scatter->row_sums = alb_allocate(n, sizeof *scatter->row_sums, error)) ||
        !(scatter->column_sums = alb_allocate(n, sizeof *scatter->column_sums, error)) ||
        !find_bodies(scatter, patches, surfaces, error) || !make_kernels(scatter, patches, surfaces, error) ||
        !make_links(scatter, patches, surfaces, error_wanted, error) || !make_self_rules(scatter, patches, error)) {
        alb_scatter_free(scatter);
        return false;
    }
    free(scatter->parts->forest.clusters);
    scatter->parts->forest.clusters = NULL;
    if (!alb_scatter_rewrite(scatter, surfaces, error) || !alb_scatter_sum_columns(scatter, error)) {
        alb_scatter_free(scatter);
        return false;
    }
    return true;
}

void alb_scatter_free(alb_scatter *scatter)
{
    alb_scatter_parts *p = scatter->parts;
    if (p) {
        for (size_t k = 0; k < p->kernel_count; k++)
            alb_scatter_kernel_free(&p->kernels[k]);
        free(p->kernels);
        free(p->totals);
        free(p->opaque);
        free(p->of_bodies);
        free(p->self);
        free_paths(p);
        alb_links_free(&p->links);
        alb_weights_free(&p->weights);
        alb_forest_free(&p->forest);
        free(p);
    }
    free(scatter->bodies);
    free(scatter->local);
    free(scatter->row_sums);
    free(scatter->column_sums);
    *scatter = (alb_scatter){0};
}
