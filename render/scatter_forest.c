// Sources in clusters. Each face of a body is halved again and again: at the median along the longest side of the box
// of its centroids, left parts of whole blocks of leaves, so that blocks of exit patches are subtrees too.
//
// Moments: a triangle with corners v_k about its centroid has covariance sum (v_k - c)(v_k - c)^T / 12; clusters merge
// by the parallel-axis rule, weighted by area. They make the second order of what a cluster sends: for a profile s seen
// from distance r, along the line of sight and across it,
//     mean s = s(r) + v_along s'' / 2 + v_across s' / (2 r)
// Light that is uneven over the cluster adds s' times its first moment along the line of sight (scatter_gather.c).
// Slab: the two faces are the patches whose normal lies within 10 degrees of the direction that carries most area; of a
// bent one, a sheet, its paths tell (optical_path.h).
#include "render/scatter_forest.h"
#include "base/memory.h"
#include <stdlib.h>
#include <string.h>

// The direction that carries most area: power iteration on sum A n n^T.
static alb_vector main_normal(const alb_body *body, const alb_patches *patches)
{
    double m[3][3] = {{0}};
    alb_vector axis = {0.48, 0.6, 0.64};
    for (size_t i = 0; i < body->count; i++) {
        const alb_vector n = patches->normals[body->patches[i]];
        const double v[3] = {n.x, n.y, n.z}, area = patches->areas_mm2[body->patches[i]];
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++)
                m[r][c] += area * v[r] * v[c];
    }
    for (int step = 0; step < 200; step++)
        axis = alb_unit((alb_vector){m[0][0] * axis.x + m[0][1] * axis.y + m[0][2] * axis.z,
                                     m[1][0] * axis.x + m[1][1] * axis.y + m[1][2] * axis.z,
                                     m[2][0] * axis.x + m[2][1] * axis.y + m[2][2] * axis.z});
    return axis;
}

static double along(alb_vector v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

typedef struct builder {
    alb_forest *forest;
    const alb_patches *patches;
    alb_vector middle;
} builder;

// Whether patch a stands before patch b along the axis; no two stand alike.
static bool before(const builder *b, int axis, uint32_t p, uint32_t q)
{
    const double at_p = along(b->patches->centroids[p], axis), at_q = along(b->patches->centroids[q], axis);
    return at_p != at_q ? at_p < at_q : p < q;
}

// Puts the `left` first along the axis to the front (Hoare 1961, FIND).
static void part(const builder *b, int axis, uint32_t *patches, size_t count, size_t left)
{
    for (size_t low = 0, high = count - 1; low < high;) {
        const uint32_t pivot = patches[low + (high - low) / 2];
        size_t i = low, j = high;
        while (i <= j) {
            while (before(b, axis, patches[i], pivot))
                i++;
            while (before(b, axis, pivot, patches[j]))
                j--;
            if (i <= j) {
                const uint32_t held = patches[i];
                patches[i++] = patches[j], patches[j] = held;
                if (!j--)
                    break;
            }
        }
        if (left <= j + 1 && j + 1 <= count) // the border lies in low .. j
            high = j;
        else if (left >= i)
            low = i;
        else
            return;
    }
}

static int longest_axis(const builder *b, const uint32_t *patches, size_t count)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            const double at = along(b->patches->centroids[patches[i]], k);
            low[k] = fmin(low[k], at), high[k] = fmax(high[k], at);
        }
    const int larger = high[1] - low[1] > high[0] - low[0];
    return high[2] - low[2] > high[larger] - low[larger] ? 2 : larger;
}

// Adds weight (d d^T) to the moments.
static void add_square(float moments[6], double weight, const double d[3])
{
    static const int rows[6] = {0, 1, 2, 0, 0, 1}, columns[6] = {0, 1, 2, 1, 2, 2};
    for (int k = 0; k < 6; k++)
        moments[k] += (float)(weight * d[rows[k]] * d[columns[k]]);
}

void alb_moments_of_triangle(float moments[6], alb_vector a, alb_vector b, alb_vector c)
{
    const alb_vector centre = alb_times(1.0 / 3, alb_add(a, alb_add(b, c)));
    const alb_vector corners[3] = {a, b, c};
    memset(moments, 0, 6 * sizeof *moments);
    for (int k = 0; k < 3; k++) {
        const alb_vector to = alb_sub(corners[k], centre);
        add_square(moments, 1.0 / 12, (const double[3]){to.x, to.y, to.z});
    }
}

