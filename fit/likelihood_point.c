// chi-square near the best fit, with a quantity held and the limits of the form (profile_likelihood.c says of what
// use). All parameters keep their sign: u = ln |parameter|, so units drop out; the offset counts in its own sd.
// Readings are whitened, chi-square = |W S(u) - v|^2, and its Gauss-Newton matrix is J^T J by u.
//
// Held: one more reading, (ln q(u) - c) / e. Limits (order of the decays, S >= 0, what the readings can show at all):
// readings of the violation alone, with an sd of 1e-5. Levenberg-Marquardt on the normal equations, scaled to unit
// diagonal: the digits that squaring loses change the path and not the point. Stops being true where the best fit lies
// on a limit: the penalty then moves it by up to that sd.
#include "fit/likelihood_point.h"
#include "fit/cholesky.h"
#include <math.h>
#include <string.h>

enum { FREE = ALB_LIKELIHOOD_FREE };
typedef alb_point point;
static const double constraint_sd = 1e-5;

alb_profile alb_likelihood_profile(const alb_likelihood *l, const double *u)
{
    alb_profile profile = {.form = l->candidate.form};
    for (int k = 0; k < l->free_count; k++)
        if (l->parameter[k] >= 0)
            profile.parameters[l->parameter[k]] = l->sign[l->parameter[k]] * exp(u[k]);
    if (l->candidate.tied)
        profile.parameters[3] = ALB_TIED_RATIO * profile.parameters[1];
    return profile;
}

void alb_likelihood_logarithms(double *u, const alb_likelihood *l, const alb_profile *profile)
{
    for (int k = 0; k < l->free_count; k++)
        u[k] = l->parameter[k] >= 0 ? log(fabs(profile->parameters[l->parameter[k]])) : l->offset / l->offset_unit;
}

// ln |quantity| and its derivatives by u.
double alb_likelihood_quantity(double *gradient, const alb_likelihood *l, alb_quantity quantity, const double *u)
{
    double own[ALB_PARAMETERS_MAX] = {0}, value;
    const alb_profile profile = alb_likelihood_profile(l, u);
    if (quantity.kind == ALB_QUANTITY_PARAMETER) {
        value = profile.parameters[quantity.parameter];
        own[quantity.parameter] = 1;
    } else {
        value = quantity.kind == ALB_QUANTITY_TOTAL ? alb_profile_total_gradient(own, &profile)
                                                    : alb_profile_gradient(own, &profile, quantity.r_mm);
    }
    for (int k = 0; k < l->free_count; k++) {
        const int p = l->parameter[k];
        gradient[k] = p >= 0 ? own[p] * profile.parameters[p] / value : 0;
        if (l->candidate.tied && p == 1)
            gradient[k] += own[3] * profile.parameters[3] / value;
    }
    return log(fabs(value));
}

static void add_row(point *at, int n, double residual, const double *row)
{
    at->penalty += residual * residual;
    for (int i = 0; i < n; i++) {
        at->full_gradient[i] += row[i] * residual;
        for (int j = 0; j < n; j++)
            at->full_matrix[i * FREE + j] += row[i] * row[j];
    }
}

double alb_likelihood_violation(const alb_likelihood *l, int c, const double *u)
{
    const double right = l->constraints[c].minus < 0 ? 0 : u[l->constraints[c].minus];
    return l->constraints[c].limit - l->constraints[c].scale * (u[l->constraints[c].plus] - right);
}

static void add_penalties(point *at, const alb_likelihood *l, const alb_hold *held)
{
    double row[FREE];
    for (int c = 0; c < l->constraint_count; c++) {
        const double violation = alb_likelihood_violation(l, c, at->u);
        if (!(violation > 0))
            continue;
        memset(row, 0, sizeof row);
        row[l->constraints[c].plus] = -l->constraints[c].scale / constraint_sd;
        if (l->constraints[c].minus >= 0)
            row[l->constraints[c].minus] = l->constraints[c].scale / constraint_sd;
        add_row(at, l->free_count, violation / constraint_sd, row);
    }
    if (!held)
        return;
    at->held = alb_likelihood_quantity(row, l, held->quantity, at->u);
    for (int k = 0; k < l->free_count; k++)
        row[k] /= held->sd;
    add_row(at, l->free_count, (at->held - held->value) / held->sd, row);
}

