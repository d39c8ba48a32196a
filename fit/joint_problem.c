// Which readings of a slab's images count, what they weigh, and how the slab makes them (joint.c gives the problem).
//
// What is used: readings of which less than 2 % comes from within half a transport mean free path of the beam, where
// the model is worse than elsewhere and where the light that has not scattered arrives. The model's accuracy is one sd
// of 0.15 % for each fifth of a unit of ln r, shared by the readings there: more rings do not average it away.
#include "fit/joint_problem.h"
#include "base/memory.h"
#include "fit/diffusion.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { PARAMETERS = ALB_JOINT_PARAMETERS, SLABS = 1 + 2 * ALB_JOINT_SCALE, GRID = 24 };
static const double near_share = 0.02, difference = 0.01;

bool alb_joint_problem_create(alb_joint_problem *p, double **jacobian, alb_error *error)
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
           (*jacobian = alb_allocate((rows + ALB_JOINT_PRIORS) * (PARAMETERS + 1), sizeof **jacobian, error));
}

void alb_joint_problem_free(alb_joint_problem *p)
{
    for (int side = 0; side < ALB_SIDES; side++)
        free(p->columns[side]);
    free(p->rows);
    free(p->on_grid);
}

alb_slab alb_joint_slab_at(const alb_joint_known *known, const double *parameters)
{
    const double g = parameters[ALB_JOINT_ANISOTROPY];
    return (alb_slab){exp(parameters[0]), exp(parameters[1]) / (1 - g), g, known->refractive_index,
                      known->thickness_mm};
}

// Columns 0..3 of columns[side]: readings of S and its derivatives by ln sigma_a, ln sigma_s' and g, the last one 0
// where g is known. Slab 1 + 2 i is a step up in parameter i from slab 0, slab 2 + 2 i one down.
bool alb_joint_evaluate_sides(alb_joint_problem *p, const double *parameters, alb_error *error)
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
        const alb_slab slab = alb_joint_slab_at(p->known, places[i]);
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

void alb_joint_evaluate(double *residuals, double *jacobian, const double *parameters, const void *context)
{
    const alb_joint_problem *p = context;
    for (int i = 0; i < p->count; i++) {
        const alb_joint_row *at = &p->rows[i];
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
    for (int k = 0; k < ALB_JOINT_PRIORS; k++) {
        const int prior = ALB_JOINT_ANISOTROPY + k;
        residuals[p->count + k] = (parameters[prior] - p->prior[k]) / p->prior_sd[k];
        for (int c = 0; jacobian && c < PARAMETERS; c++)
            jacobian[(p->count + k) * PARAMETERS + c] = c == prior ? 1 / p->prior_sd[k] : 0;
    }
}

// How badly diffusion misses the readings at these parameters, the factor fitted as far as it is open.
static double diffusion_misfit(const alb_joint_problem *p, const alb_diffusion_face *face, double absorption,
                               double scattering)
{
    const alb_diffusion light = alb_diffusion_at(face, absorption, scattering, p->known->thickness_mm);
    const double n = p->known->refractive_index, entry = 4 * n / ((n + 1) * (n + 1)), spread = 0.15;
    const double open = hypot(p->known->scale_relative_sd, 0.1);
    double weights = 1 / (open * open), sum = 0, squares = 0;
    for (int i = 0; i < p->count; i++) {
        const alb_joint_row *at = &p->rows[i];
        const double model = entry * alb_diffusion_value(NULL, &light, (alb_side)at->side, at->r_mm);
        if (!(at->value > 3 * at->sd))
            continue;
        const double off = model > 0 ? fmax(-3, fmin(3, log(at->value / model))) : 3;
        const double weight = 1 / (spread * spread + at->sd * at->sd / (at->value * at->value));
        weights += weight, sum += weight * off, squares += weight * off * off;
    }
    return squares - sum * sum / weights;
}

void alb_joint_start(double parameters[PARAMETERS], const alb_joint_problem *p)
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

void alb_joint_collect(alb_joint_problem *p)
{
    p->count = 0;
    for (int side = 0; side < ALB_SIDES; side++)
        for (int i = 0; p->sides[side].readings && i < p->sides[side].readings->count; i++) {
            const alb_readings *readings = p->sides[side].readings;
            if (readings->sd[i] > 0 && isfinite(readings->sd[i]) && isfinite(readings->value[i]))
                p->rows[p->count++] = (alb_joint_row){
                    side, i, 1, readings->r_mm[i], readings->value[i], readings->sd[i], 1 / readings->sd[i]};
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

void alb_joint_weigh(alb_joint_problem *p, double discrepancy)
{
    for (int i = 0; i < p->count; i++) {
        alb_joint_row *at = &p->rows[i];
        at->weight = 1 / hypot(at->sd, hypot(alb_joint_accuracy, discrepancy) * sqrt(at->neighbours) * at->value);
    }
}

void alb_joint_choose_rows(alb_joint_problem *p, const double *parameters)
{
    const double near_mm = alb_joint_near_mfp / (exp(parameters[0]) + exp(parameters[1]));
    int kept = 0;
    for (int i = 0; i < p->count; i++)
        if (share_within(p->sides[p->rows[i].side].forward, p->rows[i].index, near_mm) < near_share)
            p->rows[kept++] = p->rows[i];
    p->count = kept;
    for (int i = 0; i < p->count; i++) {
        alb_joint_row *at = &p->rows[i];
        at->neighbours = 0;
        for (int j = 0; j < p->count; j++)
            at->neighbours += p->rows[j].side == at->side && fabs(log(p->rows[j].r_mm / at->r_mm)) < alb_joint_span / 2;
    }
    alb_joint_weigh(p, 0);
}
