// Prisms over plane regions, where the shortest path inside is known: distance^2 = plane distance^2 + dz^2.
//
// Plane distances: a ring by its closed form; a region of unit squares by the visibility graph of its reflex corners,
// worked out with nothing but segments against sides.
#pragma once
#include "render/patch.h"
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { SQUARES = 24, REFLEX_CORNERS = 64, SIDES = 512 };

// Squares of side 1 at (column, row); '#' is inside. cells: quads per side; height in quads of the same size.
typedef struct squares {
    int columns, rows;
    const char *text[SQUARES]; // row 0 first
} squares;

static inline bool square_at(const squares *s, int column, int row)
{
    return column >= 0 && row >= 0 && column < s->columns && row < s->rows && s->text[row][column] == '#';
}

// To a multiple of 2^-20, so that one corner reached from two sides is one position.
static inline double rounded(double x) { return round(x * 0x1p20) * 0x1p-20; }

// A quad from p along u and v, n by m cells, seen from u x v; diagonals alternate.
static inline bool add_quads(alb_mesh *mesh, alb_vector p, alb_vector u, alb_vector v, int n, int m, alb_error *error)
{
    const uint32_t first = (uint32_t)mesh->vertex_count;
    for (int j = 0; j <= m; j++)
        for (int i = 0; i <= n; i++) {
            const alb_vector at = alb_add(p, alb_add(alb_times((double)i / n, u), alb_times((double)j / m, v)));
            if (!alb_mesh_add_vertex(mesh, (alb_vector){rounded(at.x), rounded(at.y), rounded(at.z)}, error))
                return false;
        }
    for (int j = 0; j < m; j++)
        for (int i = 0; i < n; i++) {
            const uint32_t a = first + (uint32_t)(j * (n + 1) + i), b = a + 1, d = a + (uint32_t)n + 1, c = d + 1;
            const bool odd = (i + j) % 2;
            if (!alb_mesh_add_face(mesh, a, b, odd ? d : c, 0, error) ||
                !alb_mesh_add_face(mesh, odd ? b : a, c, d, 0, error))
                return false;
        }
    return true;
}

