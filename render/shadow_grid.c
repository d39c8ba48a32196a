// A cube of c x c x c cells around the middle; nodes are the lattice points (i, j, k) on its surface. A point of a face
// has coordinates s = b / |a| in -1..1, a the largest component; cells are even in
//     t = s (1 + q - q |s|),   q = 0.27, close to (4 / pi) atan s: cells of about one solid angle, no arc tangent
#include "render/shadow_grid.h"
#include <assert.h>

static const double q = 0.27;

// Where t runs from 0 to 1: the s of it.
static double unwarp(double t)
{
    const double size = fabs(t), p = 1 + q;
    return copysign(2 * size / (p + sqrt(p * p - 4 * q * size)), t);
}

// Layers k = 0 and k = c are full squares, those between are rings of 4 c nodes.
static int node_at(int c, int i, int j, int k)
{
    const int square = (c + 1) * (c + 1);
    if (k == 0 || k == c)
        return (k ? square + 4 * c * (c - 1) : 0) + j * (c + 1) + i;
    const int ring = j == 0 ? i : i == c ? c + j : j == c ? 3 * c - i : 4 * c - j;
    return square + 4 * c * (k - 1) + ring;
}

alb_vector alb_shadow_grid_direction(alb_shadow_grid grid, int node)
{
    const int c = grid.cells, square = (c + 1) * (c + 1), rings = 4 * c * (c - 1);
    int at[3];
    assert(node >= 0 && node < alb_shadow_grid_count(grid));
    if (node < square || node >= square + rings) {
        const int rest = node < square ? node : node - square - rings;
        at[0] = rest % (c + 1), at[1] = rest / (c + 1), at[2] = node < square ? 0 : c;
    } else {
        const int ring = (node - square) % (4 * c), side = ring / c, along = ring % c;
        const int x[4] = {along, c, c - along, 0}, y[4] = {0, along, c, c - along};
        at[0] = x[side], at[1] = y[side], at[2] = 1 + (node - square) / (4 * c);
    }
    double p[3];
    for (int axis = 0; axis < 3; axis++)
        p[axis] = unwarp(2.0 * at[axis] / c - 1);
    return alb_unit((alb_vector){p[0], p[1], p[2]});
}

alb_shadow_place alb_shadow_grid_place(alb_shadow_grid grid, alb_vector direction)
{
    const int c = grid.cells;
    const double d[3] = {direction.x, direction.y, direction.z}, size[3] = {fabs(d[0]), fabs(d[1]), fabs(d[2])};
    const int axis = size[0] >= size[1] && size[0] >= size[2] ? 0 : size[1] >= size[2] ? 1 : 2;
    const int other[2] = {axis == 0 ? 1 : 0, axis == 2 ? 1 : 2};
    int cell[3][2];
    float into[2];
    cell[axis][0] = cell[axis][1] = d[axis] > 0 ? c : 0;
    for (int k = 0; k < 2; k++) {
        const double s = d[other[k]] / size[axis], t = s * (1 + q - q * fabs(s)), g = 0.5 * c * (t + 1);
        const int low = g >= c - 1 ? c - 1 : (int)g;
        into[k] = (float)(g - low);
        cell[other[k]][0] = low, cell[other[k]][1] = low + 1;
    }
    alb_shadow_place place;
    for (int corner = 0; corner < 4; corner++) {
        const int side[2] = {corner & 1, corner >> 1};
        int at[3];
        at[axis] = cell[axis][0];
        for (int k = 0; k < 2; k++)
            at[other[k]] = cell[other[k]][side[k]];
        place.nodes[corner] = node_at(c, at[0], at[1], at[2]);
        place.weights[corner] = (side[0] ? into[0] : 1 - into[0]) * (side[1] ? into[1] : 1 - into[1]);
    }
    return place;
}
