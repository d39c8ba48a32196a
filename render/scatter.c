// S' in density form (A_i area, c_j centroid of the exit patch, s(r) the profile, 1/mm^2):
//     B_j = sum_i S'_ji E_i,    S'_ji = (1/A_j) integral_Aj integral_Ai s  ~=  integral_Ai s(|c_j - x|) dA(x)
// The paper's form (Sheng et al. 2014, eq. 8) divides by A_i instead and is right only for patches of one area.
// No S'_ji is kept. What stays is geometry, and the profiles in tables:
//     opaque patch        S'_jj = reflectance, nothing else
//     self                the exact integral over the patch, as a rule over distances (scatter_rule.c)
//     near                patches, whole or in equal parts, each at its own distance (scatter_links.c)
//     far                 clusters of patches (scatter_forest.c), to second order in their extent; none is left out,
//                         so that a profile may become wider than that for which the links were made
// Distances are straight lines where these stay inside the body, which is exact, and the length of the shortest path
// inside elsewhere (optical_path.h). Straight however in bodies that are not closed (the caller warns).
// Between the faces of a slab the transmission profile acts at the lateral distance; on one face the reflection
// profile; from and to the edge faces the reflection profile, for want of a measurement there. Where the body is not
// convex and thin everywhere it is a sheet: distances are geodesics along its faces. Where it is not thin, a slab's
// material is that of a solid: the reflection profile, along paths inside. So is a material that is no slab, however
// thin the body: light crosses it by the reflection profile, and the sums of both faces count twice.
// Stops being true where the profile's plane geometry does: within a diffusion length of edges, and for solids thinner
// than that, whose row sums then show it by exceeding the profile's total.
#include "render/scatter.h"
#include "base/memory.h"
#include "render/scatter_links.h"
#include "render/scatter_product.h"
#include "render/scatter_rule.h"
#include "render/scatter_sample.h"
#include "render/scatter_weights.h"
#include <stdlib.h>
#include <string.h>

// Links of one row on a plane: so many that smooth light leaves within half the error wanted or less (render.scatter).
static double links_for(double error_wanted) { return fmin(fmax(0.28 / error_wanted, 20), 3000); }

// How much light comes from beyond where paths are measured: all that is there counts as just there, or where it is if
// that is further. A sheet that is rolled up has much there that lies near.
static const double far_light = 0.01, far_light_in_sheets = 0.01;

struct alb_scatter_parts {
    alb_forest forest;
    alb_links links;
    alb_scatter_kernel *kernels;
    size_t kernel_count;
    alb_body_kernels *of_bodies;
    alb_rule *self;           // of the leaves
    alb_bodies found;         // while links are made
    alb_optical_paths *paths; // likewise: of each body
    const uint16_t *materials;
    uint32_t *opaque; // patches that are in no tree
    size_t opaque_count;
    double (*totals)[3]; // of each kernel's profiles, as they are
    bool rows_known;     // the row sums are no estimate
    alb_weights weights; // empty: products look the profiles up
    bool by_links;       // so they do although there are weights
};

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

