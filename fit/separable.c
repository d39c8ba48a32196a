// min over decays b and amplitudes a of chi^2 = sum ((v_i - sum_j a_j c_i(b_j)) / sd_i)^2, a with the signs of the
// form, from no start values. The reduced problem is reduced.c's.
//
// 1. The best single exponential, b_0: the gain in chi^2 of one column is known on a grid of decays; from its peaks.
// 2. Positive terms: non-negative least squares over the grid (measure.c) finds few columns, mostly pairs of neighbours
//    around the decays of the data. Every cut of them into as many groups as terms are wanted gives a start, the
//    groups' mean ln b.
// 3. Signed pairs: all pairs of the grid and b_0 are solved; those peaks of the table that beat the single exponential
//    start a descent, and so does the best tied pair.
// 4. A second term that gains little has rivals: then also from b_0 and each peak of what a second column gains
//    (separable_second.c).
//
// 1 to 3 on readings of which neighbours are merged; what is left, one place mostly, is polished on all readings.
// The best minimum in each of thousands of random profiles, noise 0.1 to 10 %, decays 1 : 1.1 to 10 (tests). Stops
// being true where decays of the truth lie closer than the grid and the readings still tell them apart by more than two
// terms.
#include "fit/separable.h"
#include "fit/measure.h"
#include "fit/separable_search.h"
#include <math.h>
#include <string.h>

enum { TERMS = ALB_TERMS_MAX };

// A second term that gains less has rivals.
static const double gain_without_rival = 60;

