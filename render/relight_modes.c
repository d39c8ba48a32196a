// Rows of U, a cluster at a time, as few modes and each patch's share in them: Gram-Schmidt on the rows, the one of
// which most is left next, until what is left is small. Columns count as much as light at random feels them: column k
// times |T* q_k|. What is left, summed over the patches, stays below
//     mode_error^2 (number of patches) (mean over all patches of their rows' squares)
// so that light of no column in particular is bounced within mode_error. Modes have length one, their numbers steps of
// 1/32767 of it.
#include "base/memory.h"
#include "render/relight.h"
#include <stdlib.h>
#include <string.h>

static const double mode_error = 0.02;

// The rows of one cluster.
typedef struct rows {
    double *left; // [channel][row][column]
    size_t count, columns;
} rows;

static double *row_of(const rows *r, int channel, size_t row)
{
    return r->left + ((size_t)channel * r->count + row) * r->columns;
}

static double square(const double *row, size_t columns)
{
    double sum = 0;
    for (size_t k = 0; k < columns; k++)
        sum += row[k] * row[k];
    return sum;
}

static void take_rows(rows *r, const alb_relight *of, size_t cluster, alb_rgb *const *basis, const double (*lengths)[3])
{
    const alb_clusters *clusters = &of->equations->clusters;
    r->count = clusters->first[cluster + 1] - clusters->first[cluster];
    r->columns = (size_t)of->rank;
    for (size_t i = 0; i < r->count; i++) {
        const uint32_t p = clusters->members[clusters->first[cluster] + i];
        for (size_t k = 0; k < r->columns; k++)
            for (int c = 0; c < 3; c++)
                row_of(r, c, i)[k] = basis[k][p][c] * lengths[k][c];
    }
}

// The next mode of a channel, taken from the rows, and the shares in it; false where too little is left.
static bool next_mode(double *mode, double *shares, rows *r, int channel, double allowed)
{
    size_t largest = 0;
    double all = 0, most = 0;
    for (size_t i = 0; i < r->count; i++) {
        const double here = square(row_of(r, channel, i), r->columns);
        all += here;
        if (here > most)
            most = here, largest = i;
    }
    memset(mode, 0, r->columns * sizeof *mode);
    memset(shares, 0, r->count * sizeof *shares);
    if (all <= allowed * (double)r->count || !(most > 0))
        return false;
    for (size_t k = 0; k < r->columns; k++)
        mode[k] = row_of(r, channel, largest)[k] / sqrt(most);
    for (size_t i = 0; i < r->count; i++) {
        double *row = row_of(r, channel, i);
        for (size_t k = 0; k < r->columns; k++)
            shares[i] += row[k] * mode[k];
        for (size_t k = 0; k < r->columns; k++)
            row[k] -= shares[i] * mode[k];
    }
    return true;
}

// Modes of a cluster, as many as its rows ask for; written where there is room for them already.
static uint32_t find_modes(alb_relight *of, size_t cluster, rows *r, const double allowed[3])
{
    double *mode = r->left + 3 * r->count * r->columns, *shares = mode + r->columns;
    uint32_t count = 0;
    for (bool more = true; more && count < ALB_RELIGHT_MODES_MAX && count < r->count; count += more) {
        more = false;
        for (int c = 0; c < 3; c++) {
            more |= next_mode(mode, shares, r, c, allowed[c]);
            if (!of->u || of->first_mode[cluster] + count == of->first_mode[cluster + 1])
                continue;
            const uint32_t at = of->first_mode[cluster] + count,
                           modes = of->first_mode[cluster + 1] - of->first_mode[cluster];
            for (size_t k = 0; k < r->columns; k++)
                of->u[at * alb_relight_numbers(of) + 3 * k + (size_t)c] = (int16_t)lround(mode[k] * INT16_MAX);
            for (size_t i = 0; i < r->count; i++)
                of->shares[of->first_share[cluster] + i * modes + count][c] = (float)shares[i];
        }
    }
    return count;
}

static bool each_cluster(alb_relight *out, uint32_t *counts, size_t largest, alb_rgb *const *basis,
                         const double (*lengths)[3], const double allowed[3])
{
    bool failed = false;
#pragma omp parallel reduction(|| : failed)
    {
        const size_t columns = (size_t)out->rank;
        rows r = {.left = malloc((3 * largest * columns + columns + largest) * sizeof *r.left)};
        failed = !r.left;
#pragma omp for schedule(dynamic, 16)
        for (size_t k = 0; k < out->equations->clusters.count; k++)
            if (!failed) {
                take_rows(&r, out, k, basis, lengths);
                counts[k] = find_modes(out, k, &r, allowed);
            }
        free(r.left);
    }
    return !failed;
}

// Squares of a row, their mean over the patches, times the error allowed.
static void find_allowed(double allowed[3], const alb_relight *of, alb_rgb *const *basis, const double (*lengths)[3])
{
    allowed[0] = allowed[1] = allowed[2] = 0;
    for (int k = 0; k < of->rank; k++)
        for (size_t p = 0; p < of->count; p++)
            for (int c = 0; c < 3; c++) {
                const double value = basis[k][p][c] * lengths[k][c];
                allowed[c] += value * value * mode_error * mode_error / (double)of->count;
            }
}

bool alb_relight_find_modes(alb_relight *out, alb_rgb *const *basis, const double (*lengths)[3], alb_error *error)
{
    const alb_clusters *clusters = &out->equations->clusters;
    size_t largest = 0;
    double allowed[3];
    uint32_t *counts = alb_allocate(clusters->count, sizeof *counts, error);
    bool ok = counts && (out->first_mode = alb_allocate(clusters->count + 1, sizeof *out->first_mode, error)) &&
              (out->first_share = alb_allocate(clusters->count + 1, sizeof *out->first_share, error));
    for (size_t k = 0; ok && k < clusters->count; k++)
        largest = clusters->first[k + 1] - clusters->first[k] > largest ? clusters->first[k + 1] - clusters->first[k]
                                                                        : largest;
    find_allowed(allowed, out, basis, lengths);
    if (ok && !each_cluster(out, counts, largest, basis, lengths, allowed))
        ok = alb_fail(error, ALB_NO_MEMORY, "no memory for the modes of relighting");
    for (size_t k = 0; ok && k < clusters->count; k++) {
        out->first_mode[k + 1] = out->first_mode[k] + counts[k];
        out->first_share[k + 1] = out->first_share[k] + counts[k] * (clusters->first[k + 1] - clusters->first[k]);
    }
    ok = ok && (out->shares = alb_allocate(out->first_share[clusters->count], sizeof *out->shares, error)) &&
         (out->u = alb_allocate(out->first_mode[clusters->count] * alb_relight_numbers(out), sizeof *out->u, error));
    if (ok && !each_cluster(out, counts, largest, basis, lengths, allowed))
        ok = alb_fail(error, ALB_NO_MEMORY, "no memory for the modes of relighting");
    for (int k = 0; ok && k < out->rank; k++)
        for (int c = 0; c < 3; c++)
            out->u_step[3 * k + c] = lengths[k][c] > 0 ? (float)(1 / (lengths[k][c] * INT16_MAX)) : 0;
    free(counts);
    return ok;
}
