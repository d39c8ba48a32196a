// S' in density form (A_i area, c_j centroid of the exit patch, s(r) the profile, 1/mm^2):
//     B_j = sum_i S'_ji E_i,    S'_ji = (1/A_j) integral_Aj integral_Ai s  ~=  integral_Ai s(|c_j - x|) dA(x)
// The paper's form (Sheng et al. 2014, eq. 8) divides by A_i instead and is right only for patches of one area.
//     opaque patch        S'_jj = reflectance, nothing else
//     self and near       the exact integral over the source triangle (scatter_triangle.c)
//     far                 A_i s(|c_j - c_i|), s from a table of 16,384 entries over the body's diagonal D, linear:
//                         relative error (b D / 16384)^2 / 8 for exp(-b r), 1e-5 at b D = 150
// The centroid rule lacks h^2 / 48 of the Laplacian of s, h the longest edge of the source (an equilateral triangle
// lacks just that). By Gauss's theorem a row whose pairs are far from r on then lacks, of its sum T,
//     h^2 / 48  2 pi r |s'(r)| / T          (bh)^2 / 48  b r exp(-b r) for exp(-b r)
// Near is where that exceeds 5e-4, from one longest edge at least to 2.5 of them at most: beyond bh = 0.26 the upper
// limit holds, and a row sum falls short by 0.6 % at worst (bh = 1), 0.1 % at bh = 0.25.
// Distances are straight lines: exact inside a convex body, too short otherwise (closed, convex: the caller warns).
// Slab: the two faces are the patches whose normal lies within 10 degrees of the direction that carries most area.
// Between the faces the transmission profile acts at the lateral distance; on one face the reflection profile; from and
// to the edge faces the reflection profile at the straight distance, for want of a measurement there. Stops being true
// where the profile's plane geometry does: within a diffusion length of edges, and for solids thinner than that, whose
// row sums then show it by exceeding the profile's total.
#include "render/scatter.h"
#include "base/memory.h"
#include "base/vector_clones.h"
#include <stdlib.h>
#include <string.h>

enum { BLOCK = 256 };
static const double near_edges_least = 1, near_edges_most = 2.5, far_error = 5e-4;

static void triangle_of(alb_vector triangle[3], const alb_patches *patches, size_t patch)
{
    for (int k = 0; k < 3; k++)
        triangle[k] = patches->mesh->vertices[patches->mesh->faces[patch][k]];
}

// Which run of sources the body's patch j belongs to.
static int run_of(const alb_sources *sources, size_t j)
{
    return (j >= sources->starts[1]) + (j >= sources->starts[2]);
}

// The sources that act on a patch of this run by the side's profile: one stretch of them.
static void stretch_of(size_t *from, size_t *to, const alb_sources *sources, int run, alb_side side)
{
    const size_t *starts = sources->starts;
    const bool across = side == ALB_TRANSMISSION;
    *from = run == 0 ? (across ? starts[2] : 0) : run == 1 ? 0 : across ? 0 : starts[1];
    *to = run == 0   ? (across ? starts[3] : starts[2])
          : run == 1 ? (across ? 0 : starts[3])
          : across   ? starts[1]
                     : starts[3];
}

// Where the pair's profile is taken: squared distances of a block of sources from patch j, straight, or lateral between
// the faces of a slab.
typedef struct viewpoint {
    float at[3], across[3]; // centre of j; the faces' normal, or zeros for straight distances
} viewpoint;

static viewpoint viewpoint_of(const alb_scatter_body *body, size_t j, alb_side side)
{
    viewpoint out = {{body->sources.x_mm[j], body->sources.y_mm[j], body->sources.z_mm[j]}, {0}};
    if (side == ALB_TRANSMISSION)
        memcpy(out.across, body->axis, sizeof out.across);
    return out;
}

ALB_VECTOR_CLONES
static void measure_block(float *restrict distance2, const alb_sources *sources, size_t first, size_t count,
                          const viewpoint *from)
{
    const float *restrict xs = sources->x_mm + first, *restrict ys = sources->y_mm + first,
                          *restrict zs = sources->z_mm + first;
    const viewpoint r = *from;
    for (size_t k = 0; k < count; k++) {
        const float x = r.at[0] - xs[k], y = r.at[1] - ys[k], z = r.at[2] - zs[k];
        const float across = x * r.across[0] + y * r.across[1] + z * r.across[2];
        const float squared = x * x + y * y + z * z - across * across;
        distance2[k] = squared > 0 ? squared : 0;
    }
}

static size_t block_size(size_t first, size_t to) { return to - first < BLOCK ? to - first : BLOCK; }

// What the far pairs of a patch come to.
typedef struct far_sums {
    double rows[4], columns[4]; // of kernel times amount where the source, or the patch itself, sets what is far
    size_t near;                // pairs that are near by the source
} far_sums;

