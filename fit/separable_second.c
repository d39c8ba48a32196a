// A second term that gains little in chi^2 has rivals among what the noise makes: descents from the single exponential,
// column c_1, and each peak of what a second column gains beside it, on the grid and then, for positive terms, on
// rungs finer than it. Stops being true where the rivals lie closer to each other than a rung.
#include "fit/separable_search.h"
#include <math.h>

enum { TERMS = ALB_TERMS_MAX };

// From the single exponential and a second term at each peak of what that gains on rungs finer than the grid. The
// residual r of the single exponential, column c_1, is orthogonal to it and to f_1; a term at x lowers chi^2 where
// r.c > 0, by (r.c)^2 / |c beside c_1 and f_1|^2 where that is little.
static void climb(alb_place *best, alb_separable_search *s, const alb_place *one)
{
    const alb_whitened *data = &s->all.data;
    const int rows = data->basis->rows;
    const double rung = 0.15, pivot = one->x[0], amplitude = one->amplitude[0];
    alb_term *first = &s->all.term[0], *second = &s->all.term[1];
    double products[TERMS][3], before = 0, at = 0;
    alb_start here = {0};
    alb_term_evaluate(first, data, pivot, s->all.work);
    alb_term_residual(s->all.residual, products, data, first, &amplitude, 1);
    const double overlap = first->cf / first->cc, beside = first->ff - overlap * first->cf;
    const int last = (int)((data->basis->highest - s->x[0]) / rung);
    alb_starts from = {0};
    for (int k = 0; k <= last + 1; k++) {
        const double x = s->x[0] + k * rung;
        double after = 0;
        alb_start next = {0};
        if (k <= last) {
            alb_term_evaluate(second, data, x, s->all.work);
            const double lift = alb_columns_dot(s->all.residual, second->column, rows);
            const double c = alb_columns_dot(first->column, second->column, rows);
            const double f = alb_columns_dot(first->first, second->column, rows) - overlap * c;
            const double length = second->cc - c * c / first->cc - f * f / beside;
            after = lift > 0 && length > 1e-9 * second->cc ? lift * lift / length : 0;
            const double shift = after > 0 ? fmin(fmax(-lift / length * f / beside / amplitude, -0.5), 0.5) : 0;
            next = (alb_start){after, {fmin(pivot + shift, x), fmax(pivot + shift, x)}};
        }
        if (at > before && at >= after)
            alb_starts_keep(&from, here);
        before = at;
        at = after;
        here = next;
    }
    for (int k = 0; k < from.count; k++)
        alb_separable_polish(best, s, from.list[k].x, 2, ALB_POSITIVE);
}

// From the single exponential and a second term at each peak of what that gains, the first moved so that the mean
// stays.
void alb_separable_second(alb_place *best, alb_separable_search *s, const alb_place *one, alb_signs signs)
{
    const int n = s->columns, rows = s->merged.data.basis->rows;
    const double pivot = one->x[0], sign = signs == ALB_POSITIVE ? 1 : -1;
    alb_term *first = &s->merged.term[0];
    double *gain = s->gain, *shift = s->gain + n;
    alb_starts from = {0};
    alb_term_evaluate(first, &s->merged.data, pivot, s->merged.work);
    const double length = sqrt(first->cc), right = first->cv / length;
    for (int j = 0; j < n; j++) {
        const double c = alb_columns_dot(first->column, s->column[j], rows) * s->scale[j] / length;
        const double a = right - c * s->right[j], b = s->right[j] - c * right;
        gain[j] = a > 0 && b * sign > 0 && c * c < 1 ? b * b / (1 - c * c) : 0;
        shift[j] = a > 0 ? fmin(fmax(b / a * (pivot - s->x[j]), -0.5), 0.5) : 0;
    }
    for (int j = 0; j < n; j++) {
        const double before = j > 0 ? gain[j - 1] : 0, after = j + 1 < n ? gain[j + 1] : 0, x = pivot + shift[j];
        if (gain[j] > 0 && gain[j] > before && gain[j] >= after &&
            (signs == ALB_POSITIVE || s->x[j] > x + log(ALB_TIED_RATIO)))
            alb_starts_keep(&from, (alb_start){gain[j], {fmin(x, s->x[j]), fmax(x, s->x[j])}});
    }
    if (signs == ALB_POSITIVE)
        alb_starts_keep(&from, (alb_start){0, {pivot - 0.2, pivot + 0.2}});
    for (double apart = 0.7; signs != ALB_POSITIVE && apart < 2; apart += 0.6)
        alb_starts_keep(&from, (alb_start){0, {pivot + 0.02, pivot + apart}});
    for (int k = 0; k < from.count; k++)
        alb_separable_polish(best, s, from.list[k].x, 2, signs);
    if (signs == ALB_POSITIVE)
        climb(best, s, one);
}
