// Box: a lattice of cells on each of six faces, corners shared by position (alb_mesh_weld), diagonals alternating so
// that the mesh has no preferred direction. Graded lattice: cell edges grow geometrically from the middle outwards, so
// that n cells a half have the ratio g between the last and the first: edge_k ~ g^(k / (n - 1)). Sphere: the
// icosahedron, each triangle halved along its edges, new corners pushed out to the sphere.
#include "render/shape.h"
#include <assert.h>

// Position of lattice line i of `cells` along -1/2..1/2, graded from the middle outwards.
static double line_at(int i, int cells, double grading)
{
    if (grading == 1 || cells < 4)
        return (double)i / cells - 0.5;
    const double half = cells / 2.0, steps = half - 1;
    const double from_middle = fabs(i - half), q = pow(grading, 1 / steps);
    return copysign(0.5 * (pow(q, from_middle) - 1) / (pow(q, half) - 1), i - half);
}

// One face of the box: axis `w` fixed at side +-1, lattice along u and v with (u, v, w) right-handed.
static bool add_side(alb_mesh *mesh, const alb_box *box, int w, int side, alb_error *error)
{
    const int u = (w + 1) % 3, v = (w + 2) % 3, columns = box->cells[u], rows = box->cells[v];
    const double size[3] = {box->size_mm.x, box->size_mm.y, box->size_mm.z};
    const double grading[3] = {box->grading, box->grading, 1};
    const uint32_t first = (uint32_t)mesh->vertex_count;
    for (int j = 0; j <= rows; j++)
        for (int i = 0; i <= columns; i++) {
            double at[3];
            at[u] = size[u] * line_at(i, columns, grading[u]);
            at[v] = size[v] * line_at(j, rows, grading[v]);
            at[w] = 0.5 * side * size[w];
            if (!alb_mesh_add_vertex(mesh, alb_add(box->centre_mm, (alb_vector){at[0], at[1], at[2]}), error))
                return false;
        }
    const bool flip = (side > 0) == box->inward;
    for (int j = 0; j < rows; j++)
        for (int i = 0; i < columns; i++) {
            const uint32_t a = first + (uint32_t)(j * (columns + 1) + i), b = a + 1, c = b + (uint32_t)columns + 1,
                           d = c - 1;
            const uint32_t corners[4] = {(i + j) % 2 ? b : a, (i + j) % 2 ? c : b, (i + j) % 2 ? d : c,
                                         (i + j) % 2 ? a : d};
            for (int k = 0; k < 2; k++) {
                const uint32_t p = corners[0], q = corners[1 + k], r = corners[2 + k];
                if (!alb_mesh_add_face(mesh, p, flip ? r : q, flip ? q : r, 0, error))
                    return false;
            }
        }
    return true;
}

bool alb_shape_box(alb_mesh *mesh, const alb_box *box, alb_error *error)
{
    uint16_t group;
    assert(mesh->vertex_count == 0);
    double faces = 0;
    for (int w = 0; w < 3; w++)
        faces += 4.0 * box->cells[(w + 1) % 3] * box->cells[(w + 2) % 3];
    if (faces > ALB_FACES_MAX / 4)
        return alb_fail(error, ALB_BAD_DATA, "a box of %.0f triangles; at most %d", faces, ALB_FACES_MAX / 4);
    if (!alb_mesh_add_group(&group, mesh, "", error))
        return false;
    for (int w = 0; w < 3; w++)
        for (int side = -1; side <= 1; side += 2)
            if (!add_side(mesh, box, w, side, error))
                return false;
    return alb_mesh_weld(mesh, error);
}

bool alb_shape_sphere(alb_mesh *mesh, const alb_sphere *sphere, alb_error *error)
{
    const double t = (1 + sqrt(5)) / 2;
    const double corners[12][3] = {{-1, t, 0},  {1, t, 0},  {-1, -t, 0}, {1, -t, 0}, {0, -1, t},  {0, 1, t},
                                   {0, -1, -t}, {0, 1, -t}, {t, 0, -1},  {t, 0, 1},  {-t, 0, -1}, {-t, 0, 1}};
    const uint32_t faces[20][3] = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                                   {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                                   {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
    uint16_t group;
    assert(mesh->vertex_count == 0 && sphere->subdivisions <= 8);
    if (!alb_mesh_add_group(&group, mesh, "", error))
        return false;
    for (int i = 0; i < 12; i++)
        if (!alb_mesh_add_vertex(mesh, alb_unit((alb_vector){corners[i][0], corners[i][1], corners[i][2]}), error))
            return false;
    for (int i = 0; i < 20; i++)
        if (!alb_mesh_add_face(mesh, faces[i][0], faces[i][sphere->inward ? 2 : 1], faces[i][sphere->inward ? 1 : 2], 0,
                               error))
            return false;
    for (int level = 0; level < sphere->subdivisions; level++) {
        // below every edge of this level and above half of it: each is halved exactly once
        const double shortest = 0.75 * 1.0514622 / (double)(1 << level);
        if (!alb_mesh_subdivide(mesh, shortest, error))
            return false;
        for (size_t i = 0; i < mesh->vertex_count; i++)
            mesh->vertices[i] = alb_unit(mesh->vertices[i]);
    }
    for (size_t i = 0; i < mesh->vertex_count; i++)
        mesh->vertices[i] = alb_add(sphere->centre_mm, alb_times(sphere->radius_mm, mesh->vertices[i]));
    return true;
}
