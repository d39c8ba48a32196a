// min over decays b and amplitudes a of chi^2 = sum ((v_i - sum_j a_j c_i(b_j)) / sd_i)^2 (columns.c), a with the signs
// of the form.
//
// For fixed decays the amplitudes are a linear problem, so only x_j = ln b_j are searched (variable projection; Golub &
// Pereyra 1973). With residual r, columns c_j, f_j = dc_j/dx_j, s_j = d2c_j/dx_j2 the reduced problem has
//   gradient of chi^2 / 2 by x_j:   -a_j r.f_j
//   Hessian:  X - Y^T G^-1 Y,  G_kl = c_k.c_l,  Y_kj = a_j c_k.f_j - [k = j] r.f_j,
//             X_jl = a_j a_l f_j.f_l - [j = l] a_j r.s_j
// which is exact; without the terms in r it is Kaufman's approximation (1975), taken where the exact one is not
// positive definite. Newton steps, damped where they do not lower chi^2.
//
// Where it starts: at one column the gain in chi^2 is known in closed form on a grid of decays, and a Newton search
// from its best places gives the best single exponential, b_0. All pairs (or triples) of the grid and b_0 are solved;
// those local optima of the table that beat the single exponential are polished. A sum of positive terms can beat it
// only if r.c(b) > 0 somewhere (the measure of decays is a convex problem; Lindsay 1983), and where that holds at the
// grid no descent from there ends with a zero amplitude, whose chi^2 is no better than the single one's. Where it holds
// only next to b_0, r.s(b_0) > 0, the single exponential splits in two close ones, and the search starts from those.
//
// Signed pairs: in x_1 and x_2 - x_1 >= ln 1.1; where a_1 + a_2 would fall below 0 the pair has one amplitude,
// a (c_1 - c_2). The tied pair stays on the bound. Residuals come from the data and amplitudes are refined by them, so
// that squaring the condition costs steps, not digits. Stops being true where 1 - cos^2 of two columns is below 1e-14.
#include "fit/separable.h"
#include <float.h>
#include <math.h>
#include <string.h>

enum { TERMS = ALB_PARAMETERS_MAX / 2, STARTS = 4, TRIPLES = 8 };

typedef enum sign_rule { POSITIVE, SIGNED, TIED } sign_rule;

typedef double matrix[TERMS][TERMS];

typedef struct problem {
    alb_whitened data;
    int rows;
    double squares; // of the whitened values
    alb_term term[TERMS];
    double *residual, *work, *extra; // extra: columns that are not nodes
    double *nodes;                   // whitened columns of the nodes
    int columns;                     // the nodes and up to two more, in order of decay
    const double **column;
    double *x, *gram, *right, *gain;
} problem;

// The reduced problem at one place.
typedef struct point {
    double x[TERMS], amplitude[TERMS];
    double chi_square; // INFINITY: not admissible
    double gradient[TERMS];
    matrix newton, kaufman;
    matrix cc, cf, ff; // c_k.c_l, c_k.f_l, f_k.f_l
    double curvature;  // r.s of the first term
} point;

// Cholesky, in place below the diagonal; false where a pivot is not above `least` of the diagonal.
static bool factor(matrix m, int n, double least)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            const double diagonal = m[i][i];
            double sum = m[i][j];
            for (int k = 0; k < j; k++)
                sum -= m[i][k] * m[j][k];
            if (i == j && !(sum > least * diagonal))
                return false;
            m[i][j] = i == j ? sqrt(sum) : sum / m[j][j];
        }
    return true;
}

static void solve(double *x, matrix l, int n)
{
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++)
            x[i] -= l[i][k] * x[k];
        x[i] /= l[i][i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++)
            x[i] -= l[k][i] * x[k];
        x[i] /= l[i][i];
    }
}

// The linear problem at one place: free amplitudes, and the factor of their matrix. One where the pair is pinned to
// a (c_1 - c_2).
typedef struct linear {
    int count;
    bool pinned;
    matrix factor;
} linear;

