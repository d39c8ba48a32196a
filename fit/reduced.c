// The reduced problem. For fixed decays the amplitudes are a linear problem, so only x_j = ln b_j are searched
// (variable projection; Golub & Pereyra 1973). With residual r, columns c_j, f_j = dc_j/dx_j, s_j = d2c_j/dx_j2:
//   gradient of chi^2 / 2 by x_j:   -a_j r.f_j
//   Hessian:  X - Y^T G^-1 Y,  G_kl = c_k.c_l,  Y_kj = a_j c_k.f_j - [k = j] r.f_j,
//             X_jl = a_j a_l f_j.f_l - [j = l] a_j r.s_j
// which is exact; without the terms in r it is Kaufman's approximation (1975), taken where the exact one is not
// positive definite. Newton steps, damped where they do not lower chi^2, and corrected once where they leave a curved
// valley.
//
// Signed pairs: in x_1 and x_2 - x_1 >= ln 1.1; where a_1 + a_2 would fall below 0 the pair has one amplitude,
// a (c_1 - c_2). The tied pair stays on the bound. Residuals come from the data and amplitudes are refined by them, so
// that squaring the condition costs steps, not digits. Stops being true where 1 - cos^2 of two columns is below 1e-14.
#include "fit/reduced.h"
#include "fit/cholesky.h"
#include "fit/search.h"
#include <math.h>
#include <string.h>

enum { TERMS = ALB_TERMS_MAX };
typedef alb_small_matrix matrix;

// The linear problem at one place: free amplitudes, and the factor of their matrix. One where the pair is pinned to
// a (c_1 - c_2).
typedef struct linear {
    int count;
    bool pinned;
    matrix factor;
} linear;

static bool solve_amplitudes(alb_place *p, linear *system, const alb_reduced *q, int terms, alb_signs signs)
{
    *system = (linear){.count = terms};
    memcpy(system->factor, p->cc, sizeof p->cc);
    for (int t = 0; t < terms; t++)
        p->amplitude[t] = q->term[t].cv;
    if (!alb_cholesky_factor(system->factor[0], terms, TERMS, 1e-14))
        return false;
    alb_cholesky_solve(p->amplitude, system->factor[0], terms, TERMS);
    if (signs != ALB_POSITIVE && p->amplitude[0] + p->amplitude[1] < 0) {
        *system = (linear){1, true, {{sqrt(p->cc[0][0] - 2 * p->cc[0][1] + p->cc[1][1])}}};
        p->amplitude[0] = (q->term[0].cv - q->term[1].cv) / (system->factor[0][0] * system->factor[0][0]);
        p->amplitude[1] = -p->amplitude[0];
    }
    for (int t = 0; t < terms; t++)
        if (!(t == 1 && signs != ALB_POSITIVE ? p->amplitude[t] < 0 : p->amplitude[t] > 0))
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
static void refine(alb_place *p, double products[TERMS][3], const linear *system, alb_reduced *q, int terms)
{
    p->chi_square = alb_term_residual(q->residual, products, &q->data, q->term, p->amplitude, terms);
    double change[TERMS] = {0}, right[TERMS] = {0};
    for (int t = 0; t < terms; t++)
        right[t] = change[t] = products[t][0];
    gather(change, system);
    gather(right, system);
    alb_cholesky_solve(change, system->factor[0], system->count, TERMS);
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

static void differentiate(alb_place *p, double products[TERMS][3], const linear *system, int terms)
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
        // a term that shows in one reading alone leaves nothing but rounding
        p->kaufman[j][j] += 1e-12 * p->amplitude[j] * p->amplitude[j] * p->ff[j][j];
    }
    p->bend = products[0][2];
}

