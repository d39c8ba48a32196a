// Patches: the triangles of a mesh with what every part of the transport needs of them. Index = face index.
#pragma once
#include "render/mesh.h"

typedef struct alb_patches {
    const alb_mesh *mesh; // borrowed
    size_t count;
    alb_vector *centroids, *normals; // mm; unit, out of the front
    double *areas_mm2;
    double offset_mm;     // how far a ray starts above its patch: a few float roundings of the scene's half extent
    uint64_t *free_cells; // which of the 64 parts of each patch lie free (patch_cull.h); NULL: all do
    size_t culled;        // patches with parts that do not
} alb_patches;

bool alb_patches_create(alb_patches *patches, const alb_mesh *mesh, alb_error *error);
void alb_patches_free(alb_patches *patches);
void alb_patch_triangle(alb_vector triangle[3], const alb_patches *patches, size_t patch);
// Uniform point of what lies free of the triangle for u, v in [0, 1), offset_mm in front of it. Turk 1990: the square
// folded by a root.
alb_vector alb_patch_point(const alb_patches *patches, size_t patch, double u, double v);
// Corners of part 0..63: the triangle's edges halved three times.
void alb_patch_cell(alb_vector triangle[3], const alb_patches *patches, size_t patch, int cell);
// Whether nothing of the patch lies free: it neither receives nor sends light.
static inline bool alb_patch_buried(const alb_patches *patches, size_t patch)
{
    return patches->free_cells && !patches->free_cells[patch];
}

// A body: faces of one material joined along edges.
typedef struct alb_body {
    uint32_t *patches; // ascending
    size_t count;
    bool closed; // every edge has exactly two faces, in opposite directions
    bool convex; // closed, and every edge bends inwards or not at all (0.5 degrees of slack)
} alb_body;
typedef struct alb_bodies {
    alb_body *bodies;
    size_t count;
    uint32_t *patches; // storage
} alb_bodies;

// Bodies among the patches whose label is not negative; patches join along shared edges if their labels agree.
// The mesh must be welded within each label.
bool alb_bodies_find(alb_bodies *bodies, const alb_patches *patches, const int *labels, alb_error *error);
void alb_bodies_free(alb_bodies *bodies);