static bool solve_amplitudes(point *p, linear *system, const problem *q, int terms, sign_rule signs)
{
    *system = (linear){.count = terms};
    memcpy(system->factor, p->cc, sizeof p->cc);
    for (int t = 0; t < terms; t++)
        p->amplitude[t] = q->term[t].cv;
    if (!factor(system->factor, terms, 1e-14))
        return false;
    solve(p->amplitude, system->factor, terms);
    if (signs != POSITIVE && p->amplitude[0] + p->amplitude[1] < 0) {
        *system = (linear){1, true, {{sqrt(p->cc[0][0] - 2 * p->cc[0][1] + p->cc[1][1])}}};
        p->amplitude[0] = (q->term[0].cv - q->term[1].cv) / (system->factor[0][0] * system->factor[0][0]);
        p->amplitude[1] = -p->amplitude[0];
    }
    for (int t = 0; t < terms; t++)
        if (!(t == 1 && signs != POSITIVE ? p->amplitude[t] < 0 : p->amplitude[t] > 0))
            return false;
    return true;
}

// What belongs to the free amplitudes: itself, or the difference of the pair.
static void gather(double *x, const linear *system)
{
    if (system->pinned)
        x[0] -= x[1];
}

// Residual, with the amplitudes corrected by it once; products are those of alb_term_residual.
static void refine(point *p, double products[TERMS][3], const linear *system, problem *q, int terms)
{
    p->chi_square = alb_term_residual(q->residual, products, &q->data, q->term, p->amplitude, terms);
    double change[TERMS] = {0}, right[TERMS] = {0};
    for (int t = 0; t < terms; t++)
        right[t] = change[t] = products[t][0];
    gather(change, system);
    gather(right, system);
    solve(change, (double(*)[TERMS])system->factor, system->count);
    for (int k = 0; k < system->count; k++)
        p->chi_square -= change[k] * right[k];
    if (system->pinned)
        change[1] = -change[0];
    for (int k = 0; k < terms; k++) {
        p->amplitude[k] += change[k];
        for (int t = 0; t < terms; t++)
            products[t][1] -= change[k] * p->cf[k][t];
    }
}

static void differentiate(point *p, double products[TERMS][3], const linear *system, int terms)
{
    matrix full = {{0}}, flat = {{0}}; // columns of L^-1 Y, with and without the terms in r
    for (int j = 0; j < terms; j++) {
        for (int k = 0; k < terms; k++) {
            flat[j][k] = p->amplitude[j] * p->cf[k][j];
            full[j][k] = flat[j][k] - (k == j ? products[j][1] : 0);
        }
        gather(full[j], system);
        gather(flat[j], system);
        for (int i = 0; i < system->count; i++)
            for (int k = 0; k <= i; k++) {
                const double l = system->factor[i][k];
                full[j][i] = k < i ? full[j][i] - l * full[j][k] : full[j][i] / l;
                flat[j][i] = k < i ? flat[j][i] - l * flat[j][k] : flat[j][i] / l;
            }
    }
    for (int j = 0; j < terms; j++) {
        p->gradient[j] = -p->amplitude[j] * products[j][1];
        for (int l = 0; l < terms; l++) {
            p->kaufman[j][l] = p->newton[j][l] = p->amplitude[j] * p->amplitude[l] * p->ff[j][l];
            for (int k = 0; k < system->count; k++) {
                p->newton[j][l] -= full[j][k] * full[l][k];
                p->kaufman[j][l] -= flat[j][k] * flat[l][k];
            }
        }
        p->newton[j][j] -= p->amplitude[j] * products[j][2];
    }
    p->curvature = products[0][2];
}

// Fills the point at its x.
static void evaluate(point *p, problem *q, int terms, sign_rule signs)
{
    p->chi_square = (double)INFINITY;
    for (int t = 0; t < terms; t++) {
        const alb_term *term = &q->term[t];
        alb_term_evaluate(&q->term[t], &q->data, p->x[t], q->work);
        p->cc[t][t] = term->cc, p->cf[t][t] = term->cf, p->ff[t][t] = term->ff;
        for (int u = 0; u < t; u++) {
            double out[4];
            alb_term_products(out, term, &q->term[u], q->rows);
            p->cc[t][u] = p->cc[u][t] = out[0];
            p->cf[t][u] = out[1], p->cf[u][t] = out[2];
            p->ff[t][u] = p->ff[u][t] = out[3];
        }
    }
    linear system;
    double products[TERMS][3];
    if (!solve_amplitudes(p, &system, q, terms, signs))
        return;
    refine(p, products, &system, q, terms);
    differentiate(p, products, &system, terms);
}

