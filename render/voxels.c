// A body in voxels.
//
// Triangles are entered in every voxel that they touch (separating axes, Akenine-Moller 2001). Between them lie regions
// without surface, found by flooding over faces; each is inside or outside as a whole, and the winding number of one of
// its voxels says which. Where the surface has holes wider than a voxel, inside and outside are one region: there every
// voxel asks for its own.
#include "render/voxels.h"
#include "base/memory.h"
#include "render/winding.h"
#include <stdlib.h>
#include <string.h>

static const double slack = 1e-6; // of a voxel: triangles this near count as touching

static size_t voxel_count(const alb_voxels *v) { return (size_t)v->n[0] * (size_t)v->n[1] * (size_t)v->n[2]; }

static size_t index_of(const alb_voxels *v, int i, int j, int k)
{
    return ((size_t)k * (size_t)v->n[1] + (size_t)j) * (size_t)v->n[0] + (size_t)i;
}

static void lay_out(alb_voxels *v, double size_mm, size_t most)
{
    alb_vector low = {INFINITY, INFINITY, INFINITY}, high = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t t = 0; t < v->triangle_count; t++)
        for (int c = 0; c < 3; c++) {
            const alb_vector p = v->triangles[t][c];
            low = (alb_vector){fmin(low.x, p.x), fmin(low.y, p.y), fmin(low.z, p.z)};
            high = (alb_vector){fmax(high.x, p.x), fmax(high.y, p.y), fmax(high.z, p.z)};
        }
    if (v->triangle_count == 0)
        low = high = (alb_vector){0};
    const alb_vector span = alb_sub(high, low);
    v->size_mm = fmax(size_mm, 1e-9 * (alb_length(span) + alb_length(low)));
    if (!(v->size_mm > 0))
        v->size_mm = 1;
    for (;; v->size_mm *= 1.1) {
        const double x = floor(span.x / v->size_mm) + 4, y = floor(span.y / v->size_mm) + 4,
                     z = floor(span.z / v->size_mm) + 4;
        if (x * y * z <= (double)most || v->size_mm > alb_length(span)) {
            v->n[0] = (int)x, v->n[1] = (int)y, v->n[2] = (int)z;
            break;
        }
    }
    // An irrational share of a voxel of margin: faces of boxes then lie on no voxel boundary.
    const double margin = 1.3819660112501051 * v->size_mm;
    v->low = alb_sub(low, (alb_vector){margin, margin, margin});
}

// Whether all corners lie beyond the box's half width along the axis.
static bool separates(alb_vector axis, const alb_vector t[3], double half)
{
    const double a = alb_dot(axis, t[0]), b = alb_dot(axis, t[1]), c = alb_dot(axis, t[2]);
    const double radius = half * (fabs(axis.x) + fabs(axis.y) + fabs(axis.z));
    return fmin(a, fmin(b, c)) > radius || fmax(a, fmax(b, c)) < -radius;
}

static bool touches(const alb_vector triangle[3], alb_vector centre, double half)
{
    static const alb_vector axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    alb_vector t[3], edges[3];
    for (int c = 0; c < 3; c++)
        t[c] = alb_sub(triangle[c], centre), edges[c] = alb_sub(triangle[(c + 1) % 3], triangle[c]);
    if (separates(alb_cross(edges[0], edges[1]), t, half))
        return false;
    for (int a = 0; a < 3; a++) {
        if (separates(axes[a], t, half))
            return false;
        for (int c = 0; c < 3; c++)
            if (separates(alb_cross(axes[a], edges[c]), t, half))
                return false;
    }
    return true;
}

static int clamped(double x, int n) { return x < 0 ? 0 : x > n - 1 ? n - 1 : (int)x; }

