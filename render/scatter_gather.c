// The light of clusters, from the leaves up: with P_i = A_i E_i the light of patch i and c_i its centre,
//     light = sum P_i,   moments = sum P_i (c_i - centre)    (moved to the parent's centre: m + light (c - c_parent))
// A patch counts as all of it at its centroid. Sums go by halves: rounding grows as the logarithm of the number of
// leaves.
#include "render/scatter_forest.h"

// Adds what a child sends to its parent: a leaf, all from its centre, or a node.
static void add_child(alb_scatter_node *sum, const float *light, const float centre[3], const alb_scatter_node *node)
{
    for (int c = 0; c < 3; c++)
        sum->light[c] += light[c];
    for (int k = 0; k < 3; k++) {
        const float off = (node ? node->moments[k][3] : centre[k]) - sum->moments[k][3];
        for (int c = 0; c < 3; c++)
            sum->moments[k][c] += off * light[c] + (node ? node->moments[k][c] : 0);
    }
}

enum { TASK_LEAVES = 8192 };

static void gather(alb_forest *forest, const double (*irradiance)[3], uint32_t node, uint32_t first_leaf,
                   uint32_t count)
{
    if (count == 1) {
        const double area = (double)forest->areas_mm2[first_leaf];
        const double *light = irradiance ? irradiance[forest->patches[first_leaf]] : (const double[3]){1, 1, 1};
        for (int c = 0; c < 3; c++)
            forest->lights[first_leaf][c] = (float)(area * light[c]);
        return;
    }
    const uint32_t left = alb_left_count(count), counts[2] = {left, count - left};
    const uint32_t nodes[2] = {node + 1, node + left}, leaves[2] = {first_leaf, first_leaf + left};
    if (count > TASK_LEAVES) { // even a task that is not put off costs as much as a node
#pragma omp task
        gather(forest, irradiance, nodes[0], leaves[0], counts[0]);
        gather(forest, irradiance, nodes[1], leaves[1], counts[1]);
#pragma omp taskwait
    } else {
        gather(forest, irradiance, nodes[0], leaves[0], counts[0]);
        gather(forest, irradiance, nodes[1], leaves[1], counts[1]);
    }
    alb_scatter_node *sum = &forest->nodes[node];
    for (int c = 0; c < 3; c++)
        sum->light[c] = sum->moments[0][c] = sum->moments[1][c] = sum->moments[2][c] = 0;
    for (int child = 0; child < 2; child++) {
        const uint32_t leaf = leaves[child];
        const alb_scatter_node *from = counts[child] > 1 ? &forest->nodes[nodes[child]] : NULL;
        add_child(sum, from ? from->light : forest->lights[leaf], forest->centres_mm[leaf], from);
    }
}

void alb_forest_gather(alb_forest *forest, const double (*irradiance)[3])
{
#pragma omp parallel
#pragma omp single
    for (size_t t = 0; t < forest->tree_count; t++) {
        const alb_tree *tree = &forest->trees[t];
#pragma omp task if (tree->leaf_count > 256)
        gather(forest, irradiance, tree->first_cluster - tree->first_leaf, tree->first_leaf, tree->leaf_count);
    }
}
