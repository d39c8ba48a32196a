// Blocks of 256 rows: what a block touches stays in the first cache while it is used, so that k inner products read
// each of their k + 1 vectors once. Rows of three doubles are walked twelve numbers at a time, which is four rows and
// three vector registers: channel = position mod 3.
#include "render/radiosity_vectors.h"
#include "base/memory.h"
#include "base/vector_clones.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ROWS = 256, STEP = 12 };

bool alb_space_create(alb_space *space, const double *areas_mm2, size_t count, alb_error *error)
{
    *space = (alb_space){.count = count, .areas_mm2 = areas_mm2};
    for (size_t i = 0; i < count; i++)
        space->total_mm2 += areas_mm2[i];
    return (space->partial = alb_allocate((count + ROWS - 1) / ROWS, sizeof *space->partial, error));
}

void alb_space_free(alb_space *space)
{
    free(space->partial);
    *space = (alb_space){0};
}

static size_t blocks_of(const alb_space *space) { return (space->count + ROWS - 1) / ROWS; }

// Below this many rows a second thread costs more than it brings.
static bool is_large(const alb_space *space) { return space->count > 8192; }

static size_t rows_of(const alb_space *space, size_t block)
{
    const size_t left = space->count - block * ROWS;
    return left < ROWS ? left : ROWS;
}

// Rows times their area; rows after the last up to a whole step are zero.
static void weigh(double (*restrict out)[3], const double (*restrict a)[3], const double *restrict areas, size_t rows)
{
    for (size_t i = 0; i < rows; i++)
        for (int c = 0; c < 3; c++)
            out[i][c] = areas[i] * a[i][c];
}

ALB_VECTOR_CLONES
static void dot_block(double out[3], const double *restrict a, const double *restrict b, size_t numbers)
{
    double sums[STEP] = {0};
    size_t k = 0;
    for (; k + STEP <= numbers; k += STEP)
        for (int l = 0; l < STEP; l++)
            sums[l] += a[k + (size_t)l] * b[k + (size_t)l];
    for (int l = 0; k < numbers; k++, l++)
        sums[l] += a[k] * b[k];
    for (int c = 0; c < 3; c++)
        out[c] = (sums[c] + sums[c + 3]) + (sums[c + 6] + sums[c + 9]);
}

ALB_VECTOR_CLONES
static void add_block(double *restrict a, const double factor[3], const double *restrict b, size_t numbers)
{
    double factors[STEP];
    for (int l = 0; l < STEP; l++)
        factors[l] = factor[l % 3];
    size_t k = 0;
    for (; k + STEP <= numbers; k += STEP)
        for (int l = 0; l < STEP; l++)
            a[k + (size_t)l] += factors[l] * b[k + (size_t)l];
    for (int l = 0; k < numbers; k++, l++)
        a[k] += factors[l] * b[k];
}

// Adds up the blocks' partial sums and divides by the area.
static void gather(double (*out)[3], const alb_space *space, int count)
{
    memset(out, 0, (size_t)count * sizeof *out);
    for (size_t block = 0; block < blocks_of(space); block++)
        for (int k = 0; k < count; k++)
            for (int c = 0; c < 3; c++)
                out[k][c] += space->partial[block][k][c];
    for (int k = 0; space->total_mm2 > 0 && k < count; k++)
        for (int c = 0; c < 3; c++)
            out[k][c] /= space->total_mm2;
}

void alb_space_dots(double (*out)[3], const alb_space *space, const alb_rgb *a, alb_rgb *const *b, int count)
{
#pragma omp parallel for schedule(static) if (is_large(space))
    for (size_t block = 0; block < blocks_of(space); block++) {
        double weighed[ROWS][3];
        const size_t first = block * ROWS, rows = rows_of(space, block);
        weigh(weighed, a + first, space->areas_mm2 + first, rows);
        for (int k = 0; k < count; k++)
            dot_block(space->partial[block][k], weighed[0], b[k][first], 3 * rows);
    }
    gather(out, space, count);
}

static void root(double out[3])
{
    for (int c = 0; c < 3; c++)
        out[c] = sqrt(out[c]);
}

// Squares of a block's rows, times weights (NULL: ones), into its partial sums.
static void square_block(const alb_space *space, size_t block, const alb_rgb *a, const alb_rgb *weights)
{
    double weighed[ROWS][3];
    const size_t first = block * ROWS, rows = rows_of(space, block);
    weigh(weighed, a + first, space->areas_mm2 + first, rows);
    for (size_t i = 0; weights && i < rows; i++)
        for (int c = 0; c < 3; c++)
            weighed[i][c] *= weights[first + i][c];
    dot_block(space->partial[block][0], weighed[0], a[first], 3 * rows);
}

