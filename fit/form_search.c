// Sums of exponentials: search.c. The other forms are linear in the amplitudes of one or two terms: for every place, or
// pair of places, on a grid of decays and depths the amplitudes are the solution of the normal equations of the
// whitened columns, G a = h, and chi-square falls by a^T h (variable projection; Golub & Pereyra 1973). The best that
// are not neighbours of a better one and whose amplitudes are positive are polished in all parameters, on an operator
// of every eighth grid point (it is off by 64 times as much as the whole one, 0.6 % at worst; where that matters,
// only the ranking of close starts is at stake), the best of those on the whole one.
// Stops being true where a minimum is narrower than the grid: a factor of 1.6 in decays, 2.5 in depths.
#include "fit/form_search.h"
#include "base/memory.h"
#include <math.h>
#include <stdlib.h>

enum { DECAYS = 24, DEPTHS = 8, STARTS = 4, COARSER = 8 };

typedef struct start {
    double gain, amplitude[2];
    int term[2]; // the second -1 for forms of one term
} start;

// The readings of all terms, as many at a time as the operator takes.
static bool fill_readings(alb_shapes *shapes, const alb_operator *forward, alb_error *error)
{
    const size_t grid = (size_t)forward->grid_count, rows = (size_t)shapes->rows;
    double(*on_grid)[ALB_OPERATOR_COLUMNS] = alb_allocate(grid, sizeof *on_grid, error);
    double(*columns)[ALB_OPERATOR_COLUMNS] = alb_allocate(rows, sizeof *columns, error);
    const bool ok = on_grid && columns;
    for (int j = 0; ok && j < shapes->count; j += ALB_OPERATOR_COLUMNS) {
        const int together = shapes->count - j < ALB_OPERATOR_COLUMNS ? shapes->count - j : ALB_OPERATOR_COLUMNS;
        for (size_t k = 0; k < grid; k++)
            for (int c = 0; c < together; c++)
                on_grid[k][c] = alb_profile_value(&shapes->terms[j + c], forward->grid_mm[k]);
        alb_operator_apply(columns, forward, (const double(*)[ALB_OPERATOR_COLUMNS])on_grid);
        for (int c = 0; c < together; c++)
            for (size_t i = 0; i < rows; i++)
                shapes->readings[(size_t)(j + c) * rows + i] = columns[i][c];
    }
    free(on_grid);
    free(columns);
    return ok;
}

static void shapes_free(alb_shapes *shapes)
{
    free(shapes->terms);
    free(shapes->readings);
    alb_operator_free(&shapes->coarse);
    *shapes = (alb_shapes){0};
}

bool alb_shapes_create(alb_shapes *shapes, const alb_readings *readings, const alb_operator *forward, alb_error *error)
{
    double nearest = readings->outer_mm;
    for (int i = 0; i < readings->count; i++)
        if (readings->r_mm[i] > 0)
            nearest = fmin(nearest, readings->r_mm[i]);
    nearest = fmax(nearest, 1e-5 * readings->outer_mm);
    const double slow = 0.1 / readings->outer_mm, fast = 10 / nearest, deep = 2 * readings->outer_mm;
    *shapes = (alb_shapes){.count = DECAYS * (DEPTHS + 1), .rows = readings->count};
    shapes->terms = alb_allocate((size_t)shapes->count, sizeof *shapes->terms, error);
    shapes->readings = alb_allocate((size_t)shapes->count * (size_t)shapes->rows, sizeof(double), error);
    bool ok = shapes->terms && shapes->readings;
    for (int i = 0; ok && i < DECAYS; i++) {
        const double decay = slow * pow(fast / slow, i / (DECAYS - 1.0));
        for (int j = 0; j < DEPTHS; j++) {
            const double depth = j ? deep * pow(0.1 * nearest / deep, (DEPTHS - 1 - j) / (DEPTHS - 2.0)) : 0;
            shapes->terms[i * DEPTHS + j] = (alb_profile){ALB_FORM_BURIED_SOURCE, {1, decay, depth}};
        }
        shapes->terms[DECAYS * DEPTHS + i] = (alb_profile){ALB_FORM_BURLEY, {1, 1 / decay}};
    }
    ok = ok && alb_operator_coarsen(&shapes->coarse, forward, COARSER, error) &&
         fill_readings(shapes, &shapes->coarse, error);
    if (!ok)
        shapes_free(shapes);
    return ok;
}

