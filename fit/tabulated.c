// A profile as a table says it: S exponential between two distances (the straight line in ln S), linear where one of
// the two values is 0. Before the first distance the first of these exponentials goes on to r = 0, beyond the last one
// the last goes on for ever; a table that ends with 0 has nothing beyond. Over a step h from a, with decay b, x = b h:
//     integral S r dr = S(a) h (a p(x) + h q(x)),   p(x) = (1 - e^-x)/x,   q(x) = (1 - (1 + x) e^-x)/x^2
// Exact for exponentials; elsewhere off by up to (d^2 ln S/dr^2) h^2/8 of S, whose sign is that of the curvature. It
// stops being true where the table is noisy or coarse: its kinks are taken for the profile's. `fit` takes noise.
//
// A profile of this form has no parameters: the first one's room holds the address of the table.
#include "base/memory.h"
#include "fit/form.h"
#include "fit/table.h"
#include <stdlib.h>
#include <string.h>

typedef struct knot {
    double r_mm, value, decay; // up to the next; NAN: linear to 0, or from it
    double disc;               // integral of S r dr up to here
} knot;

typedef struct table {
    size_t count;
    knot knots[]; // the first at r = 0
} table;

static const double most_guessed = 0.1; // of the total: before the first distance, and beyond the last

static const table *table_of(const double *p)
{
    const table *t;
    memcpy(&t, p, sizeof t);
    return t;
}

// Integral of e^(-x t) and of t e^(-x t) over t from 0 to 1.
static void moments(double *p, double *q, double x)
{
    if (fabs(x) < 1e-2) { // where the closed forms lose their digits
        *p = 1 - x * (1.0 / 2 - x * (1.0 / 6 - x * (1.0 / 24 - x / 120)));
        *q = 1.0 / 2 - x * (1.0 / 3 - x * (1.0 / 8 - x * (1.0 / 30 - x / 144)));
        return;
    }
    *p = -expm1(-x) / x;
    *q = (*p - exp(-x)) / x;
}

// S and its integral from knot k on to r; the knot after it is looked at where the step is linear.
static double value_from(const knot *k, double r_mm)
{
    const double h = r_mm - k->r_mm;
    return isnan(k->decay) ? k->value + (k[1].value - k->value) * h / (k[1].r_mm - k->r_mm)
                           : k->value * exp(-k->decay * h);
}

static double disc_from(const knot *k, double r_mm)
{
    const double a = k->r_mm, h = r_mm - a;
    double p, q;
    if (isnan(k->decay)) {
        const double end = value_from(k, r_mm);
        return h * (a * (k->value + end) / 2 + h * (k->value + 2 * end) / 6);
    }
    moments(&p, &q, k->decay * h);
    return k->value * h * (a * p + h * q);
}

static const knot *knot_before(const table *t, double r_mm)
{
    size_t low = 0, high = t->count;
    while (high - low > 1) {
        const size_t middle = (low + high) / 2;
        *(t->knots[middle].r_mm <= r_mm ? &low : &high) = middle;
    }
    return &t->knots[low];
}

static double table_value(double *gradient, const alb_form_row *row, const double *p, double r_mm)
{
    (void)gradient, (void)row;
    return value_from(knot_before(table_of(p), r_mm), r_mm);
}

static double table_disc(const alb_form_row *row, const double *p, double rho_mm)
{
    const knot *k = knot_before(table_of(p), rho_mm);
    (void)row;
    return k->disc + disc_from(k, rho_mm);
}

static double tail_of(const knot *last)
{
    return last->value > 0 ? last->value * (last->r_mm + 1 / last->decay) / last->decay : 0;
}

static double table_total(double *gradient, const alb_form_row *row, const double *p)
{
    const table *t = table_of(p);
    const knot *last = &t->knots[t->count - 1];
    (void)gradient, (void)row;
    return 2 * M_PI * (last->disc + tail_of(last));
}

static double table_slowest(const alb_form_row *row, const double *p)
{
    (void)row;
    return table_of(p)->knots[table_of(p)->count - 1].decay;
}

static bool table_sound(const alb_form_row *row, const double *p)
{
    (void)row;
    return table_of(p) != NULL;
}

