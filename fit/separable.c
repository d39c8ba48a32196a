// min over decays b and amplitudes a of chi^2 = sum ((v_i - sum_j a_j c_i(b_j)) / sd_i)^2, a with the signs of the
// form, from no start values. The reduced problem is reduced.c's.
//
// 1. The best single exponential, b_0: the gain in chi^2 of one column is known on a grid of decays; from its peaks.
// 2. Positive terms: non-negative least squares over the grid (measure.c) finds few columns, mostly pairs of neighbours
//    around the decays of the data. Every cut of them into as many groups as terms are wanted gives a start, the
//    groups' mean ln b.
// 3. Signed pairs: all pairs of the grid and b_0 are solved; those peaks of the table that beat the single exponential
//    start a descent, and so does the best tied pair.
// 4. A second term that gains little has rivals: then also from b_0 and each peak of what a second column gains.
//
// 1 to 3 on readings of which neighbours are merged; what is left, one place mostly, is polished on all readings.
// The best minimum in each of thousands of random profiles, noise 0.1 to 10 %, decays 1 : 1.1 to 10 (tests). Stops
// being true where decays of the truth lie closer than the grid and the readings still tell them apart by more than two
// terms.
#include "fit/separable.h"
#include "fit/measure.h"
#include "fit/reduced.h"
#include <float.h>
#include <math.h>
#include <string.h>

enum { TERMS = ALB_TERMS_MAX, STARTS = 8 };

// A second term that gains less has rivals among what the noise makes.
static const double gain_without_rival = 60;

typedef struct start {
    double merit, x[TERMS];
} start;

typedef struct starts {
    int count;
    start list[STARTS];
} starts;

typedef struct search {
    alb_reduced all, merged;
    double *input[2];      // of all and of the merged readings: rows of weight, value, energy
    double unit;           // of the values
    int columns;           // of the grid, for the merged readings: the nodes, and one more in its place
    const double **column; // whitened, in order of decay
    double *nodes, *x, *right, *scale,
        *gram; // right: products with the values; those and gram of columns of unit length
    double *gain;
} search;

// The best come first.
static void keep(starts *s, start candidate)
{
    if (s->count == STARTS && !(candidate.merit > s->list[STARTS - 1].merit))
        return;
    int at = s->count < STARTS ? s->count++ : STARTS - 1;
    for (; at > 0 && s->list[at - 1].merit < candidate.merit; at--)
        s->list[at] = s->list[at - 1];
    s->list[at] = candidate;
}

static bool same_place(const alb_place *p, const alb_place *q, int terms)
{
    double apart = 0;
    for (int t = 0; t < terms; t++)
        apart = fmax(apart, fabs(p->x[t] - q->x[t]));
    return apart < 1e-2;
}

static void polish(alb_place *best, search *s, const double *x, int terms, alb_signs signs)
{
    alb_place p;
    memcpy(p.x, x, sizeof p.x);
    alb_reduced_minimise(&p, &s->all, terms, signs, 1e-9);
    if (p.chi_square < best->chi_square)
        *best = p;
}

// Descends from the starts on the merged readings, and on all of them from those places that may be the best. Returns
// the least chi^2 of the merged readings.
static double descend(alb_place *best, search *s, const starts *from, int terms, alb_signs signs)
{
    alb_place places[STARTS];
    double least = (double)INFINITY;
    int count = 0;
    for (int k = 0; k < from->count; k++) {
        alb_place *p = &places[count];
        memcpy(p->x, from->list[k].x, sizeof p->x);
        alb_reduced_minimise(p, &s->merged, terms, signs, 1e-4);
        bool known = !isfinite(p->chi_square);
        for (int j = 0; j < count; j++)
            known |= same_place(p, &places[j], terms);
        count += !known;
        least = fmin(least, p->chi_square);
    }
    for (int k = 0; k < count; k++)
        if (places[k].chi_square <= 1.1 * least + 2)
            polish(best, s, places[k].x, terms, signs);
    return least;
}

static void whiten(double *out, const double *column, const alb_whitened *data)
{
    const alb_basis *basis = data->basis;
    for (int i = 0; i < basis->rows; i++)
        out[i] = data->weight[i] * column[i];
    if (data->energy)
        out[basis->count] = alb_columns_dot(data->energy, out, basis->rows);
}

