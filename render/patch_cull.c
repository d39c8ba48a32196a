// The level of a point is how many more fronts than backs a ray from it passes to infinity: 0 in the open, 1 inside a
// room, one less inside a body than around it. Light moves where most patches look out, the free level; a point is
// buried where seven rays agree on a lower one. Of a patch that reaches through another surface those of its 64 cells
// are kept whose corners and middle all lie free: no ray starts beyond the surface, and nothing leaks along its foot.
//
// Only patches of which a ray meets a back, or misses in a closed room, are looked at: sound scenes cost 8 rays a
// patch. Stops being true: for open meshes, of which the rays disagree: nothing is culled there; for what reaches
// through a surface by less than an eighth of a patch.
#include "render/patch_cull.h"
#include "base/memory.h"
#include "base/random.h"
#include <stdlib.h>

enum { LOOKS = 8, VOTES = 7, LEVELS = 9 };
static const uint64_t stream = 0x63756c6c; // of the random numbers, its own

static alb_vector direction_of(alb_random *random)
{
    const double z = 2 * alb_random_uniform(random) - 1, angle = 2 * M_PI * alb_random_uniform(random);
    const double side = sqrt(1 - z * z);
    return (alb_vector){side * cos(angle), side * sin(angle), z};
}

static int level_of(const alb_tracer *tracer, alb_vector at, uint64_t patch)
{
    alb_random random = alb_random_at(0, stream, patch);
    return alb_tracer_crossings(tracer, at, direction_of(&random));
}

// The level at which most of about a thousand patches look out.
static int free_level(const alb_patches *patches, const alb_tracer *tracer)
{
    double areas[LEVELS] = {0};
    const size_t step = patches->count / 1000 + 1;
    int best = LEVELS / 2;
    for (size_t p = 0; p < patches->count; p += step) {
        const int level = level_of(tracer, alb_patch_point(patches, p, 4.0 / 9, 0.5), p) + LEVELS / 2;
        areas[level < 0 ? 0 : level >= LEVELS ? LEVELS - 1 : level] += patches->areas_mm2[p];
    }
    for (int k = 0; k < LEVELS; k++)
        best = areas[k] > areas[best] ? k : best;
    return best - LEVELS / 2;
}

static bool is_buried(const alb_tracer *tracer, alb_vector at, int free, uint64_t patch)
{
    alb_random random = alb_random_at(1, stream, patch);
    const int level = alb_tracer_crossings(tracer, at, direction_of(&random));
    for (int k = 1; k < VOTES && level < free; k++)
        if (alb_tracer_crossings(tracer, at, direction_of(&random)) != level)
            return false;
    return level < free;
}

// Whether any of a few rays, two from near each corner and from the middle, meets what one in the open would not.
static bool is_suspect(const alb_patches *patches, const alb_tracer *tracer, int free, size_t patch)
{
    alb_random random = alb_random_at(2, stream, patch);
    const alb_vector middle = patches->centroids[patch];
    alb_vector from[4];
    alb_patch_triangle(from, patches, patch);
    from[3] = middle;
    for (int k = 0; k < LOOKS; k++) {
        const alb_vector foot = alb_add(alb_times(0.98, from[k / 2]), alb_times(0.02, middle));
        const alb_vector at = alb_add(foot, alb_times(patches->offset_mm, patches->normals[patch]));
        const alb_vector d = alb_unit(alb_add(patches->normals[patch], direction_of(&random)));
        alb_hit hit;
        if (alb_tracer_closest(&hit, tracer, at, d) ? !hit.front : free > 0)
            return true;
    }
    return false;
}

static uint64_t free_cells_of(const alb_patches *patches, const alb_tracer *tracer, int free, size_t patch)
{
    const alb_vector up = alb_times(patches->offset_mm, patches->normals[patch]);
    uint64_t cells = 0;
    for (int cell = 0; cell < 64; cell++) {
        alb_vector t[3];
        alb_patch_cell(t, patches, patch, cell);
        const alb_vector middle = alb_times(1.0 / 3, alb_add(t[0], alb_add(t[1], t[2])));
        bool buried = is_buried(tracer, alb_add(middle, up), free, patch);
        for (int k = 0; k < 3 && !buried; k++) // the corners drawn in a little: a corner may lie on the other surface
            buried =
                is_buried(tracer, alb_add(alb_add(alb_times(0.99, t[k]), alb_times(0.01, middle)), up), free, patch);
        cells |= (uint64_t)!buried << cell;
    }
    return cells;
}

bool alb_patches_cull(alb_patches *patches, const alb_tracer *tracer, alb_error *error)
{
    const size_t n = patches->count;
    uint64_t *cells = alb_allocate(n, sizeof *cells, error);
    if (!cells)
        return false;
    const int free_at = free_level(patches, tracer);
#pragma omp parallel for schedule(dynamic, 64)
    for (size_t p = 0; p < n; p++)
        cells[p] = is_suspect(patches, tracer, free_at, p) ? free_cells_of(patches, tracer, free_at, p) : UINT64_MAX;
    for (size_t p = 0; p < n; p++)
        if (cells[p] != UINT64_MAX) {
            patches->areas_mm2[p] *= fmax(__builtin_popcountll(cells[p]) / 64.0, 1e-9);
            patches->culled++;
        }
    if (patches->culled)
        patches->free_cells = cells;
    else
        free(cells);
    return true;
}