void alb_starts_keep(alb_starts *s, alb_start candidate)
{
    if (s->count == ALB_STARTS && !(candidate.merit > s->list[ALB_STARTS - 1].merit))
        return;
    int at = s->count < ALB_STARTS ? s->count++ : ALB_STARTS - 1;
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

void alb_separable_polish(alb_place *best, alb_separable_search *s, const double *x, int terms, alb_signs signs)
{
    alb_place p;
    memcpy(p.x, x, sizeof p.x);
    alb_reduced_minimise(&p, &s->all, terms, signs, 1e-9);
    if (p.chi_square < best->chi_square)
        *best = p;
}

// Descends from the starts on the merged readings, and on all of them from those places that may be the best. Returns
// the least chi^2 of the merged readings.
static double descend(alb_place *best, alb_separable_search *s, const alb_starts *from, int terms, alb_signs signs)
{
    alb_place places[ALB_STARTS];
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
            alb_separable_polish(best, s, places[k].x, terms, signs);
    return least;
}

static void search_one(alb_place *best, alb_separable_search *s)
{
    alb_starts from = {0};
    const int n = s->columns;
    for (int j = 0; j < n; j++) {
        const double before = j > 0 ? s->right[j - 1] : 0, after = j + 1 < n ? s->right[j + 1] : 0, at = s->right[j];
        if (at > 0 && at > before && at >= after) {
            const double bend = 2 * at - before - after;
            alb_starts_keep(
                &from,
                (alb_start){at, {s->x[j] + (bend > 0 ? s->all.data.basis->step * (after - before) / bend / 2 : 0)}});
        }
    }
    descend(best, s, &from, 1, ALB_POSITIVE);
}

// Mean of ln b over the atoms [from, to), and in *spread their weighted variance.
static double middle(double *spread, const alb_measure *m, const alb_separable_search *s, int from, int to)
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
static void cut(alb_starts *out, const alb_measure *m, const alb_separable_search *s, int terms)
{
    for (int i = 1; i < m->count; i++)
        for (int j = terms == 3 ? i + 1 : m->count; j < m->count + (terms == 2); j++) {
            alb_start at = {0};
            double spread = 0;
            at.x[0] = middle(&spread, m, s, 0, i);
            at.x[1] = middle(&spread, m, s, i, j);
            if (terms == 3)
                at.x[2] = middle(&spread, m, s, j, m->count);
            at.merit = -spread;
            alb_starts_keep(out, at);
        }
}

// No two or three terms come closer than the measure, but for the steps of the grid: where the first start leads as
// close as that, the others cannot lead to more.
static void search_positive(alb_place *best, alb_separable_search *s, const alb_place *one, int terms)
{
    alb_starts all = {0};
    alb_measure m;
    double bound = s->merged.squares;
    alb_measure_fit(&m, s->column, s->right, s->scale, s->columns, s->merged.data.basis->rows, 1e-4 * one->chi_square,
                    s->gram);
    for (int k = 0; k < m.count; k++)
        bound -= m.amplitude[k] * s->right[m.column[k]];
    cut(&all, &m, s, terms);
    if (terms == 2 && all.count > 1) {
        const alb_starts first = {1, {all.list[0]}};
        if (descend(best, s, &first, terms, ALB_POSITIVE) < 1.1 * bound + 1 &&
            one->chi_square - best->chi_square > gain_without_rival)
            return;
    }
    descend(best, s, &all, terms, ALB_POSITIVE);
    if (terms == 2 && !(one->chi_square - best->chi_square > gain_without_rival))
        alb_separable_second(best, s, one, ALB_POSITIVE);
}

static void search_tied(alb_place *best, alb_separable_search *s, const alb_place *one)
{
    const alb_whitened *data = &s->merged.data;
    const int n = data->basis->nodes, rows = data->basis->rows;
    double *gain = s->gain, *tied = s->merged.residual;
    alb_starts from = {0};
    for (int j = 0; j < n; j++) {
        const double *column = s->nodes + (size_t)j * (size_t)rows;
        alb_separable_whiten(tied, data->basis->tied + (size_t)j * (size_t)rows, data);
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
            alb_starts_keep(&from, (alb_start){gain[j], {s->x[j], s->x[j] + log(ALB_TIED_RATIO)}});
    }
    descend(best, s, &from, 2, ALB_TIED);
    if (best->chi_square < one->chi_square)
        return;
    const double close[TERMS] = {one->x[0] + 0.02, one->x[0] + 0.02 + log(ALB_TIED_RATIO)};
    alb_separable_polish(best, s, close, 2, ALB_TIED);
}

// gain[i * n + j]: how much columns i < j lower chi^2, the faster one with a negative amplitude; -1 where the signs are
// others.
static void tabulate_pairs(alb_separable_search *s)
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

static void search_signed(alb_place *best, alb_separable_search *s, const alb_place *one)
{
    alb_place tied = {.chi_square = (double)INFINITY};
    alb_starts from = {0};
    search_tied(&tied, s, one);
    alb_separable_insert(s, one->x[0]);
    tabulate_pairs(s);
    const int n = s->columns;
    alb_place merged = {.x = {one->x[0]}};
    alb_reduced_evaluate(&merged, &s->merged, 1, ALB_POSITIVE);
    for (int i = 0; i < n; i++)
        for (int j = i + 1; j < n; j++)
            if (s->gain[i * n + j] > s->merged.squares - merged.chi_square && is_peak(s->gain, n, i, j) &&
                s->x[j] - s->x[i] > log(ALB_TIED_RATIO))
                alb_starts_keep(&from, (alb_start){s->gain[i * n + j], {s->x[i], s->x[j]}});
    descend(best, s, &from, 2, ALB_SIGNED);
    if (!(one->chi_square - best->chi_square > gain_without_rival))
        alb_separable_second(best, s, one, ALB_SIGNED);
    if (isfinite(tied.chi_square))
        alb_separable_polish(best, s, tied.x, 2, ALB_SIGNED);
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
    alb_separable_search s;
    alb_place one = {.chi_square = (double)INFINITY}, best = one;
    const int terms = alb_form_term_count(candidate.form);
    *fit = (alb_separable){.profile = {.form = candidate.form}, .chi_square = (double)INFINITY};
    if (!alb_separable_prepare(&s, basis, value, sd, energy_sd, scratch))
        return;
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