static void make_grid(search *s)
{
    const alb_whitened *data = &s->merged.data;
    const alb_basis *basis = data->basis;
    s->columns = basis->nodes;
    for (int j = 0; j < basis->nodes; j++) {
        double *column = s->nodes + (size_t)j * (size_t)basis->rows;
        whiten(column, basis->column + (size_t)j * (size_t)basis->rows, data);
        s->x[j] = basis->first + j * basis->step;
        s->column[j] = column;
        s->scale[j] = 1 / sqrt(alb_columns_dot(column, column, basis->rows));
        s->right[j] = alb_columns_dot(column, data->value, basis->rows) * s->scale[j];
    }
}

static void search_one(alb_place *best, search *s)
{
    starts from = {0};
    const int n = s->columns;
    for (int j = 0; j < n; j++) {
        const double before = j > 0 ? s->right[j - 1] : 0, after = j + 1 < n ? s->right[j + 1] : 0, at = s->right[j];
        if (at > 0 && at > before && at >= after) {
            const double bend = 2 * at - before - after;
            keep(&from,
                 (start){at, {s->x[j] + (bend > 0 ? s->all.data.basis->step * (after - before) / bend / 2 : 0)}});
        }
    }
    descend(best, s, &from, 1, ALB_POSITIVE);
}
// Mean of ln b over the atoms [from, to), and in *spread their weighted variance.
static double middle(double *spread, const alb_measure *m, const search *s, int from, int to)
{
    double weight = 0, mean = 0, square = 0;
    for (int k = from; k < to; k++) {
        weight += m->amplitude[k];
        mean += m->amplitude[k] * s->x[m->column[k]];
    }
    mean /= weight;
    for (int k = from; k < to; k++)
        square += m->amplitude[k] * (s->x[m->column[k]] - mean) * (s->x[m->column[k]] - mean);
    *spread += square;
    return mean;
}

// Every cut of the atoms into two or three groups; of least spread first.
static void cut(starts *out, const alb_measure *m, const search *s, int terms)
{
    for (int i = 1; i < m->count; i++)
        for (int j = terms == 3 ? i + 1 : m->count; j < m->count + (terms == 2); j++) {
            start at = {0};
            double spread = 0;
            at.x[0] = middle(&spread, m, s, 0, i);
            at.x[1] = middle(&spread, m, s, i, j);
            if (terms == 3)
                at.x[2] = middle(&spread, m, s, j, m->count);
            at.merit = -spread;
            keep(out, at);
        }
}

// From the single exponential and a second term at each peak of what that gains on rungs finer than the grid. The
// residual r of the single exponential, column c_1, is orthogonal to it and to f_1; a term at x lowers chi^2 where
// r.c > 0, by (r.c)^2 / |c beside c_1 and f_1|^2 where that is little.
static void climb(alb_place *best, search *s, const alb_place *one)
{
    const alb_whitened *data = &s->all.data;
    const int rows = data->basis->rows;
    const double rung = 0.15, pivot = one->x[0], amplitude = one->amplitude[0];
    alb_term *first = &s->all.term[0], *second = &s->all.term[1];
    double products[TERMS][3], before = 0, at = 0;
    start here = {0};
    alb_term_evaluate(first, data, pivot, s->all.work);
    alb_term_residual(s->all.residual, products, data, first, &amplitude, 1);
    const double overlap = first->cf / first->cc, beside = first->ff - overlap * first->cf;
    const int last = (int)((data->basis->highest - s->x[0]) / rung);
    starts from = {0};
    for (int k = 0; k <= last + 1; k++) {
        const double x = s->x[0] + k * rung;
        double after = 0;
        start next = {0};
        if (k <= last) {
            alb_term_evaluate(second, data, x, s->all.work);
            const double lift = alb_columns_dot(s->all.residual, second->column, rows);
            const double c = alb_columns_dot(first->column, second->column, rows);
            const double f = alb_columns_dot(first->first, second->column, rows) - overlap * c;
            const double length = second->cc - c * c / first->cc - f * f / beside;
            after = lift > 0 && length > 1e-9 * second->cc ? lift * lift / length : 0;
            const double shift = after > 0 ? fmin(fmax(-lift / length * f / beside / amplitude, -0.5), 0.5) : 0;
            next = (start){after, {fmin(pivot + shift, x), fmax(pivot + shift, x)}};
        }
        if (at > before && at >= after)
            keep(&from, here);
        before = at;
        at = after;
        here = next;
    }
    for (int k = 0; k < from.count; k++)
        polish(best, s, from.list[k].x, 2, ALB_POSITIVE);
}

