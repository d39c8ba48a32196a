// Table schemes over a law. Knots lie equally far apart in t = ln k (mid-range: k) in [from, to]; Chebyshev's
// coefficients come from the law at the points cos((i + 1/2) pi/n). The spline's slopes d solve d_(i-1) + 4 d_i +
// d_(i+1) = 3 (y_(i+1) - y_(i-1)) (unit steps), at its ends one-sided differences of fourth order.
#include "render/sh_table.h"
#include "base/memory.h"
#include <math.h>
#include <stdlib.h>

const char *const alb_sh_scheme_names[ALB_SH_SCHEMES] = {"linear", "spline", "chebyshev", "direct"};

static int value_count(const alb_sh_table *table)
{
    return alb_sh_scaling_count(table->law.order_out, table->law.order_in);
}

static int columns(const alb_sh_table *table)
{
    return table->scheme == ALB_SH_SCHEME_DIRECT ? 0 : table->scheme == ALB_SH_SCHEME_SPLINE ? 2 : 1;
}

size_t alb_sh_table_bytes(const alb_sh_table *table)
{
    return (size_t)table->knots * (size_t)columns(table) * (size_t)value_count(table) * sizeof *table->values;
}

// t in [0, 1] of k, and back.
static double parameter(const alb_sh_table *table, double k)
{
    return table->law.map == ALB_SH_MAP_MIDRANGE ? (k - table->from) / (table->to - table->from)
                                                 : log(k / table->from) / log(table->to / table->from);
}

static double ratio(const alb_sh_table *table, double t)
{
    return table->law.map == ALB_SH_MAP_MIDRANGE ? table->from + t * (table->to - table->from)
                                                 : table->from * pow(table->to / table->from, t);
}

// Slopes of one value over the knots, by elimination; y and the work are `knots` long.
static void find_slopes(double *slope, const double *y, double *work, int n)
{
    slope[0] = (-25 * y[0] + 48 * y[1] - 36 * y[2] + 16 * y[3] - 3 * y[4]) / 12;
    slope[n - 1] = (25 * y[n - 1] - 48 * y[n - 2] + 36 * y[n - 3] - 16 * y[n - 4] + 3 * y[n - 5]) / 12;
    work[0] = 0;
    for (int i = 1; i < n - 1; i++) {
        work[i] = 1 / (4 - work[i - 1]);
        slope[i] = (3 * (y[i + 1] - y[i - 1]) - slope[i - 1]) * work[i];
    }
    for (int i = n - 2; i > 0; i--)
        slope[i] -= work[i] * slope[i + 1];
}

static void store_value(alb_sh_table *table, int v, const double *y, double *slope, double *work)
{
    const int n = table->knots, count = value_count(table);
    float *out = table->values + v;
    if (table->scheme == ALB_SH_SCHEME_SPLINE)
        find_slopes(slope, y, work, n);
    for (int i = 0; i < n; i++) {
        double sum = 0;
        if (table->scheme == ALB_SH_SCHEME_CHEBYSHEV)
            for (int p = 0; p < n; p++)
                sum += (i ? 2. : 1.) / n * y[p] * cos(i * (p + 0.5) * M_PI / n);
        else
            sum = y[i];
        out[(size_t)(i * columns(table)) * (size_t)count] = (float)sum;
        if (table->scheme == ALB_SH_SCHEME_SPLINE)
            out[(size_t)(2 * i + 1) * (size_t)count] = (float)slope[i];
    }
}