// Step of the reduced problem in its variables: x, or x_1 and x_2 - x_1 of a signed pair. Those fixed stay.
static bool newton_step(double *step, matrix hessian, matrix scale, const double *gradient, const bool *fixed, int n,
                        double damping)
{
    matrix m;
    for (int i = 0; i < n; i++) {
        step[i] = fixed[i] ? 0 : -gradient[i];
        for (int j = 0; j < n; j++)
            m[i][j] = fixed[i] || fixed[j] ? i == j : hessian[i][j] + (i == j ? damping * scale[i][i] : 0);
    }
    if (!factor(m, n, 1e-13))
        return false;
    solve(step, m, n);
    return true;
}

static void to_differences(matrix m)
{
    m[0][0] += m[0][1] + m[1][0] + m[1][1];
    m[0][1] += m[1][1];
    m[1][0] += m[1][1];
}

// From x to the place the step leads to, within the bounds; the fall of chi^2 that it promises.
static double propose(double *x, const point *p, const alb_basis *basis, int terms, sign_rule signs, double damping)
{
    const bool differences = signs != POSITIVE && terms == 2;
    const double closest = log(ALB_TIED_RATIO);
    double gradient[TERMS], step[TERMS], longest = 0, promise = 0;
    matrix newton, kaufman;
    bool fixed[TERMS];
    memcpy(gradient, p->gradient, sizeof gradient);
    memcpy(newton, p->newton, sizeof newton);
    memcpy(kaufman, p->kaufman, sizeof kaufman);
    if (differences) {
        to_differences(newton);
        to_differences(kaufman);
        gradient[0] += gradient[1];
    }
    for (int t = 0; t < terms; t++)
        fixed[t] = (p->x[t] <= basis->lowest && gradient[t] > 0) || (p->x[t] >= basis->highest && gradient[t] < 0);
    if (differences)
        fixed[1] = signs == TIED || (p->x[1] - p->x[0] <= closest * (1 + 1e-12) && gradient[1] > 0);
    if (!newton_step(step, newton, kaufman, gradient, fixed, terms, damping) &&
        !newton_step(step, kaufman, kaufman, gradient, fixed, terms, fmax(damping, 1e-6)))
        return -1;
    for (int t = 0; t < terms; t++) {
        longest = fmax(longest, fabs(step[t]));
        promise -= gradient[t] * step[t];
    }
    const double shrink = longest > 1.5 ? 1.5 / longest : 1;
    for (int t = 0; t < terms; t++)
        x[t] = p->x[t] + shrink * (differences && t == 1 ? step[0] + step[1] : step[t]);
    for (int t = 0; t < terms; t++)
        x[t] = fmin(fmax(x[t], basis->lowest), basis->highest);
    if (differences && (signs == TIED || x[1] - x[0] < closest)) {
        x[0] = fmin(x[0], basis->highest - closest);
        x[1] = x[0] + closest;
    }
    return promise;
}

// Descends from the point's x.
static void minimise(point *p, problem *q, int terms, sign_rule signs)
{
    double damping = 0;
    evaluate(p, q, terms, signs);
    for (int iteration = 0; iteration < 100 && isfinite(p->chi_square); iteration++) {
        point next;
        const double promise = propose(next.x, p, q->data.basis, terms, signs, damping);
        if (!(promise > 1e-11 * p->chi_square + 1e-32 * q->squares))
            break;
        evaluate(&next, q, terms, signs);
        if (next.chi_square < p->chi_square) {
            *p = next;
            damping = damping > 1e-3 ? damping / 10 : 0;
        } else {
            // no less within rounding
            if (promise < 1e-14 * sqrt(p->chi_square * q->squares) || damping > 1e9)
                break;
            damping = damping > 0 ? damping * 10 : 1e-2;
        }
    }
}

