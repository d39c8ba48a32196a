// What a change of materials rewrites, links and rules as they are:
//     tables of the kernels, weights of the exact pairs, S'_jj of each patch; row sums
// Row sums cost a product. They may wait for one that is wanted anyway; meanwhile those before, times what the totals
// of the profiles grew by, stand for them: of a body of one material,
//     sum_i S'_ji  ~  R + T    (totals of reflection and, through a slab, transmission)
// That is right wherever the new profile differs from the old one by a factor, and an estimate elsewhere.
#include "render/scatter_product.h"
#include "render/scatter_state.h"
#include <string.h>

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

// Row sums as the totals of the profiles let expect, and by how much they change. False where they do not.
static bool estimate_rows(alb_scatter *scatter, const alb_surface *surfaces)
{
    const alb_scatter_parts *p = scatter->parts;
    double change = 0;
    for (size_t k = 0; k < p->opaque_count; k++) {
        double *sums = scatter->row_sums[p->opaque[k]];
        const double *now = scatter->local[p->opaque[k]];
        for (int c = 0; c < 3; c++)
            change = now[c] == sums[c] ? change : fmax(change, fabs(now[c] / sums[c] - 1)); // infinite from zero
        memcpy(sums, now, sizeof *scatter->local);
    }
    for (const alb_tree *tree = p->forest.trees; tree < p->forest.trees + p->forest.tree_count; tree++) {
        double ratios[3];
        for (int c = 0; c < 3; c++)
            if (!isfinite(ratios[c] = ratio_of(p, tree, surfaces, c)))
                return false;
            else
                change = fmax(change, fabs(ratios[c] - 1));
#pragma omp parallel for schedule(static) if (tree->leaf_count > 4096)
        for (uint32_t leaf = tree->first_leaf; leaf < tree->first_leaf + tree->leaf_count; leaf++)
            for (int c = 0; c < 3; c++)
                scatter->row_sums[p->forest.patches[leaf]][c] *= ratios[c];
    }
    scatter->change = change;
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
    scatter->change = INFINITY;
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
