// Weighted least squares on p = (ln sigma_a, ln sigma_s', g, ln c, ln b) of
//     readings_i = c (of transmission: c b) (W S(sigma_a, sigma_s'))_i,  W the readings' operator (operator.h), S by
// transport (slab.h), with ln c and ln b known to the calibration's sds and g to the
// caller's; by Gauss and Newton's steps, derivatives by
// central differences of a model without noise. The inverse of J^T J is Cramer and Rao's bound and, times chi-square
// per degree of freedom where that is above 1, the covariance.
//
// What is used: readings of which less than 2 % comes from within half a transport mean free path of the beam, where
// the model is worse than elsewhere and where the light that has not scattered arrives. The model's accuracy is one sd
// of 0.15 % for each fifth of a unit of ln r, shared by the readings there: more rings do not average it away.
//
// Where chi-square stands above its degrees of freedom by more than noise makes once in a thousand times, the readings
// miss the slab by a relative discrepancy t, which comes to each in quadrature with its sd (discrepancy.h) and is
// fitted in turn with the parameters. It weighs as the model's accuracy does: what a slab misses it misses over a
// stretch of distances, and more rings do not average it away.
//
// The start is the best of a grid by diffusion (diffusion.h), which is wrong by tens of percent but never lost.
//
// Where it stops being true: g and the phase function are the caller's word; the slab is endless, alike everywhere,
// with smooth faces in air; the spot is small against the slab.
#include "fit/joint.h"
#include "base/memory.h"
#include "base/statistics.h"
#include "fit/cholesky.h"
#include "fit/diffusion.h"
#include "fit/discrepancy.h"
#include "fit/solve.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    PARAMETERS = ALB_JOINT_PARAMETERS,
    PRIORS = PARAMETERS - ALB_JOINT_ANISOTROPY,
    SLABS = 1 + 2 * ALB_JOINT_SCALE,
    GRID = 24,
    STEPS_MAX = 16,
    ROUNDS_MAX = 8
};
static const double near_mfp = 0.5, near_share = 0.02, accuracy = 1.5e-3, accuracy_span = 0.2, difference = 0.01,
                    settled = 1e-4, reject_tail = 1e-3,
                    run_limit = 3.3; // 5e-4 by chance

static const double reach[PARAMETERS] = {1.5, 0.4, 0.2, 0.2, 0.2}; // of one step
static const double most_anisotropy = 0.9;

// One row: a reading, the face it is of, its row of the operator and the sd to weigh it with.
typedef struct row {
    int side, index, neighbours;    // that share its error of the model
    double r_mm, value, sd, weight; // weight: 1 / sd with the model's accuracy
} row;

typedef struct problem {
    const alb_joint_side *sides;
    const alb_joint_known *known;
    row *rows;
    int count; // of rows; what is known of g and the factors are PRIORS more residuals
    double prior[PRIORS], prior_sd[PRIORS], end_mm, point[PARAMETERS];
    double (*on_grid)[ALB_OPERATOR_COLUMNS], (*columns[ALB_SIDES])[ALB_OPERATOR_COLUMNS];
} problem;

static alb_slab slab_at(const alb_joint_known *known, const double *parameters)
{
    const double g = parameters[ALB_JOINT_ANISOTROPY];
    return (alb_slab){exp(parameters[0]), exp(parameters[1]) / (1 - g), g, known->refractive_index,
                      known->thickness_mm};
}