static void whiten(double *out, const double *column, const problem *q)
{
    for (int i = 0; i < q->rows; i++)
        out[i] = q->data.weight[i] * column[i];
    if (q->data.energy)
        out[q->data.basis->count] = alb_columns_dot(q->data.energy, out, q->rows);
}

// Best single exponential: from the local optima of the grid.
static void search_one(point *best, problem *q)
{
    const int n = q->columns;
    *best = (point){.chi_square = (double)INFINITY};
    for (int j = 0; j < n; j++) {
        const double right = alb_columns_dot(q->column[j], q->data.value, q->rows);
        q->gain[j] = right > 0 ? right * right / alb_columns_dot(q->column[j], q->column[j], q->rows) : 0;
    }
    for (int j = 0; j < n; j++) {
        const double before = j > 0 ? q->gain[j - 1] : 0, after = j + 1 < n ? q->gain[j + 1] : 0;
        if (!(q->gain[j] > before && q->gain[j] >= after))
            continue;
        point p = {.x = {q->x[j]}};
        minimise(&p, q, 1, POSITIVE);
        if (p.chi_square < best->chi_square)
            *best = p;
    }
}

// Makes the column of decay e^x one of the grid's.
static void insert(problem *q, int extra, double x)
{
    double *column = q->extra + (size_t)extra * (size_t)q->rows;
    alb_term_evaluate(&q->term[0], &q->data, x, q->work);
    memcpy(column, q->term[0].column, (size_t)q->rows * sizeof *column);
    int at = q->columns++;
    for (; at > 0 && q->x[at - 1] > x; at--) {
        q->x[at] = q->x[at - 1];
        q->column[at] = q->column[at - 1];
    }
    q->x[at] = x;
    q->column[at] = column;
}

static void make_grid(problem *q)
{
    q->columns = q->data.basis->nodes;
    for (int j = 0; j < q->columns; j++) {
        q->x[j] = q->data.basis->first + j * q->data.basis->step;
        q->column[j] = q->nodes + (size_t)j * (size_t)q->rows;
    }
}

// Inner products of all columns, scaled to unit length, and with the values.
static void make_gram(problem *q)
{
    const int n = q->columns;
    double *scale = q->gain; // free until the table is made
    alb_columns_gram(q->gram, q->column, n, q->rows);
    for (int i = 0; i < n; i++)
        scale[i] = q->gram[i * n + i] > 0 ? 1 / sqrt(q->gram[i * n + i]) : 0;
    for (int i = 0; i < n; i++) {
        q->right[i] = alb_columns_dot(q->column[i], q->data.value, q->rows) * scale[i];
        q->right[n + i] = scale[i];
        for (int j = i; j < n; j++)
            q->gram[i * n + j] *= scale[i] * scale[j];
    }
}

// gain[i * n + j]: how much columns i < j lower chi^2 with amplitudes of the right signs; -1 where they have others.
static void tabulate_pairs(problem *q, sign_rule signs)
{
    const int n = q->columns;
    const double *h = q->right, *scale = q->right + n;
    for (int i = 0; i < n; i++)
        for (int j = i + 1; j < n; j++) {
            const double c = q->gram[i * n + j], a = h[i] - c * h[j], b = h[j] - c * h[i];
            const double gain = (h[i] * a + h[j] * b) / (1 - c * c);
            q->gain[i * n + j] = a > 0 && (signs == POSITIVE ? b > 0 : b < 0) && c * c < 1 ? gain : -1;
        }
    for (int i = 0; signs != POSITIVE && i < n; i++)
        for (int j = i + 1; j < n; j++) {
            const double c = q->gram[i * n + j], si = scale[i], sj = scale[j];
            if (q->gain[i * n + j] > 0 && si * (h[i] - c * h[j]) + sj * (h[j] - c * h[i]) < 0) {
                const double right = h[i] * sj - h[j] * si;
                q->gain[i * n + j] = right > 0 ? right * right / (si * si + sj * sj - 2 * c * si * sj) : -1;
            }
        }
}

typedef struct start {
    double gain, x[TERMS];
} start;