static bool fill(alb_sh_table *table, alb_error *error)
{
    const int n = table->knots, count = value_count(table);
    double *samples = alb_allocate((size_t)n * (size_t)(count + 2), sizeof *samples, error);
    double *slope = samples + (size_t)n * (size_t)count;
    bool ok = samples != NULL;
    for (int i = 0; i < n && ok; i++) {
        const double t =
            table->scheme == ALB_SH_SCHEME_CHEBYSHEV ? 0.5 + 0.5 * cos((i + 0.5) * M_PI / n) : (double)i / (n - 1);
        alb_sh_scaling m;
        ok = alb_sh_law_at(&m, &table->law, ratio(table, t), error);
        for (int v = 0; v < count && ok; v++)
            samples[(size_t)v * (size_t)n + (size_t)i] = m.value[v];
    }
    for (int v = 0; v < count && ok; v++)
        store_value(table, v, samples + (size_t)v * (size_t)n, slope, slope + n);
    free(samples);
    return ok;
}

bool alb_sh_table_create(alb_sh_table *table, const alb_sh_law *law, alb_sh_scheme scheme, int knots, double from,
                         double to, alb_error *error)
{
    *table = (alb_sh_table){.law = *law, .scheme = scheme, .knots = knots, .from = from, .to = to};
    const int least = scheme == ALB_SH_SCHEME_LINEAR ? 2 : 6;
    const double lowest = law->map == ALB_SH_MAP_MIDRANGE ? -1 : 0,
                 highest = law->map == ALB_SH_MAP_MIDRANGE ? 1 : INFINITY;
    if (!alb_sh_law_check(law, error))
        return false;
    if (scheme == ALB_SH_SCHEME_DIRECT) {
        table->knots = 0;
        return true;
    }
    if (knots < least || knots > 1000)
        return alb_fail(error, ALB_USAGE, "table with %d knots; expected %d to 1000", knots, least);
    if (!(from > lowest && to > from && to < highest))
        return alb_fail(error, ALB_USAGE, "table for k from %g to %g; expected two rising values between %g and %g",
                        from, to, lowest, highest);
    table->values = alb_allocate(alb_sh_table_bytes(table), 1, error);
    if (table->values && fill(table, error))
        return true;
    alb_sh_table_free(table);
    return false;
}

void alb_sh_table_free(alb_sh_table *table)
{
    free(table->values);
    *table = (alb_sh_table){0};
}

static void chebyshev_at(double *value, const alb_sh_table *table, double t, int count)
{
    const double x = 2 * t - 1;
    for (int v = 0; v < count; v++) {
        double next = 0, after = 0;
        for (int j = table->knots - 1; j >= 1; j--) {
            const double sum = 2 * x * next - after + (double)table->values[(size_t)(j * count + v)];
            after = next, next = sum;
        }
        value[v] = x * next - after + (double)table->values[v];
    }
}

static void between_knots(double *value, const alb_sh_table *table, double t, int count)
{
    const double at = t * (table->knots - 1);
    const int cell = at >= table->knots - 1 ? table->knots - 2 : (int)at;
    const double x = at - cell;
    const float *low = table->values + (size_t)(cell * columns(table) * count), *high = low + columns(table) * count;
    for (int v = 0; v < count; v++) {
        const double from = (double)low[v], rise = (double)high[v] - from;
        if (table->scheme == ALB_SH_SCHEME_LINEAR) {
            value[v] = from + x * rise;
            continue;
        }
        const double begin = (double)low[count + v], end = (double)high[count + v];
        value[v] = from + x * (begin + x * (3 * rise - 2 * begin - end + x * (begin + end - 2 * rise)));
    }
}

bool alb_sh_table_at(alb_sh_scaling *scaling, const alb_sh_table *table, double k, alb_error *error)
{
    if (table->scheme == ALB_SH_SCHEME_DIRECT || !(k >= table->from && k <= table->to))
        return alb_sh_law_at(scaling, &table->law, k, error);
    if (!alb_sh_scaling_begin(scaling, table->law.order_out, table->law.order_in, error))
        return false;
    const double t = fmin(fmax(parameter(table, k), 0), 1);
    if (table->scheme == ALB_SH_SCHEME_CHEBYSHEV)
        chebyshev_at(scaling->value, table, t, value_count(table));
    else
        between_knots(scaling->value, table, t, value_count(table));
    return true;
}
