// Weighted least squares on p = (ln sigma_a, ln sigma_s', g, ln c, ln b) of
//     readings_i = c (of transmission: c b) (W S(sigma_a, sigma_s'))_i,  W the readings' operator (operator.h), S by
// transport (slab.h), with ln c and ln b known to the calibration's sds and g to the
// caller's; by Gauss and Newton's steps, derivatives by
// central differences of a model without noise. The inverse of J^T J is Cramer and Rao's bound and, times chi-square
// per degree of freedom where that is above 1, the covariance.
//
// Where chi-square stands above its degrees of freedom by more than noise makes once in a thousand times, the readings
// miss the slab by a relative discrepancy t, which comes to each in quadrature with its sd (discrepancy.h) and is
// fitted in turn with the parameters. It weighs as the model's accuracy does: what a slab misses it misses over a
// stretch of distances, and more rings do not average it away.
//
// Which readings count, what they weigh and where the fit starts: joint_problem.c.
//
// Where it stops being true: g and the phase function are the caller's word; the slab is endless, alike everywhere,
// with smooth faces in air; the spot is small against the slab.
#include "fit/joint.h"
#include "base/statistics.h"
#include "fit/cholesky.h"
#include "fit/discrepancy.h"
#include "fit/joint_problem.h"
#include "fit/solve.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PARAMETERS = ALB_JOINT_PARAMETERS, STEPS_MAX = 16, ROUNDS_MAX = 8 };
static const double most_anisotropy = 0.9, settled = 1e-4, reject_tail = 1e-3,
                    run_limit = 3.3; // 5e-4 by chance

static const double reach[PARAMETERS] = {1.5, 0.4, 0.2, 0.2, 0.2}; // of one step

static bool invert(double inverse[PARAMETERS][PARAMETERS], double a[PARAMETERS][PARAMETERS])
{
    double scale[PARAMETERS];
    for (int i = 0; i < PARAMETERS; i++) {
        scale[i] = sqrt(a[i][i]);
        if (!(scale[i] > 0 && isfinite(scale[i])))
            return false;
    }
    double l[PARAMETERS][PARAMETERS];
    for (int i = 0; i < PARAMETERS; i++)
        for (int j = 0; j <= i; j++)
            l[i][j] = a[i][j] / (scale[i] * scale[j]);
    if (!alb_cholesky_factor(l[0], PARAMETERS, PARAMETERS, 1e-12))
        return false;
    for (int c = 0; c < PARAMETERS; c++) {
        double x[PARAMETERS] = {0};
        x[c] = 1;
        alb_cholesky_solve(x, l[0], PARAMETERS, PARAMETERS);
        for (int i = 0; i < PARAMETERS; i++)
            inverse[i][c] = x[i] / (scale[i] * scale[c]);
    }
    return true;
}

// Fills covariance and bound from the Jacobian at the parameters.
static void weigh_up(alb_joint *joint, const double *parameters, const alb_joint_problem *p, double *jacobian)
{
    double information[PARAMETERS][PARAMETERS] = {{0}}, bound[PARAMETERS][PARAMETERS];
    joint->degrees_of_freedom = p->count + ALB_JOINT_PRIORS - PARAMETERS;
    joint->undecided[0] = 0;
    alb_joint_evaluate(jacobian + (p->count + ALB_JOINT_PRIORS) * PARAMETERS, jacobian, parameters, p);
    for (int i = 0; i < p->count + ALB_JOINT_PRIORS; i++)
        for (int a = 0; a < PARAMETERS; a++)
            for (int b = 0; b < PARAMETERS; b++)
                information[a][b] += jacobian[i * PARAMETERS + a] * jacobian[i * PARAMETERS + b];
    if (!invert(bound, information)) {
        snprintf(joint->undecided, sizeof joint->undecided, "absorption and scattering cannot be told apart");
        return;
    }
    const double widen = fmax(1, joint->chi_square / joint->degrees_of_freedom);
    for (int a = 0; a < PARAMETERS; a++) {
        joint->relative_bound[a] = sqrt(bound[a][a]);
        joint->relative_sd[a] = sqrt(widen * bound[a][a]);
        for (int b = 0; b < PARAMETERS; b++)
            joint->covariance[a][b] = widen * bound[a][b];
    }
}

static double misfit(double *residuals, const double *parameters, const alb_joint_problem *p)
{
    double sum = 0;
    alb_joint_evaluate(residuals, NULL, parameters, p);
    for (int i = 0; i < p->count + ALB_JOINT_PRIORS; i++)
        sum += residuals[i] * residuals[i];
    return sum;
}

