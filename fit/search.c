// Weighted least squares of a form to the readings: min sum ((v_i - (W S)_i) / sd_i)^2.
//
// The search is separable.c; from a place that is given, Levenberg-Marquardt (Ceres) in parameters that cannot break
// the form:
//   positive: ln a_j, ln b_j        signed: ln a1, ln b1, s = -a2/a1 in 0..1, ln(b2/b1 - 1), b2/b1 >= 1.1
// Logarithms and whitening make the answer independent of the units. b1 < b2 < b3 in all.
// Covariance: (J^T J)^-1 in the form's own parameters, J whitened, scaled to unit diagonal before it is inverted. It is
// the linear approximation: too small where the decays come close (b2/b1 below about 1.5 at 1 % noise).
#include "fit/search.h"
#include "base/memory.h"
#include "fit/cholesky.h"
#include "fit/gauss_newton.h"
#include "fit/separable.h"
#include "fit/solve.h"
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { PARAMETERS = ALB_PARAMETERS_MAX };

int alb_candidate_parameters(alb_candidate candidate)
{
    return alb_form_parameter_count(candidate.form) - candidate.tied;
}

// One problem of the solver.
typedef struct search {
    alb_candidate candidate;
    alb_model model;
    bool known; // the model's values are those of `at`
    double at[PARAMETERS];
} search;

// The form's parameters from the solver's, and the derivatives d form[i] / d solver[j].
static alb_profile profile_of(double jacobian[PARAMETERS][PARAMETERS], alb_candidate candidate, const double *u)
{
    alb_profile profile = {.form = candidate.form};
    double *p = profile.parameters, (*j)[PARAMETERS] = jacobian;
    memset(jacobian, 0, sizeof(double[PARAMETERS][PARAMETERS]));
    const bool positive = candidate.form != ALB_FORM_SIGNED_EXPONENTIALS;
    for (int i = 0; i < (positive ? alb_form_parameter_count(candidate.form) : 2); i++)
        p[i] = j[i][i] = exp(u[i]);
    if (!positive) {
        const double excess = candidate.tied ? ALB_TIED_RATIO - 1 : exp(u[3]); // of b2 over b1
        p[2] = j[2][0] = -u[2] * p[0];
        j[2][2] = -p[0];
        p[3] = j[3][1] = p[1] * (1 + excess);
        j[3][3] = candidate.tied ? 0 : p[1] * excess;
    }
    return profile;
}

static void solver_of(double *u, const alb_profile *profile)
{
    const double *p = profile->parameters;
    const bool positive = profile->form != ALB_FORM_SIGNED_EXPONENTIALS;
    for (int i = 0; i < (positive ? alb_form_parameter_count(profile->form) : 2); i++)
        u[i] = log(p[i]);
    if (!positive) {
        u[2] = -p[2] / p[0];
        u[3] = log(p[3] / p[1] - 1);
    }
}

static void evaluate(double *residuals, double *jacobian, const double *u, const void *context)
{
    search *s = (search *)context;
    const alb_weighing *weighing = s->model.weighing;
    double chain[PARAMETERS][PARAMETERS];
    const alb_profile profile = profile_of(chain, s->candidate, u);
    const int all = alb_form_parameter_count(s->candidate.form), rows = alb_weighing_rows(weighing);
    const int free_parameters = alb_candidate_parameters(s->candidate);
    const size_t size = (size_t)free_parameters * sizeof *u;
    // the solver asks for the residuals first, then for the Jacobian there
    if (!s->known || memcmp(s->at, u, size) != 0)
        alb_model_evaluate(&s->model, &profile);
    s->known = true;
    memcpy(s->at, u, size);
    for (int i = 0; i < rows; i++) {
        residuals[i] = s->model.values[0][i] - alb_weighing_reading(weighing, i);
        for (int q = 0; jacobian && q < free_parameters; q++) {
            double sum = 0;
            for (int p = 0; p < all; p++)
                sum += s->model.values[1 + p][i] * chain[p][q];
            jacobian[i * free_parameters + q] = sum;
        }
    }
}

// Of the solver's parameters: amplitudes within e^40 of what the readings show, decays and depths by their range.
static void bounds_of(double *lower, double *upper, alb_form form, const alb_weighing *weighing)
{
    const double outer = weighing->readings->outer_mm;
    double top = 0;
    for (int i = 0; i < weighing->readings->count; i++)
        top = fmax(top, fabs(weighing->readings->value[i]));
    for (int p = 0; p < alb_form_parameter_count(form); p++) {
        const alb_parameter *parameter = alb_form_parameter(form, p);
        const double amplitude = log(top) + (parameter->length + 2) * log(outer);
        lower[p] = parameter->flux ? amplitude - 40 : parameter->length < 0 ? log(0.01 / outer) : log(1e-5 * outer);
        upper[p] = parameter->flux ? amplitude + 40 : parameter->length < 0 ? log(1e7 / outer) : log(1e1 * outer);
    }
    if (form == ALB_FORM_SIGNED_EXPONENTIALS) {
        lower[2] = 0, upper[2] = 1;
        lower[3] = log(ALB_TIED_RATIO - 1), upper[3] = log(1e7);
    }
}