void alb_space_add(double norm[3], const alb_space *space, alb_rgb *a, const double (*factors)[3], alb_rgb *const *b,
                   int count)
{
#pragma omp parallel for schedule(static) if (is_large(space))
    for (size_t block = 0; block < blocks_of(space); block++) {
        const size_t first = block * ROWS, rows = rows_of(space, block);
        for (int k = 0; k < count; k++)
            add_block(a[first], factors[k], b[k][first], 3 * rows);
        if (norm)
            square_block(space, block, (const alb_rgb *)a, NULL);
    }
    if (norm) {
        gather((double(*)[3])norm, space, 1);
        root(norm);
    }
}

void alb_space_scale(const alb_space *space, alb_rgb *a, const double factor[3])
{
#pragma omp parallel for schedule(static) if (is_large(space))
    for (size_t i = 0; i < space->count; i++)
        for (int c = 0; c < 3; c++)
            a[i][c] *= factor[c];
}

static void mean_block(const alb_space *space, size_t block, int at, const alb_rgb *a)
{
    double *sums = space->partial[block][at];
    const size_t first = block * ROWS, rows = rows_of(space, block);
    sums[0] = sums[1] = sums[2] = 0;
    for (size_t i = first; i < first + rows; i++)
        for (int c = 0; c < 3; c++)
            sums[c] += space->areas_mm2[i] * fabs(a[i][c]);
}

void alb_space_residual(double norm[3], double mean[3], const alb_space *space, alb_rgb *r, const alb_rgb *right,
                        const alb_rgb *x)
{
    double sums[2][3];
#pragma omp parallel for schedule(static) if (is_large(space))
    for (size_t block = 0; block < blocks_of(space); block++) {
        const size_t first = block * ROWS, rows = rows_of(space, block);
        for (size_t i = first; i < first + rows; i++)
            for (int c = 0; c < 3; c++)
                r[i][c] += right[i][c] - x[i][c];
        square_block(space, block, (const alb_rgb *)r, NULL);
        mean_block(space, block, 1, (const alb_rgb *)r);
    }
    gather(sums, space, 2);
    root(sums[0]);
    memcpy(norm, sums[0], sizeof sums[0]);
    memcpy(mean, sums[1], sizeof sums[1]);
}

void alb_space_norm(double out[3], const alb_space *space, const alb_rgb *a)
{
    alb_space_weighted_norm(out, space, a, NULL);
}

void alb_space_weighted_norm(double out[3], const alb_space *space, const alb_rgb *a, const alb_rgb *weights)
{
#pragma omp parallel for schedule(static) if (is_large(space))
    for (size_t block = 0; block < blocks_of(space); block++)
        square_block(space, block, a, weights);
    gather((double(*)[3])out, space, 1);
    root(out);
}

void alb_space_mean(double out[3], const alb_space *space, const alb_rgb *a)
{
#pragma omp parallel for schedule(static) if (is_large(space))
    for (size_t block = 0; block < blocks_of(space); block++)
        mean_block(space, block, 0, a);
    gather((double(*)[3])out, space, 1);
}

void alb_space_orthonormalise(const alb_space *space, alb_rgb *const *vectors, alb_rgb *const *images, int k,
                              double least)
{
    double dots[ALB_SPACE_VECTORS][3], before[3] = {0}, length[3], factor[3];
    if (least > 0)
        alb_space_norm(before, space, (const alb_rgb *)vectors[k]);
    for (int round = 0; round < 2; round++)
        for (int first = 0; first < k; first += ALB_SPACE_VECTORS) {
            const int count = k - first < ALB_SPACE_VECTORS ? k - first : ALB_SPACE_VECTORS;
            alb_space_dots(dots, space, (const alb_rgb *)vectors[k], vectors + first, count);
            for (int i = 0; i < count; i++)
                for (int c = 0; c < 3; c++)
                    dots[i][c] = -dots[i][c];
            alb_space_add(NULL, space, vectors[k], (const double(*)[3])dots, vectors + first, count);
            if (images)
                alb_space_add(NULL, space, images[k], (const double(*)[3])dots, images + first, count);
        }
    alb_space_norm(length, space, (const alb_rgb *)vectors[k]);
    for (int c = 0; c < 3; c++)
        factor[c] = length[c] > least * before[c] ? 1 / length[c] : 0;
    alb_space_scale(space, vectors[k], factor);
    if (images)
        alb_space_scale(space, images[k], factor);
}