void alb_bases_free(alb_bases *bases)
{
    alb_basis_free(&bases->exponentials);
    shapes_free(&bases->shapes);
}

// The linear problem of the terms of one form.
typedef struct problem {
    const alb_shapes *shapes;
    int count, rows;
    int *term;       // of shapes
    double *columns; // whitened, count x rows
    double *right;   // their products with the readings
    bool mixed;      // pairs of one buried source and one term over r
    start best[STARTS];
    int kept;
} problem;

static bool buried_term(const problem *p, int i) { return p->shapes->terms[p->term[i]].parameters[2] > 0; }

static bool belongs(alb_form form, const alb_profile *term)
{
    if (form == ALB_FORM_BURLEY || term->form == ALB_FORM_BURLEY)
        return form == term->form;
    const bool buried = term->parameters[2] > 0;
    return form == ALB_FORM_BURIED_AND_OVER_R || (form == ALB_FORM_TWO_OVER_R) != buried;
}

static void problem_free(problem *p)
{
    free(p->term);
    free(p->columns);
    free(p->right);
}

static double dot(const double *x, const double *y, int n)
{
    double sum = 0;
    for (int i = 0; i < n; i++)
        sum += x[i] * y[i];
    return sum;
}

static bool problem_create(problem *p, const alb_shapes *shapes, alb_form form, const alb_weighing *weighing,
                           alb_error *error)
{
    const int rows = alb_weighing_rows(weighing), n = shapes->rows;
    *p = (problem){.shapes = shapes, .rows = rows, .mixed = form == ALB_FORM_BURIED_AND_OVER_R};
    double *readings = alb_allocate((size_t)rows, sizeof(double), error);
    const bool ok = readings && (p->term = alb_allocate((size_t)shapes->count, sizeof(int), error)) &&
                    (p->columns = alb_allocate((size_t)shapes->count * (size_t)rows, sizeof(double), error)) &&
                    (p->right = alb_allocate((size_t)shapes->count, sizeof(double), error));
    for (int i = 0; ok && i < rows; i++)
        readings[i] = alb_weighing_reading(weighing, i);
    for (int j = 0; ok && j < shapes->count; j++) {
        if (!belongs(form, &shapes->terms[j]))
            continue;
        const double *from = shapes->readings + (size_t)j * (size_t)n;
        double *column = p->columns + (size_t)p->count * (size_t)rows;
        for (int i = 0; i < n; i++)
            column[i] = from[i] / weighing->sd[i];
        if (rows > n)
            column[n] = alb_energy(weighing->readings, from) / weighing->energy_sd;
        const double size = dot(column, column, rows);
        if (!(size > 0 && isfinite(size)))
            continue;
        p->term[p->count] = j;
        p->right[p->count++] = dot(column, readings, rows);
    }
    free(readings);
    return ok;
}

// Places on the grid as (decay, depth).
static bool neighbours(const start *x, const start *y)
{
    for (int k = 0; k < 2; k++) {
        const int i = x->term[k], j = y->term[k];
        if (i >= 0 && (abs(i / DEPTHS - j / DEPTHS) > 1 || abs(i % DEPTHS - j % DEPTHS) > 1))
            return false;
    }
    return true;
}