// Columns 0..3 of columns[side]: readings of S and its derivatives by ln sigma_a, ln sigma_s' and g, the last one 0
// where g is known. Slab 1 + 2 i is a step up in parameter i from slab 0, slab 2 + 2 i one down.
static bool evaluate_sides(problem *p, const double *parameters, alb_error *error)
{
    alb_slab_light light[SLABS];
    alb_error reasons[SLABS] = {{0}};
    double places[SLABS][PARAMETERS];
    const int slabs = p->known->anisotropy_sd > 0 ? SLABS : SLABS - 2;
    memcpy(p->point, parameters, sizeof p->point);
    for (int i = 0; i < SLABS; i++) {
        memcpy(places[i], parameters, sizeof places[i]);
        if (i > 0)
            places[i][(i - 1) / 2] += i % 2 ? difference : -difference;
        places[i][ALB_JOINT_ANISOTROPY] = fmax(places[i][ALB_JOINT_ANISOTROPY], 0);
    }
#pragma omp parallel for schedule(dynamic)
    for (int i = 0; i < slabs; i++) {
        const alb_slab slab = slab_at(p->known, places[i]);
        alb_slab_light_create(&light[i], &slab, p->end_mm, &reasons[i]);
    }
    for (int i = 0; i < slabs; i++)
        if (reasons[i].status != ALB_OK)
            return alb_fail(error, reasons[i].status, "%s", reasons[i].text);
    for (int side = 0; side < ALB_SIDES; side++) {
        const alb_operator *forward = p->sides[side].forward;
        for (int k = 0; forward && k < forward->grid_count; k++) {
            double value[SLABS] = {0};
            for (int i = 0; i < slabs; i++)
                value[i] = alb_slab_light_value(&light[i], (alb_side)side, forward->grid_mm[k]);
            p->on_grid[k][0] = value[0];
            for (int c = 0; c < ALB_JOINT_SCALE; c++)
                p->on_grid[k][1 + c] =
                    (value[1 + 2 * c] - value[2 + 2 * c]) / (places[1 + 2 * c][c] - places[2 + 2 * c][c]);
        }
        if (forward)
            alb_operator_apply(p->columns[side], forward, (const double(*)[ALB_OPERATOR_COLUMNS])p->on_grid);
    }
    return true;
}

// The readings near the point where the sides were last evaluated: ln(W S) as linear in ln sigma_a, ln sigma_s' and g.
static void evaluate(double *residuals, double *jacobian, const double *parameters, const void *context)
{
    const problem *p = context;
    for (int i = 0; i < p->count; i++) {
        const row *at = &p->rows[i];
        const double *here = p->columns[at->side][at->index];
        double ln_model = parameters[ALB_JOINT_SCALE] + (at->side ? parameters[ALB_JOINT_BALANCE] : 0);
        for (int c = 0; c < ALB_JOINT_SCALE; c++)
            ln_model += here[1 + c] / here[0] * (parameters[c] - p->point[c]);
        const double model = here[0] * exp(ln_model);
        residuals[i] = at->weight * (model - at->value);
        for (int c = 0; jacobian && c < PARAMETERS; c++)
            jacobian[i * PARAMETERS + c] =
                at->weight * model *
                (c < ALB_JOINT_SCALE ? here[1 + c] / here[0] : c == ALB_JOINT_SCALE || at->side == ALB_TRANSMISSION);
    }
    for (int k = 0; k < PRIORS; k++) {
        const int prior = ALB_JOINT_ANISOTROPY + k;
        residuals[p->count + k] = (parameters[prior] - p->prior[k]) / p->prior_sd[k];
        for (int c = 0; jacobian && c < PARAMETERS; c++)
            jacobian[(p->count + k) * PARAMETERS + c] = c == prior ? 1 / p->prior_sd[k] : 0;
    }
}

// How badly diffusion misses the readings at these parameters, the factor fitted as far as it is open.
static double diffusion_misfit(const problem *p, const alb_diffusion_face *face, double absorption, double scattering)
{
    const alb_diffusion light = alb_diffusion_at(face, absorption, scattering, p->known->thickness_mm);
    const double n = p->known->refractive_index, entry = 4 * n / ((n + 1) * (n + 1)), spread = 0.15;
    const double open = hypot(p->known->scale_relative_sd, 0.1);
    double weights = 1 / (open * open), sum = 0, squares = 0;
    for (int i = 0; i < p->count; i++) {
        const row *at = &p->rows[i];
        const double model = entry * alb_diffusion_value(NULL, &light, (alb_side)at->side, at->r_mm);
        if (!(at->value > 3 * at->sd))
            continue;
        const double off = model > 0 ? fmax(-3, fmin(3, log(at->value / model))) : 3;
        const double weight = 1 / (spread * spread + at->sd * at->sd / (at->value * at->value));
        weights += weight, sum += weight * off, squares += weight * off * off;
    }
    return squares - sum * sum / weights;
}