// From the single exponential and a second term at each peak of what that gains, the first moved so that the mean
// stays.
static void polish_second(alb_place *best, search *s, const alb_place *one, alb_signs signs)
{
    const int n = s->columns, rows = s->merged.data.basis->rows;
    const double pivot = one->x[0], sign = signs == ALB_POSITIVE ? 1 : -1;
    alb_term *first = &s->merged.term[0];
    double *gain = s->gain, *shift = s->gain + n;
    starts from = {0};
    alb_term_evaluate(first, &s->merged.data, pivot, s->merged.work);
    const double length = sqrt(first->cc), right = first->cv / length;
    for (int j = 0; j < n; j++) {
        const double c = alb_columns_dot(first->column, s->column[j], rows) * s->scale[j] / length;
        const double a = right - c * s->right[j], b = s->right[j] - c * right;
        gain[j] = a > 0 && b * sign > 0 && c * c < 1 ? b * b / (1 - c * c) : 0;
        shift[j] = a > 0 ? fmin(fmax(b / a * (pivot - s->x[j]), -0.5), 0.5) : 0;
    }
    for (int j = 0; j < n; j++) {
        const double before = j > 0 ? gain[j - 1] : 0, after = j + 1 < n ? gain[j + 1] : 0, x = pivot + shift[j];
        if (gain[j] > 0 && gain[j] > before && gain[j] >= after &&
            (signs == ALB_POSITIVE || s->x[j] > x + log(ALB_TIED_RATIO)))
            keep(&from, (start){gain[j], {fmin(x, s->x[j]), fmax(x, s->x[j])}});
    }
    if (signs == ALB_POSITIVE)
        keep(&from, (start){0, {pivot - 0.2, pivot + 0.2}});
    for (double apart = 0.7; signs != ALB_POSITIVE && apart < 2; apart += 0.6)
        keep(&from, (start){0, {pivot + 0.02, pivot + apart}});
    for (int k = 0; k < from.count; k++)
        polish(best, s, from.list[k].x, 2, signs);
    if (signs == ALB_POSITIVE)
        climb(best, s, one);
}

// No two or three terms come closer than the measure, but for the steps of the grid: where the first start leads as
// close as that, the others cannot lead to more.
static void search_positive(alb_place *best, search *s, const alb_place *one, int terms)
{
    starts all = {0};
    alb_measure m;
    double bound = s->merged.squares;
    alb_measure_fit(&m, s->column, s->right, s->scale, s->columns, s->merged.data.basis->rows, 1e-4 * one->chi_square,
                    s->gram);
    for (int k = 0; k < m.count; k++)
        bound -= m.amplitude[k] * s->right[m.column[k]];
    cut(&all, &m, s, terms);
    if (terms == 2 && all.count > 1) {
        const starts first = {1, {all.list[0]}};
        if (descend(best, s, &first, terms, ALB_POSITIVE) < 1.1 * bound + 1 &&
            one->chi_square - best->chi_square > gain_without_rival)
            return;
    }
    descend(best, s, &all, terms, ALB_POSITIVE);
    if (terms == 2 && !(one->chi_square - best->chi_square > gain_without_rival))
        polish_second(best, s, one, ALB_POSITIVE);
}

static void search_tied(alb_place *best, search *s, const alb_place *one)
{
    const alb_whitened *data = &s->merged.data;
    const int n = data->basis->nodes, rows = data->basis->rows;
    double *gain = s->gain, *tied = s->merged.residual;
    starts from = {0};
    for (int j = 0; j < n; j++) {
        const double *column = s->nodes + (size_t)j * (size_t)rows;
        whiten(tied, data->basis->tied + (size_t)j * (size_t)rows, data);
        const double g11 = alb_columns_dot(column, column, rows), g12 = alb_columns_dot(column, tied, rows);
        const double g22 = alb_columns_dot(tied, tied, rows), h1 = alb_columns_dot(column, data->value, rows);
        const double h2 = alb_columns_dot(tied, data->value, rows), determinant = g11 * g22 - g12 * g12;
        const double a1 = (g22 * h1 - g12 * h2) / determinant, a2 = (g11 * h2 - g12 * h1) / determinant;
        gain[j] = a1 > 0 && a2 < 0 ? a1 * h1 + a2 * h2 : -1;
        if (a1 > 0 && a2 < 0 && a1 + a2 < 0)
            gain[j] = h1 > h2 ? (h1 - h2) * (h1 - h2) / (g11 - 2 * g12 + g22) : -1;
    }
    for (int j = 0; j < n; j++) {
        const double before = j > 0 ? gain[j - 1] : -1, after = j + 1 < n ? gain[j + 1] : -1;
        if (gain[j] > 0 && gain[j] > before && gain[j] >= after)
            keep(&from, (start){gain[j], {s->x[j], s->x[j] + log(ALB_TIED_RATIO)}});
    }
    descend(best, s, &from, 2, ALB_TIED);
    if (best->chi_square < one->chi_square)
        return;
    const double close[TERMS] = {one->x[0] + 0.02, one->x[0] + 0.02 + log(ALB_TIED_RATIO)};
    polish(best, s, close, 2, ALB_TIED);
}