static void keep(problem *p, const start *candidate)
{
    int worst = 0;
    for (int k = 0; k < p->kept; k++) {
        if (neighbours(&p->best[k], candidate)) {
            if (candidate->gain > p->best[k].gain)
                p->best[k] = *candidate;
            return;
        }
        worst = p->best[k].gain < p->best[worst].gain ? k : worst;
    }
    if (p->kept < STARTS)
        p->best[p->kept++] = *candidate;
    else if (candidate->gain > p->best[worst].gain)
        p->best[worst] = *candidate;
}

static void find_starts(problem *p, bool pairs)
{
    const size_t rows = (size_t)p->rows;
    for (int i = 0; i < p->count; i++) {
        const double *x = p->columns + (size_t)i * rows, xx = dot(x, x, p->rows), h1 = p->right[i];
        if (!pairs && h1 > 0)
            keep(p, &(start){h1 * h1 / xx, {h1 / xx, 0}, {p->term[i], -1}});
        for (int j = i + 1; pairs && j < p->count; j++) {
            const double *y = p->columns + (size_t)j * rows, h2 = p->right[j];
            const double xy = dot(x, y, p->rows), yy = dot(y, y, p->rows), determinant = xx * yy - xy * xy;
            const double a1 = (yy * h1 - xy * h2) / determinant, a2 = (xx * h2 - xy * h1) / determinant;
            if (p->mixed && buried_term(p, i) == buried_term(p, j))
                continue;
            if (determinant > 1e-10 * xx * yy && a1 > 0 && a2 > 0)
                keep(p, &(start){a1 * h1 + a2 * h2, {a1, a2}, {p->term[i], p->term[j]}});
        }
    }
}

static alb_profile profile_at(alb_form form, const alb_shapes *shapes, const start *at)
{
    alb_profile profile = {.form = form};
    double *p = profile.parameters;
    const bool turned = form == ALB_FORM_BURIED_AND_OVER_R && shapes->terms[at->term[0]].parameters[2] == 0;
    for (int k = 0; k < 2 && at->term[k] >= 0; k++) {
        const double *term = shapes->terms[at->term[turned ? 1 - k : k]].parameters;
        *p++ = at->amplitude[turned ? 1 - k : k];
        *p++ = term[1];
        if (form != ALB_FORM_BURLEY && term[2] > 0)
            *p++ = term[2];
    }
    alb_profile_order(&profile);
    return profile;
}

static bool search_shapes(alb_profile *profile, double *chi_square, bool *found, alb_form form,
                          const alb_shapes *shapes, const alb_weighing *weighing, alb_error *error)
{
    problem p;
    const alb_candidate candidate = {form, false};
    alb_weighing coarse = *weighing;
    coarse.forward = &shapes->coarse;
    *found = false;
    *chi_square = INFINITY;
    bool ok = problem_create(&p, shapes, form, weighing, error);
    if (ok)
        find_starts(&p, alb_form_parameter_count(form) > 3);
    for (int k = 0; ok && k < p.kept; k++) {
        alb_profile tried = profile_at(form, shapes, &p.best[k]);
        double reached;
        ok = alb_search_polish(&tried, &reached, candidate, &coarse, error);
        if (ok && reached < *chi_square) {
            *profile = tried;
            *chi_square = reached;
            *found = true;
        }
    }
    problem_free(&p);
    return ok && (!*found || alb_search_polish(profile, chi_square, candidate, weighing, error));
}

bool alb_form_search(alb_profile *profile, double *chi_square, bool *found, alb_candidate candidate, alb_bases *bases,
                     const alb_weighing *weighing, alb_error *error)
{
    if (alb_form_term_count(candidate.form) > 0)
        return alb_search(profile, chi_square, found, candidate, &bases->exponentials, weighing, error);
    if (!bases->shapes.terms && !alb_shapes_create(&bases->shapes, weighing->readings, weighing->forward, error))
        return false;
    return search_shapes(profile, chi_square, found, candidate.form, &bases->shapes, weighing, error);
}