static void start(double parameters[PARAMETERS], const problem *p)
{
    const alb_diffusion_face face = alb_diffusion_face_at(ALB_DIFFUSION_GROSJEAN, p->known->refractive_index);
    double best = INFINITY;
    memcpy(parameters + ALB_JOINT_ANISOTROPY, p->prior, sizeof p->prior);
    for (int i = 0; i < GRID; i++)
        for (int j = 0; j < GRID; j++) {
            const double scattering = 0.5 / p->known->thickness_mm * pow(1000, (double)i / (GRID - 1));
            const double absorption = 1e-5 * scattering * pow(2e5, (double)j / (GRID - 1));
            const double misfit = diffusion_misfit(p, &face, absorption, scattering);
            if (misfit < best) {
                best = misfit;
                parameters[0] = log(absorption), parameters[1] = log(scattering);
            }
        }
}

// Every reading with an sd; those within the spot too.
static void collect(problem *p)
{
    p->count = 0;
    for (int side = 0; side < ALB_SIDES; side++)
        for (int i = 0; p->sides[side].readings && i < p->sides[side].readings->count; i++) {
            const alb_readings *readings = p->sides[side].readings;
            if (readings->sd[i] > 0 && isfinite(readings->sd[i]) && isfinite(readings->value[i]))
                p->rows[p->count++] =
                    (row){side, i, 1, readings->r_mm[i], readings->value[i], readings->sd[i], 1 / readings->sd[i]};
        }
}

static double share_within(const alb_operator *forward, int index, double r_mm)
{
    double within = 0, whole = 0;
    for (int k = forward->first[index]; k <= forward->last[index]; k++) {
        const double weight = forward->weight[forward->offset[index] + (size_t)(k - forward->first[index])];
        whole += weight;
        within += forward->grid_mm[k] < r_mm ? weight : 0;
    }
    return whole > 0 ? within / whole : 1;
}

// With the model's accuracy and the discrepancy in the sd.
static void weigh(problem *p, double discrepancy)
{
    for (int i = 0; i < p->count; i++) {
        row *at = &p->rows[i];
        at->weight = 1 / hypot(at->sd, hypot(accuracy, discrepancy) * sqrt(at->neighbours) * at->value);
    }
}