// Makes the column of decay e^x one of the grid's.
static void insert(search *s, double x)
{
    const alb_basis *basis = s->merged.data.basis;
    double *column = s->nodes + (size_t)basis->nodes * (size_t)basis->rows;
    alb_term_evaluate(&s->merged.term[0], &s->merged.data, x, s->merged.work);
    memcpy(column, s->merged.term[0].column, (size_t)basis->rows * sizeof *column);
    int at = s->columns++;
    for (; at > 0 && s->x[at - 1] > x; at--) {
        s->x[at] = s->x[at - 1];
        s->column[at] = s->column[at - 1];
        s->scale[at] = s->scale[at - 1];
        s->right[at] = s->right[at - 1];
    }
    s->x[at] = x;
    s->column[at] = column;
    s->scale[at] = 1 / sqrt(s->merged.term[0].cc);
    s->right[at] = s->merged.term[0].cv * s->scale[at];
}

// gain[i * n + j]: how much columns i < j lower chi^2, the faster one with a negative amplitude; -1 where the signs are
// others.
static void tabulate_pairs(search *s)
{
    const int n = s->columns;
    const double *h = s->right;
    alb_columns_gram(s->gram, s->column, n, s->merged.data.basis->rows);
    for (int i = 0; i < n; i++)
        for (int j = i + 1; j < n; j++) {
            const double si = s->scale[i], sj = s->scale[j], c = s->gram[i * n + j] * si * sj;
            const double a = h[i] - c * h[j], b = h[j] - c * h[i], difference = h[i] * sj - h[j] * si;
            double *gain = &s->gain[i * n + j];
            *gain = a > 0 && b < 0 && c * c < 1 ? (h[i] * a + h[j] * b) / (1 - c * c) : -1;
            if (*gain > 0 && si * a + sj * b < 0)
                *gain = difference > 0 ? difference * difference / (si * si + sj * sj - 2 * c * si * sj) : -1;
        }
}

static bool is_peak(const double *gain, int n, int i, int j)
{
    for (int k = i > 0 ? i - 1 : 0; k <= i + 1; k++)
        for (int l = j > 0 ? j - 1 : 0; l <= j + 1 && l < n; l++)
            if (k < l && gain[k * n + l] > gain[i * n + j])
                return false;
    return true;
}

static void search_signed(alb_place *best, search *s, const alb_place *one)
{
    alb_place tied = {.chi_square = (double)INFINITY};
    starts from = {0};
    search_tied(&tied, s, one);
    insert(s, one->x[0]);
    tabulate_pairs(s);
    const int n = s->columns;
    alb_place merged = {.x = {one->x[0]}};
    alb_reduced_evaluate(&merged, &s->merged, 1, ALB_POSITIVE);
    for (int i = 0; i < n; i++)
        for (int j = i + 1; j < n; j++)
            if (s->gain[i * n + j] > s->merged.squares - merged.chi_square && is_peak(s->gain, n, i, j) &&
                s->x[j] - s->x[i] > log(ALB_TIED_RATIO))
                keep(&from, (start){s->gain[i * n + j], {s->x[i], s->x[j]}});
    descend(best, s, &from, 2, ALB_SIGNED);
    if (!(one->chi_square - best->chi_square > gain_without_rival))
        polish_second(best, s, one, ALB_SIGNED);
    if (isfinite(tied.chi_square))
        polish(best, s, tied.x, 2, ALB_SIGNED);
}

static double *take(double **scratch, size_t count)
{
    double *taken = *scratch;
    *scratch += count;
    return taken;
}

static void lay_out_data(alb_reduced *out, const alb_basis *basis, double **scratch)
{
    const size_t rows = (size_t)basis->rows;
    *out = (alb_reduced){.data = {.basis = basis}};
    for (int t = 0; t < TERMS; t++) {
        out->term[t].column = take(scratch, rows);
        out->term[t].first = take(scratch, rows);
        out->term[t].second = take(scratch, rows);
    }
    out->residual = take(scratch, rows);
    out->work = take(scratch, 3 * rows);
}

enum { ROWS_OF_DATA = 3 * TERMS + 4 + 3 };

size_t alb_separable_scratch(const alb_basis *basis)
{
    const size_t columns = (size_t)basis->nodes + 1;
    return ROWS_OF_DATA * (size_t)(basis->rows + basis->merged->rows) + columns * (size_t)basis->merged->rows +
           5 * columns + 2 * columns * columns;
}

