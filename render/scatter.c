// S' in density form (A_i area, c_j centroid of the exit patch, s(r) the profile, 1/mm^2):
//     B_j = sum_i S'_ji E_i,    S'_ji = (1/A_j) integral_Aj integral_Ai s  ~=  integral_Ai s(|c_j - x|) dA(x)
// The paper's form (Sheng et al. 2014, eq. 8) divides by A_i instead and is right only for patches of one area.
//     opaque patch        S'_jj = reflectance, nothing else
//     self and near       the exact integral over the source triangle (scatter_triangle.c); near: the centroids are
//     less than
//                         2.5 longest edges of the source apart
//     far                 A_i s(|c_j - c_i|), s from a table of 16,384 entries over the body's diagonal D, linear:
//     relative
//                         error (b D / 16384)^2 / 8 for exp(-b r), 1e-5 at b D = 150. The centroid rule itself lacks
//                         (b h)^2 / 48 of each pair, h the longest edge; with the share (1 + 2.5 b h) exp(-2.5 b h)
//                         that is far, a row sum falls short by 0.6 % at worst (b h = 1), 0.1 % at b h = 0.25
// Distances are straight lines: exact inside a convex body, too short otherwise (closed, convex: the caller warns).
// Slab: the two faces are the patches whose normal lies within 10 degrees of the direction that carries most area.
// Between the faces the transmission profile acts at the lateral distance; on one face the reflection profile; from and
// to the edge faces the reflection profile at the straight distance, for want of a measurement there. Stops being true
// where the profile's plane geometry does: within a diffusion length of edges, and for solids thinner than that, whose
// row sums then show it by exceeding the profile's total.
#include "render/scatter.h"
#include "base/memory.h"
#include <stdlib.h>
#include <string.h>

static const double near_edges = 2.5;

static void triangle_of(alb_vector triangle[3], const alb_patches *patches, size_t patch)
{
    for (int k = 0; k < 3; k++)
        triangle[k] = patches->mesh->vertices[patches->mesh->faces[patch][k]];
}

static alb_side side_between(const alb_scatter_body *body, size_t j, size_t i)
{
    return body->sides[j] * body->sides[i] < 0 ? ALB_TRANSMISSION : ALB_REFLECTION;
}

// Squared distance at which the profile of the pair is taken: straight, or lateral between the faces of a slab.
static inline float distance2_between(const alb_scatter_body *body, size_t j, size_t i)
{
    const float x = body->centres[j][0] - body->centres[i][0], y = body->centres[j][1] - body->centres[i][1],
                z = body->centres[j][2] - body->centres[i][2];
    const float distance2 = x * x + y * y + z * z;
    if (body->sides[j] * body->sides[i] >= 0)
        return distance2;
    const float across = x * body->axis[0] + y * body->axis[1] + z * body->axis[2];
    return fmaxf(0, distance2 - across * across);
}

// out[c] += sum over the far partners of j of kernel times body->amounts. By source: pairs are near by the partner's
// size, as a row of S' needs it; else by j's own, as a column needs it. The kernel itself is symmetric.
static void add_far(double out[3], const alb_scatter_body *body, size_t j, bool by_source)
{
    double sum[3] = {0};
    for (size_t i = 0; i < body->count; i++) {
        const float distance2 = distance2_between(body, j, i);
        if (distance2 < body->near2_mm2[by_source ? i : j])
            continue;
        const float at = sqrtf(distance2) * body->entries_per_mm;
        const int entry = (int)at;
        const float between = at - (float)entry, *low = body->tables[side_between(body, j, i)][entry], *high = low + 3;
        for (int c = 0; c < 3; c++)
            sum[c] += (double)(low[c] + between * (high[c] - low[c])) * body->amounts[i][c];
    }
    for (int c = 0; c < 3; c++)
        out[c] += sum[c];
}

// The source triangle as exit patch j sees it: for a slab's other face, moved along the axis into the plane of c_j.
static void exact_pair(double weight[3], const alb_scatter_body *body, const alb_surface *surface,
                       const alb_patches *patches, size_t j, size_t i)
{
    const alb_side side = side_between(body, j, i);
    alb_vector triangle[3], p = patches->centroids[body->patches[j]];
    triangle_of(triangle, patches, body->patches[i]);
    if (side == ALB_TRANSMISSION) {
        const alb_vector axis = {(double)body->axis[0], (double)body->axis[1], (double)body->axis[2]};
        for (int k = 0; k < 3; k++)
            triangle[k] = alb_add(triangle[k], alb_times(alb_dot(axis, alb_sub(p, triangle[k])), axis));
    }
    if (distance2_between(body, j, i) > 0.25f * body->near2_mm2[i]) // 1.25 longest edges
        alb_scatter_triangle_from_afar(weight, surface->profiles[side], triangle, p);
    else
        alb_scatter_triangle(weight, surface->profiles[side], triangle, p);
    for (int c = 0; c < 3; c++)
        weight[c] = fmax(0, weight[c]); // quadrature noise where the profile has died away
}

