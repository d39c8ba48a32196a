// Building blocks of the measured scenes: grids, lathed solids, implicit surfaces. Each appends one object that shares
// no vertex with others, counter-clockwise seen from outside, closed where it says so. Lengths in mm.
#pragma once
#include "render/mesh.h"

// A sheet of columns x rows cells, two triangles each, from the corner along u and v; the front is where u x v points.
bool shape_sheet(alb_mesh *mesh, alb_vector corner, alb_vector u, alb_vector v, int columns, int rows, uint16_t group,
                 alb_error *error);

// The solid that the outline (r, z)[count] sweeps about the z axis, closed. The outline starts and ends on the axis
// (r = 0) and runs with the solid to its left, seen with r to the right and z up. Rings have as many corners as fit
// edges of edge_mm, so triangles stay of one size up to the poles.
bool shape_lathe(alb_mesh *mesh, const double (*outline)[2], int count, alb_vector foot, double edge_mm, uint16_t group,
                 alb_error *error);

// The surface f = 0 around f < 0 inside the box, by surface nets (Gibson 1998) on cubes of cell_mm, each corner then
// moved onto the surface along the gradient. Closed where the surface stays inside the box; manifold where nothing is
// thinner than two cells.
typedef double (*shape_field)(const void *context, alb_vector at);
bool shape_implicit(alb_mesh *mesh, shape_field field, const void *context, alb_vector low, alb_vector high,
                    double cell_mm, uint16_t group, alb_error *error);