// Adds the stretch from .. to of the sources. own_near2 INFINITY: no columns.
ALB_VECTOR_CLONES
static void add_far(far_sums *out, const alb_radial *radial, const alb_sources *sources, const float *near2,
                    float own_near2, size_t from, size_t to, const viewpoint *seen_from)
{
    typedef float float4 __attribute__((vector_size(16)));
    typedef double double4 __attribute__((vector_size(32)));
    double4 rows = {0}, columns = {0};
    float distance2[BLOCK], at[BLOCK];
    int entries[BLOCK];
    size_t near = 0;
    const float per_mm = (float)radial->entries_per_mm;
    for (size_t first = from; first < to; first += BLOCK) {
        const size_t count = block_size(first, to);
        measure_block(distance2, sources, first, count, seen_from);
        for (size_t k = 0; k < count; k++) {
            at[k] = sqrtf(distance2[k]) * per_mm;
            entries[k] = (int)at[k];
        }
        for (size_t k = 0; k < count; k++) {
            float4 low, high;
            double4 amount;
            memcpy(&low, radial->values[entries[k]], sizeof low);
            memcpy(&high, radial->values[entries[k] + 1], sizeof high);
            memcpy(&amount, sources->amounts[first + k], sizeof amount);
            low += (at[k] - (float)entries[k]) * (high - low);
            const double4 share = __builtin_convertvector(low, double4) * amount;
            if (distance2[k] >= near2[first + k])
                rows += share;
            else
                near++;
            if (distance2[k] >= own_near2)
                columns += share;
        }
    }
    for (int c = 0; c < 4; c++)
        out->rows[c] += rows[c], out->columns[c] += columns[c];
    out->near += near;
}

static double longest_edge(const alb_vector t[3])
{
    return fmax(alb_length(alb_sub(t[1], t[0])),
                fmax(alb_length(alb_sub(t[2], t[1])), alb_length(alb_sub(t[0], t[2]))));
}

// The source triangle as exit patch j sees it: for a slab's other face, moved along the axis into the plane of c_j.
static void exact_pair(double weight[3], const alb_scatter_body *body, const alb_patches *patches, alb_side side,
                       size_t j, size_t i)
{
    alb_vector triangle[3], p = patches->centroids[body->patches[j]];
    triangle_of(triangle, patches, body->patches[i]);
    if (side == ALB_TRANSMISSION) {
        const alb_vector axis = {(double)body->axis[0], (double)body->axis[1], (double)body->axis[2]};
        for (int k = 0; k < 3; k++)
            triangle[k] = alb_add(triangle[k], alb_times(alb_dot(axis, alb_sub(p, triangle[k])), axis));
    }
    const alb_vector middle = alb_times(1.0 / 3, alb_add(triangle[0], alb_add(triangle[1], triangle[2])));
    if (alb_length(alb_sub(middle, p)) > 1.25 * longest_edge(triangle))
        alb_scatter_triangle_from_afar(weight, &body->radials[side], triangle, p);
    else
        alb_scatter_triangle(weight, &body->radials[side], triangle, p);
    for (int c = 0; c < 3; c++)
        weight[c] = fmax(0, weight[c]); // quadrature noise where the profile has died away
}

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
        triangle_of(triangle, patches, body->patches[i]);
        const double h = longest_edge(triangle);
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

static bool fill_body(alb_scatter_body *body, const alb_body *from, const alb_patches *patches,
                      const alb_surface *surface, alb_error *error)
{
    *body = (alb_scatter_body){.closed = from->closed, .convex = from->convex};
    if (!(body->patches = alb_allocate(from->count, sizeof *body->patches, error)) ||
        !allocate_sources(&body->sources, from->count, error) || !allocate_sources(&body->lit, from->count, error))
        return false;
    order_patches(body, from, patches, surface->slab);
    const double diagonal_mm = fill_geometry(body, patches);
    for (int side = 0; side <= (surface->slab ? ALB_TRANSMISSION : ALB_REFLECTION); side++)
        if (!alb_radial_create(&body->radials[side], surface->profiles[side], diagonal_mm, error) ||
            !fill_near_limits(body->sources.near2_mm2[side], body, &body->radials[side], patches, error))
            return false;
    return true;
}