const alb_form_row alb_tabulated_row = {.name = "tabulated",
                                        .value = table_value,
                                        .total = table_total,
                                        .disc = table_disc,
                                        .slowest = table_slowest,
                                        .sound = table_sound};

// One over the distance within which S falls to 1/e of where it begins.
double alb_tabulated_fastest(const alb_profile *profile)
{
    const table *t = table_of(profile->parameters);
    const double least = t->knots[0].value * exp(-1);
    size_t k = 0;
    while (k + 1 < t->count && t->knots[k].value > least)
        k++;
    return t->knots[k].r_mm > 0 ? 1 / t->knots[k].r_mm : table_slowest(NULL, profile->parameters);
}

static double decay_between(const knot *a, const knot *b)
{
    return a->value > 0 && b->value > 0   ? log(a->value / b->value) / (b->r_mm - a->r_mm)
           : a->value > 0 || b->value > 0 ? (double)NAN
                                          : 0;
}

static bool fill(table *t, const alb_readings *readings, const char *path, alb_error *error)
{
    const size_t n = (size_t)readings->count, begin = readings->r_mm[0] > 0;
    t->count = n + begin;
    for (size_t i = 0; i < n; i++) {
        t->knots[i + begin] = (knot){.r_mm = readings->r_mm[i], .value = readings->value[i]};
        if (!(readings->value[i] >= 0))
            return alb_fail(error, ALB_BAD_DATA, "%s:%zu: column 2: a profile is nowhere negative; fit takes noise",
                            path, i + 2);
    }
    for (size_t k = begin; k + 1 < t->count; k++)
        t->knots[k].decay = decay_between(&t->knots[k], &t->knots[k + 1]);
    if (begin) {
        const double decay = fmax(isnan(t->knots[1].decay) ? 0 : t->knots[1].decay, 0);
        t->knots[0] = (knot){.value = t->knots[1].value * exp(decay * t->knots[1].r_mm), .decay = decay};
    }
    for (size_t k = 0; k + 1 < t->count; k++)
        t->knots[k + 1].disc = t->knots[k].disc + disc_from(&t->knots[k], t->knots[k + 1].r_mm);
    knot *last = &t->knots[t->count - 1];
    last->decay = last->value > 0 ? last[-1].decay : 0;
    if (last->value > 0 && !(last->decay > 0))
        return alb_fail(error, ALB_BAD_DATA,
                        "%s:%zu: column 2: the profile does not fall where the table ends, so that what lies beyond is "
                        "not known; tabulate further out, or end with 0",
                        path, n + 1);
    const double guessed = tail_of(last) + (begin ? t->knots[1].disc : 0), total = last->disc + tail_of(last);
    if (!(guessed <= most_guessed * total))
        return alb_fail(error, ALB_BAD_DATA,
                        "%s: %.3g %% of the light leaves nearer than the first line says or beyond the last; at most "
                        "%g %% may: tabulate from 0 mm and further out",
                        path, 100 * guessed / total, 100 * most_guessed);
    if (!(2 * M_PI * total < 1))
        return alb_fail(error, ALB_BAD_DATA,
                        "%s: the profile lets out %.4g times the light that falls in (2 pi times the integral of value "
                        "times r); less than 1 is wanted",
                        path, 2 * M_PI * total);
    return true;
}

bool alb_profile_read_table(alb_profile *profile, const char *path, alb_error *error)
{
    alb_readings readings;
    *profile = (alb_profile){.form = ALB_FORM_NONE};
    if (!alb_table_read(&readings, path, error))
        return false;
    const size_t room = (size_t)readings.count + 1;
    table *t = alb_allocate(1, sizeof *t + room * sizeof *t->knots, error);
    const bool ok = t && (readings.count > 1 || alb_fail(error, ALB_BAD_DATA, "%s: one line is no profile", path)) &&
                    fill(t, &readings, path, error);
    alb_readings_free(&readings);
    if (!ok) {
        free(t);
        return false;
    }
    profile->form = ALB_FORM_TABULATED;
    memcpy(profile->parameters, &t, sizeof t);
    return true;
}

void alb_profile_free(alb_profile *profile)
{
    table *t;
    memcpy(&t, profile->parameters, sizeof t);
    if (profile->form == ALB_FORM_TABULATED)
        free(t);
    *profile = (alb_profile){.form = ALB_FORM_NONE};
}