static void leaf_cluster(alb_cluster *cluster, const builder *b, uint32_t leaf)
{
    const uint32_t patch = b->forest->patches[leaf];
    const alb_vector centre = b->patches->centroids[patch], from_middle = alb_sub(centre, b->middle);
    alb_vector corners[3];
    alb_patch_triangle(corners, b->patches, patch);
    *cluster = (alb_cluster){.centre_mm = {(float)from_middle.x, (float)from_middle.y, (float)from_middle.z},
                             .area_mm2 = (float)b->patches->areas_mm2[patch],
                             .leaf = leaf};
    alb_moments_of_triangle(cluster->moments, corners[0], corners[1], corners[2]);
    for (int k = 0; k < 3; k++)
        cluster->radius_mm = fmaxf(cluster->radius_mm, (float)alb_length(alb_sub(corners[k], centre)));
}

static void merge(alb_cluster *cluster, const alb_cluster *left, const alb_cluster *right)
{
    const alb_cluster *const parts[2] = {left, right};
    const double area = (double)left->area_mm2 + (double)right->area_mm2;
    double nearest = INFINITY, radius = 0;
    *cluster = (alb_cluster){.area_mm2 = (float)area};
    for (int k = 0; k < 3; k++)
        cluster->centre_mm[k] = (float)(((double)left->area_mm2 * (double)left->centre_mm[k] +
                                         (double)right->area_mm2 * (double)right->centre_mm[k]) /
                                        area);
    for (int part = 0; part < 2; part++) {
        const alb_cluster *from = parts[part];
        const double share = (double)from->area_mm2 / area;
        double d[3];
        for (int k = 0; k < 3; k++)
            d[k] = (double)from->centre_mm[k] - (double)cluster->centre_mm[k];
        for (int k = 0; k < 6; k++)
            cluster->moments[k] += (float)share * from->moments[k];
        add_square(cluster->moments, share, d);
        const double distance = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        radius = fmax(radius, distance + (double)from->radius_mm);
        if (distance < nearest)
            nearest = distance, cluster->leaf = from->leaf;
    }
    cluster->radius_mm = (float)radius;
}

// What a product needs of a cluster: of a node, or of a leaf.
static void keep(alb_forest *forest, const alb_cluster *cluster, alb_scatter_node *node, uint32_t leaf)
{
    if (node) {
        node->light[3] = cluster->spread_mm2;
        forest->node_areas_mm2[node - forest->nodes] = cluster->area_mm2;
    } else
        forest->lights[leaf][3] = cluster->spread_mm2;
    for (int k = 0; k < 3; k++)
        *(node ? &node->moments[k][3] : &forest->centres_mm[leaf][k]) = cluster->centre_mm[k];
}

static void build(const builder *b, uint32_t index, uint32_t first_leaf, uint32_t count)
{
    alb_cluster *cluster = &b->forest->clusters[index];
    if (count == 1) {
        leaf_cluster(cluster, b, first_leaf);
    } else {
        const uint32_t left = alb_left_count(count);
        uint32_t *patches = b->forest->patches + first_leaf;
        part(b, longest_axis(b, patches, count), patches, count, left);
        build(b, index + 1, first_leaf, left);
        build(b, index + 2 * left, first_leaf + left, count - left);
        merge(cluster, cluster + 1, cluster + 2 * (size_t)left);
    }
    cluster->spread_mm2 = 0.5F * (cluster->moments[0] + cluster->moments[1] + cluster->moments[2]);
    keep(b->forest, cluster, count == 1 ? NULL : &b->forest->nodes[index - first_leaf], first_leaf);
}

static int face_of(const alb_patches *patches, const alb_optical_paths *paths, alb_vector axis, uint32_t patch)
{
    const double cosine = alb_dot(axis, patches->normals[patch]);
    if (paths->kind == ALB_OPTICAL_SHEET)
        return (int)alb_optical_paths_face(paths, patch);
    return cosine > 0.985 ? ALB_FACE_FRONT : cosine < -0.985 ? ALB_FACE_BACK : ALB_FACE_EDGE;
}