// Keeps what is far enough from the beam for the parameters, and weighs it.
static void choose_rows(problem *p, const double *parameters)
{
    const double near_mm = near_mfp / (exp(parameters[0]) + exp(parameters[1]));
    int kept = 0;
    for (int i = 0; i < p->count; i++)
        if (share_within(p->sides[p->rows[i].side].forward, p->rows[i].index, near_mm) < near_share)
            p->rows[kept++] = p->rows[i];
    p->count = kept;
    for (int i = 0; i < p->count; i++) {
        row *at = &p->rows[i];
        at->neighbours = 0;
        for (int j = 0; j < p->count; j++)
            at->neighbours += p->rows[j].side == at->side && fabs(log(p->rows[j].r_mm / at->r_mm)) < accuracy_span / 2;
    }
    weigh(p, 0);
}

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
static void weigh_up(alb_joint *joint, const double *parameters, const problem *p, double *jacobian)
{
    double information[PARAMETERS][PARAMETERS] = {{0}}, bound[PARAMETERS][PARAMETERS];
    joint->degrees_of_freedom = p->count + PRIORS - PARAMETERS;
    joint->undecided[0] = 0;
    evaluate(jacobian + (p->count + PRIORS) * PARAMETERS, jacobian, parameters, p);
    for (int i = 0; i < p->count + PRIORS; i++)
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

static double misfit(double *residuals, const double *parameters, const problem *p)
{
    double sum = 0;
    evaluate(residuals, NULL, parameters, p);
    for (int i = 0; i < p->count + PRIORS; i++)
        sum += residuals[i] * residuals[i];
    return sum;
}

// Correlation of the residuals with those next beyond accuracy_span on the same side, in its sd were there none. As
// many residuals count as the stretches that share an error of the model.
static double run_of(const double *residuals, const problem *p)
{
    double products = 0, squares = 0, stretches = 0;
    for (int i = 0; i < p->count; i++) {
        const row *at = &p->rows[i];
        int next = i + 1;
        while (next < p->count && p->rows[next].side == at->side && log(p->rows[next].r_mm / at->r_mm) < accuracy_span)
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
static bool minimise(alb_joint *joint, double *parameters, problem *p, double *jacobian, alb_error *error)
{
    double last = INFINITY, best[PARAMETERS] = {0};
    for (int step = 0; step < STEPS_MAX; step++) {
        if (!evaluate_sides(p, parameters, error))
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
        const alb_problem least_squares = {PARAMETERS, p->count + PRIORS, evaluate, p, lower, upper};
        if (!alb_solve(parameters, &joint->chi_square, &least_squares, error))
            return false;
        if (stalled || now - joint->chi_square < settled)
            break;
    }
    return true;
}

// Fits, and where the noise does not suffice fits and widens in turn until the discrepancy no longer moves.
static bool settle(alb_joint *joint, double *parameters, problem *p, double *jacobian, alb_error *error)
{
    const int freedom = p->count + PRIORS - PARAMETERS;
    if (!minimise(joint, parameters, p, jacobian, error))
        return false;
    joint->discrepancy_relative = 0;
    const double by_noise = joint->chi_square;
    bool moved = alb_chi_square_tail(joint->chi_square, freedom) < reject_tail;
    for (int round = 0; moved && round < ROUNDS_MAX; round++) {
        double *value = jacobian, *sd = value + p->count, *fitted = sd + p->count, *residuals = fitted + p->count;
        misfit(residuals, parameters, p);
        for (int i = 0; i < p->count; i++) {
            const row *at = &p->rows[i];
            value[i] = at->value;
            sd[i] = hypot(at->sd, accuracy * sqrt(at->neighbours) * at->value);
            fitted[i] = at->value + residuals[i] / at->weight;
        }
        const double before = joint->discrepancy_relative;
        joint->discrepancy_relative = alb_discrepancy_of(value, sd, fitted, p->count, freedom);
        weigh(p, joint->discrepancy_relative);
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

static void conclude(alb_joint *joint, const double *parameters, const problem *p)
{
    const alb_slab slab = slab_at(p->known, parameters);
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

static bool allocate(problem *p, double **jacobian, alb_error *error)
{
    size_t rows = 0, grid = 1;
    for (int side = 0; side < ALB_SIDES; side++) {
        const alb_operator *forward = p->sides[side].forward;
        if (!forward)
            continue;
        const size_t count = (size_t)forward->row_count;
        rows += count;
        grid = (size_t)forward->grid_count > grid ? (size_t)forward->grid_count : grid;
        p->end_mm = fmax(p->end_mm, forward->grid_mm[forward->grid_count - 1]);
        if (!(p->columns[side] = alb_allocate(count, sizeof *p->columns[side], error)))
            return false;
    }
    return (p->rows = alb_allocate(rows, sizeof *p->rows, error)) &&
           (p->on_grid = alb_allocate(grid, sizeof *p->on_grid, error)) &&
           (*jacobian = alb_allocate((rows + PRIORS) * (PARAMETERS + 1), sizeof **jacobian, error));
}

bool alb_joint_fit(alb_joint *joint, const alb_joint_side sides[ALB_SIDES], const alb_joint_known *known,
                   alb_error *error)
{
    *joint = (alb_joint){0};
    problem p = {.sides = sides,
                 .known = known,
                 .prior = {known->anisotropy, 0, 0},
                 .prior_sd = {fmax(known->anisotropy_sd, 1e-6), known->scale_relative_sd,
                              fmax(known->balance_relative_sd, 1e-6)}};
    double *jacobian = NULL, parameters[PARAMETERS];
    bool ok = check_request(sides, known, error) && allocate(&p, &jacobian, error);
    if (!ok)
        goto done;
    collect(&p);
    start(parameters, &p);
    for (int pass = 0; ok && pass < 2;
         pass++) { // the second time with the readings that the first one's answer asks for
        collect(&p);
        choose_rows(&p, parameters);
        ok = p.count > PARAMETERS ||
             alb_fail(error, ALB_UNDECIDED,
                      "%d readings further than %g transport mean free paths from the beam; 4 are "
                      "wanted",
                      p.count, near_mfp);
        ok = ok && settle(joint, parameters, &p, jacobian, error);
    }
    if (ok)
        conclude(joint, parameters, &p);
done:
    for (int side = 0; side < ALB_SIDES; side++)
        free(p.columns[side]);
    free(p.rows);
    free(p.on_grid);
    free(jacobian);
    return ok;
}