// Keeps the best `limit`.
static void keep(start *starts, int *count, int limit, start candidate)
{
    if (*count == limit && !(candidate.gain > starts[limit - 1].gain))
        return;
    int at = *count < limit ? (*count)++ : limit - 1;
    for (; at > 0 && starts[at - 1].gain < candidate.gain; at--)
        starts[at] = starts[at - 1];
    starts[at] = candidate;
}

static bool is_peak(const double *gain, int n, int i, int j)
{
    for (int k = i > 0 ? i - 1 : 0; k <= i + 1; k++)
        for (int l = j > 0 ? j - 1 : 0; l <= j + 1 && l < n; l++)
            if (k < l && gain[k * n + l] > gain[i * n + j])
                return false;
    return true;
}

static void descend(point *best, problem *q, const start *starts, int count, int terms, sign_rule signs)
{
    for (int k = 0; k < count; k++) {
        point p = {.chi_square = (double)INFINITY};
        memcpy(p.x, starts[k].x, sizeof p.x);
        minimise(&p, q, terms, signs);
        if (p.chi_square < best->chi_square)
            *best = p;
    }
}

static void search_tied(point *best, problem *q)
{
    const int n = q->data.basis->nodes;
    double *gain = q->gain, *tied = q->residual;
    for (int j = 0; j < n; j++) {
        const double *column = q->nodes + (size_t)j * (size_t)q->rows;
        whiten(tied, q->data.basis->tied + (size_t)j * (size_t)q->rows, q);
        const double g11 = alb_columns_dot(column, column, q->rows), g12 = alb_columns_dot(column, tied, q->rows);
        const double g22 = alb_columns_dot(tied, tied, q->rows), h1 = alb_columns_dot(column, q->data.value, q->rows);
        const double h2 = alb_columns_dot(tied, q->data.value, q->rows), determinant = g11 * g22 - g12 * g12;
        const double a1 = (g22 * h1 - g12 * h2) / determinant, a2 = (g11 * h2 - g12 * h1) / determinant;
        gain[j] = a1 > 0 && a2 < 0 ? a1 * h1 + a2 * h2 : -1;
        if (a1 > 0 && a2 < 0 && a1 + a2 < 0)
            gain[j] = h1 > h2 ? (h1 - h2) * (h1 - h2) / (g11 - 2 * g12 + g22) : -1;
    }
    start starts[STARTS];
    int count = 0;
    for (int j = 0; j < n; j++) {
        const double before = j > 0 ? gain[j - 1] : -1, after = j + 1 < n ? gain[j + 1] : -1,
                     x = q->data.basis->first + j * q->data.basis->step;
        if (gain[j] > 0 && gain[j] > before && gain[j] >= after)
            keep(starts, &count, STARTS, (start){gain[j], {x, x + log(ALB_TIED_RATIO), 0}});
    }
    descend(best, q, starts, count, 2, TIED);
}

// From the table of pairs, of which those are worth a descent that beat the single exponential.
static void search_two(point *best, problem *q, const point *one, sign_rule signs)
{
    start starts[STARTS];
    int count = 0;
    insert(q, 0, one->x[0]);
    make_gram(q);
    tabulate_pairs(q, signs);
    const int n = q->columns;
    const double gain_one = q->squares - one->chi_square;
    for (int i = 0; i < n; i++)
        for (int j = i + 1; j < n; j++)
            if (q->gain[i * n + j] > gain_one && is_peak(q->gain, n, i, j))
                keep(starts, &count, STARTS, (start){q->gain[i * n + j], {q->x[i], q->x[j], 0}});
    descend(best, q, starts, count, 2, signs);
    if (signs == POSITIVE && one->curvature > 0) {
        const start split = {0, {one->x[0] - 0.1, one->x[0] + 0.1, 0}};
        descend(best, q, &split, 1, 2, signs);
    }
}