void alb_reduced_evaluate(alb_place *p, alb_reduced *q, int terms, alb_signs signs)
{
    p->chi_square = (double)INFINITY;
    for (int t = 0; t < terms; t++) {
        const alb_term *term = &q->term[t];
        alb_term_evaluate(&q->term[t], &q->data, p->x[t], q->work);
        p->cc[t][t] = term->cc, p->cf[t][t] = term->cf, p->ff[t][t] = term->ff;
        for (int u = 0; u < t; u++) {
            double out[4];
            alb_term_products(out, term, &q->term[u], q->data.basis->rows);
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
    if (!alb_cholesky_factor(m[0], n, TERMS, 1e-13))
        return false;
    alb_cholesky_solve(step, m[0], n, TERMS);
    return true;
}

// Variables of the descent. Positive terms on both sides of the pivot m: x = ln m -+ ln(1 + e^-+u), so that b - m = -+m
// e^u or its reciprocal. A signed pair: x_1, x_2 - x_1. Otherwise x.
typedef enum coordinates { PLAIN, SIDES, DIFFERENCES } coordinates;

static coordinates coordinates_of(const alb_place *p, const alb_reduced *q, int terms, alb_signs signs)
{
    if (terms != 2)
        return PLAIN;
    if (signs != ALB_POSITIVE)
        return DIFFERENCES;
    return q->pivot - p->x[0] > 1e-12 && p->x[1] - q->pivot > 1e-12 ? SIDES : PLAIN;
}

// Gradient and both Hessians by the variables.
static void transform(alb_place *p, const alb_reduced *q, coordinates variables)
{
    if (variables == DIFFERENCES) {
        matrix *both[2] = {&p->newton, &p->kaufman};
        for (int k = 0; k < 2; k++) {
            (*both[k])[0][0] += (*both[k])[0][1] + (*both[k])[1][0] + (*both[k])[1][1];
            (*both[k])[0][1] += (*both[k])[1][1];
            (*both[k])[1][0] += (*both[k])[1][1];
        }
        p->gradient[0] += p->gradient[1];
    } else if (variables == SIDES) {
        const double slope[2] = {expm1(p->x[0] - q->pivot), -expm1(q->pivot - p->x[1])}; // dx / du
        const double bend[2] = {slope[0] * (1 + slope[0]), slope[1] * (1 - slope[1])};
        for (int i = 0; i < 2; i++)
            for (int j = 0; j < 2; j++) {
                p->kaufman[i][j] *= slope[i] * slope[j];
                p->newton[i][j] *= slope[i] * slope[j];
                p->newton[i][j] += i == j ? p->gradient[i] * bend[i] : 0;
            }
        for (int i = 0; i < 2; i++)
            p->gradient[i] *= slope[i];
    }
}

// x after a step in the variables.
static void advance(double *x, const alb_place *p, const alb_reduced *q, const double *step, int terms,
                    coordinates variables)
{
    for (int t = 0; t < terms; t++)
        x[t] = p->x[t] + step[t];
    if (variables == DIFFERENCES) {
        x[1] += step[0];
    } else if (variables == SIDES) {
        x[0] = q->pivot - log1p(expm1(q->pivot - p->x[0]) * exp(step[0]));
        x[1] = q->pivot + log1p(expm1(p->x[1] - q->pivot) * exp(step[1]));
    }
}

// Step in the variables from the transformed place p, those fixed staying; false where it cannot be had.
static bool solve_step(double *step, double *promise, alb_place *p, const bool *fixed, int terms, double damping)
{
    double longest = 0;
    *promise = 0;
    if (!newton_step(step, p->newton, p->kaufman, p->gradient, fixed, terms, damping) &&
        !newton_step(step, p->kaufman, p->kaufman, p->gradient, fixed, terms, fmax(damping, 1e-6)))
        return false;
    for (int t = 0; t < terms; t++) {
        longest = fmax(longest, fabs(step[t]));
        *promise -= p->gradient[t] * step[t];
    }
    for (int t = 0; t < terms; t++)
        step[t] *= longest > 1.5 ? 1.5 / longest : 1;
    return true;
}

// From x to the place the step leads to, within the bounds; the fall of chi^2 that it promises, -1 where it cannot be
// had. What stands at a bound and would leave it stays there.
static double propose(double *x, const alb_place *at, const alb_reduced *q, int terms, alb_signs signs, double damping)
{
    const alb_basis *basis = q->data.basis;
    const double closest = log(ALB_TIED_RATIO);
    const coordinates variables = coordinates_of(at, q, terms, signs);
    double step[TERMS], promise;
    bool fixed[TERMS] = {false, variables == DIFFERENCES && signs == ALB_TIED, false}, again = true;
    alb_place p = *at;
    transform(&p, q, variables);
    while (again) {
        again = false;
        if (!solve_step(step, &promise, &p, fixed, terms, damping))
            return -1;
        advance(x, &p, q, step, terms, variables);
        for (int t = 0; t < terms; t++) {
            const bool leaves = (p.x[t] <= basis->lowest && x[t] < basis->lowest) ||
                                (p.x[t] >= basis->highest && x[t] > basis->highest) ||
                                (t == 1 && variables == DIFFERENCES && p.x[1] - p.x[0] <= closest * (1 + 1e-12) &&
                                 x[1] - x[0] < closest * (1 - 1e-12));
            again |= leaves && !fixed[t];
            fixed[t] |= leaves;
        }
    }
    for (int t = 0; t < terms; t++)
        x[t] = fmin(fmax(x[t], basis->lowest), basis->highest);
    if (variables == DIFFERENCES && (signs == ALB_TIED || x[1] - x[0] < closest)) {
        x[0] = fmin(x[0], basis->highest - closest);
        x[1] = x[0] + closest;
    }
    return promise;
}

// From a place beside a curved valley towards its floor: the Newton step along the steepest curvature alone.
static void correct(double *x, const alb_place *p, const alb_basis *basis, int terms, alb_signs signs)
{
    double along[TERMS] = {1, 1, 1}, slope = 0, curvature = 0;
    for (int power = 0; power < 8; power++) { // eigenvector of the largest curvature
        double next[TERMS] = {0}, norm = 0;
        for (int i = 0; i < terms; i++) {
            for (int j = 0; j < terms; j++)
                next[i] += p->kaufman[i][j] * along[j];
            norm += next[i] * next[i];
        }
        for (int i = 0; norm > 0 && i < terms; i++)
            along[i] = next[i] / sqrt(norm);
    }
    for (int i = 0; i < terms; i++) {
        slope += p->gradient[i] * along[i];
        for (int j = 0; j < terms; j++)
            curvature += along[i] * p->kaufman[i][j] * along[j];
    }
    const double step = curvature > 0 ? fmin(fmax(slope / curvature, -0.5), 0.5) : 0;
    for (int i = 0; i < terms; i++)
        x[i] = fmin(fmax(p->x[i] - step * along[i], basis->lowest), basis->highest);
    if (signs != ALB_POSITIVE && terms == 2)
        x[1] = fmax(x[1], x[0] + log(ALB_TIED_RATIO));
}

void alb_reduced_minimise(alb_place *p, alb_reduced *q, int terms, alb_signs signs, double wanted)
{
    double damping = 0;
    alb_reduced_evaluate(p, q, terms, signs);
    for (int iteration = 0; iteration < 100 && isfinite(p->chi_square); iteration++) {
        alb_place next;
        const double promise = propose(next.x, p, q, terms, signs, damping);
        if (!(promise > wanted * p->chi_square + 1e-32 * q->squares))
            break;
        alb_reduced_evaluate(&next, q, terms, signs);
        if (!(next.chi_square < p->chi_square) && isfinite(next.chi_square) && terms > 1 && signs != ALB_TIED &&
            promise > 1e-3 * p->chi_square) {
            alb_place back;
            correct(back.x, &next, q->data.basis, terms, signs);
            alb_reduced_evaluate(&back, q, terms, signs);
            next = back;
        }
        if (!(next.chi_square < p->chi_square) && damping == 0 && terms > 1 && signs != ALB_TIED) {
            // a direction that is all but flat can spoil the step: without it
            correct(next.x, p, q->data.basis, terms, signs);
            alb_reduced_evaluate(&next, q, terms, signs);
        }
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
