// The profile likelihood of a quantity q of a fit (a parameter, the total, S(r)): D(q) = the least chi-square with q
// held there, less that of the best fit. The interval of confidence 1 - p is {q: D(q) <= chi-square quantile}, 3.841
// for 95 % (Venzon & Moolgavkar 1988). It needs no linear approximation, does not depend on how the parameters are
// written, and shows where the data set no limit, which curvature cannot.
//
// All parameters keep their sign: u = ln |parameter|, and the quantity is ln |q|; so units drop out. Holding: one more
// reading, (ln q(u) - c) / e, with e a hundredth of the half-width. Whatever q the least squares then reach, they are a
// point of D exactly: the gradient of chi-square is along that of q there, and dD/d ln q = 2 (c - ln q) / e^2. Newton
// on sqrt(D), which is nearly straight, within a bracket; from point to point along the line of least chi-square to
// first order. Inside each point Levenberg-Marquardt on the normal equations, whose lost digits change the path and not
// the point. Limits of the form (order of the decays, S >= 0) are readings of the violation alone, with an sd of 1e-5.
//
// Cramer-Rao bound: (J^T J)^-1 at a profile, J whitened, by Householder QR with its columns scaled to unit length.
//
// Stops being true where the best fit lies on a limit of the form (the quantile is then between those of zero and one
// degree of freedom: the interval is too wide), and where D has a second valley as deep: only the first is followed.
#include "fit/profile_likelihood.h"
#include "base/memory.h"
#include "fit/cholesky.h"
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { FREE = ALB_PARAMETERS_MAX + 1, MATRIX = FREE * FREE };
static const double constraint_sd = 1e-5, furthest = 25; // e^25 times the fit
static const double bound_rise = 6.635;                  // 99 % for one degree of freedom

typedef struct hold {
    alb_quantity quantity;
    double value, sd; // of ln |quantity|
} hold;

// A point: where it is, chi-square there, and the Gauss-Newton matrix of chi-square alone.
typedef struct point {
    double u[FREE], chi_square, penalty, matrix[MATRIX], gradient[FREE];
    double full_matrix[MATRIX], full_gradient[FREE]; // with the readings of what is held and of the limits
    double held;                                     // ln |quantity|, where one is held
} point;

static alb_profile profile_at(const alb_likelihood *l, const double *u)
{
    alb_profile profile = {.form = l->candidate.form};
    for (int k = 0; k < l->free_count; k++)
        if (l->parameter[k] >= 0)
            profile.parameters[l->parameter[k]] = l->sign[l->parameter[k]] * exp(u[k]);
    if (l->candidate.tied)
        profile.parameters[3] = ALB_TIED_RATIO * profile.parameters[1];
    return profile;
}

static void logarithms(double *u, const alb_likelihood *l, const alb_profile *profile)
{
    for (int k = 0; k < l->free_count; k++)
        u[k] = l->parameter[k] >= 0 ? log(fabs(profile->parameters[l->parameter[k]])) : l->offset / l->offset_unit;
}

