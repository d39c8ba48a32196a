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
#include "render/scatter_product.h"
#include "render/scatter_sample.h"
#include "render/scatter_state.h"
#include <string.h>

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