// Where only so much of the widest profile's light is further off.
static double reach_of(const alb_profile profiles[3], double left)
{
    double reach = 0;
    for (int c = 0; c < 3; c++) {
        const double total = alb_profile_total(&profiles[c]);
        double r = 1e-6;
        while (total > 0 && 2 * M_PI * alb_profile_disc(&profiles[c], r) < (1 - left) * total && r < 1e6)
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
        alb_optical_options options = {.reach_mm = reach_of(surface->profiles[ALB_REFLECTION], far_light)};
        if (surface->slab) {
            options.reach_mm = fmax(reach_of(surface->profiles[ALB_REFLECTION], far_light_in_sheets),
                                    reach_of(surface->profiles[ALB_TRANSMISSION], far_light_in_sheets));
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

// Whether each surface still is what the links were made for.
static bool check_surfaces(const alb_scatter *scatter, const alb_surface *surfaces, alb_error *error)
{
    const alb_scatter_parts *p = scatter->parts;
    size_t scattering = 0;
    for (size_t i = 0; i < scatter->patch_count; i++)
        scattering += surfaces[p->materials[i]].scatters;
    bool alike = scattering == p->forest.leaf_count;
    for (size_t k = 0; alike && k < p->kernel_count; k++) {
        const alb_surface *surface = &surfaces[p->kernels[k].surface];
        alike = surface->scatters && (surface->slab || p->kernels[k].side == ALB_REFLECTION);
    }
    return alike || alb_fail(error, ALB_BAD_DATA,
                             "a material that was opaque scatters now, or was a solid and is a slab: links cannot be "
                             "rewritten for that; prepare the scene anew");
}

static const uint32_t rules_ahead = 32;

static void write_local(alb_scatter *scatter, const alb_surface *surfaces)
{
    const alb_scatter_parts *p = scatter->parts;
    for (size_t k = 0; k < p->opaque_count; k++)
        memcpy(scatter->local[p->opaque[k]], surfaces[p->materials[p->opaque[k]]].reflectance, sizeof *scatter->local);
    for (size_t t = 0; t < p->forest.tree_count; t++) {
        const alb_tree *tree = &p->forest.trees[t];
        const alb_scatter_kernel *kernel = &p->kernels[p->of_bodies[tree->body].index[ALB_REFLECTION]];
#pragma omp parallel for schedule(static)
        for (uint32_t leaf = tree->first_leaf; leaf < tree->first_leaf + tree->leaf_count; leaf++) {
            if (leaf + rules_ahead < p->forest.leaf_count) // memory is slower than the rule
                __builtin_prefetch(&p->self[leaf + rules_ahead]);
            alb_rule_apply(scatter->local[p->forest.patches[leaf]], &p->self[leaf], kernel);
        }
    }
}

static const unsigned both_sides = 1U << ALB_REFLECTION | 1U << ALB_TRANSMISSION;

void alb_scatter_sum_rows(alb_scatter *scatter)
{
    alb_scatter_parts *p = scatter->parts;
    if (p->rows_known)
        return;
    memcpy(scatter->row_sums, scatter->local, scatter->patch_count * sizeof *scatter->local);
    alb_forest_gather(&p->forest, NULL);
    alb_product_add(scatter->row_sums, NULL, &p->links, &p->forest, p->kernels, both_sides);
    p->rows_known = true;
}

bool alb_scatter_rows_known(const alb_scatter *scatter) { return scatter->parts->rows_known; }

// The transposed product with the areas.
bool alb_scatter_sum_columns(alb_scatter *scatter, alb_error *error)
{
    alb_scatter_parts *p = scatter->parts;
    if (scatter->columns_known)
        return true;
    memcpy(scatter->column_sums, scatter->local, scatter->patch_count * sizeof *scatter->local);
    return scatter->columns_known =
               alb_product_add_columns(scatter->column_sums, &p->links, &p->forest, p->kernels, error);
}

static double total_of(const alb_scatter_kernel *kernel, const alb_surface *surfaces, int channel)
{
    return alb_profile_total(&surfaces[kernel->surface].profiles[kernel->side][channel]);
}

// What a body of the tree's material sends out in all, over what it sent by the totals before; infinite where
// that was nothing.
static double ratio_of(const alb_scatter_parts *p, const alb_tree *tree, const alb_surface *surfaces, int channel)
{
    double now = 0, before = 0;
    for (size_t k = 0; k < p->kernel_count; k++)
        if (p->kernels[k].surface == tree->surface) {
            now += total_of(&p->kernels[k], surfaces, channel);
            before += p->totals[k][channel];
        }
    return before > 0 ? now / before : now > 0 ? HUGE_VAL : 1;
}

// Row sums as the totals of the profiles let expect. False where they do not.
static bool estimate_rows(alb_scatter *scatter, const alb_surface *surfaces)
{
    const alb_scatter_parts *p = scatter->parts;
    for (size_t k = 0; k < p->opaque_count; k++)
        memcpy(scatter->row_sums[p->opaque[k]], scatter->local[p->opaque[k]], sizeof *scatter->local);
    for (const alb_tree *tree = p->forest.trees; tree < p->forest.trees + p->forest.tree_count; tree++) {
        double ratios[3];
        for (int c = 0; c < 3; c++)
            if (!isfinite(ratios[c] = ratio_of(p, tree, surfaces, c)))
                return false;
#pragma omp parallel for schedule(static) if (tree->leaf_count > 4096)
        for (uint32_t leaf = tree->first_leaf; leaf < tree->first_leaf + tree->leaf_count; leaf++)
            for (int c = 0; c < 3; c++)
                scatter->row_sums[p->forest.patches[leaf]][c] *= ratios[c];
    }
    return true;
}

bool alb_scatter_rewrite_tables(alb_scatter *scatter, const alb_surface *surfaces, alb_error *error)
{
    alb_scatter_parts *p = scatter->parts;
    if (!check_surfaces(scatter, surfaces, error))
        return false;
    alb_weights_free(&p->weights);
    for (size_t k = 0; k < p->kernel_count; k++)
        alb_scatter_kernel_write(&p->kernels[k], surfaces[p->kernels[k].surface].profiles[p->kernels[k].side]);
    alb_product_write_pairs(&p->links, p->kernels);
    write_local(scatter, surfaces);
    const bool estimated = p->rows_known && estimate_rows(scatter, surfaces);
    for (size_t k = 0; k < p->kernel_count; k++)
        for (int c = 0; c < 3; c++)
            p->totals[k][c] = total_of(&p->kernels[k], surfaces, c);
    p->rows_known = scatter->columns_known = false;
    if (!estimated)
        alb_scatter_sum_rows(scatter);
    return true;
}

bool alb_scatter_rewrite(alb_scatter *scatter, const alb_surface *surfaces, alb_error *error)
{
    if (!alb_scatter_rewrite_tables(scatter, surfaces, error))
        return false;
    alb_scatter_sum_rows(scatter);
    return true;
}

void alb_scatter_apply(double (*out)[3], const alb_scatter *scatter, const double (*irradiance)[3])
{
    alb_scatter_parts *p = scatter->parts;
    double(*even)[3] = p->rows_known ? NULL : scatter->row_sums;
    if (p->weights.blocks && !p->by_links) {
        for (size_t k = 0; k < p->opaque_count; k++)
            for (int c = 0; c < 3; c++)
                out[p->opaque[k]][c] = scatter->local[p->opaque[k]][c] * irradiance[p->opaque[k]][c];
        alb_weights_apply(out, &p->weights, &p->forest, (const double(*)[3])scatter->local, irradiance);
        return;
    }
#pragma omp parallel for schedule(static)
    for (size_t j = 0; j < scatter->patch_count; j++)
        for (int c = 0; c < 3; c++) {
            out[j][c] = scatter->local[j][c] * irradiance[j][c];
            if (even)
                even[j][c] = scatter->local[j][c];
        }
    alb_forest_gather(&p->forest, irradiance);
    alb_product_add(out, even, &p->links, &p->forest, p->kernels, both_sides);
    p->rows_known = true;
}

void alb_scatter_use_links(const alb_scatter *scatter, bool links) { scatter->parts->by_links = links; }

bool alb_scatter_keep_weights(alb_scatter *scatter, double error_wanted, double *error_percent, alb_error *error)
{
    alb_scatter_parts *p = scatter->parts;
    const double(*sums)[3] = (const double(*)[3])scatter->row_sums, (*local)[3] = (const double(*)[3])scatter->local;
    alb_weights made;
    alb_scatter_sum_rows(scatter);
    if (!alb_weights_create(&made, &p->links, &p->forest, p->kernels, sums, local, error_wanted, error))
        return false;
    if (error_percent && !alb_weights_error(error_percent, &made, &p->links, &p->forest, p->kernels, local,
                                            scatter->patch_count, error)) {
        alb_weights_free(&made);
        return false;
    }
    alb_weights_free(&p->weights);
    p->weights = made;
    return true;
}

void alb_scatter_apply_across(double (*out)[3], const alb_scatter *scatter, const double (*irradiance)[3])
{
    alb_scatter_parts *p = scatter->parts;
    memset(out, 0, scatter->patch_count * sizeof *out);
    alb_forest_gather(&p->forest, irradiance);
    alb_product_add(out, NULL, &p->links, &p->forest, p->kernels, 1U << ALB_TRANSMISSION);
}

bool alb_scatter_sample(uint32_t *sources, const alb_scatter *scatter, const uint32_t *first, int channel,
                        alb_error *error)
{
    const alb_scatter_parts *p = scatter->parts;
    return alb_links_sample(sources, first, channel, &p->links, &p->forest, p->kernels,
                            (const double(*)[3])scatter->row_sums, (const double(*)[3])scatter->local,
                            scatter->patch_count, error);
}

void alb_scatter_note(FILE *out, const char *prefix, const alb_scatter *scatter)
{
    static const char *const ways[ALB_OPTICAL_KINDS] = {"", "solids: paths inside, reflection alone",
                                                        "sheets: paths along the faces, transmission between them"};
    for (int kind = ALB_OPTICAL_SOLID; kind < ALB_OPTICAL_KINDS; kind++) {
        size_t count = 0;
        double thinnest = INFINITY, thickest = 0;
        for (const alb_scatter_body *body = scatter->bodies; body < scatter->bodies + scatter->body_count; body++)
            if ((int)body->paths == kind) {
                count++;
                thinnest = fmin(thinnest, body->thickness_mm), thickest = fmax(thickest, body->thickness_mm);
            }
        if (count && thickest > 0)
            fprintf(out, "%s%zu bodies of a slab's material, %.3g to %.3g mm thick, are %s\n", prefix, count, thinnest,
                    thickest, ways[kind]);
        else if (count)
            fprintf(out, "%s%zu translucent bodies are %s\n", prefix, count, ways[kind]);
    }
}

size_t alb_scatter_bytes(const alb_scatter *scatter)
{
    const alb_scatter_parts *p = scatter->parts;
    size_t bytes = 3 * scatter->patch_count * sizeof *scatter->local + scatter->body_count * sizeof *scatter->bodies;
    if (!p)
        return bytes;
    bytes += alb_weights_bytes(&p->weights, &p->forest) + alb_forest_bytes(&p->forest) +
             p->forest.leaf_count * sizeof *p->self + p->opaque_count * sizeof *p->opaque;
    for (size_t k = 0; k < p->kernel_count; k++)
        bytes += alb_scatter_kernel_bytes(&p->kernels[k]);
    for (size_t b = 0; b < p->links.block_count; b++)
        bytes += sizeof p->links.blocks[b] + p->links.blocks[b].bytes;
    return bytes;
}
