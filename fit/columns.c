// c_i(b) = (W e^(-b r))_i / sd_i and its derivatives by x = ln b.
//
// A reading averages e^(-b r) over the distances that the operator gives it, so it is share_i e^(-b rho_i(x)) with an
// effective distance rho_i = -ln((W e^(-b r))_i / share_i) / b: bounded, falling from the mean distance for b -> 0 to
// the smallest for b -> infinity, and smooth on the scale of 1 in x. rho + rho' is the mean distance under the weights
// W e^(-b r), so that both are known at the nodes of a table and cubic Hermite interpolation serves between them. With
// t = b (rho + rho') and s = b (rho + 2 rho' + rho''):   dc/dx = -t c,   d2c/dx2 = (t^2 - s) c.
// At step h the interpolation costs b h^4 / 384 |rho''''| of c: 1e-7 b P for a spot of size P at h = 0.11. Readings
// that are values of S have rho = r, and no table.
//
// e^x = 2^k e^y, |y| <= ln(2) / 2, by the Taylor series of degree 12 (remainder 2e-16): four at a time, and the same
// bytes on any machine. Sums are taken in four lanes and a fixed order.
#include "fit/columns.h"
#include "base/memory.h"
#include "base/vector_clones.h"
#include "fit/search.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LANES = 4 };
typedef double lanes __attribute__((vector_size(32), aligned(8), may_alias));
typedef long long whole __attribute__((vector_size(32)));

// 1.5 * 2^52: what is added to it keeps its nearest integer in the low bits.
#define ROUNDER 6755399441055744.0
#define SPLAT(v) ((lanes){(v), (v), (v), (v)})
#define SUM(v) (((v)[0] + (v)[2]) + ((v)[1] + (v)[3]))

static inline __attribute__((always_inline)) void exponentiate(lanes *v)
{
    lanes x = *v;
    const whole low = x < SPLAT(-300.0);
    x = (lanes)(((whole)SPLAT(-300.0) & low) | ((whole)x & ~low));
    const lanes shifted = x * SPLAT(M_LOG2E) + SPLAT(ROUNDER), k = shifted - SPLAT(ROUNDER);
    // ln 2 in two parts, the first short enough for k times it to be exact
    const lanes y = (x - k * SPLAT(0x1.62e42fee00000p-1)) - k * SPLAT(0x1.a39ef35793c76p-33);
    const lanes y2 = y * y, y4 = y2 * y2;
    const lanes p0 = (SPLAT(1.0 / 6) * y + SPLAT(0.5)) * y2 + (y + SPLAT(1.0));
    const lanes p4 = (SPLAT(1.0 / 5040) * y + SPLAT(1.0 / 720)) * y2 + (SPLAT(1.0 / 120) * y + SPLAT(1.0 / 24));
    const lanes p8 = (SPLAT(1.0 / 39916800) * y + SPLAT(1.0 / 3628800)) * y2 +
                     (SPLAT(1.0 / 362880) * y + SPLAT(1.0 / 40320)) + SPLAT(1.0 / 479001600) * y4;
    const lanes sum = p0 + y4 * (p4 + y4 * p8);
    *v = (lanes)((whole)sum + ((whole)shifted << 52));
}

ALB_VECTOR_CLONES
void alb_columns_exp(double *x, int rows)
{
    for (int i = 0; i + LANES <= rows; i += LANES)
        exponentiate((lanes *)(x + i));
    lanes rest = SPLAT(0.0);
    const int done = rows / LANES * LANES;
    for (int i = done; i < rows; i++)
        rest[i - done] = x[i];
    exponentiate(&rest);
    for (int i = done; i < rows; i++)
        x[i] = rest[i - done];
}

