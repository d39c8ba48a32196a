// One scattering body made ready: its patches side by side as sources, the table of its profile, and how near a source
// must be to be integrated exactly (scatter.c says what for).
// The centroid rule lacks h^2 / 48 of the Laplacian of s, h the longest edge of the source (an equilateral triangle
// lacks just that). By Gauss's theorem a row whose pairs are far from r on then lacks, of its sum T,
//     h^2 / 48  2 pi r |s'(r)| / T          (bh)^2 / 48  b r exp(-b r) for exp(-b r)
// Near is where that exceeds 5e-4, from one longest edge at least to 2.5 of them at most: beyond bh = 0.26 the upper
// limit holds, and a row sum falls short by 0.6 % at worst (bh = 1), 0.1 % at bh = 0.25.
// Slab: the two faces are the patches whose normal lies within 10 degrees of the direction that carries most area.
#include "render/scatter_body.h"
#include "base/memory.h"
#include <stdlib.h>

static const double near_edges_least = 1, near_edges_most = 2.5, far_error = 5e-4;

// The direction that carries most area: power iteration on sum A n n^T.
static alb_vector main_normal(const alb_body *body, const alb_patches *patches)
{
    double m[3][3] = {{0}};
    alb_vector axis = {0.48, 0.6, 0.64};
    for (size_t i = 0; i < body->count; i++) {
        const alb_vector n = patches->normals[body->patches[i]];
        const double v[3] = {n.x, n.y, n.z}, area = patches->areas_mm2[body->patches[i]];
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++)
                m[r][c] += area * v[r] * v[c];
    }
    for (int step = 0; step < 200; step++)
        axis = alb_unit((alb_vector){m[0][0] * axis.x + m[0][1] * axis.y + m[0][2] * axis.z,
                                     m[1][0] * axis.x + m[1][1] * axis.y + m[1][2] * axis.z,
                                     m[2][0] * axis.x + m[2][1] * axis.y + m[2][2] * axis.z});
    return axis;
}

// The three runs, each in the order of the body.
static void order_patches(alb_scatter_body *body, const alb_body *from, const alb_patches *patches, bool slab)
{
    const alb_vector axis = slab ? main_normal(from, patches) : (alb_vector){0};
    body->axis[0] = (float)axis.x, body->axis[1] = (float)axis.y, body->axis[2] = (float)axis.z;
    size_t count = 0;
    for (int run = 0; run < 3; run++) {
        body->sources.starts[run] = count;
        for (size_t i = 0; i < from->count; i++) {
            const double cosine = alb_dot(axis, patches->normals[from->patches[i]]);
            if (run == (cosine > 0.985 ? 0 : cosine < -0.985 ? 2 : 1))
                body->patches[count++] = from->patches[i];
        }
    }
    body->sources.starts[3] = count;
}

// Centres, areas and the diagonal of the body's bounds.
static double fill_geometry(alb_scatter_body *body, const alb_patches *patches)
{
    alb_sources *sources = &body->sources;
    alb_vector low = {INFINITY, INFINITY, INFINITY}, high = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < sources->count; i++) {
        const alb_vector c = patches->centroids[body->patches[i]];
        low = (alb_vector){fmin(low.x, c.x), fmin(low.y, c.y), fmin(low.z, c.z)};
        high = (alb_vector){fmax(high.x, c.x), fmax(high.y, c.y), fmax(high.z, c.z)};
    }
    const alb_vector middle = alb_times(0.5, alb_add(low, high));
    for (size_t i = 0; i < sources->count; i++) {
        const alb_vector c = alb_sub(patches->centroids[body->patches[i]], middle);
        sources->x_mm[i] = (float)c.x, sources->y_mm[i] = (float)c.y, sources->z_mm[i] = (float)c.z;
        for (int k = 0; k < 3; k++)
            sources->amounts[i][k] = patches->areas_mm2[body->patches[i]];
    }
    return alb_length(alb_sub(high, low));
}

