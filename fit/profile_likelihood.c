// The profile likelihood of a quantity q of a fit (a parameter, the total, S(r)): D(q) = the least chi-square with q
// held there, less that of the best fit. The interval of confidence 1 - p is {q: D(q) <= chi-square quantile}, 3.841
// for 95 % (Venzon & Moolgavkar 1988). It needs no linear approximation, does not depend on how the parameters are
// written, and shows where the data set no limit, which curvature cannot.
//
// The quantity is ln |q|. Holding it at c is one more reading (likelihood_point.c), with an sd e of a hundredth of the
// half-width. Whatever q the least squares then reach, they are a point of D exactly: the gradient of chi-square is
// along that of q there, and dD/d ln q = 2 (c - ln q) / e^2. Newton on sqrt(D), which is nearly straight, within a
// bracket; from point to point along the line of least chi-square to first order.
//
// Cramer-Rao bound: (J^T J)^-1 at a profile, J whitened, by QR (qr.h).
//
// Stops being true where the best fit lies on a limit of the form (the quantile is then between those of zero and one
// degree of freedom: the interval is too wide), and where D has a second valley as deep: only the first is followed.
#include "fit/profile_likelihood.h"
#include "base/memory.h"
#include "fit/likelihood_point.h"
#include "fit/qr.h"
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { FREE = ALB_LIKELIHOOD_FREE };
typedef alb_point point;
static const double furthest = 25;      // e^25 times the fit
static const double bound_rise = 6.635; // 99 % for one degree of freedom

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
        alb_likelihood_set_offset_column(l);
    }
    for (int i = 0; i < l->rows; i++)
        l->reading[i] = alb_weighing_reading(weighing, i);
    alb_likelihood_set_constraints(l);
    point best = {.held = 0};
    alb_likelihood_logarithms(best.u, l, start);
    alb_point_minimise(&best, l, NULL);
    l->best = alb_likelihood_profile(l, best.u);
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
    alb_likelihood_logarithms(best.u, l, &l->best);
    alb_point_evaluate(&best, l, NULL);
    best.chi_square = l->chi_square;
    best.held = alb_likelihood_quantity(gradient, l, quantity, best.u);
    return best;
}

// du / d ln q along the line of least chi-square, to first order; false where the matrix is singular.
static bool direction_of(double *direction, double *curvature, const point *at, const alb_likelihood *l,
                         alb_quantity quantity)
{
    double gradient[FREE], slope = 0;
    alb_likelihood_quantity(gradient, l, quantity, at->u);
    // what is held is left out of the matrix, the limits are not
    if (!alb_point_solve(direction, at->matrix, gradient, l->free_count, 0))
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
    const alb_hold held = {quantity, value, sd};
    if (direction_of(direction, &curvature, from, l, quantity))
        for (int k = 0; k < l->free_count; k++) {
            const double move = direction[k] * (value - from->held);
            to.u[k] += l->parameter[k] >= 0 ? fmin(fmax(move, -1), 1) : move;
        }
    alb_point_minimise(&to, l, &held);
    return to;
}

static bool at_open_limit(const alb_likelihood *l, const double *u)
{
    for (int c = 0; c < l->constraint_count; c++)
        if (l->constraints[c].open && alb_likelihood_violation(l, c, u) > -1e-2)
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
    const alb_profile profile = alb_likelihood_profile(l, at->u);
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
    *profile = alb_likelihood_profile(l, at.u);
    return at.chi_square;
}

bool alb_likelihood_bound(double covariance[FREE][FREE], double *condition, alb_likelihood *l,
                          const alb_profile *profile)
{
    double u[FREE], scale[FREE], diagonal[FREE], work[FREE * FREE];
    const alb_qr qr = {l->rows, l->free_count, l->columns, NULL, scale, diagonal};
    memset(covariance, 0, sizeof(double[FREE][FREE]));
    *condition = INFINITY;
    if (l->rows < l->free_count)
        return false;
    alb_likelihood_logarithms(u, l, profile);
    alb_likelihood_linearise(l, u);
    const bool full_rank = alb_qr_factor(&qr, 1e-12);
    if (full_rank)
        *condition = alb_qr_covariance(covariance[0], FREE, &qr, work);
    if (l->with_offset) // R stands in its place
        alb_likelihood_set_offset_column(l);
    return full_rank;
}