// From the profile to the nearest minimum; `near`: it is next to it, and the last digits are wanted.
static bool polish(alb_profile *profile, double *chi_square, bool near, alb_candidate candidate,
                   const alb_weighing *weighing, alb_error *error)
{
    search s = {.candidate = candidate};
    if (!alb_model_create(&s.model, weighing, error))
        return false;
    double u[PARAMETERS], lower[PARAMETERS], upper[PARAMETERS], chain[PARAMETERS][PARAMETERS];
    solver_of(u, profile);
    bounds_of(lower, upper, candidate.form, weighing);
    const int parameters = alb_candidate_parameters(candidate);
    for (int p = 0; p < parameters; p++)
        u[p] = fmin(fmax(u[p], lower[p]), upper[p]);
    const alb_problem problem = {parameters, alb_weighing_rows(weighing), evaluate, &s, lower, upper};
    bool full_rank;
    const bool ok =
        near ? alb_gauss_newton(u, chi_square, &full_rank, &problem, error) : alb_solve(u, chi_square, &problem, error);
    *profile = profile_of(chain, candidate, u);
    alb_profile_order(profile);
    alb_model_free(&s.model);
    return ok;
}

bool alb_search_polish(alb_profile *profile, double *chi_square, alb_candidate candidate, const alb_weighing *weighing,
                       alb_error *error)
{
    return polish(profile, chi_square, false, candidate, weighing, error);
}

int alb_search_at_bound(const alb_profile *profile, alb_candidate candidate, const alb_weighing *weighing)
{
    double u[PARAMETERS], lower[PARAMETERS], upper[PARAMETERS];
    solver_of(u, profile);
    bounds_of(lower, upper, candidate.form, weighing);
    for (int p = 0; p < alb_candidate_parameters(candidate); p++)
        if (fmin(u[p] - lower[p], upper[p] - u[p]) < 1e-6 * (upper[p] - lower[p]))
            return p;
    return -1;
}

// Readings under a finite spot see interpolated columns in the search, so that its result is polished by the exact
// ones.
bool alb_search(alb_profile *profile, double *chi_square, bool *found, alb_candidate candidate, const alb_basis *basis,
                const alb_weighing *weighing, alb_error *error)
{
    alb_separable fit;
    double *scratch = alb_allocate(alb_separable_scratch(basis), sizeof *scratch, error);
    if (!scratch)
        return false;
    alb_separable_fit(&fit, candidate, basis, weighing->readings->value, weighing->sd, weighing->energy_sd, scratch);
    free(scratch);
    *found = fit.found;
    *chi_square = fit.chi_square;
    if (!fit.found)
        return true;
    *profile = fit.profile;
    return polish(profile, chi_square, !basis->slope, candidate, weighing, error);
}

// Inverts a symmetric positive definite matrix of unit diagonal in place by Cholesky; false where a pivot, which is
// 1 - R^2 of a parameter on those before it, is below 1e-11.
static bool invert(double matrix[PARAMETERS][PARAMETERS], int n)
{
    double inverse[PARAMETERS][PARAMETERS] = {{0}}; // of the factor
    if (!alb_cholesky_factor(matrix[0], n, PARAMETERS, 1e-11))
        return false;
    for (int column = 0; column < n; column++)
        for (int i = column; i < n; i++) {
            double sum = i == column ? 1 : 0;
            for (int k = column; k < i; k++)
                sum -= matrix[i][k] * inverse[k][column];
            inverse[i][column] = sum / matrix[i][i];
        }
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            matrix[i][j] = 0;
            for (int k = 0; k < n; k++)
                matrix[i][j] += inverse[k][i] * inverse[k][j];
        }
    return true;
}

bool alb_candidate_covariance(double covariance[PARAMETERS][PARAMETERS], double normal[PARAMETERS][PARAMETERS],
                              alb_candidate candidate)
{
    const int n = alb_candidate_parameters(candidate), all = alb_form_parameter_count(candidate.form);
    double matrix[PARAMETERS][PARAMETERS], scale[PARAMETERS];
    memset(covariance, 0, sizeof(double[PARAMETERS][PARAMETERS]));
    memcpy(matrix, normal, sizeof matrix);
    if (candidate.tied) // b2 follows b1
        for (int p = 0; p < n; p++) {
            matrix[p][1] = normal[p][1] + ALB_TIED_RATIO * normal[p][3];
            matrix[1][p] = matrix[p][1];
        }
    if (candidate.tied)
        matrix[1][1] = normal[1][1] + ALB_TIED_RATIO * (2 * normal[1][3] + ALB_TIED_RATIO * normal[3][3]);
    for (int p = 0; p < n; p++) {
        scale[p] = sqrt(matrix[p][p]);
        if (!(scale[p] > 0 && isfinite(scale[p])))
            return false;
    }
    for (int p = 0; p < n; p++)
        for (int q = 0; q < n; q++)
            matrix[p][q] = matrix[p][q] / scale[p] / scale[q];
    if (!invert(matrix, n))
        return false;
    for (int p = 0; p < all; p++)
        for (int q = 0; q < all; q++) {
            const int k = p < n ? p : 1, l = q < n ? q : 1;
            const double follow = (p < n ? 1 : ALB_TIED_RATIO) * (q < n ? 1 : ALB_TIED_RATIO);
            covariance[p][q] = follow * matrix[k][l] / scale[k] / scale[l];
        }
    return true;
}

bool alb_search_covariance(double covariance[ALB_PARAMETERS_MAX][ALB_PARAMETERS_MAX], bool *full_rank,
                           const alb_profile *profile, alb_candidate candidate, const alb_weighing *weighing,
                           alb_error *error)
{
    alb_model m;
    if (!alb_model_create(&m, weighing, error))
        return false;
    alb_model_evaluate(&m, profile);
    const int all = alb_form_parameter_count(profile->form), rows = alb_weighing_rows(weighing);
    double normal[PARAMETERS][PARAMETERS] = {{0}};
    for (int p = 0; p < all; p++)
        for (int q = 0; q < all; q++)
            for (int i = 0; i < rows; i++)
                normal[p][q] += m.values[1 + p][i] * m.values[1 + q][i];
    alb_model_free(&m);
    *full_rank = alb_candidate_covariance(covariance, normal, candidate);
    return true;
}
