// Generated meshes: a box and a sphere, for scenes and tests. Group 0 is named "". Appended to an empty mesh.
#pragma once
#include "render/mesh.h"

typedef struct alb_box {
    alb_vector centre_mm, size_mm;
    int cells[3];   // along x, y, z; each cell is two triangles
    double grading; // along x and y, cells grow from the middle outwards: largest edge / smallest edge; 1 is uniform
    bool inward;    // fronts face the inside: a room
} alb_box;
bool alb_shape_box(alb_mesh *mesh, const alb_box *box, alb_error *error);

typedef struct alb_sphere {
    alb_vector centre_mm;
    double radius_mm;
    int subdivisions; // icosahedron halved that many times: 20 * 4^n triangles with corners on the sphere; at most 8
    bool inward;
} alb_sphere;
bool alb_shape_sphere(alb_mesh *mesh, const alb_sphere *sphere, alb_error *error);