static void lay_out(search *s, const alb_basis *basis, double *scratch)
{
    const size_t columns = (size_t)basis->nodes + 1;
    s->column = (const double **)(void *)take(&scratch, columns); // pointers are no larger than doubles
    lay_out_data(&s->all, basis, &scratch);
    lay_out_data(&s->merged, basis->merged, &scratch);
    s->input[0] = take(&scratch, 3 * (size_t)basis->rows);
    s->input[1] = take(&scratch, 3 * (size_t)basis->merged->rows);
    s->nodes = take(&scratch, columns * (size_t)basis->merged->rows);
    s->x = take(&scratch, columns);
    s->right = take(&scratch, columns);
    s->scale = take(&scratch, columns);
    s->gram = take(&scratch, columns * columns);
    s->gain = take(&scratch, columns * columns);
}

static void bind(alb_reduced *problem, double *input, bool energy)
{
    const int rows = problem->data.basis->rows;
    problem->data.weight = input;
    problem->data.value = input + rows;
    problem->data.energy = energy ? input + 2 * rows : NULL;
    problem->squares = alb_columns_dot(input + rows, input + rows, rows);
}

// Whitens the values, in units of the largest of them; false where they are not fit for it.
static bool set_values(search *s, const double *value, const double *sd, double energy_sd)
{
    const alb_basis *basis = s->all.data.basis;
    const int n = basis->count, rows = basis->rows;
    double *weight = s->input[0], *whitened = weight + rows, *energy = whitened + rows;
    double top = 0, bad = 0;
    memset(weight, 0, 3 * (size_t)rows * sizeof *weight);
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
    if (energy_sd > 0) {
        for (int i = 0; i < n; i++)
            energy[i] = basis->area_mm2[i] * sd[i] / energy_sd;
        whitened[n] = alb_columns_dot(energy, whitened, rows);
    }
    s->unit = top;
    bind(&s->all, weight, energy_sd > 0);
    return isfinite(s->all.squares);
}

// Plain means of neighbours, as their columns are.
static void merge_values(search *s, const double *value, const double *sd, double energy_sd)
{
    const alb_basis *basis = s->all.data.basis, *merged = basis->merged;
    double *weight = s->input[1], *whitened = weight + merged->rows, *energy = whitened + merged->rows;
    memset(weight, 0, 3 * (size_t)merged->rows * sizeof *weight);
    for (int g = 0; g < merged->count; g++) {
        const int from = basis->group[g], to = basis->group[g + 1];
        double square = 0, sum = 0;
        for (int i = from; i < to; i++) {
            square += (sd[i] / s->unit) * (sd[i] / s->unit);
            sum += value[i] / s->unit;
        }
        const double mean_sd = sqrt(square); // (to - from) times it
        weight[g] = merged->share[g] * (to - from) / mean_sd;
        whitened[g] = sum / mean_sd;
        if (energy_sd > 0)
            energy[g] = merged->area_mm2[g] * (mean_sd / (to - from)) * (s->unit / energy_sd);
    }
    if (energy_sd > 0)
        whitened[merged->count] = s->all.data.value[basis->count];
    bind(&s->merged, weight, energy_sd > 0);
}

// Profile and covariance of the best place, in the units of the data.
static void report(alb_separable *fit, const alb_place *p, alb_candidate candidate, double unit)
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
    search s;
    alb_place one = {.chi_square = (double)INFINITY}, best = one;
    const int terms = alb_form_term_count(candidate.form);
    *fit = (alb_separable){.profile = {.form = candidate.form}, .chi_square = (double)INFINITY};
    lay_out(&s, basis, scratch);
    if (!set_values(&s, value, sd, energy_sd))
        return;
    merge_values(&s, value, sd, energy_sd);
    make_grid(&s);
    search_one(&one, &s);
    fit->chi_square = fit->chi_square_one = fmin(one.chi_square, s.all.squares);
    if (!isfinite(one.chi_square))
        return;
    s.all.pivot = s.merged.pivot = one.x[0];
    if (terms == 1)
        best = one;
    else if (candidate.form != ALB_FORM_SIGNED_EXPONENTIALS)
        search_positive(&best, &s, &one, terms);
    else if (candidate.tied)
        search_tied(&best, &s, &one);
    else
        search_signed(&best, &s, &one);
    fit->found = best.chi_square < (terms == 1 ? s.all.squares : one.chi_square);
    if (!fit->found)
        return;
    fit->chi_square = best.chi_square;
    report(fit, &best, candidate, s.unit);
}