// The direction that carries most area: power iteration on sum A n n^T.
static alb_vector main_normal(const alb_scatter_body *body, const alb_patches *patches)
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

static void fill_slab(alb_scatter_body *body, const alb_patches *patches)
{
    const alb_vector axis = main_normal(body, patches);
    const double coordinates[3] = {axis.x, axis.y, axis.z};
    for (int k = 0; k < 3; k++)
        body->axis[k] = (float)coordinates[k];
    for (size_t i = 0; i < body->count; i++) {
        const double cosine = alb_dot(axis, patches->normals[body->patches[i]]);
        body->sides[i] = (signed char)(cosine > 0.985 ? 1 : cosine < -0.985 ? -1 : 0);
    }
}

// Centres, areas, near limits and the diagonal of the body's bounds.
static double fill_geometry(alb_scatter_body *body, const alb_patches *patches)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < body->count; i++) {
        const alb_vector c = patches->centroids[body->patches[i]];
        const double at[3] = {c.x, c.y, c.z};
        for (int k = 0; k < 3; k++)
            low[k] = fmin(low[k], at[k]), high[k] = fmax(high[k], at[k]);
    }
    for (size_t i = 0; i < body->count; i++) {
        alb_vector t[3], c = patches->centroids[body->patches[i]];
        triangle_of(t, patches, body->patches[i]);
        const double at[3] = {c.x, c.y, c.z};
        for (int k = 0; k < 3; k++)
            body->centres[i][k] = (float)(at[k] - 0.5 * (low[k] + high[k]));
        const double longest = fmax(alb_length(alb_sub(t[1], t[0])),
                                    fmax(alb_length(alb_sub(t[2], t[1])), alb_length(alb_sub(t[0], t[2]))));
        body->areas_mm2[i] = (float)patches->areas_mm2[body->patches[i]];
        body->near2_mm2[i] = (float)(near_edges * near_edges * longest * longest);
    }
    return sqrt(pow(high[0] - low[0], 2) + pow(high[1] - low[1], 2) + pow(high[2] - low[2], 2));
}

static bool fill_tables(alb_scatter_body *body, const alb_surface *surface, double diagonal_mm, alb_error *error)
{
    body->entries_per_mm = (float)(ALB_SCATTER_TABLE / fmax(1.0001 * diagonal_mm, 1e-9));
    for (int side = 0; side <= (surface->slab ? ALB_TRANSMISSION : ALB_REFLECTION); side++) {
        if (!(body->tables[side] = alb_allocate(ALB_SCATTER_TABLE + 2, sizeof *body->tables[side], error)))
            return false;
        for (size_t k = 0; k < ALB_SCATTER_TABLE + 2; k++)
            for (int c = 0; c < 3; c++)
                body->tables[side][k][c] =
                    (float)alb_profile_value(&surface->profiles[side][c], (double)k / (double)body->entries_per_mm);
    }
    return true;
}

static bool fill_body(alb_scatter_body *body, const alb_body *from, const alb_patches *patches,
                      const alb_surface *surface, alb_error *error)
{
    const size_t n = from->count;
    *body = (alb_scatter_body){.count = n, .closed = from->closed, .convex = from->convex};
    if (!(body->patches = alb_allocate(n, sizeof *body->patches, error)) ||
        !(body->centres = alb_allocate(n, sizeof *body->centres, error)) ||
        !(body->areas_mm2 = alb_allocate(n, sizeof *body->areas_mm2, error)) ||
        !(body->near2_mm2 = alb_allocate(n, sizeof *body->near2_mm2, error)) ||
        !(body->amounts = alb_allocate(n, sizeof *body->amounts, error)) ||
        !(body->sides = alb_allocate(n, sizeof *body->sides, error)))
        return false;
    memcpy(body->patches, from->patches, n * sizeof *body->patches);
    const double diagonal_mm = fill_geometry(body, patches);
    if (surface->slab)
        fill_slab(body, patches);
    return fill_tables(body, surface, diagonal_mm, error);
}

// Number of near partners of every exit patch, into starts[patch + 1].
static void count_near(size_t *starts, const alb_scatter_body *body)
{
#pragma omp parallel for schedule(dynamic, 16)
    for (size_t j = 0; j < body->count; j++) {
        size_t count = 0;
        for (size_t i = 0; i < body->count; i++)
            count += i != j && distance2_between(body, j, i) < body->near2_mm2[i];
        starts[body->patches[j] + 1] = count;
    }
}

