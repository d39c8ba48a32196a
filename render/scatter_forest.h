// The sources of scattering in clusters: a binary tree for each face of each body, its leaves patches.
#pragma once
#include "render/optical_path.h"
#include "render/scatter.h"

// Exit patches are taken in blocks of so many consecutive leaves.
enum { ALB_BLOCK = 8 };

// The runs of a body: faces of a slab, and what is neither (all of a solid).
enum { ALB_FACE_EDGE = ALB_RIM, ALB_FACE_FRONT = ALB_FRONT, ALB_FACE_BACK = ALB_BACK, ALB_FACES };

typedef struct alb_cluster {
    float centre_mm[3]; // relative to the body's middle
    float moments[6];   // xx, yy, zz, xy, xz, yz: variances of a point of it, mm^2
    float radius_mm;    // no vertex is further from the centre
    float spread_mm2;   // half the trace of the moments: the variance along any direction of its plane, if alike
    float area_mm2;
    uint32_t leaf; // one near the centre
} alb_cluster;

// A cluster as a product sees it. The light, area times irradiance of R, G and B, and its first moments about the
// centre along x, y and z, in which the last element stays: the centre.
typedef struct alb_scatter_node {
    float light[4]; // the last: the spread
    float moments[3][4];
} alb_scatter_node;

typedef struct alb_tree {
    uint32_t body, first_cluster, first_leaf, leaf_count;
    uint16_t surface;     // what the body is made of
    uint8_t face;         // ALB_FACE_...
    float axis[3];        // slab: normal of its faces; of a sheet zero
    alb_vector middle_mm; // of the body
} alb_tree;

// Clusters of a tree, its patches too, stand in depth-first order. One of n leaves is made of 2 n - 1 clusters; its
// children are the next one, with alb_left_count(n) leaves, and the one 2 alb_left_count(n) further on. The node of a
// cluster of several leaves is clusters before it less leaves before it: cluster - first leaf.
typedef struct alb_forest {
    size_t tree_count, leaf_count, cluster_count;
    alb_tree *trees;
    uint32_t *patches;       // of the leaves
    float *areas_mm2;        // of the leaves
    float *node_areas_mm2;   // of the nodes
    float (*centres_mm)[3];  // of the leaves, as those of clusters
    float (*lights)[4];      // of the leaves: light of R, G and B, and the spread; workspace of a product
    alb_scatter_node *nodes; // likewise
    alb_cluster *clusters;   // only while links are made
} alb_forest;

static inline uint32_t alb_left_count(uint32_t count)
{
    return count <= ALB_BLOCK ? count / 2 : (count / 2 + ALB_BLOCK - 1) / ALB_BLOCK * ALB_BLOCK;
}

// Trees of all bodies, patches of one face of one body each (scatter_forest.c). materials[patch] indexes surfaces;
// paths[body] tell the faces of sheets. All is read, nothing kept. ALB_NO_MEMORY, *forest then empty.
bool alb_forest_create(alb_forest *forest, const alb_bodies *bodies, const alb_patches *patches,
                       const uint16_t *materials, const alb_surface *surfaces, const alb_optical_paths *paths,
                       alb_error *error);
void alb_forest_free(alb_forest *forest);
// Covariance of a point of the triangle, mm^2, in the order of alb_cluster.
void alb_moments_of_triangle(float moments[6], alb_vector a, alb_vector b, alb_vector c);
// Fills lights and nodes from irradiance[patch], RGB; NULL: one everywhere (formula: scatter_gather.c). The same bytes
// with any number of threads.
void alb_forest_gather(alb_forest *forest, const double (*irradiance)[3]);
// Everything that stays allocated.
size_t alb_forest_bytes(const alb_forest *forest);