// Effective distances at x, work = rho, rho + rho', rho + 2 rho' + rho''.
ALB_VECTOR_CLONES
static void interpolate(double *work, const alb_basis *basis, double x)
{
    const int rows = basis->rows, last = basis->fine_nodes - 2;
    const double at = (x - basis->lowest) / basis->fine_step, h = basis->fine_step;
    const int k = at < 0 ? 0 : at > last ? last : (int)at;
    const double u = at - k, v = 1 - u;
    const double *p0 = basis->distance + (size_t)k * (size_t)rows, *p1 = p0 + rows;
    const double *s0 = basis->slope + (size_t)k * (size_t)rows, *s1 = s0 + rows;
    for (int i = 0; i < rows; i++) {
        const double step = p1[i] - p0[i], m0 = s0[i] * h, m1 = s1[i] * h;
        const double value = p0[i] + u * u * (3 - 2 * u) * step + u * v * (v * m0 - u * m1);
        const double slope = (6 * u * v * step + v * (1 - 3 * u) * m0 - u * (2 - 3 * u) * m1) / h;
        const double bend = ((6 - 12 * u) * step + (6 * u - 4) * m0 + (6 * u - 2) * m1) / (h * h);
        work[i] = value;
        work[rows + i] = value + slope;
        work[2 * rows + i] = value + 2 * slope + bend;
    }
}

// distance: rho, rho + rho', rho + 2 rho' + rho''.
ALB_VECTOR_CLONES
static void fill(alb_term *term, const alb_whitened *whitened, double b, const double *const distance[3])
{
    const int rows = whitened->basis->rows;
    const lanes decay = SPLAT(-b);
    lanes cc = SPLAT(0.0), cf = SPLAT(0.0), ff = SPLAT(0.0), cv = SPLAT(0.0);
    for (int i = 0; i < rows; i += LANES) {
        lanes c = decay * *(const lanes *)(distance[0] + i);
        const lanes t = decay * *(const lanes *)(distance[1] + i), s = decay * *(const lanes *)(distance[2] + i);
        exponentiate(&c);
        c *= *(const lanes *)(whitened->weight + i);
        const lanes f = t * c;
        *(lanes *)(term->column + i) = c;
        *(lanes *)(term->first + i) = f;
        *(lanes *)(term->second + i) = t * f + s * c;
        cc += c * c;
        cf += c * f;
        ff += f * f;
        cv += c * *(const lanes *)(whitened->value + i);
    }
    term->cc = SUM(cc);
    term->cf = SUM(cf);
    term->ff = SUM(ff);
    term->cv = SUM(cv);
}

void alb_term_evaluate(alb_term *term, const alb_whitened *whitened, double ln_decay, double *work)
{
    const alb_basis *basis = whitened->basis;
    const int rows = basis->rows, n = basis->count;
    if (basis->slope)
        interpolate(work, basis, ln_decay);
    const double *const plain[3] = {basis->distance, basis->distance, basis->distance};
    const double *const read[3] = {work, work + rows, work + 2 * rows};
    fill(term, whitened, exp(ln_decay), basis->slope ? read : plain);
    if (whitened->energy) {
        const double c = alb_columns_dot(whitened->energy, term->column, rows);
        const double f = alb_columns_dot(whitened->energy, term->first, rows);
        term->second[n] = alb_columns_dot(whitened->energy, term->second, rows);
        term->column[n] = c;
        term->first[n] = f;
        term->cc += c * c;
        term->cf += c * f;
        term->ff += f * f;
        term->cv += c * whitened->value[n];
    }
}

ALB_VECTOR_CLONES
void alb_term_products(double out[4], const alb_term *x, const alb_term *y, int rows)
{
    lanes cc = SPLAT(0.0), cf = SPLAT(0.0), fc = SPLAT(0.0), ff = SPLAT(0.0);
    for (int i = 0; i < rows; i += LANES) {
        const lanes xc = *(const lanes *)(x->column + i), xf = *(const lanes *)(x->first + i);
        const lanes yc = *(const lanes *)(y->column + i), yf = *(const lanes *)(y->first + i);
        cc += xc * yc;
        cf += xc * yf;
        fc += xf * yc;
        ff += xf * yf;
    }
    out[0] = SUM(cc);
    out[1] = SUM(cf);
    out[2] = SUM(fc);
    out[3] = SUM(ff);
}