// Far sums of all patches from the sources given; with columns, and counting the near pairs, where `sums` is there.
static void far_pairs(double (*out)[3], alb_scatter *sums, const alb_scatter_body *body, const alb_sources *sources)
{
#pragma omp parallel for schedule(dynamic, 16)
    for (size_t j = 0; j < body->sources.count; j++) {
        far_sums found = {.near = 0};
        const size_t patch = body->patches[j];
        for (int side = 0; side < ALB_SIDES; side++) {
            size_t from, to;
            stretch_of(&from, &to, sources, run_of(&body->sources, j), (alb_side)side);
            const viewpoint seen_from = viewpoint_of(body, j, (alb_side)side);
            if (from < to)
                add_far(&found, &body->radials[side], sources, sources->near2_mm2[side],
                        sums ? body->sources.near2_mm2[side][j] : INFINITY, from, to, &seen_from);
        }
        for (int c = 0; c < 3; c++)
            out[patch][c] += found.rows[c];
        for (int c = 0; sums && c < 3; c++)
            sums->column_sums[patch][c] += found.columns[c];
        if (sums)
            sums->row_starts[patch + 1] = found.near - 1; // but for itself
    }
}

// The self-term and the near pairs of exit patch j.
static void fill_near_row(alb_scatter *scatter, const alb_scatter_body *body, const alb_patches *patches, size_t j)
{
    size_t at = scatter->row_starts[body->patches[j]], from, to;
    const int run = run_of(&body->sources, j);
    float distance2[BLOCK];
    double weight[3];
    for (int side = 0; side < ALB_SIDES; side++) {
        stretch_of(&from, &to, &body->sources, run, (alb_side)side);
        const viewpoint seen_from = viewpoint_of(body, j, (alb_side)side);
        for (size_t first = from; first < to; first += BLOCK) {
            const size_t count = block_size(first, to);
            measure_block(distance2, &body->sources, first, count, &seen_from);
            for (size_t k = 0; k < count; k++) {
                const size_t i = first + k;
                if (distance2[k] >= body->sources.near2_mm2[side][i])
                    continue;
                exact_pair(weight, body, patches, (alb_side)side, j, i);
                if (i == j) {
                    memcpy(scatter->local[body->patches[j]], weight, sizeof weight);
                    continue;
                }
                scatter->sources[at] = body->patches[i];
                for (int c = 0; c < 3; c++)
                    scatter->weights[at][c] = (float)weight[c];
                at++;
            }
        }
    }
}

// Local and near terms of the sums.
static void add_near_sums(alb_scatter *scatter, const alb_patches *patches)
{
    for (size_t j = 0; j < scatter->patch_count; j++) {
        for (int c = 0; c < 3; c++) {
            scatter->row_sums[j][c] += scatter->local[j][c];
            scatter->column_sums[j][c] += scatter->local[j][c];
        }
        for (size_t k = scatter->row_starts[j]; k < scatter->row_starts[j + 1]; k++) {
            const size_t i = scatter->sources[k];
            const double ratio = patches->areas_mm2[j] / patches->areas_mm2[i];
            for (int c = 0; c < 3; c++) {
                scatter->row_sums[j][c] += (double)scatter->weights[k][c];
                scatter->column_sums[i][c] += (double)scatter->weights[k][c] * ratio;
            }
        }
    }
}

static bool fill_rows(alb_scatter *scatter, const alb_patches *patches, alb_error *error)
{
    for (size_t b = 0; b < scatter->body_count; b++)
        far_pairs(scatter->row_sums, scatter, &scatter->bodies[b], &scatter->bodies[b].sources);
    for (size_t p = 0; p < patches->count; p++)
        scatter->row_starts[p + 1] += scatter->row_starts[p];
    const size_t pairs = scatter->row_starts[patches->count];
    if (!(scatter->sources = alb_allocate(pairs, sizeof *scatter->sources, error)) ||
        !(scatter->weights = alb_allocate(pairs, sizeof *scatter->weights, error)))
        return false;
    for (size_t b = 0; b < scatter->body_count; b++) {
        const alb_scatter_body *body = &scatter->bodies[b];
#pragma omp parallel for schedule(dynamic, 16)
        for (size_t j = 0; j < body->sources.count; j++)
            fill_near_row(scatter, body, patches, j);
    }
    add_near_sums(scatter, patches);
    return true;
}