// Correlation of the residuals with those next beyond alb_joint_span on the same side, in its sd were there none. As
// many residuals count as the stretches that share an error of the model.
static double run_of(const double *residuals, const alb_joint_problem *p)
{
    double products = 0, squares = 0, stretches = 0;
    for (int i = 0; i < p->count; i++) {
        const alb_joint_row *at = &p->rows[i];
        int next = i + 1;
        while (next < p->count && p->rows[next].side == at->side && log(p->rows[next].r_mm / at->r_mm) < alb_joint_span)
            next++;
        if (next == p->count || p->rows[next].side != at->side)
            continue;
        const double one = residuals[i] * sqrt(at->neighbours),
                     other = residuals[next] * sqrt(p->rows[next].neighbours);
        products += one * other;
        squares += 0.5 * (one * one + other * other);
        stretches += 1.0 / at->neighbours;
    }
    return squares > 0 ? products / squares * sqrt(stretches) : 0;
}

// Gauss and Newton's steps, each to the minimum of the problem as it looks from where the last one ended, within reach,
// until one promises nothing; a step that raised chi-square is halved.
static bool minimise(alb_joint *joint, double *parameters, alb_joint_problem *p, double *jacobian, alb_error *error)
{
    double last = INFINITY, best[PARAMETERS] = {0};
    for (int step = 0; step < STEPS_MAX; step++) {
        if (!alb_joint_evaluate_sides(p, parameters, error))
            return false;
        const double now = misfit(jacobian, parameters, p);
        if (now > last + settled) {
            for (int c = 0; c < PARAMETERS; c++)
                parameters[c] = 0.5 * (parameters[c] + best[c]);
            continue;
        }
        const bool stalled = last - now < settled;
        last = fmin(last, now);
        double lower[PARAMETERS], upper[PARAMETERS];
        for (int c = 0; c < PARAMETERS; c++) {
            best[c] = parameters[c];
            lower[c] = best[c] - reach[c];
            upper[c] = best[c] + reach[c];
        }
        if (p->known->anisotropy_sd > 0) {
            lower[ALB_JOINT_ANISOTROPY] = fmax(lower[ALB_JOINT_ANISOTROPY], 0);
            upper[ALB_JOINT_ANISOTROPY] = fmin(upper[ALB_JOINT_ANISOTROPY], most_anisotropy);
        }
        const alb_problem least_squares = {PARAMETERS, p->count + ALB_JOINT_PRIORS, alb_joint_evaluate, p, lower,
                                           upper};
        if (!alb_solve(parameters, &joint->chi_square, &least_squares, error))
            return false;
        if (stalled || now - joint->chi_square < settled)
            break;
    }
    return true;
}

// Fits, and where the noise does not suffice fits and widens in turn until the discrepancy no longer moves.
static bool settle(alb_joint *joint, double *parameters, alb_joint_problem *p, double *jacobian, alb_error *error)
{
    const int freedom = p->count + ALB_JOINT_PRIORS - PARAMETERS;
    if (!minimise(joint, parameters, p, jacobian, error))
        return false;
    joint->discrepancy_relative = 0;
    const double by_noise = joint->chi_square;
    bool moved = alb_chi_square_tail(joint->chi_square, freedom) < reject_tail;
    for (int round = 0; moved && round < ROUNDS_MAX; round++) {
        double *value = jacobian, *sd = value + p->count, *fitted = sd + p->count, *residuals = fitted + p->count;
        misfit(residuals, parameters, p);
        for (int i = 0; i < p->count; i++) {
            const alb_joint_row *at = &p->rows[i];
            value[i] = at->value;
            sd[i] = hypot(at->sd, alb_joint_accuracy * sqrt(at->neighbours) * at->value);
            fitted[i] = at->value + residuals[i] / at->weight;
        }
        const double before = joint->discrepancy_relative;
        joint->discrepancy_relative = alb_discrepancy_of(value, sd, fitted, p->count, freedom);
        alb_joint_weigh(p, joint->discrepancy_relative);
        if (!minimise(joint, parameters, p, jacobian, error))
            return false;
        moved = fabs(joint->discrepancy_relative - before) > 0.01 * before;
    }
    weigh_up(joint, parameters, p, jacobian);
    joint->chi_square = by_noise;
    misfit(jacobian, parameters, p);
    const double run = run_of(jacobian, p);
    if (joint->discrepancy_relative > 0 && run > run_limit && !*joint->undecided)
        snprintf(joint->undecided, sizeof joint->undecided,
                 "the readings miss those of any such slab by %.2g %% beyond their noise (chi-square %.4g / %d), and "
                 "neighbours miss them alike (correlation of %.2g sd): check thickness, index, scale and stray light",
                 100 * joint->discrepancy_relative, joint->chi_square, joint->degrees_of_freedom, run);
    return true;
}