ALB_VECTOR_CLONES
double alb_term_residual(double *residual, double (*products)[3], const alb_whitened *whitened, const alb_term *terms,
                         const double *amplitude, int count)
{
    const int rows = whitened->basis->rows;
    memcpy(residual, whitened->value, (size_t)rows * sizeof *residual);
    lanes squares = SPLAT(0.0);
    for (int t = 0; t < count; t++) {
        const lanes a = SPLAT(amplitude[t]);
        for (int i = 0; i < rows; i += LANES)
            *(lanes *)(residual + i) -= a * *(const lanes *)(terms[t].column + i);
    }
    for (int i = 0; i < rows; i += LANES)
        squares += *(lanes *)(residual + i) * *(lanes *)(residual + i);
    for (int t = 0; t < count; t++) {
        lanes c = SPLAT(0.0), f = SPLAT(0.0), s = SPLAT(0.0);
        for (int i = 0; i < rows; i += LANES) {
            const lanes r = *(const lanes *)(residual + i);
            c += r * *(const lanes *)(terms[t].column + i);
            f += r * *(const lanes *)(terms[t].first + i);
            s += r * *(const lanes *)(terms[t].second + i);
        }
        products[t][0] = SUM(c);
        products[t][1] = SUM(f);
        products[t][2] = SUM(s);
    }
    return SUM(squares);
}

ALB_VECTOR_CLONES
double alb_columns_dot(const double *x, const double *y, int rows)
{
    lanes even = SPLAT(0.0), odd = SPLAT(0.0);
    int i = 0;
    for (; i + LANES < rows; i += 2 * LANES) {
        even += *(const lanes *)(x + i) * *(const lanes *)(y + i);
        odd += *(const lanes *)(x + i + LANES) * *(const lanes *)(y + i + LANES);
    }
    if (i < rows)
        even += *(const lanes *)(x + i) * *(const lanes *)(y + i);
    even += odd;
    return SUM(even);
}

// Four columns at a time against one.
ALB_VECTOR_CLONES
void alb_columns_gram(double *gram, const double *const *columns, int count, int rows)
{
    for (int i = 0; i < count; i++)
        for (int j = i; j < count; j += 4) {
            const double *x = columns[i], *y[4];
            for (int k = 0; k < 4; k++)
                y[k] = columns[j + k < count ? j + k : count - 1];
            lanes s0 = SPLAT(0.0), s1 = SPLAT(0.0), s2 = SPLAT(0.0), s3 = SPLAT(0.0);
            for (int r = 0; r < rows; r += LANES) {
                const lanes v = *(const lanes *)(x + r);
                s0 += v * *(const lanes *)(y[0] + r);
                s1 += v * *(const lanes *)(y[1] + r);
                s2 += v * *(const lanes *)(y[2] + r);
                s3 += v * *(const lanes *)(y[3] + r);
            }
            const double sums[4] = {SUM(s0), SUM(s1), SUM(s2), SUM(s3)};
            for (int k = 0; k < 4 && j + k < count; k++)
                gram[i * count + j + k] = sums[k];
        }
}

// Effective distances of one row at all fine nodes; `work` has room for the row.
static void tabulate(alb_basis *basis, const alb_operator *forward, int row, double *work)
{
    const int n = forward->last[row] - forward->first[row] + 1;
    const double *weight = forward->weight + forward->offset[row], *r = forward->grid_mm + forward->first[row];
    for (int k = 0; k < basis->fine_nodes; k++) {
        const double b = exp(basis->lowest + k * basis->fine_step);
        for (int i = 0; i < n; i++)
            work[i] = -b * (r[i] - r[0]);
        alb_columns_exp(work, n);
        double sum = 0, moment = 0;
        for (int i = 0; i < n; i++) {
            sum += weight[i] * work[i];
            moment += weight[i] * work[i] * (r[i] - r[0]);
        }
        const size_t at = (size_t)k * (size_t)basis->rows + (size_t)row;
        const double rho = -log(sum / basis->share[row]) / b;
        basis->distance[at] = r[0] + rho;
        basis->slope[at] = moment / sum - rho;
    }
}