// 2 pi r |s'(r)| / T at the table's entries, the largest of the channels, and made to fall: what lies further out
// counts too.
static void fill_lacks(double lacks[ALB_SCATTER_TABLE], const alb_radial *radial)
{
    lacks[ALB_SCATTER_TABLE - 1] = 0;
    for (int k = ALB_SCATTER_TABLE - 2; k >= 0; k--) {
        lacks[k] = lacks[k + 1];
        for (int c = 0; c < 3; c++) {
            const double total = alb_profile_total(&radial->profiles[c]), step = 1 / radial->entries_per_mm;
            const double change = (double)radial->values[k + 2][c] - (double)radial->values[k][c];
            if (total > 0)
                lacks[k] = fmax(lacks[k], 2 * M_PI * (k + 1) * step * fabs(change / (2 * step)) / total);
        }
    }
}

// Within which squared distance each source is integrated exactly.
static bool fill_near_limits(float *near2_mm2, const alb_scatter_body *body, const alb_radial *radial,
                             const alb_patches *patches, alb_error *error)
{
    double *lacks = alb_allocate(ALB_SCATTER_TABLE, sizeof *lacks, error);
    if (!lacks)
        return false;
    fill_lacks(lacks, radial);
    for (size_t i = 0; i < body->sources.count; i++) {
        alb_vector triangle[3];
        alb_patch_triangle(triangle, patches, body->patches[i]);
        const double h = alb_longest_edge(triangle);
        int low = 0, high = ALB_SCATTER_TABLE - 1; // first entry where h^2 / 48 lacks is small enough
        while (low < high) {
            const int middle = (low + high) / 2;
            if (h * h / 48 * lacks[middle] > far_error)
                low = middle + 1;
            else
                high = middle;
        }
        const double near = fmin(fmax((low + 1) / radial->entries_per_mm, near_edges_least * h), near_edges_most * h);
        near2_mm2[i] = (float)(near * near);
    }
    free(lacks);
    return true;
}

static bool allocate_sources(alb_sources *sources, size_t n, alb_error *error)
{
    sources->count = n;
    return (sources->x_mm = alb_allocate(n, sizeof *sources->x_mm, error)) &&
           (sources->y_mm = alb_allocate(n, sizeof *sources->y_mm, error)) &&
           (sources->z_mm = alb_allocate(n, sizeof *sources->z_mm, error)) &&
           (sources->near2_mm2[ALB_REFLECTION] = alb_allocate(n, sizeof(float), error)) &&
           (sources->near2_mm2[ALB_TRANSMISSION] = alb_allocate(n, sizeof(float), error)) &&
           (sources->amounts = alb_allocate(n, sizeof *sources->amounts, error));
}

static void free_sources(alb_sources *sources)
{
    free(sources->x_mm);
    free(sources->y_mm);
    free(sources->z_mm);
    for (int side = 0; side < ALB_SIDES; side++)
        free(sources->near2_mm2[side]);
    free(sources->amounts);
}

void alb_scatter_body_free(alb_scatter_body *body)
{
    free(body->patches);
    free_sources(&body->sources);
    free_sources(&body->lit);
    for (int side = 0; side < ALB_SIDES; side++)
        alb_radial_free(&body->radials[side]);
    *body = (alb_scatter_body){0};
}

bool alb_scatter_body_create(alb_scatter_body *body, const alb_body *from, const alb_patches *patches,
                             const alb_surface *surface, alb_error *error)
{
    *body = (alb_scatter_body){.closed = from->closed, .convex = from->convex};
    bool ok = (body->patches = alb_allocate(from->count, sizeof *body->patches, error)) &&
              allocate_sources(&body->sources, from->count, error) && allocate_sources(&body->lit, from->count, error);
    double diagonal_mm = 0;
    if (ok) {
        order_patches(body, from, patches, surface->slab);
        diagonal_mm = fill_geometry(body, patches);
    }
    for (int side = 0; ok && side <= (surface->slab ? ALB_TRANSMISSION : ALB_REFLECTION); side++)
        ok = alb_radial_create(&body->radials[side], surface->profiles[side], diagonal_mm, error) &&
             fill_near_limits(body->sources.near2_mm2[side], body, &body->radials[side], patches, error);
    if (!ok)
        alb_scatter_body_free(body);
    return ok;
}
