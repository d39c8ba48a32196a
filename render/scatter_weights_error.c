// The error of stored weights, against the links that they were made of: light of one around a random patch and nothing
// beyond a distance from it, the sharpest edge that light can have, and one that cuts through clusters; the distance is
// that across a cluster around the patch, its size spread evenly over its octaves from 32 patches up. Over the patches
// of all bodies,
//     sqrt(sum A (B - B')^2 / sum A B'^2),  worst channel, worst light
#include "base/memory.h"
#include "base/random.h"
#include "render/scatter_product.h"
#include "render/scatter_weights.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LIGHTS = 12, LEAVES_MIN = 32 };

static float distance_mm(const alb_forest *forest, uint32_t a, uint32_t b)
{
    float squares = 0;
    for (int k = 0; k < 3; k++) {
        const float to = forest->centres_mm[a][k] - forest->centres_mm[b][k];
        squares += to * to;
    }
    return sqrtf(squares);
}

// Lights the patches, and writes what they send of it themselves.
static void light_around(double (*light)[3], double (*sent)[3], const alb_forest *forest, const double (*local)[3],
                         int index)
{
    alb_random random = alb_random_at(0, 0, (uint64_t)index);
    const uint32_t middle = (uint32_t)(alb_random_uniform(&random) * (double)forest->leaf_count);
    const alb_tree *tree = forest->trees;
    while (middle >= tree->first_leaf + tree->leaf_count)
        tree++;
    const double most = fmax(tree->leaf_count / (double)LEAVES_MIN, 1),
                 wanted = LEAVES_MIN * pow(most, alb_random_uniform(&random));
    uint32_t first = tree->first_leaf, count = tree->leaf_count;
    while (count > wanted) {
        const uint32_t left = alb_left_count(count);
        const bool right = middle >= first + left;
        first += right ? left : 0;
        count = right ? count - left : left;
    }
    const float reach_mm = fmaxf(distance_mm(forest, middle, first), distance_mm(forest, middle, first + count - 1));
    for (uint32_t leaf = tree->first_leaf; leaf < tree->first_leaf + tree->leaf_count; leaf++)
        for (int c = 0; c < 3 && distance_mm(forest, middle, leaf) <= reach_mm; c++) {
            const uint32_t patch = forest->patches[leaf];
            light[patch][c] = 1;
            sent[patch][c] = local[patch][c];
        }
}

static double difference(const alb_forest *forest, const double (*found)[3], const double (*wanted)[3])
{
    double worst = 0;
    for (int c = 0; c < 3; c++) {
        double off = 0, whole = 0;
        for (size_t leaf = 0; leaf < forest->leaf_count; leaf++) {
            const uint32_t patch = forest->patches[leaf];
            const double area = (double)forest->areas_mm2[leaf], to = wanted[patch][c], apart = found[patch][c] - to;
            off += area * apart * apart;
            whole += area * to * to;
        }
        worst = fmax(worst, whole > 0 ? sqrt(off / whole) : 0);
    }
    return worst;
}

bool alb_weights_error(double *percent, const alb_weights *weights, const alb_links *links, alb_forest *forest,
                       const alb_scatter_kernel *kernels, const double (*local)[3], size_t patch_count,
                       alb_error *error)
{
    double(*light)[3] = alb_allocate(patch_count, sizeof *light, error);
    double(*found)[3] = light ? alb_allocate(patch_count, sizeof *found, error) : NULL;
    double(*wanted)[3] = found ? alb_allocate(patch_count, sizeof *wanted, error) : NULL;
    *percent = 0;
    for (int k = 0; wanted && forest->leaf_count && k < LIGHTS; k++) {
        memset(light, 0, patch_count * sizeof *light);
        memset(found, 0, patch_count * sizeof *found);
        light_around(light, found, forest, local, k);
        memcpy(wanted, found, patch_count * sizeof *found);
        alb_weights_apply(found, weights, forest, local, (const double(*)[3])light);
        alb_forest_gather(forest, (const double(*)[3])light);
        alb_product_add(wanted, NULL, links, forest, kernels, 1U << ALB_REFLECTION | 1U << ALB_TRANSMISSION);
        *percent = fmax(*percent, 100 * difference(forest, (const double(*)[3])found, (const double(*)[3])wanted));
    }
    const bool ok = wanted != NULL;
    free(light);
    free(found);
    free(wanted);
    return ok;
}