// ln |quantity| and its derivatives by u.
static double quantity_of(double *gradient, const alb_likelihood *l, alb_quantity quantity, const double *u)
{
    double own[ALB_PARAMETERS_MAX] = {0}, value;
    const alb_profile profile = profile_at(l, u);
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

static double violation_of(const alb_likelihood *l, int c, const double *u)
{
    const double right = l->constraints[c].minus < 0 ? 0 : u[l->constraints[c].minus];
    return l->constraints[c].limit - l->constraints[c].scale * (u[l->constraints[c].plus] - right);
}

static void add_penalties(point *at, const alb_likelihood *l, const hold *held)
{
    double row[FREE];
    for (int c = 0; c < l->constraint_count; c++) {
        const double violation = violation_of(l, c, at->u);
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
    at->held = quantity_of(row, l, held->quantity, at->u);
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
static void linearise(alb_likelihood *l, const double *u)
{
    const alb_profile profile = profile_at(l, u);
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

static void evaluate(point *at, alb_likelihood *l, const hold *held)
{
    const int n = l->free_count;
    linearise(l, at->u);
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
static bool solve(double *x, const double *a, const double *b, int n, double damping)
{
    double l[MATRIX], scale[FREE];
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
static void minimise(point *at, alb_likelihood *l, const hold *held)
{
    const int n = l->free_count;
    double damping = 0;
    evaluate(at, l, held);
    for (int iteration = 0; iteration < 100; iteration++) {
        double step[FREE], promised = 0, largest = 0;
        if (solve(step, at->full_matrix, at->full_gradient, n, damping)) {
            for (int k = 0; k < n; k++) {
                promised += step[k] * at->full_gradient[k];
                largest = fmax(largest, l->parameter[k] >= 0 ? fabs(step[k]) : 0);
            }
            if (!(promised > 1e-9 + 1e-14 * at->chi_square))
                return;
            point next;
            for (int k = 0; k < n; k++)
                next.u[k] = at->u[k] - step[k] * fmin(1, 2 / largest);
            evaluate(&next, l, held);
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
static void set_constraints(alb_likelihood *l)
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

static bool make_room(alb_likelihood *l, alb_error *error)
{
    const size_t rows = (size_t)l->rows;
    if (!alb_model_create(&l->model, l->model.weighing, error) ||
        !(l->reading = alb_allocate((2 + FREE) * rows, sizeof(double), error)))
        return false;
    l->residual = l->reading + rows;
    for (int k = 0; k < FREE; k++)
        l->columns[k] = l->residual + (size_t)(k + 1) * rows;
    return true;
}

// The constant 1, whitened, of unit length, so that the offset counts in its own sd.
static void set_offset_column(alb_likelihood *l)
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

bool alb_likelihood_create(alb_likelihood *l, const alb_profile *start, alb_candidate candidate,
                           const alb_weighing *weighing, bool with_offset, alb_error *error)
{
    *l = (alb_likelihood){.model.weighing = weighing, .candidate = candidate, .with_offset = with_offset};
    l->rows = alb_weighing_rows(weighing);
    if (!make_room(l, error)) {
        alb_likelihood_free(l);
        return false;
    }
    for (int p = 0; p < alb_candidate_parameters(candidate); p++) {
        assert(start->parameters[p] != 0);
        l->parameter[l->free_count++] = p;
        l->sign[p] = start->parameters[p] < 0 ? -1 : 1;
    }
    l->offset_unit = 1;
    if (with_offset) {
        l->parameter[l->free_count++] = -1;
        set_offset_column(l);
    }
    for (int i = 0; i < l->rows; i++)
        l->reading[i] = alb_weighing_reading(weighing, i);
    set_constraints(l);
    point best = {.held = 0};
    logarithms(best.u, l, start);
    minimise(&best, l, NULL);
    l->best = profile_at(l, best.u);
    l->chi_square = best.chi_square;
    l->offset = with_offset ? best.u[l->free_count - 1] * l->offset_unit : 0;
    return true;
}

void alb_likelihood_free(alb_likelihood *l)
{
    alb_model_free(&l->model);
    free(l->reading);
    *l = (alb_likelihood){0};
}

static point best_point(alb_likelihood *l, alb_quantity quantity)
{
    point best = {.held = 0};
    double gradient[FREE];
    logarithms(best.u, l, &l->best);
    evaluate(&best, l, NULL);
    best.chi_square = l->chi_square;
    best.held = quantity_of(gradient, l, quantity, best.u);
    return best;
}

// du / d ln q along the line of least chi-square, to first order; false where the matrix is singular.
static bool direction_of(double *direction, double *curvature, const point *at, const alb_likelihood *l,
                         alb_quantity quantity)
{
    double gradient[FREE], slope = 0;
    quantity_of(gradient, l, quantity, at->u);
    // what is held is left out of the matrix, the limits are not
    if (!solve(direction, at->matrix, gradient, l->free_count, 0))
        return false;
    for (int k = 0; k < l->free_count; k++)
        slope += gradient[k] * direction[k];
    if (!(slope > 0) || !isfinite(slope))
        return false;
    for (int k = 0; k < l->free_count; k++)
        direction[k] /= slope;
    *curvature = 1 / slope;
    return true;
}

// The point of the profile likelihood near ln q = value, from a point at another.
static point point_near(const point *from, alb_likelihood *l, alb_quantity quantity, double value, double sd)
{
    point to = *from;
    double direction[FREE], curvature;
    const hold held = {quantity, value, sd};
    if (direction_of(direction, &curvature, from, l, quantity))
        for (int k = 0; k < l->free_count; k++) {
            const double move = direction[k] * (value - from->held);
            to.u[k] += l->parameter[k] >= 0 ? fmin(fmax(move, -1), 1) : move;
        }
    minimise(&to, l, &held);
    return to;
}

static bool at_open_limit(const alb_likelihood *l, const double *u)
{
    for (int c = 0; c < l->constraint_count; c++)
        if (l->constraints[c].open && violation_of(l, c, u) > -1e-2)
            return true;
    return false;
}

// The end of an interval on one side; false where it is open, the point is then the furthest looked at.
static bool find_end(point *end, alb_likelihood *l, alb_quantity quantity, double rise, int side)
{
    const point best = best_point(l, quantity);
    double direction[FREE], curvature, low = 0, high = INFINITY;
    double width = direction_of(direction, &curvature, &best, l, quantity) ? sqrt(rise / curvature) : 1;
    width = fmin(width, 3);
    double reach = width;
    point low_point = best;
    *end = best;
    for (int iteration = 0; iteration < 40; iteration++) {
        const double sd = 0.01 * fmin(width, reach);
        *end = point_near(&low_point, l, quantity, best.held + side * reach, sd);
        const double moved = side * (end->held - best.held), height = fmax(end->chi_square - l->chi_square, 0);
        const double slope = 2 * (reach - moved) / (sd * sd); // dD / d ln q, outwards
        if (fabs(height - rise) < 0.02 * rise && slope > 0) {
            end->held += side * (rise - height) / slope;
            return !at_open_limit(l, end->u);
        }
        if (height < rise) {
            low = fmax(low, moved);
            low_point = *end;
        } else {
            high = fmin(high, moved);
        }
        if (low >= furthest || (height < rise && at_open_limit(l, end->u)) || (high - low < 1e-9 * high))
            break;
        const double z = sqrt(height);
        double next = moved + (sqrt(rise) - z) * 2 * z / slope;
        if (!(next > low && next < high))
            next = isfinite(high) ? (low + high) / 2 : 3 * fmax(moved, reach);
        reach = fmin(fmin(next, 3 * fmax(low, width)), 2 * furthest);
    }
    return isfinite(high) && !at_open_limit(l, end->u);
}

static void note_bound(double *worst, alb_likelihood *l, const point *at)
{
    double covariance[FREE][FREE], condition;
    const alb_profile profile = profile_at(l, at->u);
    const bool known = alb_likelihood_bound(covariance, &condition, l, &profile);
    for (int k = 0; k < l->free_count; k++)
        if (l->parameter[k] >= 0)
            worst[l->parameter[k]] = fmax(worst[l->parameter[k]], known ? sqrt(covariance[k][k]) : (double)INFINITY);
}

alb_interval alb_likelihood_interval(alb_likelihood *l, alb_quantity quantity, double rise, double *worst)
{
    const point best = best_point(l, quantity);
    point ends[2];
    bool closed[2];
    for (int s = 0; s < 2; s++) {
        closed[s] = find_end(&ends[s], l, quantity, rise, s ? 1 : -1);
        if (!worst)
            continue;
        const double further = (ends[s].held - best.held) * (sqrt(bound_rise / rise) - 1);
        const point beyond =
            closed[s] ? point_near(&ends[s], l, quantity, ends[s].held + further, 0.01 * fabs(further)) : ends[s];
        if (!closed[s] || at_open_limit(l, beyond.u))
            worst[quantity.parameter] = INFINITY;
        else
            note_bound(worst, l, &beyond);
    }
    const bool negative = quantity.kind == ALB_QUANTITY_PARAMETER && l->best.parameters[quantity.parameter] < 0;
    const alb_interval interval = {exp(ends[0].held), exp(ends[1].held), !closed[0], !closed[1]};
    return negative ? (alb_interval){-interval.upper, -interval.lower, interval.upper_open, interval.lower_open}
                    : interval;
}

// Steps of at most 1 towards the value, then the value put right by what the reading that holds it misses it by.
double alb_likelihood_hold(alb_profile *profile, alb_likelihood *l, alb_quantity quantity, double value)
{
    point at = best_point(l, quantity);
    double direction[FREE], curvature, missed = 0;
    const double target = log(fabs(value)), from = at.held, distance = target - from;
    const double width = direction_of(direction, &curvature, &at, l, quantity) ? 1 / sqrt(curvature) : 1;
    const double sd = 0.03 * fmin(width, 1);
    const int steps = (int)fmin(ceil(fabs(distance)), 100);
    for (int s = 1; s <= steps; s++)
        at = point_near(&at, l, quantity, from + distance * s / steps, sd);
    for (int again = 0; again < 20 && fabs(target - at.held) > 1e-9; again++) {
        missed += target - at.held;
        at = point_near(&at, l, quantity, target + missed, sd);
    }
    *profile = profile_at(l, at.u);
    return at.chi_square;
}

// Householder: overwrites the columns by R above the diagonal (r, n x n).
static void factor(double r[FREE][FREE], double *const *columns, int rows, int n)
{
    for (int k = 0; k < n; k++) {
        double *v = columns[k] + k;
        const int m = rows - k;
        const double norm = sqrt(dot(v, v, m)), head = v[0] > 0 ? -norm : norm;
        for (int j = 0; j < k; j++)
            r[j][k] = columns[k][j];
        r[k][k] = head;
        v[0] -= head;
        const double square = dot(v, v, m);
        for (int j = k + 1; square > 0 && j < n; j++) {
            const double factor = 2 * dot(v, columns[j] + k, m) / square;
            for (int i = 0; i < m; i++)
                columns[j][k + i] -= factor * v[i];
        }
    }
}

bool alb_likelihood_bound(double covariance[FREE][FREE], double *condition, alb_likelihood *l,
                          const alb_profile *profile)
{
    const int n = l->free_count;
    double u[FREE], scale[FREE], r[FREE][FREE] = {{0}}, inverse[FREE][FREE] = {{0}}, sizes[2] = {0};
    memset(covariance, 0, sizeof r);
    *condition = INFINITY;
    if (l->rows < n)
        return false;
    logarithms(u, l, profile);
    linearise(l, u);
    for (int k = 0; k < n; k++) {
        scale[k] = sqrt(dot(l->columns[k], l->columns[k], l->rows));
        if (!(scale[k] > 0) || !isfinite(scale[k]))
            return false;
        for (int i = 0; i < l->rows; i++)
            l->columns[k][i] /= scale[k];
    }
    factor(r, l->columns, l->rows, n);
    if (l->with_offset)
        set_offset_column(l);
    for (int k = 0; k < n; k++)
        if (!(fabs(r[k][k]) > 1e-12))
            return false;
    for (int k = 0; k < n; k++) // R^-1, upper
        for (int i = k; i >= 0; i--) {
            double sum = i == k;
            for (int j = i + 1; j <= k; j++)
                sum -= r[i][j] * inverse[j][k];
            inverse[i][k] = sum / r[i][i];
            sizes[0] += r[i][k] * r[i][k];
            sizes[1] += inverse[i][k] * inverse[i][k];
        }
    *condition = sizes[0] * sizes[1];
    for (int p = 0; p < n; p++)
        for (int q = 0; q < n; q++)
            for (int k = p > q ? p : q; k < n; k++)
                covariance[p][q] += inverse[p][k] * inverse[q][k] / scale[p] / scale[q];
    return true;
}
