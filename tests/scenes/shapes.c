#include "scenes/shapes.h"
#include "base/memory.h"
#include <assert.h>
#include <stdlib.h>

bool shape_sheet(alb_mesh *mesh, alb_vector corner, alb_vector u, alb_vector v, int columns, int rows, uint16_t group,
                 alb_error *error)
{
    const uint32_t first = (uint32_t)mesh->vertex_count, wide = (uint32_t)columns + 1;
    for (int j = 0; j <= rows; j++)
        for (int i = 0; i <= columns; i++)
            if (!alb_mesh_add_vertex(
                    mesh, alb_add(corner, alb_add(alb_times((double)i / columns, u), alb_times((double)j / rows, v))),
                    error))
                return false;
    for (int j = 0; j < rows; j++)
        for (int i = 0; i < columns; i++) {
            const uint32_t a = first + (uint32_t)j * wide + (uint32_t)i, b = a + 1, c = b + wide, d = a + wide;
            const bool turn = (i + j) % 2; // alternating diagonals: no preferred direction
            if (!alb_mesh_add_face(mesh, turn ? b : a, turn ? c : b, turn ? d : c, group, error) ||
                !alb_mesh_add_face(mesh, turn ? b : a, turn ? d : c, turn ? a : d, group, error))
                return false;
        }
    return true;
}

// One ring of a lathed solid: `corners` vertices from `first` on; a pole has one.
typedef struct ring {
    uint32_t first, corners;
} ring;

static bool add_ring(ring *out, alb_mesh *mesh, double r, double z, alb_vector foot, double edge_mm, alb_error *error)
{
    const double turns = 2 * M_PI * r / edge_mm;
    *out = (ring){(uint32_t)mesh->vertex_count, r > 0 ? (uint32_t)fmax(6, round(turns)) : 1};
    for (uint32_t k = 0; k < out->corners; k++) {
        const double angle = 2 * M_PI * k / out->corners;
        if (!alb_mesh_add_vertex(mesh, alb_add(foot, (alb_vector){r * cos(angle), r * sin(angle), z}), error))
            return false;
    }
    return true;
}

// The band between two rings: whichever ring lags in angle moves on by one corner.
static bool stitch(alb_mesh *mesh, ring low, ring high, uint16_t group, alb_error *error)
{
    const uint32_t steps_low = low.corners > 1 ? low.corners : 0, steps_high = high.corners > 1 ? high.corners : 0;
    for (uint32_t i = 0, j = 0; i < steps_low || j < steps_high;) {
        const uint32_t a = low.first + i % low.corners, b = high.first + j % high.corners;
        const bool on_low = j == steps_high || (i < steps_low && (i + 0.5) * steps_high <= (j + 0.5) * steps_low);
        const uint32_t next = on_low ? low.first + (i + 1) % low.corners : high.first + (j + 1) % high.corners;
        if (!alb_mesh_add_face(mesh, a, next, b, group, error))
            return false;
        i += on_low, j += !on_low;
    }
    return true;
}

bool shape_lathe(alb_mesh *mesh, const double (*outline)[2], int count, alb_vector foot, double edge_mm, uint16_t group,
                 alb_error *error)
{
    ring last = {0}, next;
    const double *from = outline[0];
    assert(count > 2 && outline[0][0] == 0 && outline[count - 1][0] == 0);
    if (!add_ring(&last, mesh, 0, outline[0][1], foot, edge_mm, error))
        return false;
    for (int k = 0; k + 1 < count; k++) {
        const double dr = outline[k + 1][0] - from[0], dz = outline[k + 1][1] - from[1];
        if (hypot(dr, dz) < 0.6 * edge_mm && k + 2 < count) // a bend finer than the mesh
            continue;
        const int pieces = (int)fmax(1, round(hypot(dr, dz) / edge_mm));
        for (int i = 1; i <= pieces; i++) {
            const double t = (double)i / pieces;
            const double r = i == pieces ? outline[k + 1][0] : from[0] + t * dr;
            if (!add_ring(&next, mesh, r, from[1] + t * dz, foot, edge_mm, error) ||
                !stitch(mesh, last, next, group, error))
                return false;
            last = next;
        }
        from = outline[k + 1];
    }
    return true;
}

