// Whitened model values and their derivatives. For sums of exponentials all come from the readings of e^(-b r) and
// r e^(-b r) of the terms: two columns of the operator each, one application for two terms, a second for the third.
// Other forms give their value and derivatives on the operator's grid.
#include "fit/model.h"
#include "base/memory.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

double alb_energy(const alb_readings *readings, const double *value)
{
    double sum = 0;
    for (int i = 0; i < readings->count; i++)
        sum += readings->area_mm2[i] * value[i];
    return sum;
}

int alb_weighing_rows(const alb_weighing *weighing) { return weighing->readings->count + (weighing->energy_sd > 0); }

double alb_weighing_reading(const alb_weighing *weighing, int i)
{
    return i < weighing->readings->count
               ? weighing->readings->value[i] / weighing->sd[i]
               : alb_energy(weighing->readings, weighing->readings->value) / weighing->energy_sd;
}

void alb_model_free(alb_model *model)
{
    free(model->on_grid);
    free(model->columns[0]);
    free(model->values[0]);
    *model = (alb_model){0};
}

bool alb_model_create(alb_model *model, const alb_weighing *weighing, alb_error *error)
{
    const size_t grid = (size_t)weighing->forward->grid_count, rows = (size_t)weighing->readings->count + 1;
    *model = (alb_model){.weighing = weighing};
    if (!(model->on_grid = alb_allocate(grid, sizeof *model->on_grid, error)) ||
        !(model->columns[0] = alb_allocate(ALB_MODEL_BLOCKS * rows, sizeof *model->columns[0], error)) ||
        !(model->values[0] = alb_allocate((1 + ALB_PARAMETERS_MAX) * rows, sizeof(double), error))) {
        alb_model_free(model);
        return false;
    }
    for (int block = 1; block < ALB_MODEL_BLOCKS; block++)
        model->columns[block] = model->columns[block - 1] + rows;
    for (int p = 1; p <= ALB_PARAMETERS_MAX; p++)
        model->values[p] = model->values[p - 1] + rows;
    return true;
}

// Readings of e^(-b r) and r e^(-b r) of the terms from parameter `from` on, as many as go together.
static void apply_terms(alb_model *model, const double *p, int from, int parameters)
{
    const alb_operator *forward = model->weighing->forward;
    const int together = parameters - from < ALB_OPERATOR_COLUMNS ? parameters - from : ALB_OPERATOR_COLUMNS;
    for (int k = 0; k < forward->grid_count; k++)
        for (int t = 0; t < together; t += 2) {
            const double e = exp(-p[from + t + 1] * forward->grid_mm[k]);
            model->on_grid[k][t] = e;
            model->on_grid[k][t + 1] = forward->grid_mm[k] * e;
        }
    alb_operator_apply(model->columns[from / ALB_OPERATOR_COLUMNS], forward,
                       (const double(*)[ALB_OPERATOR_COLUMNS])model->on_grid);
}

static void evaluate_exponentials(alb_model *model, const alb_profile *profile)
{
    const int n = model->weighing->readings->count, parameters = alb_form_parameter_count(profile->form);
    const double *p = profile->parameters;
    for (int from = 0; from < parameters; from += ALB_OPERATOR_COLUMNS)
        apply_terms(model, p, from, parameters);
    for (int i = 0; i < n; i++) {
        model->values[0][i] = 0;
        for (int t = 0; t < parameters; t += 2) {
            const double *column = model->columns[t / ALB_OPERATOR_COLUMNS][i] + t % ALB_OPERATOR_COLUMNS;
            model->values[0][i] += p[t] * column[0];
            model->values[1 + t][i] = column[0];
            model->values[2 + t][i] = -p[t] * column[1];
        }
    }
}

// Any other form: its value and derivatives on the grid, four columns at a time.
static void evaluate_on_grid(alb_model *model, const alb_profile *profile)
{
    const alb_operator *forward = model->weighing->forward;
    const int n = model->weighing->readings->count, columns = 1 + alb_form_parameter_count(profile->form);
    for (int from = 0; from < columns; from += ALB_OPERATOR_COLUMNS) {
        double values[ALB_PARAMETERS_MAX + 1 + ALB_OPERATOR_COLUMNS] = {0};
        for (int k = 0; k < forward->grid_count; k++) {
            values[0] = alb_profile_gradient(values + 1, profile, forward->grid_mm[k]);
            memcpy(model->on_grid[k], values + from, sizeof model->on_grid[k]);
        }
        alb_operator_apply(model->columns[0], forward, (const double(*)[ALB_OPERATOR_COLUMNS])model->on_grid);
        for (int c = from; c < columns && c < from + ALB_OPERATOR_COLUMNS; c++)
            for (int i = 0; i < n; i++)
                model->values[c][i] = model->columns[0][i][c - from];
    }
}

void alb_model_evaluate(alb_model *model, const alb_profile *profile)
{
    const alb_weighing *weighing = model->weighing;
    const int n = weighing->readings->count;
    if (alb_form_term_count(profile->form) > 0)
        evaluate_exponentials(model, profile);
    else
        evaluate_on_grid(model, profile);
    for (int q = 0; q <= alb_form_parameter_count(profile->form); q++) {
        double *values = model->values[q];
        if (weighing->energy_sd > 0)
            values[n] = alb_energy(weighing->readings, values) / weighing->energy_sd;
        for (int i = 0; i < n; i++)
            values[i] /= weighing->sd[i];
    }
}
