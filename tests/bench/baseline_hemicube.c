// Pixel (x, y) of the top, at height 1: dF = dA / (pi (x^2 + y^2 + 1)^2). Pixel (y, z) of a side, at distance 1:
// dF = z dA / (pi (y^2 + z^2 + 1)^2), z > 0 (Cohen & Greenberg 1985). They sum to 1 but for the pixels' size: they are
// scaled to do so.
#include "baseline_hemicube.h"
#include "base/memory.h"
#include <stdlib.h>

bool hemicube_create(hemicube *cube, int side, double threshold, alb_error *error)
{
    *cube = (hemicube){.side = side, .threshold = threshold, .count = 3 * (size_t)side * (size_t)side};
    if (!(cube->directions = alb_allocate(cube->count, sizeof *cube->directions, error)) ||
        !(cube->share = alb_allocate(cube->count, sizeof *cube->share, error))) {
        hemicube_free(cube);
        return false;
    }
    const double pixel = 2.0 / side;
    size_t n = 0;
    double sum = 0;
    for (int face = 0; face < 5; face++)
        for (int j = face ? side / 2 : 0; j < side; j++) // of the sides the upper half
            for (int i = 0; i < side; i++) {
                const double a = (i + 0.5) * pixel - 1, b = (j + 0.5) * pixel - 1, r2 = a * a + b * b + 1;
                const double at[5][3] = {{a, b, 1}, {1, a, b}, {-1, a, b}, {a, 1, b}, {a, -1, b}};
                cube->share[n] = pixel * pixel * (face ? b : 1) / (M_PI * r2 * r2);
                sum += cube->share[n];
                for (int k = 0; k < 3; k++)
                    cube->directions[n][k] = at[face][k] / sqrt(r2);
                n++;
            }
    for (size_t k = 0; k < n; k++)
        cube->share[k] /= sum;
    cube->count = n;
    return true;
}

void hemicube_free(hemicube *cube)
{
    free(cube->directions);
    free(cube->share);
    *cube = (hemicube){0};
}

static int by_index(const void *a, const void *b)
{
    const hemicube_entry *p = a, *q = b;
    return p->patch < q->patch ? -1 : p->patch > q->patch;
}

size_t hemicube_row(hemicube_entry *row, const hemicube *cube, const alb_patches *patches, const alb_tracer *tracer,
                    size_t patch)
{
    alb_vector t, b;
    const alb_vector n = patches->normals[patch];
    const alb_vector from = alb_add(patches->centroids[patch], alb_times(patches->offset_mm, n));
    size_t hits = 0, kept = 0;
    alb_tangents(&t, &b, n);
    for (size_t k = 0; k < cube->count; k++) {
        const double *d = cube->directions[k];
        alb_hit hit;
        if (!alb_tracer_closest(&hit, tracer, from,
                                alb_add(alb_times(d[0], t), alb_add(alb_times(d[1], b), alb_times(d[2], n)))) ||
            !hit.front)
            continue;
        row[hits++] = (hemicube_entry){hit.face, (float)cube->share[k]};
    }
    qsort(row, hits, sizeof *row, by_index);
    for (size_t k = 0; k < hits;) {
        double sum = 0;
        const uint32_t face = row[k].patch;
        for (; k < hits && row[k].patch == face; k++)
            sum += (double)row[k].value;
        if (sum >= cube->threshold)
            row[kept++] = (hemicube_entry){face, (float)sum};
    }
    return kept;
}