// The lattice of an implicit surface: values at (columns + 1) (rows + 1) (layers + 1) corners, a vertex for each cell
// that the surface crosses.
typedef struct lattice {
    int cells[3];
    alb_vector low;
    double cell_mm;
    float *values;
    uint32_t *vertices; // UINT32_MAX: none
    shape_field field;
    const void *context;
} lattice;

static size_t corner_at(const lattice *l, int x, int y, int z)
{
    return ((size_t)z * (size_t)(l->cells[1] + 1) + (size_t)y) * (size_t)(l->cells[0] + 1) + (size_t)x;
}
static size_t cell_at(const lattice *l, int x, int y, int z)
{
    return ((size_t)z * (size_t)l->cells[1] + (size_t)y) * (size_t)l->cells[0] + (size_t)x;
}
static bool inside(const lattice *l, int x, int y, int z) { return l->values[corner_at(l, x, y, z)] < 0; }

static void fill_values(lattice *l)
{
#pragma omp parallel for schedule(dynamic, 1)
    for (int z = 0; z <= l->cells[2]; z++)
        for (int y = 0; y <= l->cells[1]; y++)
            for (int x = 0; x <= l->cells[0]; x++) {
                const alb_vector at = alb_add(l->low, alb_times(l->cell_mm, (alb_vector){x, y, z}));
                l->values[corner_at(l, x, y, z)] = (float)l->field(l->context, at);
            }
}

// Where two corners of a lattice face lie inside and the two between them outside, the surface could run either way and
// four faces would share an edge: one of the outer corners is moved just inside. True where such a face was found.
static bool settle(lattice *l)
{
    bool found = false;
    for (int axis = 0; axis < 3; axis++)
        for (int z = 0; z < l->cells[2] + (axis == 2); z++)
            for (int y = 0; y < l->cells[1] + (axis == 1); y++)
                for (int x = 0; x < l->cells[0] + (axis == 0); x++) {
                    float *corner[4];
                    for (int k = 0; k < 4; k++) { // around the face
                        int at[3] = {x, y, z};
                        at[(axis + 1) % 3] += k == 1 || k == 2, at[(axis + 2) % 3] += k >= 2;
                        corner[k] = &l->values[corner_at(l, at[0], at[1], at[2])];
                    }
                    const bool first = *corner[0] < 0;
                    if ((*corner[2] < 0) != first || (*corner[1] < 0) == first || (*corner[3] < 0) == first)
                        continue;
                    *corner[first] = (float)(-1e-3 * l->cell_mm);
                    found = true;
                }
    return found;
}

// Newton's steps along the gradient, each at most half a cell.
static alb_vector onto_surface(const lattice *l, alb_vector p)
{
    const double step = 1e-3 * l->cell_mm;
    for (int k = 0; k < 4; k++) {
        const double f = l->field(l->context, p);
        double slope[3];
        for (int c = 0; c < 3; c++) {
            const alb_vector d = {step * (c == 0), step * (c == 1), step * (c == 2)};
            slope[c] = (l->field(l->context, alb_add(p, d)) - l->field(l->context, alb_sub(p, d))) / (2 * step);
        }
        const alb_vector gradient = {slope[0], slope[1], slope[2]};
        const double steep = fmax(alb_length(gradient), 1e-6);
        const double along = fmin(fmax(f / steep, -0.5 * l->cell_mm), 0.5 * l->cell_mm);
        p = alb_sub(p, alb_times(along / steep, gradient));
    }
    return p;
}

// The mean of where the surface crosses the cell's edges, then onto the surface. False where it crosses none.
static bool vertex_of(alb_vector *out, const lattice *l, int x, int y, int z)
{
    alb_vector sum = {0};
    int crossings = 0;
    for (int axis = 0; axis < 3; axis++)
        for (int k = 0; k < 4; k++) {
            int a[3] = {x, y, z}, b[3];
            a[(axis + 1) % 3] += k % 2, a[(axis + 2) % 3] += k / 2;
            for (int c = 0; c < 3; c++)
                b[c] = a[c] + (c == axis);
            const double fa = (double)l->values[corner_at(l, a[0], a[1], a[2])],
                         fb = (double)l->values[corner_at(l, b[0], b[1], b[2])];
            if ((fa < 0) == (fb < 0))
                continue;
            double at[3] = {a[0], a[1], a[2]};
            at[axis] += fa / (fa - fb);
            sum = alb_add(sum, (alb_vector){at[0], at[1], at[2]});
            crossings++;
        }
    if (!crossings)
        return false;
    *out = onto_surface(l, alb_add(l->low, alb_times(l->cell_mm / crossings, sum)));
    return true;
}

