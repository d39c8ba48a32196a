// What the pictures of a shadow field are taken of: the object's faces between clusters of its vertices, in radii of
// the bounding sphere about its centre. Internal to render/shadow_field.c.
#pragma once
#include "render/mesh.h"
#include "render/shadow_sphere.h"

typedef struct alb_shadow_shape {
    const char *name;
    uint32_t (*faces)[3]; // of the mesh
    size_t face_count, vertex_count;
    uint32_t (*drawn)[3]; // between clusters; those within one are gone
    size_t drawn_count;
    bool closed;          // every edge has as many faces one way as the other: fronts alone hide what the whole does
    uint32_t *cluster_of; // of each vertex
    float *share;         // of each vertex in its cluster
    size_t cluster_count;
    float *x, *y, *z;       // of clusters: means of their vertices
    uint32_t *face_colours; // of each face; NULL: an occluder
    float (*colours)[3];    // radiance; the first is black, each occurs once
    size_t colour_count;
} alb_shadow_shape;

// cell_mm: side of the cubes whose vertices become one; 0: every vertex stays. With radiance every vertex stays.
bool alb_shadow_shape_create(alb_shadow_shape *shape, const alb_mesh *mesh, const float (*face_radiance)[3],
                             double cell_mm, const char *name, alb_error *error);
void alb_shadow_shape_free(alb_shadow_shape *shape);
// Sets x, y, z from the vertices as they are now.
void alb_shadow_shape_place(alb_shadow_shape *shape, const alb_vector *vertices, const alb_shadow_sphere *sphere);
