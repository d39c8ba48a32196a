// Choice of links. Exit patches go in blocks of eight neighbours that share the list of clusters and have each their
// own distances. For a block of radius R_b, a cluster at distance d, of radius R and squared size 12 spread:
//     it is taken where   R <= 0.65 (d - R_b)   and   size^2 <= what the kernel allows at d - R_b - R / 2
// and opened elsewhere. Between the faces of a slab d is lateral and the first condition, which keeps a patch out of
// the clusters that light it, falls away.
//
// A patch is taken whole or as 4, 16 or (long ones) 64 equal triangles: the least that leave (scatter_parts.c), of a
// row's sum, no more than 0.15 of the error wanted; where the smallest leave sixteen times that, exactly
// (scatter_rule.c). Of more than one, three distances stay that have the parts' mean, variance and skewness, or eight
// where these leave too much.
// Distances: scatter_distance.c, scatter_detour.c; links from them: scatter_grant.c.
#include "render/scatter_links.h"
#include "base/memory.h"
#include "base/progress.h"
#include "render/scatter_viewer.h"
#include <omp.h>
#include <stdlib.h>
#include <string.h>

static void want(const alb_viewer *v, alb_wish wished)
{
    alb_link_workspace *work = v->work;
    work->wishes =
        alb_grow(&work->found.failed, work->wishes, &work->wish_capacity, work->wish_count, 1, sizeof *work->wishes);
    if (!work->found.failed)
        work->wishes[work->wish_count++] = wished;
}

// How the patch is taken by a row at this distance of the centroids: ALB_LINK_EXACT where no parts do.
static int kind_of(const alb_viewer *v, const alb_cluster *cluster, int side, uint32_t row, float distance)
{
    const alb_scatter_kernel_needs *needs = v->needs[side];
    float gap = distance - cluster->radius_mm;
    if (gap < cluster->radius_mm) {
        alb_vector t[3];
        alb_viewer_triangle(t, v, cluster, side, row);
        gap = (float)alb_distance_to_triangle(v->patches->centroids[v->forest->patches[v->first_leaf + row]], t);
    }
    const int bin = alb_scatter_kernel_bin(needs, gap);
    const float allowed = 0.15F * (float)v->error_wanted, from = fmaxf(distance, 1e-15F);
    const int most = alb_parts_most(cluster);
    int parts = 1;
    bool thirds = true;
    for (int c = 0; c < 3; c++) {
        thirds &= needs->shares[bin][c] * cluster->area_mm2 *
                      alb_parts_left_by_thirds(cluster, needs->slopes[bin][c], from) <=
                  allowed;
        for (;; parts *= 4) {
            const float left = needs->shares[bin][c] * cluster->area_mm2 *
                               fminf(alb_parts_left(cluster, parts, needs->slopes[bin][c], from), 1);
            if (left > 16 * allowed && parts == most && distance <= 3 * cluster->radius_mm)
                return ALB_LINK_EXACT;
            if (left <= allowed || parts == most)
                break;
        }
    }
    return parts == 1 ? ALB_LINK_PATCH : thirds ? ALB_LINK_THIRDS : ALB_LINK_EIGHTHS;
}

// Each row by itself where the patch is near for any.
static void add_leaf(const alb_viewer *v, uint32_t index, uint32_t leaf, int side)
{
    const alb_cluster *cluster = &v->forest->clusters[index];
    const uint32_t own = leaf - v->first_leaf;
    const unsigned all = (1U << v->row_count) - 1;
    float distances[ALB_BLOCK], along_mm2[ALB_BLOCK];
    alb_source whole;
    unsigned left_out = own < v->row_count ? 1U << own : 0;
    int kind = ALB_LINK_PATCH;
    memcpy(whole.at, cluster->centre_mm, sizeof whole.at);
    memcpy(whole.moments, cluster->moments, sizeof whole.moments);
    alb_viewer_measure(distances, along_mm2, v, &whole, side == ALB_TRANSMISSION);
    for (uint32_t row = 0; row < v->row_count; row++) {
        if (left_out >> row & 1)
            continue;
        const int wanted = kind_of(v, cluster, side, row, distances[row]);
        if (wanted == ALB_LINK_EXACT) {
            want(v, (alb_wish){index, leaf, (uint8_t)side, (uint8_t) ~(1U << row), ALB_LINK_EXACT});
            left_out |= 1U << row;
        } else if (wanted > kind) {
            kind = wanted;
        }
    }
    if (left_out != all)
        want(v, (alb_wish){index, leaf, (uint8_t)side, (uint8_t)left_out, (int8_t)kind});
}