static bool place_vertices(lattice *l, alb_mesh *mesh, alb_error *error)
{
    for (int z = 0; z < l->cells[2]; z++)
        for (int y = 0; y < l->cells[1]; y++)
            for (int x = 0; x < l->cells[0]; x++) {
                alb_vector at;
                uint32_t *vertex = &l->vertices[cell_at(l, x, y, z)];
                *vertex = UINT32_MAX;
                if (!vertex_of(&at, l, x, y, z))
                    continue;
                *vertex = (uint32_t)mesh->vertex_count;
                if (!alb_mesh_add_vertex(mesh, at, error))
                    return false;
            }
    return true;
}

// A lattice edge that the surface crosses joins the vertices of the four cells around it; the shorter diagonal splits.
static bool add_quad(const lattice *l, alb_mesh *mesh, const int at[3], int axis, uint16_t group, alb_error *error)
{
    uint32_t q[4];
    for (int k = 0; k < 4; k++) { // around the edge, counter-clockwise seen from its far end
        int c[3] = {at[0], at[1], at[2]};
        c[(axis + 1) % 3] -= k == 0 || k == 3;
        c[(axis + 2) % 3] -= k <= 1;
        q[k] = l->vertices[cell_at(l, c[0], c[1], c[2])];
    }
    if (!inside(l, at[0], at[1], at[2])) { // the inside lies at the far end: turn
        const uint32_t swap = q[1];
        q[1] = q[3], q[3] = swap;
    }
    const alb_vector *v = mesh->vertices;
    const bool other = alb_length(alb_sub(v[q[1]], v[q[3]])) < alb_length(alb_sub(v[q[0]], v[q[2]]));
    return alb_mesh_add_face(mesh, q[other], q[other + 1], q[(other + 2) % 4], group, error) &&
           alb_mesh_add_face(mesh, q[other], q[(other + 2) % 4], q[(other + 3) % 4], group, error);
}

bool shape_implicit(alb_mesh *mesh, shape_field field, const void *context, alb_vector low, alb_vector high,
                    double cell_mm, uint16_t group, alb_error *error)
{
    const alb_vector size = alb_sub(high, low);
    lattice l = {.low = low, .cell_mm = cell_mm, .field = field, .context = context};
    l.cells[0] = (int)ceil(size.x / cell_mm), l.cells[1] = (int)ceil(size.y / cell_mm),
    l.cells[2] = (int)ceil(size.z / cell_mm);
    const size_t cells = (size_t)l.cells[0] * (size_t)l.cells[1] * (size_t)l.cells[2];
    l.values = alb_allocate(corner_at(&l, 0, 0, l.cells[2] + 1), sizeof *l.values, error);
    l.vertices = alb_allocate(cells, sizeof *l.vertices, error);
    bool ok = l.values && l.vertices;
    if (ok) {
        fill_values(&l);
        while (settle(&l))
            continue;
        ok = place_vertices(&l, mesh, error);
    }
    for (int z = 0; z < l.cells[2]; z++)
        for (int y = 0; y < l.cells[1]; y++)
            for (int x = 0; x < l.cells[0]; x++)
                for (int axis = 0; ok && axis < 3; axis++) {
                    const int at[3] = {x, y, z};
                    const bool crosses =
                        inside(&l, x, y, z) != inside(&l, x + (axis == 0), y + (axis == 1), z + (axis == 2));
                    if (crosses && at[(axis + 1) % 3] > 0 && at[(axis + 2) % 3] > 0)
                        ok = add_quad(&l, mesh, at, axis, group, error);
                }
    free(l.values);
    free(l.vertices);
    return ok;
}