// Gain of columns i < j < k with positive amplitudes; -1 where they are not.
static double gain_of_three(const problem *q, int i, int j, int k)
{
    const int n = q->columns;
    const double *h = q->right, r01 = q->gram[i * n + j], r02 = q->gram[i * n + k], r12 = q->gram[j * n + k];
    const double p11 = 1 - r01 * r01, p21 = r12 - r01 * r02, p22 = 1 - r02 * r02 - p21 * p21 / p11;
    if (!(p11 > 1e-12 && p22 > 1e-12))
        return -1;
    const double v1 = h[j] - r01 * h[i], v2 = h[k] - r02 * h[i] - p21 / p11 * v1;
    const double a2 = v2 / p22, a1 = (v1 - p21 * a2) / p11, a0 = h[i] - r01 * a1 - r02 * a2;
    return a0 > 0 && a1 > 0 && a2 > 0 ? a0 * h[i] + a1 * h[j] + a2 * h[k] : -1;
}

static bool close_by(const problem *q, const start *x, const start *y)
{
    for (int t = 0; t < TERMS; t++)
        if (fabs(x->x[t] - y->x[t]) > 1.5 * q->data.basis->step)
            return false;
    return true;
}

static void search_three(point *best, problem *q, const point *two)
{
    start starts[TRIPLES];
    int count = 0;
    make_grid(q);
    insert(q, 0, two->x[0]);
    insert(q, 1, two->x[1]);
    make_gram(q);
    const int n = q->columns;
    for (int i = 0; i < n; i++)
        for (int j = i + 1; j < n; j++)
            for (int k = j + 1; k < n; k++) {
                start s = {gain_of_three(q, i, j, k), {q->x[i], q->x[j], q->x[k]}};
                if (!(s.gain > q->squares - two->chi_square) || (count == TRIPLES && s.gain <= starts[count - 1].gain))
                    continue;
                int near = 0;
                while (near < count && !close_by(q, &starts[near], &s))
                    near++;
                if (near < count && starts[near].gain >= s.gain)
                    continue;
                if (near < count) {
                    memmove(&starts[near], &starts[near + 1], (size_t)(count - near - 1) * sizeof *starts);
                    count--;
                }
                keep(starts, &count, TRIPLES, s);
            }
    descend(best, q, starts, count, 3, POSITIVE);
}

size_t alb_separable_scratch(const alb_basis *basis)
{
    const size_t rows = (size_t)basis->rows, columns = (size_t)basis->nodes + TERMS - 1;
    return (3 + 3 * TERMS + 1 + 3 + columns) * rows + columns + (columns + 2) * columns + columns * columns +
           columns * sizeof(double *) / sizeof(double) + columns;
}

static double *take(double **scratch, size_t count)
{
    double *taken = *scratch;
    *scratch += count;
    return taken;
}

static void lay_out(problem *q, const alb_basis *basis, double *scratch)
{
    const size_t rows = (size_t)basis->rows, columns = (size_t)basis->nodes + TERMS - 1;
    *q = (problem){.data = {.basis = basis}, .rows = basis->rows};
    q->column = (const double **)(void *)take(&scratch, columns); // pointers are no larger than doubles
    for (int t = 0; t < TERMS; t++) {
        q->term[t].column = take(&scratch, rows);
        q->term[t].first = take(&scratch, rows);
        q->term[t].second = take(&scratch, rows);
    }
    q->residual = take(&scratch, rows);
    q->work = take(&scratch, 3 * rows);
    q->nodes = take(&scratch, columns * rows);
    q->extra = q->nodes + (size_t)basis->nodes * rows;
    q->x = take(&scratch, columns);
    q->gram = take(&scratch, columns * columns);
    q->right = take(&scratch, 2 * columns);
    q->gain = take(&scratch, columns * columns);
}