static void visit(const alb_viewer *v, uint32_t index, uint32_t leaf, uint32_t count, int side)
{
    const alb_cluster *cluster = &v->forest->clusters[index];
    if (count == 1) {
        add_leaf(v, index, leaf, side);
        return;
    }
    float to[3];
    for (int k = 0; k < 3; k++)
        to[k] = cluster->centre_mm[k] - v->centre[k];
    if (side == ALB_TRANSMISSION)
        alb_viewer_project(to, v, v->middle_row);
    const float room = sqrtf(to[0] * to[0] + to[1] * to[1] + to[2] * to[2]) - v->radius;
    const int bin = alb_scatter_kernel_bin(v->needs[side], fmaxf(room - 0.5F * cluster->radius_mm, 0));
    if ((side == ALB_TRANSMISSION || cluster->radius_mm <= 0.65F * room) &&
        12 * cluster->spread_mm2 <= v->needs[side]->size2_mm2[bin]) {
        want(v, (alb_wish){index, index - leaf, (uint8_t)side, 0, ALB_LINK_NODE});
        return;
    }
    const uint32_t left = alb_left_count(count);
    visit(v, index + 1, leaf, left, side);
    visit(v, index + 2 * left, leaf + left, count - left, side);
}

// Which profile light takes from one face to another: between the faces of a slab that of transmission.
static int side_between(const alb_tree *from, const alb_tree *to)
{
    return from->face != to->face && from->face != ALB_FACE_EDGE && to->face != ALB_FACE_EDGE ? ALB_TRANSMISSION
                                                                                              : ALB_REFLECTION;
}

static void place_rows(alb_viewer *v)
{
    float middle[3] = {0};
    for (uint32_t row = 0; row < ALB_BLOCK; row++) {
        const uint32_t leaf = v->first_leaf + (row < v->row_count ? row : v->row_count - 1);
        const alb_vector at = alb_sub(v->patches->centroids[v->forest->patches[leaf]], v->tree->middle_mm),
                         own = v->patches->normals[v->forest->patches[leaf]];
        const float places[3] = {(float)at.x, (float)at.y, (float)at.z},
                    normal[3] = {(float)own.x, (float)own.y, (float)own.z};
        for (int k = 0; k < 3; k++) {
            v->at[k][row] = places[k];
            v->axes[k][row] = alb_viewer_in_sheet(v) ? normal[k] : v->tree->axis[k];
            middle[k] += places[k] / ALB_BLOCK;
        }
    }
    v->radius = 0;
    memcpy(v->centre, middle, sizeof middle);
    for (int row = 0; row < ALB_BLOCK; row++)
        v->radius = fmaxf(v->radius, sqrtf((v->at[0][row] - middle[0]) * (v->at[0][row] - middle[0]) +
                                           (v->at[1][row] - middle[1]) * (v->at[1][row] - middle[1]) +
                                           (v->at[2][row] - middle[2]) * (v->at[2][row] - middle[2])));
}

static uint32_t middle_row(const alb_viewer *v)
{
    uint32_t middle = 0;
    float nearest = INFINITY;
    for (uint32_t row = 0; row < v->row_count; row++) {
        const float x = v->at[0][row] - v->centre[0], y = v->at[1][row] - v->centre[1],
                    z = v->at[2][row] - v->centre[2];
        if (x * x + y * y + z * z < nearest)
            nearest = x * x + y * y + z * z, middle = row;
    }
    return middle;
}