static void fill_near(alb_scatter *scatter, const alb_scatter_body *body, const alb_surface *surface,
                      const alb_patches *patches)
{
#pragma omp parallel for schedule(dynamic, 16)
    for (size_t j = 0; j < body->count; j++) {
        size_t at = scatter->row_starts[body->patches[j]];
        exact_pair(scatter->local[body->patches[j]], body, surface, patches, j, j);
        for (size_t i = 0; i < body->count; i++) {
            if (i == j || distance2_between(body, j, i) >= body->near2_mm2[i])
                continue;
            double weight[3];
            exact_pair(weight, body, surface, patches, j, i);
            scatter->sources[at] = body->patches[i];
            for (int c = 0; c < 3; c++)
                scatter->weights[at][c] = (float)weight[c];
            at++;
        }
    }
}

static bool fill_rows(alb_scatter *scatter, const alb_patches *patches, const uint16_t *materials,
                      const alb_surface *surfaces, alb_error *error)
{
    for (size_t b = 0; b < scatter->body_count; b++)
        count_near(scatter->row_starts, &scatter->bodies[b]);
    for (size_t p = 0; p < patches->count; p++)
        scatter->row_starts[p + 1] += scatter->row_starts[p];
    const size_t pairs = scatter->row_starts[patches->count];
    if (!(scatter->sources = alb_allocate(pairs, sizeof *scatter->sources, error)) ||
        !(scatter->weights = alb_allocate(pairs, sizeof *scatter->weights, error)))
        return false;
    for (size_t b = 0; b < scatter->body_count; b++)
        fill_near(scatter, &scatter->bodies[b], &surfaces[materials[scatter->bodies[b].patches[0]]], patches);
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
    ok = fill_rows(scatter, patches, materials, surfaces, error);
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
        free(body->centres);
        free(body->areas_mm2);
        free(body->near2_mm2);
        free(body->sides);
        free(body->amounts);
        for (int side = 0; side < ALB_SIDES; side++)
            free(body->tables[side]);
    }
    free(scatter->bodies);
    free(scatter->local);
    free(scatter->row_starts);
    free(scatter->sources);
    free(scatter->weights);
    *scatter = (alb_scatter){0};
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
        const alb_scatter_body *body = &scatter->bodies[b];
        for (size_t i = 0; i < body->count; i++)
            for (int c = 0; c < 3; c++)
                body->amounts[i][c] = (double)body->areas_mm2[i] * irradiance[body->patches[i]][c];
#pragma omp parallel for schedule(dynamic, 16)
        for (size_t j = 0; j < body->count; j++)
            add_far(out[body->patches[j]], body, j, true);
    }
}

void alb_scatter_column_sums(double (*out)[3], const alb_scatter *scatter, const alb_patches *patches)
{
    memcpy(out, scatter->local, scatter->patch_count * sizeof *out);
    for (size_t j = 0; j < scatter->patch_count; j++)
        for (size_t k = scatter->row_starts[j]; k < scatter->row_starts[j + 1]; k++)
            for (int c = 0; c < 3; c++)
                out[scatter->sources[k]][c] +=
                    (double)scatter->weights[k][c] * patches->areas_mm2[j] / patches->areas_mm2[scatter->sources[k]];
    for (size_t b = 0; b < scatter->body_count; b++) {
        const alb_scatter_body *body = &scatter->bodies[b];
        for (size_t j = 0; j < body->count; j++)
            for (int c = 0; c < 3; c++)
                body->amounts[j][c] = (double)body->areas_mm2[j]; // S'_ji A_j / A_i = s A_j
#pragma omp parallel for schedule(dynamic, 16)
        for (size_t i = 0; i < body->count; i++)
            add_far(out[body->patches[i]], body, i, false);
    }
}

size_t alb_scatter_bytes(const alb_scatter *scatter)
{
    const size_t n = scatter->patch_count, pairs = n ? scatter->row_starts[n] : 0;
    size_t bytes = n * (sizeof *scatter->local + sizeof *scatter->row_starts) +
                   pairs * (sizeof *scatter->sources + sizeof *scatter->weights);
    for (size_t b = 0; b < scatter->body_count; b++) {
        const alb_scatter_body *body = &scatter->bodies[b];
        bytes += body->count *
                 (sizeof *body->patches + sizeof *body->centres + sizeof *body->amounts + 2 * sizeof(float) + 1);
        for (int side = 0; side < ALB_SIDES; side++)
            bytes += body->tables[side] ? (ALB_SCATTER_TABLE + 2) * sizeof *body->tables[side] : 0;
    }
    return bytes;
}