// Counts the voxels of each triangle (lists NULL) or enters it in their lists, from the end of each.
static void enter(alb_voxels *v, size_t triangle, uint32_t *lists)
{
    const alb_vector *t = v->triangles[triangle];
    const double inverse = 1 / v->size_mm, half = v->size_mm * (0.5 + slack);
    int first[3], last[3];
    for (int a = 0; a < 3; a++) {
        double low = INFINITY, high = -INFINITY;
        for (int c = 0; c < 3; c++) {
            const alb_vector p = alb_sub(t[c], v->low);
            const double x = a == 0 ? p.x : a == 1 ? p.y : p.z;
            low = fmin(low, x), high = fmax(high, x);
        }
        first[a] = clamped(floor(low * inverse - slack), v->n[a]);
        last[a] = clamped(floor(high * inverse + slack), v->n[a]);
    }
    for (int k = first[2]; k <= last[2]; k++)
        for (int j = first[1]; j <= last[1]; j++)
            for (int i = first[0]; i <= last[0]; i++) {
                const alb_vector centre =
                    alb_add(v->low, alb_times(v->size_mm, (alb_vector){i + 0.5, j + 0.5, k + 0.5}));
                if (!touches(t, centre, half))
                    continue;
                const size_t voxel = index_of(v, i, j, k);
                if (lists)
                    lists[--v->starts[voxel]] = (uint32_t)triangle;
                else
                    v->starts[voxel]++, v->state[voxel] = ALB_VOXEL_SURFACE;
            }
}

static bool fill_lists(alb_voxels *v, alb_error *error)
{
    const size_t n = voxel_count(v);
    for (size_t t = 0; t < v->triangle_count; t++)
        enter(v, t, NULL);
    size_t total = 0;
    for (size_t i = 0; i < n; i++) {
        total += v->starts[i];
        v->starts[i] = (uint32_t)total;
    }
    v->starts[n] = (uint32_t)total;
    if (total > UINT32_MAX)
        return alb_fail(error, ALB_NO_MEMORY, "%zu entries of triangles in voxels are more than can be kept", total);
    if (!(v->lists = alb_allocate(total, sizeof *v->lists, error)))
        return false;
    for (size_t t = v->triangle_count; t-- > 0;)
        enter(v, t, v->lists);
    return true;
}

static alb_vector centre_of(const alb_voxels *v, size_t voxel)
{
    const size_t x = (size_t)v->n[0], y = (size_t)v->n[1];
    const alb_vector at = {(double)(voxel % x) + 0.5, (double)(voxel / x % y) + 0.5, (double)(voxel / (x * y)) + 0.5};
    return alb_add(v->low, alb_times(v->size_mm, at));
}

static bool is_inside(alb_voxels *v, const alb_winding *winding, size_t voxel, size_t voxels)
{
    const double number = alb_winding_number(winding, centre_of(v, voxel));
    if (fabs(number - round(number)) > 0.1)
        v->unsure += voxels;
    return number >= 0.5;
}

// Flooding over faces from a voxel that is ALB_VOXEL_INSIDE and unmarked. The marks are voxels' `clear`.
static size_t flood(alb_voxels *v, size_t seed, size_t *queue)
{
    const size_t x = (size_t)v->n[0], xy = x * (size_t)v->n[1], n = voxel_count(v), steps[3] = {1, x, xy};
    size_t head = 0, tail = 0;
    queue[tail++] = seed;
    v->clear[seed] = 1;
    while (head < tail) {
        const size_t at = queue[head++], place[3] = {at % x, at / x % (size_t)v->n[1], at / xy};
        for (int a = 0; a < 3; a++)
            for (int up = 0; up < 2; up++) {
                if (place[a] == (up ? (size_t)v->n[a] - 1 : 0))
                    continue;
                const size_t next = up ? at + steps[a] : at - steps[a];
                if (next < n && v->state[next] != ALB_VOXEL_SURFACE && !v->clear[next])
                    v->clear[next] = 1, queue[tail++] = next;
            }
    }
    return tail;
}

static bool fill_states(alb_voxels *v, bool closed, alb_error *error)
{
    const size_t n = voxel_count(v);
    alb_winding winding = {0};
    size_t *queue = alb_allocate(n, sizeof *queue, error);
    const bool ok = queue && alb_winding_create(&winding, v->triangles, v->triangle_count, error);
    for (size_t seed = 0; ok && seed < n; seed++) {
        if (v->state[seed] == ALB_VOXEL_SURFACE || v->clear[seed])
            continue;
        const size_t size = flood(v, seed, queue);
        if (closed) { // seed 0 lies in the margin: outside
            const bool inside = seed != 0 && is_inside(v, &winding, seed, size);
            for (size_t i = 0; i < size; i++)
                v->state[queue[i]] = inside ? ALB_VOXEL_INSIDE : ALB_VOXEL_OUTSIDE;
        } else
            for (size_t i = 0; i < size; i++)
                v->state[queue[i]] = is_inside(v, &winding, queue[i], 1) ? ALB_VOXEL_INSIDE : ALB_VOXEL_OUTSIDE;
    }
    alb_winding_free(&winding);
    free(queue);
    return ok;
}