static double dot(const double *x, const double *y, int n)
{
    double sum[4] = {0};
    int i = 0;
    for (; i + 4 <= n; i += 4)
        for (int k = 0; k < 4; k++)
            sum[k] += x[i + k] * y[i + k];
    for (; i < n; i++)
        sum[0] += x[i] * y[i];
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

// Residuals and Jacobian at u into the likelihood's room.
void alb_likelihood_linearise(alb_likelihood *l, const double *u)
{
    const alb_profile profile = alb_likelihood_profile(l, u);
    const double *const *values = (const double *const *)l->model.values;
    alb_model_evaluate(&l->model, &profile);
    for (int i = 0; i < l->rows; i++)
        l->residual[i] = values[0][i] - l->reading[i];
    for (int k = 0; k < l->free_count; k++) {
        const int p = l->parameter[k];
        double *column = l->columns[k];
        if (p < 0) { // the offset's column is made once
            for (int i = 0; i < l->rows; i++)
                l->residual[i] += u[k] * column[i];
            continue;
        }
        for (int i = 0; i < l->rows; i++)
            column[i] = profile.parameters[p] * values[1 + p][i];
        for (int i = 0; l->candidate.tied && p == 1 && i < l->rows; i++)
            column[i] += profile.parameters[3] * values[4][i];
    }
}

void alb_point_evaluate(point *at, alb_likelihood *l, const alb_hold *held)
{
    const int n = l->free_count;
    alb_likelihood_linearise(l, at->u);
    at->chi_square = dot(l->residual, l->residual, l->rows);
    for (int i = 0; i < n; i++) {
        at->gradient[i] = dot(l->columns[i], l->residual, l->rows);
        for (int j = 0; j <= i; j++)
            at->matrix[i * FREE + j] = at->matrix[j * FREE + i] = dot(l->columns[i], l->columns[j], l->rows);
    }
    at->penalty = 0;
    memcpy(at->full_matrix, at->matrix, sizeof at->matrix);
    memcpy(at->full_gradient, at->gradient, sizeof at->gradient);
    add_penalties(at, l, held);
}

// x of (A + damping diag A) x = b by Cholesky, scaled to unit diagonal; false where it is not positive definite.
bool alb_point_solve(double *x, const double *a, const double *b, int n, double damping)
{
    double l[ALB_POINT_MATRIX], scale[FREE];
    for (int i = 0; i < n; i++) {
        scale[i] = sqrt(a[i * FREE + i]);
        if (!(scale[i] > 0) || !isfinite(scale[i]))
            return false;
    }
    for (int i = 0; i < n; i++) {
        x[i] = b[i] / scale[i];
        for (int j = 0; j <= i; j++)
            l[i * FREE + j] = i == j ? 1 + damping : a[i * FREE + j] / (scale[i] * scale[j]);
    }
    if (!alb_cholesky_factor(l, n, FREE, 1e-15 / (1 + damping)))
        return false;
    alb_cholesky_solve(x, l, n, FREE);
    for (int i = 0; i < n; i++)
        x[i] /= scale[i];
    return true;
}

// Levenberg-Marquardt from at->u, in place, until a step promises less than 1e-9 of chi-square.
void alb_point_minimise(point *at, alb_likelihood *l, const alb_hold *held)
{
    const int n = l->free_count;
    double damping = 0;
    alb_point_evaluate(at, l, held);
    for (int iteration = 0; iteration < 100; iteration++) {
        double step[FREE], promised = 0, largest = 0;
        if (alb_point_solve(step, at->full_matrix, at->full_gradient, n, damping)) {
            for (int k = 0; k < n; k++) {
                promised += step[k] * at->full_gradient[k];
                largest = fmax(largest, l->parameter[k] >= 0 ? fabs(step[k]) : 0);
            }
            if (!(promised > 1e-9 + 1e-14 * at->chi_square))
                return;
            point next;
            for (int k = 0; k < n; k++)
                next.u[k] = at->u[k] - step[k] * fmin(1, 2 / largest);
            alb_point_evaluate(&next, l, held);
            if (next.chi_square + next.penalty < at->chi_square + at->penalty) {
                *at = next;
                damping = damping > 1e-7 ? damping / 10 : 0;
                continue;
            }
        }
        damping = fmax(10 * damping, 1e-7);
        if (damping > 1e9)
            return;
    }
}

// The constant 1, whitened, of unit length, so that the offset counts in its own sd.
void alb_likelihood_set_offset_column(alb_likelihood *l)
{
    const alb_weighing *weighing = l->model.weighing;
    const alb_readings *readings = weighing->readings;
    double *column = l->columns[l->free_count - 1], area = 0;
    for (int i = 0; i < readings->count; i++) {
        column[i] = 1 / weighing->sd[i];
        area += readings->area_mm2[i];
    }
    if (weighing->energy_sd > 0)
        column[readings->count] = area / weighing->energy_sd;
    l->offset_unit = 1 / sqrt(dot(column, column, l->rows));
    for (int i = 0; i < l->rows; i++)
        column[i] *= l->offset_unit;
}

static void add_constraint(alb_likelihood *l, int plus, int minus, double scale, double limit, bool open)
{
    const int c = l->constraint_count++;
    l->constraints[c].plus = plus;
    l->constraints[c].minus = minus;
    l->constraints[c].scale = scale;
    l->constraints[c].limit = scale * limit;
    l->constraints[c].open = open;
}

// Order of the decays, S >= 0, and decays and depths that the readings can show at all.
void alb_likelihood_set_constraints(alb_likelihood *l)
{
    const double outer = l->model.weighing->readings->outer_mm;
    const bool is_signed = l->candidate.form == ALB_FORM_SIGNED_EXPONENTIALS;
    int before = -1; // decay of the term before
    for (int p = 0; p < alb_candidate_parameters(l->candidate); p++) {
        const alb_parameter *parameter = alb_form_parameter(l->candidate.form, p);
        if (parameter->flux || !parameter->length)
            continue;
        const bool decay = parameter->length < 0;
        add_constraint(l, p, -1, 1, log(decay ? 0.01 / outer : 1e-5 * outer), true);
        add_constraint(l, p, -1, -1, log(decay ? 1e7 / outer : 10 * outer), true);
        if (decay && before >= 0 && alb_form_ordered(l->candidate.form))
            add_constraint(l, p, before, 1, is_signed ? log(ALB_TIED_RATIO) : 0, false);
        before = decay ? p : before;
    }
    if (is_signed)
        add_constraint(l, 0, 2, 1, 0, false);
}