static void conclude(alb_joint *joint, const double *parameters, const alb_joint_problem *p)
{
    const alb_slab slab = alb_joint_slab_at(p->known, parameters);
    joint->absorption_per_mm = slab.absorption_per_mm;
    joint->reduced_scattering_per_mm = exp(parameters[1]);
    joint->anisotropy = slab.anisotropy;
    joint->scale = exp(parameters[ALB_JOINT_SCALE]);
    joint->balance = exp(parameters[ALB_JOINT_BALANCE]);
    joint->unscattered = alb_slab_scale(&slab, ALB_HARMONICS_ORDER).beam.leaving[ALB_TRANSMISSION];
    const double sigma = joint->absorption_per_mm + joint->reduced_scattering_per_mm;
    joint->albedo = joint->reduced_scattering_per_mm / sigma;
    joint->thickness_mfp = sigma * slab.thickness_mm;
    for (int side = 0; side < ALB_SIDES; side++)
        joint->from_mm[side] = INFINITY;
    for (int i = 0; i < p->count; i++) {
        joint->used[p->rows[i].side]++;
        joint->from_mm[p->rows[i].side] = fmin(joint->from_mm[p->rows[i].side], p->rows[i].r_mm);
    }
    for (int side = 0; side < ALB_SIDES; side++)
        joint->from_mm[side] = joint->used[side] ? joint->from_mm[side] : 0;
    for (int a = 0; a < ALB_JOINT_ANISOTROPY && !joint->undecided[0]; a++)
        if (joint->relative_sd[a] > 0.5)
            snprintf(joint->undecided, sizeof joint->undecided, "the %s is known to %.0f %% only",
                     a == ALB_JOINT_ABSORPTION ? "absorption" : "scattering", 100 * joint->relative_sd[a]);
}

static bool check_request(const alb_joint_side sides[ALB_SIDES], const alb_joint_known *known, alb_error *error)
{
    if (!sides[ALB_REFLECTION].readings)
        return alb_fail(error, ALB_UNDECIDED,
                        "transmission alone does not tell absorption from scattering: give the reflection as well");
    if (!(known->thickness_mm > 0 && known->refractive_index >= 1 && known->refractive_index <= 3 &&
          known->anisotropy >= 0 && known->anisotropy <= most_anisotropy && known->anisotropy_sd >= 0 &&
          known->scale_relative_sd > 0 && known->balance_relative_sd >= 0))
        return alb_fail(error, ALB_BAD_DATA,
                        "a slab of thickness %g mm, index %g (1 to 3), g %g (0 to 0.9), scale known to %g: thickness "
                        "and scale's sd are to be above zero",
                        known->thickness_mm, known->refractive_index, known->anisotropy, known->scale_relative_sd);
    return true;
}

bool alb_joint_fit(alb_joint *joint, const alb_joint_side sides[ALB_SIDES], const alb_joint_known *known,
                   alb_error *error)
{
    *joint = (alb_joint){0};
    alb_joint_problem p = {.sides = sides,
                           .known = known,
                           .prior = {known->anisotropy, 0, 0},
                           .prior_sd = {fmax(known->anisotropy_sd, 1e-6), known->scale_relative_sd,
                                        fmax(known->balance_relative_sd, 1e-6)}};
    double *jacobian = NULL, parameters[PARAMETERS];
    bool ok = check_request(sides, known, error) && alb_joint_problem_create(&p, &jacobian, error);
    if (!ok)
        goto done;
    alb_joint_collect(&p);
    alb_joint_start(parameters, &p);
    for (int pass = 0; ok && pass < 2; pass++) { // again with the readings that the first answer asks for
        alb_joint_collect(&p);
        alb_joint_choose_rows(&p, parameters);
        ok = p.count > PARAMETERS ||
             alb_fail(error, ALB_UNDECIDED,
                      "%d readings further than %g transport mean free paths from the beam; 4 are "
                      "wanted",
                      p.count, alb_joint_near_mfp);
        ok = ok && settle(joint, parameters, &p, jacobian, error);
    }
    if (ok)
        conclude(joint, parameters, &p);
done:
    alb_joint_problem_free(&p);
    free(jacobian);
    return ok;
}