// Chebyshev distance to the nearest voxel of another state, less one: two sweeps, each over the 13 neighbours behind.
static void sweep(alb_voxels *v, int way)
{
    const int nx = v->n[0], ny = v->n[1], nz = v->n[2];
    for (int kk = 0; kk < nz; kk++)
        for (int jj = 0; jj < ny; jj++)
            for (int ii = 0; ii < nx; ii++) {
                const int i = way > 0 ? ii : nx - 1 - ii, j = way > 0 ? jj : ny - 1 - jj,
                          k = way > 0 ? kk : nz - 1 - kk;
                const size_t at = index_of(v, i, j, k);
                int least = v->clear[at];
                for (int d = 0; d < 13 && least > 0; d++) {
                    const int x = i + way * (d % 3 - 1), y = j + way * (d / 3 % 3 - 1), z = k + way * (d / 9 - 1);
                    if (x < 0 || x >= nx || y < 0 || y >= ny || z < 0 || z >= nz)
                        continue;
                    const size_t near = index_of(v, x, y, z);
                    const int reach = v->state[near] != v->state[at] ? 0 : v->clear[near] + 1;
                    least = reach < least ? reach : least;
                }
                v->clear[at] = (unsigned char)least;
            }
}

// Four roundings of numbers as large as the box.
static bool fill_planes(alb_voxels *v, alb_error *error)
{
    const size_t total = v->starts[voxel_count(v)];
    if (!(v->planes = alb_allocate(total, sizeof *v->planes, error)))
        return false;
    v->margin = 4 * 0x1p-23F * (float)(v->n[0] + v->n[1] + v->n[2]);
    for (size_t i = 0; i < total; i++) {
        const alb_vector *t = v->triangles[v->lists[i]],
                         n = alb_unit(alb_cross(alb_sub(t[1], t[0]), alb_sub(t[2], t[0])));
        const float plane[4] = {(float)n.x, (float)n.y, (float)n.z,
                                (float)(alb_dot(n, alb_sub(t[0], v->low)) / v->size_mm)};
        memcpy(v->planes[i], plane, sizeof plane);
    }
    return true;
}

bool alb_voxels_create(alb_voxels *voxels, const alb_vector (*triangles)[3], size_t count, double size_mm, size_t most,
                       bool closed, alb_error *error)
{
    *voxels = (alb_voxels){.triangles = triangles, .triangle_count = count};
    lay_out(voxels, size_mm, most);
    const size_t n = voxel_count(voxels);
    if (!(voxels->state = alb_allocate(n, 1, error)) || !(voxels->clear = alb_allocate(n, 1, error)) ||
        !(voxels->starts = alb_allocate(n + 1, sizeof *voxels->starts, error)) || !fill_lists(voxels, error) ||
        !fill_planes(voxels, error) || !fill_states(voxels, closed, error)) {
        alb_voxels_free(voxels);
        return false;
    }
    for (size_t i = 0; i < n; i++)
        voxels->clear[i] = voxels->state[i] == ALB_VOXEL_SURFACE ? 0 : 255;
    sweep(voxels, 1);
    sweep(voxels, -1);
    return true;
}

void alb_voxels_free(alb_voxels *voxels)
{
    free(voxels->state);
    free(voxels->clear);
    free(voxels->starts);
    free(voxels->lists);
    free(voxels->planes);
    *voxels = (alb_voxels){0};
}

size_t alb_voxels_bytes(const alb_voxels *voxels)
{
    const size_t n = voxel_count(voxels);
    return voxels->starts
               ? n * (2 + sizeof(uint32_t)) + voxels->starts[n] * (sizeof *voxels->lists + sizeof *voxels->planes)
               : 0;
}