bool alb_scatter_create(alb_scatter *scatter, const alb_patches *patches, const uint16_t *materials,
                        const alb_surface *surfaces, alb_error *error)
{
    const size_t n = patches->count;
    bool ok = false;
    alb_bodies found = {0};
    int *labels = alb_allocate(n, sizeof *labels, error);
    *scatter = (alb_scatter){.patch_count = n};
    if (!labels || !(scatter->local = alb_allocate(n, sizeof *scatter->local, error)) ||
        !(scatter->row_sums = alb_allocate(n, sizeof *scatter->row_sums, error)) ||
        !(scatter->column_sums = alb_allocate(n, sizeof *scatter->column_sums, error)) ||
        !(scatter->row_starts = alb_allocate(n + 1, sizeof *scatter->row_starts, error)))
        goto done;
    for (size_t p = 0; p < n; p++) {
        const alb_surface *surface = &surfaces[materials[p]];
        labels[p] = surface->scatters ? materials[p] : -1;
        memcpy(scatter->local[p], surface->reflectance, sizeof scatter->local[p]);
    }
    if (!alb_bodies_find(&found, patches, labels, error) ||
        !(scatter->bodies = alb_allocate(found.count, sizeof *scatter->bodies, error)))
        goto done;
    for (; scatter->body_count < found.count; scatter->body_count++) {
        const alb_body *body = &found.bodies[scatter->body_count];
        if (!fill_body(&scatter->bodies[scatter->body_count], body, patches, &surfaces[materials[body->patches[0]]],
                       error)) {
            scatter->body_count++;
            goto done;
        }
    }
    ok = fill_rows(scatter, patches, error);
    for (size_t b = 0; b < scatter->body_count; b++) // what the products need no longer
        for (int side = 0; side < ALB_SIDES; side++) {
            free(scatter->bodies[b].radials[side].discs);
            scatter->bodies[b].radials[side].discs = NULL;
            scatter->bodies[b].radials[side].profiles = NULL;
        }
done:
    free(labels);
    alb_bodies_free(&found);
    if (!ok)
        alb_scatter_free(scatter);
    return ok;
}

void alb_scatter_free(alb_scatter *scatter)
{
    for (size_t b = 0; b < scatter->body_count; b++) {
        alb_scatter_body *body = &scatter->bodies[b];
        free(body->patches);
        free_sources(&body->sources);
        free_sources(&body->lit);
        for (int side = 0; side < ALB_SIDES; side++)
            alb_radial_free(&body->radials[side]);
    }
    free(scatter->bodies);
    free(scatter->local);
    free(scatter->row_sums);
    free(scatter->column_sums);
    free(scatter->row_starts);
    free(scatter->sources);
    free(scatter->weights);
    *scatter = (alb_scatter){0};
}

// The sources that light falls on, in their runs.
static void take_lit(alb_sources *lit, const alb_scatter_body *body, const double (*irradiance)[3])
{
    const alb_sources *all = &body->sources;
    lit->count = 0;
    for (int run = 0; run < 3; run++) {
        lit->starts[run] = lit->count;
        for (size_t i = all->starts[run]; i < all->starts[run + 1]; i++) {
            const double *light = irradiance[body->patches[i]];
            if (light[0] == 0 && light[1] == 0 && light[2] == 0)
                continue;
            const size_t to = lit->count++;
            lit->x_mm[to] = all->x_mm[i], lit->y_mm[to] = all->y_mm[i], lit->z_mm[to] = all->z_mm[i];
            for (int side = 0; side < ALB_SIDES; side++)
                lit->near2_mm2[side][to] = all->near2_mm2[side][i];
            for (int c = 0; c < 3; c++)
                lit->amounts[to][c] = all->amounts[i][c] * light[c];
        }
    }
    lit->starts[3] = lit->count;
}

void alb_scatter_apply(double (*out)[3], const alb_scatter *scatter, const double (*irradiance)[3])
{
#pragma omp parallel for schedule(static)
    for (size_t j = 0; j < scatter->patch_count; j++) {
        double sum[3];
        for (int c = 0; c < 3; c++)
            sum[c] = scatter->local[j][c] * irradiance[j][c];
        for (size_t k = scatter->row_starts[j]; k < scatter->row_starts[j + 1]; k++)
            for (int c = 0; c < 3; c++)
                sum[c] += (double)scatter->weights[k][c] * irradiance[scatter->sources[k]][c];
        memcpy(out[j], sum, sizeof sum);
    }
    for (size_t b = 0; b < scatter->body_count; b++) {
        alb_scatter_body *body = &scatter->bodies[b];
        take_lit(&body->lit, body, irradiance);
        far_pairs(out, NULL, body, &body->lit);
    }
}

static size_t sources_bytes(const alb_sources *sources)
{
    return sources->starts[3] * (5 * sizeof(float) + sizeof *sources->amounts);
}

size_t alb_scatter_bytes(const alb_scatter *scatter)
{
    const size_t n = scatter->patch_count, pairs = n ? scatter->row_starts[n] : 0;
    size_t bytes = n * (3 * sizeof *scatter->local + sizeof *scatter->row_starts) +
                   pairs * (sizeof *scatter->sources + sizeof *scatter->weights);
    for (size_t b = 0; b < scatter->body_count; b++) {
        const alb_scatter_body *body = &scatter->bodies[b];
        bytes += body->sources.count * sizeof *body->patches + 2 * sources_bytes(&body->sources);
        for (int side = 0; side < ALB_SIDES; side++)
            bytes += body->radials[side].values ? (ALB_SCATTER_TABLE + 2) * sizeof *body->radials[side].values : 0;
    }
    return bytes;
}
