// The data of one search: values whitened in units of the largest, the same with neighbours merged (their plain means,
// as their columns are, with the sd of those), and the grid's columns of the merged ones. Stops being true where
// neighbours that are merged (basis.c) differ by more than the search has to know.
#include "fit/separable.h"
#include "fit/separable_search.h"
#include <float.h>
#include <math.h>
#include <string.h>

enum { TERMS = ALB_TERMS_MAX };

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

static void lay_out(alb_separable_search *s, const alb_basis *basis, double *scratch)
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
static bool set_values(alb_separable_search *s, const double *value, const double *sd, double energy_sd)
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
static void merge_values(alb_separable_search *s, const double *value, const double *sd, double energy_sd)
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

void alb_separable_whiten(double *out, const double *column, const alb_whitened *data)
{
    const alb_basis *basis = data->basis;
    for (int i = 0; i < basis->rows; i++)
        out[i] = data->weight[i] * column[i];
    if (data->energy)
        out[basis->count] = alb_columns_dot(data->energy, out, basis->rows);
}

static void make_grid(alb_separable_search *s)
{
    const alb_whitened *data = &s->merged.data;
    const alb_basis *basis = data->basis;
    s->columns = basis->nodes;
    for (int j = 0; j < basis->nodes; j++) {
        double *column = s->nodes + (size_t)j * (size_t)basis->rows;
        alb_separable_whiten(column, basis->column + (size_t)j * (size_t)basis->rows, data);
        s->x[j] = basis->first + j * basis->step;
        s->column[j] = column;
        s->scale[j] = 1 / sqrt(alb_columns_dot(column, column, basis->rows));
        s->right[j] = alb_columns_dot(column, data->value, basis->rows) * s->scale[j];
    }
}

bool alb_separable_prepare(alb_separable_search *s, const alb_basis *basis, const double *value, const double *sd,
                           double energy_sd, double *scratch)
{
    lay_out(s, basis, scratch);
    if (!set_values(s, value, sd, energy_sd))
        return false;
    merge_values(s, value, sd, energy_sd);
    make_grid(s);
    return true;
}

void alb_separable_insert(alb_separable_search *s, double x)
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