// Whitens the values, in units of the largest of them; false where they are not fit for it.
static bool set_values(problem *q, double *unit, double *scratch, const double *value, const double *sd,
                       double energy_sd)
{
    const alb_basis *basis = q->data.basis;
    const int n = basis->count, rows = q->rows;
    double *weight = scratch, *whitened = scratch + rows, *energy = scratch + 2 * rows;
    double top = 0, bad = 0;
    memset(scratch, 0, 3 * (size_t)rows * sizeof *scratch);
    for (int i = 0; i < n; i++) {
        const double size = fabs(value[i]);
        top = size > top ? size : top;
        bad += !(size <= DBL_MAX) || !(sd[i] > 0) || !(sd[i] <= DBL_MAX);
    }
    if (bad > 0 || !(top > 0))
        return false;
    for (int i = 0; i < n; i++) {
        weight[i] = basis->share[i] * (top / sd[i]);
        whitened[i] = value[i] / sd[i];
    }
    q->data.weight = weight;
    q->data.value = whitened;
    if (energy_sd > 0) {
        for (int i = 0; i < n; i++)
            energy[i] = basis->area_mm2[i] * sd[i] / energy_sd;
        whitened[n] = alb_columns_dot(energy, whitened, rows);
        q->data.energy = energy;
    }
    q->squares = alb_columns_dot(whitened, whitened, rows);
    *unit = top;
    return isfinite(q->squares);
}

// Profile and covariance of the best place, in the units of the data.
static void report(alb_separable *fit, const point *p, alb_candidate candidate, double unit)
{
    const int terms = alb_form_term_count(candidate.form);
    double normal[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX] = {{0}};
    int order[TERMS] = {0, 1, 2};
    for (int i = 1; i < terms; i++)
        for (int j = i; j > 0 && p->x[order[j]] < p->x[order[j - 1]]; j--) {
            const int t = order[j];
            order[j] = order[j - 1];
            order[j - 1] = t;
        }
    for (int i = 0; i < terms; i++) {
        const int s = order[i];
        const double b = exp(p->x[s]), slope = p->amplitude[s] * unit / b;
        fit->profile.parameters[2 * i] = p->amplitude[s] * unit;
        fit->profile.parameters[2 * i + 1] = b;
        for (int j = 0; j < terms; j++) {
            const int t = order[j];
            const double other = p->amplitude[t] * unit / exp(p->x[t]);
            normal[2 * i][2 * j] = p->cc[s][t] / unit / unit;
            normal[2 * i][2 * j + 1] = p->cf[s][t] / unit * (other / unit);
            normal[2 * i + 1][2 * j] = p->cf[t][s] / unit * (slope / unit);
            normal[2 * i + 1][2 * j + 1] = p->ff[s][t] * (slope / unit) * (other / unit);
        }
    }
    fit->full_rank = alb_candidate_covariance(fit->covariance, normal, candidate);
}

void alb_separable_fit(alb_separable *fit, alb_candidate candidate, const alb_basis *basis, const double *value,
                       const double *sd, double energy_sd, double *scratch)
{
    problem q;
    double unit;
    point one, best = {.chi_square = (double)INFINITY};
    const int terms = alb_form_term_count(candidate.form);
    const size_t rows = (size_t)basis->rows;
    *fit = (alb_separable){.profile = {.form = candidate.form}, .chi_square = (double)INFINITY};
    lay_out(&q, basis, scratch + 3 * rows);
    if (!set_values(&q, &unit, scratch, value, sd, energy_sd))
        return;
    make_grid(&q);
    for (int j = 0; j < basis->nodes; j++)
        whiten(q.nodes + (size_t)j * rows, basis->column + (size_t)j * rows, &q);
    search_one(&one, &q);
    fit->chi_square = fit->chi_square_one = fmin(one.chi_square, q.squares);
    if (!isfinite(one.chi_square))
        return;
    if (terms == 1) {
        best = one;
    } else if (candidate.form != ALB_FORM_SIGNED_EXPONENTIALS) {
        search_two(&best, &q, &one, POSITIVE);
        if (terms == 3) {
            const point two = best;
            best.chi_square = (double)INFINITY;
            if (isfinite(two.chi_square))
                search_three(&best, &q, &two);
        }
    } else {
        search_tied(&best, &q);
        if (!candidate.tied) {
            const start tied = {0, {best.x[0], best.x[1], 0}};
            const bool found = isfinite(best.chi_square);
            best.chi_square = (double)INFINITY;
            descend(&best, &q, &tied, found, 2, SIGNED);
            search_two(&best, &q, &one, SIGNED);
        }
    }
    fit->found = best.chi_square < (terms == 1 ? q.squares : one.chi_square);
    if (!fit->found)
        return;
    fit->chi_square = best.chi_square;
    report(fit, &best, candidate, unit);
}