static bool fill_distances(alb_basis *basis, const alb_operator *forward, bool plain, alb_error *error)
{
    for (int i = 0; i < basis->count; i++) {
        for (size_t k = forward->offset[i]; k <= forward->offset[i] + (size_t)(forward->last[i] - forward->first[i]);
             k++)
            basis->share[i] += forward->weight[k];
        if (plain)
            basis->distance[i] = forward->grid_mm[forward->first[i]];
    }
    if (plain)
        return true;
    double *work = alb_allocate((size_t)forward->grid_count, sizeof *work, error);
    if (!work)
        return false;
    for (int i = 0; i < basis->count; i++)
        tabulate(basis, forward, i, work);
    free(work);
    return true;
}

static void fill_nodes(double *columns, const alb_basis *basis, double shift, double *work)
{
    for (int j = 0; j < basis->nodes; j++) {
        const double x = basis->first + j * basis->step + shift, b = exp(x);
        double *column = columns + (size_t)j * (size_t)basis->rows;
        const double *distance = basis->distance;
        if (basis->slope) {
            interpolate(work, basis, x);
            distance = work;
        }
        for (int i = 0; i < basis->rows; i++)
            column[i] = -b * distance[i];
        alb_columns_exp(column, basis->rows);
        for (int i = 0; i < basis->rows; i++)
            column[i] *= basis->share[i];
    }
}

// Bounds of ln b: the slowest term falls by 1 % over the readings, the fastest by e^40 before the first of them.
static void set_range(alb_basis *basis, const alb_readings *readings)
{
    const double node_step = 0.46, fine_step = 0.11;
    double nearest = readings->outer_mm;
    for (int i = 0; i < readings->count; i++)
        if (readings->r_mm[i] > 0)
            nearest = fmin(nearest, readings->r_mm[i]);
    nearest = fmax(nearest, 1e-6 * readings->outer_mm);
    basis->lowest = log(0.01 / readings->outer_mm);
    basis->highest = log(40 / nearest);
    basis->first = basis->lowest;
    const double range = log(10 / nearest) - basis->first;
    basis->nodes = (int)fmax(ceil(range / node_step), 12);
    basis->step = range / (basis->nodes - 1);
    basis->fine_nodes = (int)ceil((basis->highest - basis->lowest) / fine_step) + 1;
    basis->fine_step = (basis->highest - basis->lowest) / (basis->fine_nodes - 1);
}

static bool allocate(alb_basis *basis, bool plain, alb_error *error)
{
    const size_t rows = (size_t)basis->rows, grid = (size_t)basis->nodes * rows;
    const size_t table = plain ? rows : (size_t)basis->fine_nodes * rows;
    return (basis->column = alb_allocate(grid, sizeof(double), error)) &&
           (basis->tied = alb_allocate(grid, sizeof(double), error)) &&
           (basis->distance = alb_allocate(table, sizeof(double), error)) &&
           (plain || (basis->slope = alb_allocate(table, sizeof(double), error))) &&
           (basis->share = alb_allocate(rows, sizeof(double), error)) &&
           (basis->area_mm2 = alb_allocate(rows, sizeof(double), error));
}

static bool fill_columns(alb_basis *basis, alb_error *error)
{
    double *work = alb_allocate(3 * (size_t)basis->rows, sizeof *work, error);
    if (work) {
        fill_nodes(basis->column, basis, 0, work);
        fill_nodes(basis->tied, basis, log(ALB_TIED_RATIO), work);
    }
    free(work);
    return work != NULL;
}