static void link_block(alb_link_block *block, alb_viewer *v, const uint16_t kernels[ALB_SIDES])
{
    v->work->wish_count = v->work->found.count = v->work->found.code_count = v->work->found.pair_count = 0;
    place_rows(v);
    v->middle_row = middle_row(v);
    for (size_t t = 0; t < v->forest->tree_count; t++) {
        const alb_tree *tree = &v->forest->trees[t];
        if (tree->body == v->tree->body)
            visit(v, tree->first_cluster, tree->first_leaf, tree->leaf_count, side_between(tree, v->tree));
    }
    alb_viewer_find_detours(v);
    alb_viewer_grant(v);
    if (!v->work->found.failed)
        alb_link_block_write(block, &v->work->found, kernels);
}

// Blocks of leaves, tree after tree.
static bool lay_blocks(alb_links *links, uint32_t **trees, const alb_forest *forest, alb_error *error)
{
    for (size_t t = 0; t < forest->tree_count; t++)
        links->block_count += (forest->trees[t].leaf_count + ALB_BLOCK - 1) / ALB_BLOCK;
    if (!(links->blocks = alb_allocate(links->block_count, sizeof *links->blocks, error)) ||
        !(*trees = alb_allocate(links->block_count, sizeof **trees, error)))
        return false;
    size_t at = 0;
    for (size_t t = 0; t < forest->tree_count; t++) {
        const alb_tree *tree = &forest->trees[t];
        for (uint32_t leaf = 0; leaf < tree->leaf_count; leaf += ALB_BLOCK, at++) {
            const uint32_t left = tree->leaf_count - leaf;
            (*trees)[at] = (uint32_t)t;
            links->blocks[at] = (alb_link_block){.first_leaf = tree->first_leaf + leaf,
                                                 .row_count = left < ALB_BLOCK ? left : ALB_BLOCK};
        }
    }
    return true;
}

static void free_workspace(alb_link_workspace *work)
{
    free(work->wishes);
    free(work->detours);
    free(work->targets);
    free(work->distances);
    free(work->opposite);
    alb_optical_workspace_free(&work->paths);
    alb_found_links_free(&work->found);
}

bool alb_links_create(alb_links *links, const alb_forest *forest, const alb_patches *patches,
                      const alb_body_kernels *of_bodies, const alb_scatter_kernel *kernels,
                      const alb_scatter_kernel_needs *needs, const alb_optical_paths *paths, double error_wanted,
                      alb_error *error)
{
    bool failed = false;
    uint32_t *trees = NULL;
    long done = 0;
    alb_progress progress;
    *links = (alb_links){0};
    if (!lay_blocks(links, &trees, forest, error)) {
        alb_links_free(links);
        return false;
    }
    alb_progress_begin(&progress, "scattering", (long)links->block_count);
#pragma omp parallel reduction(|| : failed)
    {
        alb_link_workspace work = {0};
#pragma omp for schedule(dynamic, 16)
        for (size_t b = 0; b < links->block_count; b++) {
            alb_link_block *block = &links->blocks[b];
            const alb_tree *tree = &forest->trees[trees[b]];
            const uint16_t *own = of_bodies[tree->body].index;
            alb_viewer v = {.forest = forest,
                            .patches = patches,
                            .kernels = {&kernels[own[0]], &kernels[own[1]]},
                            .index = own,
                            .needs = {&needs[own[0]], &needs[own[1]]},
                            .tree = tree,
                            .paths = &paths[tree->body],
                            .error_wanted = error_wanted,
                            .first_leaf = block->first_leaf,
                            .row_count = block->row_count,
                            .work = &work};
            link_block(block, &v, own);
            const long so_far = __atomic_add_fetch(&done, 1, __ATOMIC_RELAXED);
            if (omp_get_thread_num() == 0)
                alb_progress_at(&progress, so_far);
        }
        failed = failed || work.found.failed;
        free_workspace(&work);
    }
    alb_progress_end(&progress);
    free(trees);
    if (failed) {
        alb_links_free(links);
        return alb_fail(error, ALB_NO_MEMORY, "out of memory for the links of scattering");
    }
    return true;
}

void alb_links_free(alb_links *links)
{
    for (size_t b = 0; b < links->block_count; b++)
        free(links->blocks[b].pairs);
    free(links->blocks);
    *links = (alb_links){0};
}