static inline bool make_squares(alb_mesh *mesh, const squares *s, int cells, double height, alb_error *error)
{
    static const int sides[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
    const int tall = (int)ceil(height * cells);
    const alb_vector up = {0, 0, height};
    uint16_t group;
    if (!alb_mesh_add_group(&group, mesh, "", error))
        return false;
    for (int row = 0; row < s->rows; row++)
        for (int column = 0; column < s->columns; column++) {
            if (!square_at(s, column, row))
                continue;
            const alb_vector at = {column, row, 0}, x = {1, 0, 0}, y = {0, 1, 0};
            if (!add_quads(mesh, at, y, x, cells, cells, error) ||
                !add_quads(mesh, alb_add(at, up), x, y, cells, cells, error))
                return false;
            for (int k = 0; k < 4; k++) {
                const double dx = sides[k][0], dy = sides[k][1];
                const alb_vector along = {-dy, dx, 0};
                const alb_vector from = {column + 0.5 + 0.5 * (dx + dy), row + 0.5 + 0.5 * (dy - dx), 0};
                if (!square_at(s, column + sides[k][0], row + sides[k][1]) &&
                    !add_quads(mesh, from, along, up, cells, tall, error))
                    return false;
            }
        }
    return alb_mesh_weld(mesh, error);
}

typedef struct plane_region {
    double sides[SIDES][4]; // x0 y0 x1 y1, the inside on the left
    int side_count;
    double corners[REFLEX_CORNERS][2];
    int corner_count;
    double between[REFLEX_CORNERS][REFLEX_CORNERS];
} plane_region;

static inline double turn(double ax, double ay, double bx, double by, double px, double py)
{
    return (bx - ax) * (py - ay) - (by - ay) * (px - ax);
}

// Whether the open segment crosses no side; touching corners and running along sides is allowed.
static inline bool region_sees(const plane_region *r, const squares *s, const double a[2], const double b[2])
{
    const double tiny = 1e-9;
    for (int i = 0; i < r->side_count; i++) {
        const double *e = r->sides[i];
        const double t0 = turn(a[0], a[1], b[0], b[1], e[0], e[1]), t1 = turn(a[0], a[1], b[0], b[1], e[2], e[3]);
        const double u0 = turn(e[0], e[1], e[2], e[3], a[0], a[1]), u1 = turn(e[0], e[1], e[2], e[3], b[0], b[1]);
        if (((t0 > tiny && t1 < -tiny) || (t0 < -tiny && t1 > tiny)) &&
            ((u0 > tiny && u1 < -tiny) || (u0 < -tiny && u1 > tiny)))
            return false;
    }
    for (int k = 1; k < 64; k++) { // through corners into the outside
        const double f = k / 64.0, x = a[0] + f * (b[0] - a[0]), y = a[1] + f * (b[1] - a[1]);
        bool inside = false;
        for (int d = 0; d < 4; d++)
            inside |= square_at(s, (int)floor(x + (d % 2 ? 1e-7 : -1e-7)), (int)floor(y + (d / 2 ? 1e-7 : -1e-7)));
        if (!inside)
            return false;
    }
    return true;
}

static inline void make_region(plane_region *r, const squares *s)
{
    *r = (plane_region){0};
    for (int row = 0; row <= s->rows; row++)
        for (int column = 0; column <= s->columns; column++) {
            const bool here = square_at(s, column, row), left = square_at(s, column - 1, row),
                       below = square_at(s, column, row - 1), corner = square_at(s, column - 1, row - 1);
            const double x = column, y = row;
            if (here != left) {
                const double side[4] = {x, here ? y + 1 : y, x, here ? y : y + 1};
                memcpy(r->sides[r->side_count++], side, sizeof side);
            }
            if (here != below) {
                const double side[4] = {here ? x : x + 1, y, here ? x + 1 : x, y};
                memcpy(r->sides[r->side_count++], side, sizeof side);
            }
            if (here + left + below + corner == 3)
                r->corners[r->corner_count][0] = x, r->corners[r->corner_count++][1] = y;
        }
    for (int i = 0; i < r->corner_count; i++)
        for (int j = 0; j < r->corner_count; j++)
            r->between[i][j] = region_sees(r, s, r->corners[i], r->corners[j])
                                   ? hypot(r->corners[i][0] - r->corners[j][0], r->corners[i][1] - r->corners[j][1])
                                   : (double)INFINITY;
    for (int k = 0; k < r->corner_count; k++) // Floyd & Warshall
        for (int i = 0; i < r->corner_count; i++)
            for (int j = 0; j < r->corner_count; j++)
                r->between[i][j] = fmin(r->between[i][j], r->between[i][k] + r->between[k][j]);
}

static inline double region_distance(const plane_region *r, const squares *s, const double a[2], const double b[2])
{
    if (region_sees(r, s, a, b))
        return hypot(a[0] - b[0], a[1] - b[1]);
    double best = (double)INFINITY, to[REFLEX_CORNERS];
    for (int j = 0; j < r->corner_count; j++)
        to[j] = region_sees(r, s, r->corners[j], b) ? hypot(r->corners[j][0] - b[0], r->corners[j][1] - b[1])
                                                    : (double)INFINITY;
    for (int i = 0; i < r->corner_count; i++)
        if (region_sees(r, s, a, r->corners[i]))
            for (int j = 0; j < r->corner_count; j++)
                best = fmin(best, hypot(r->corners[i][0] - a[0], r->corners[i][1] - a[1]) + r->between[i][j] + to[j]);
    return best;
}

// A pipe of inner radius a and outer radius r about the z axis.
static inline bool make_ring(alb_mesh *mesh, double a, double r, double height, int around, int across, int up,
                             alb_error *error)
{
    const int outline = 2 * (across + up); // of the section, counter-clockwise in (radius, z)
    uint16_t group;
    if (!alb_mesh_add_group(&group, mesh, "", error))
        return false;
    for (int i = 0; i < around; i++)
        for (int j = 0; j < outline; j++) {
            double radius = r, z = 0;
            if (j < across)
                radius = a + (r - a) * j / across;
            else if (j < across + up)
                z = height * (j - across) / up;
            else if (j < 2 * across + up)
                z = height, radius = r - (r - a) * (j - across - up) / across;
            else
                z = height * (outline - j) / up, radius = a;
            const double angle = 2 * M_PI * i / around;
            if (!alb_mesh_add_vertex(mesh, (alb_vector){radius * cos(angle), radius * sin(angle), z}, error))
                return false;
        }
    for (int i = 0; i < around; i++)
        for (int j = 0; j < outline; j++) {
            const uint32_t p = (uint32_t)(i * outline + j), q = (uint32_t)(i * outline + (j + 1) % outline),
                           s = (uint32_t)((i + 1) % around * outline + j),
                           t = (uint32_t)((i + 1) % around * outline + (j + 1) % outline);
            const bool odd = (i + j) % 2;
            if (!alb_mesh_add_face(mesh, p, odd ? s : t, q, 0, error) || !alb_mesh_add_face(mesh, odd ? s : p,
                                                                                            s == p ? p
                                                                                            : odd  ? t
                                                                                                   : s,
                                                                                            odd ? q : t, 0, error))
                return false;
        }
    return true;
}

// The plane distance in a ring of inner radius a: a straight line, or two tangents and an arc.
static inline double ring_distance(double a, const double p[2], const double q[2])
{
    const double r1 = fmax(hypot(p[0], p[1]), a), r2 = fmax(hypot(q[0], q[1]), a);
    const double angle = fabs(atan2(p[0] * q[1] - p[1] * q[0], p[0] * q[0] + p[1] * q[1]));
    const double arc = angle - acos(a / r1) - acos(a / r2);
    return arc > 0 ? sqrt(r1 * r1 - a * a) + sqrt(r2 * r2 - a * a) + a * arc : hypot(p[0] - q[0], p[1] - q[1]);
}