// The patches of the body, face after face; trees that have any.
static void plant(alb_forest *forest, const alb_body *body, uint32_t index, const alb_patches *patches,
                  uint16_t surface, bool slab, const alb_optical_paths *paths)
{
    const alb_vector axis = slab && paths->kind == ALB_OPTICAL_CONVEX ? main_normal(body, patches) : (alb_vector){0};
    const alb_vector first = patches->centroids[body->patches[0]];
    alb_vector low = first, high = first;
    for (size_t i = 0; i < body->count; i++) {
        const alb_vector c = patches->centroids[body->patches[i]];
        low = (alb_vector){fmin(low.x, c.x), fmin(low.y, c.y), fmin(low.z, c.z)};
        high = (alb_vector){fmax(high.x, c.x), fmax(high.y, c.y), fmax(high.z, c.z)};
    }
    for (int face = 0; face < ALB_FACES; face++) {
        alb_tree tree = {.body = index,
                         .first_cluster = (uint32_t)forest->cluster_count,
                         .first_leaf = (uint32_t)forest->leaf_count,
                         .surface = surface,
                         .face = (uint8_t)face,
                         .axis = {(float)axis.x, (float)axis.y, (float)axis.z},
                         .middle_mm = alb_times(0.5, alb_add(low, high))};
        for (size_t i = 0; i < body->count; i++) {
            if (face == face_of(patches, paths, axis, body->patches[i]))
                forest->patches[forest->leaf_count++] = body->patches[i];
        }
        tree.leaf_count = (uint32_t)forest->leaf_count - tree.first_leaf;
        if (!tree.leaf_count)
            continue;
        forest->cluster_count += 2 * (size_t)tree.leaf_count - 1;
        forest->trees[forest->tree_count++] = tree;
    }
}

bool alb_forest_create(alb_forest *forest, const alb_bodies *bodies, const alb_patches *patches,
                       const uint16_t *materials, const alb_surface *surfaces, const alb_optical_paths *paths,
                       alb_error *error)
{
    size_t leaves = 0;
    *forest = (alb_forest){0};
    for (size_t b = 0; b < bodies->count; b++)
        leaves += bodies->bodies[b].count;
    if (!(forest->trees = alb_allocate(ALB_FACES * bodies->count, sizeof *forest->trees, error)) ||
        !(forest->patches = alb_allocate(leaves, sizeof *forest->patches, error)) ||
        !(forest->areas_mm2 = alb_allocate(leaves, sizeof *forest->areas_mm2, error)) ||
        !(forest->node_areas_mm2 = alb_allocate(leaves, sizeof *forest->node_areas_mm2, error)) ||
        !(forest->centres_mm = alb_allocate(leaves, sizeof *forest->centres_mm, error)) ||
        !(forest->lights = alb_allocate(leaves, sizeof *forest->lights, error)) ||
        !(forest->nodes = alb_allocate(leaves, sizeof *forest->nodes, error)) ||
        !(forest->clusters = alb_allocate(2 * leaves, sizeof *forest->clusters, error))) {
        alb_forest_free(forest);
        return false;
    }
    for (size_t b = 0; b < bodies->count; b++) {
        const uint16_t surface = materials[bodies->bodies[b].patches[0]];
        plant(forest, &bodies->bodies[b], (uint32_t)b, patches, surface, surfaces[surface].slab, &paths[b]);
    }
#pragma omp parallel for schedule(dynamic, 1)
    for (size_t t = 0; t < forest->tree_count; t++) {
        const alb_tree *tree = &forest->trees[t];
        const builder b = {forest, patches, tree->middle_mm};
        build(&b, tree->first_cluster, tree->first_leaf, tree->leaf_count);
    }
    for (size_t i = 0; i < forest->leaf_count; i++)
        forest->areas_mm2[i] = (float)patches->areas_mm2[forest->patches[i]];
    return true;
}

void alb_forest_free(alb_forest *forest)
{
    free(forest->trees);
    free(forest->patches);
    free(forest->areas_mm2);
    free(forest->node_areas_mm2);
    free(forest->centres_mm);
    free(forest->lights);
    free(forest->nodes);
    free(forest->clusters);
    *forest = (alb_forest){0};
}

size_t alb_forest_bytes(const alb_forest *forest)
{
    return forest->tree_count * sizeof *forest->trees +
           forest->leaf_count * (sizeof *forest->patches + 2 * sizeof *forest->areas_mm2 + sizeof *forest->centres_mm +
                                 sizeof *forest->lights + sizeof *forest->nodes) +
           (forest->clusters ? forest->cluster_count * sizeof *forest->clusters : 0);
}