// Groups of neighbours that lie within a fifth of their distance; how many.
static int group(int *first, const alb_readings *readings)
{
    int count = 0;
    for (int i = 0; i < readings->count; i++) {
        const double from = count ? readings->r_mm[first[count - 1]] : 0, span = readings->r_mm[i] - from;
        if (count == 0 || !(span >= 0 && span <= 0.2 * from))
            first[count++] = i;
    }
    first[count] = readings->count;
    return count;
}

// Effective distance of the mean of a group of readings, at fine node k.
static void merge_distance(alb_basis *merged, const alb_basis *basis, int g, int k)
{
    const double x = basis->lowest + k * merged->fine_step, b = exp(x);
    const int from = basis->group[g], to = basis->group[g + 1];
    double nearest = (double)INFINITY, sum = 0, moment = 0;
    for (int pass = 0; pass < 2; pass++)
        for (int i = from; i < to; i++) {
            double rho = basis->distance[i], slope = 0;
            if (basis->slope) {
                rho = basis->distance[k * basis->rows + i];
                slope = basis->slope[k * basis->rows + i];
            }
            if (pass == 0) {
                nearest = fmin(nearest, rho);
            } else {
                const double column = basis->share[i] * exp(-b * (rho - nearest));
                sum += column;
                moment += column * (rho - nearest + slope);
            }
        }
    const double rho = -log(sum / (to - from) / merged->share[g]) / b;
    merged->distance[k * merged->rows + g] = nearest + rho;
    merged->slope[k * merged->rows + g] = moment / sum - rho;
}

// The same for the plain means of neighbouring readings.
static bool merge(alb_basis *basis, const alb_readings *readings, alb_error *error)
{
    if (!(basis->group = alb_allocate((size_t)basis->count + 1, sizeof *basis->group, error)) ||
        !(basis->merged = alb_allocate(1, sizeof *basis->merged, error)))
        return false;
    alb_basis *merged = basis->merged;
    *merged = (alb_basis){.count = group(basis->group, readings),
                          .lowest = basis->lowest,
                          .highest = basis->highest,
                          .nodes = basis->nodes,
                          .first = basis->first,
                          .step = basis->step,
                          .fine_nodes = basis->fine_nodes,
                          .fine_step = basis->fine_step};
    merged->rows = (merged->count + 1 + LANES - 1) / LANES * LANES;
    if (!allocate(merged, false, error))
        return false;
    for (int g = 0; g < merged->count; g++) {
        for (int i = basis->group[g]; i < basis->group[g + 1]; i++) {
            merged->share[g] += basis->share[i] / (basis->group[g + 1] - basis->group[g]);
            merged->area_mm2[g] += basis->area_mm2[i];
        }
        for (int k = 0; k < merged->fine_nodes; k++)
            merge_distance(merged, basis, g, k);
    }
    return fill_columns(merged, error);
}

bool alb_basis_create(alb_basis *basis, const alb_readings *readings, const alb_operator *forward, alb_error *error)
{
    const int n = readings->count;
    *basis = (alb_basis){.count = n, .rows = (n + 1 + LANES - 1) / LANES * LANES};
    set_range(basis, readings);
    bool plain = true;
    for (int i = 0; i < n; i++)
        plain &= forward->first[i] == forward->last[i];
    bool ok = allocate(basis, plain, error) && fill_distances(basis, forward, plain, error);
    if (ok)
        memcpy(basis->area_mm2, readings->area_mm2, (size_t)n * sizeof(double));
    ok = ok && fill_columns(basis, error) && merge(basis, readings, error);
    if (!ok)
        alb_basis_free(basis);
    return ok;
}

void alb_basis_free(alb_basis *basis)
{
    if (basis->merged)
        alb_basis_free(basis->merged);
    free(basis->merged);
    free(basis->group);
    free(basis->column);
    free(basis->tied);
    free(basis->distance);
    free(basis->slope);
    free(basis->share);
    free(basis->area_mm2);
    *basis = (alb_basis){0};
}
