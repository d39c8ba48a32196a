// Angular scaling: tables by scheme, error against bytes and time; a whole table, and many receivers, beside plain code
// timed in the same run. Prints tables and draws the chart: bench.sh_scaling CHART.svg
//
// Errors are the largest of an entry of M (or of a coefficient that comes out) against quadrature to 1e-13, over 200 k
// between the knots. Times are the best of many runs.
#include "base/plot.h"
#include "base/progress.h"
#include "base/quadrature.h"
#include "base/random.h"
#include "render/sh_scale_batch.h"
#include "render/sh_table.h"
#include <math.h>
#include <stdio.h>

enum { KNOTS = 40, VALUES = 30, RATIOS = 200, SETTINGS = 5, STORED = 3 };
static const double from = 0.25, to = 8;
static const int settings[STORED][SETTINGS] = {{20, 40, 80, 160, 320}, {12, 16, 24, 40, 80}, {12, 16, 20, 24, 32}};

typedef struct schemes {
    double bytes[STORED][SETTINGS], error[STORED][SETTINGS], ns[STORED][SETTINGS];
} schemes;

static double compare(const alb_sh_table *table, alb_error *error)
{
    double largest = 0;
    for (int i = 0; i < RATIOS; i++) {
        alb_sh_scaling exact, stored;
        const double k = from * pow(to / from, (i + 0.5) / RATIOS);
        if (!alb_sh_law_at(&exact, &table->law, k, error) || !alb_sh_table_at(&stored, table, k, error))
            return INFINITY;
        for (int v = 0; v < VALUES; v++)
            largest = fmax(largest, fabs(exact.value[v] - stored.value[v]));
    }
    return largest;
}

static double time_table(const alb_sh_table *table, int calls, alb_error *error)
{
    double best = INFINITY;
    for (int run = 0; run < 30; run++) {
        const double start_s = alb_clock_s();
        alb_sh_scaling m;
        for (int i = 0; i < calls; i++)
            if (!alb_sh_table_at(&m, table, from * pow(to / from, (i + 0.5) / calls), error))
                return INFINITY;
        best = fmin(best, (alb_clock_s() - start_s) / calls);
    }
    return 1e9 * best;
}

static bool measure_schemes(schemes *found, alb_error *error)
{
    alb_sh_law law = {ALB_SH_LAW_VISIBILITY, ALB_SH_MAP_CONE, 45, 4, 4};
    alb_sh_table table;
    printf("%-10s %6s %8s %12s %12s %8s\n", "scheme", "knots", "bytes", "visibility", "energy", "ns");
    for (int s = 0; s < STORED; s++)
        for (int i = 0; i < SETTINGS; i++) {
            law.kind = ALB_SH_LAW_ENERGY;
            if (!alb_sh_table_create(&table, &law, (alb_sh_scheme)s, settings[s][i], from, to, error))
                return false;
            const double energy = compare(&table, error);
            alb_sh_table_free(&table);
            law.kind = ALB_SH_LAW_VISIBILITY;
            if (!alb_sh_table_create(&table, &law, (alb_sh_scheme)s, settings[s][i], from, to, error))
                return false;
            found->bytes[s][i] = (double)alb_sh_table_bytes(&table);
            found->error[s][i] = compare(&table, error);
            found->ns[s][i] = time_table(&table, 1000, error);
            printf("%-10s %6d %8.0f %12.1e %12.1e %8.1f\n", alb_sh_scheme_names[s], settings[s][i], found->bytes[s][i],
                   found->error[s][i], energy, found->ns[s][i]);
            alb_sh_table_free(&table);
        }
    if (!alb_sh_table_create(&table, &law, ALB_SH_SCHEME_DIRECT, 0, from, to, error))
        return false;
    printf("%-10s %6s %8d %12.0e %12.0e %8.0f\n", "direct", "", 0, 1e-13, 1e-13, time_table(&table, 40, error));
    return true;
}

// Plain code for one k: 64 Gauss points in theta, the functions of Legendre by recurrence at each, all in a loop.
static void naive_matrices(double *visibility, double *energy, double k, const double *theta, const double *weight)
{
    for (int v = 0; v < VALUES; v++)
        visibility[v] = energy[v] = 0;
    for (int n = 0; n < 64; n++) {
        double outer[10], inner[10];
        const double s = sin(theta[n]), c = cos(theta[n]), x = c + (1 - k) * s, y = k * s, slope = k / (x * x + y * y);
        const double tau = atan2(y, x), of_visibility = 2 * M_PI * weight[n] * s,
                     of_energy = 2 * M_PI * weight[n] * sin(tau) * slope;
        int v = 0;
        alb_sh_legendre(outer, 4, c, s);
        alb_sh_legendre(inner, 4, cos(tau), sin(tau));
        for (int m = 0; m < 4; m++)
            for (int l = m; l < 4; l++)
                for (int j = m; j < 4; j++, v++) {
                    const double product = outer[l * (l + 1) / 2 + m] * inner[j * (j + 1) / 2 + m];
                    visibility[v] += of_visibility * product, energy[v] += of_energy * product;
                }
    }
}

static bool measure_tables(alb_error *error)
{
    static float visibility[KNOTS * VALUES], energy[KNOTS * VALUES];
    static double naive[2][KNOTS * VALUES];
    double k[KNOTS], theta[64], weight[64], best[2] = {INFINITY, INFINITY}, off[2] = {0, 0};
    for (int i = 0; i < KNOTS; i++)
        k[i] = from * pow(to / from, i / (KNOTS - 1.));
    alb_quadrature_gauss(theta, weight, 64, 0, M_PI);
    for (int run = 0; run < 300; run++) {
        double start_s = alb_clock_s();
        if (!alb_sh_table_cone(visibility, energy, k, KNOTS, 45, 4, error))
            return false;
        best[0] = fmin(best[0], alb_clock_s() - start_s);
        start_s = alb_clock_s();
        for (int i = 0; i < KNOTS; i++)
            naive_matrices(naive[0] + i * VALUES, naive[1] + i * VALUES, k[i], theta, weight);
        best[1] = fmin(best[1], alb_clock_s() - start_s);
    }
    for (int i = 0; i < KNOTS; i++)
        for (int measure = 0; measure < 2; measure++) {
            alb_sh_map map;
            alb_sh_scaling m;
            if (!alb_sh_map_cone(&map, k[i], 45, error) ||
                !alb_sh_scaling_compute(&m, &map, (alb_sh_measure)measure, 4, 4, error))
                return false;
            for (int v = 0; v < VALUES; v++) {
                const double fast = (double)(measure ? energy : visibility)[i * VALUES + v];
                off[0] = fmax(off[0], fabs(fast - m.value[v]));
                off[1] = fmax(off[1], fabs(naive[measure][i * VALUES + v] - m.value[v]));
            }
        }
    printf("\n40 k, order 4, both measures: %.1f us, error %.1e; plain code with 64 points: %.1f us, error %.1e\n",
           1e6 * best[0], off[0], 1e6 * best[1], off[1]);
    return true;
}

typedef struct receivers {
    size_t count, stride;
    float *k, *in, *out;
} receivers;

// Plain code: the paper's table of 40, interpolated in ln k, the sparse product, a receiver at a time.
static void naive_apply(const receivers *all, const alb_sh_table *table)
{
    const float scale = 39 / logf((float)(to / from)), low = (float)from;
    for (size_t r = 0; r < all->count; r++) {
        float m[VALUES];
        const float at = logf(all->k[r] / low) * scale;
        const int cell = at < 38 ? (int)at : 38;
        const float *row = table->values + cell * VALUES;
        for (int v = 0; v < VALUES; v++)
            m[v] = row[v] + (at - (float)cell) * (row[VALUES + v] - row[v]);
        const float *value = m;
        for (int am = 0; am < 4; am++)
            for (int l = am; l < 4; l++) {
                float plus = 0, minus = 0;
                for (int j = am; j < 4; j++, value++) {
                    plus += *value * all->in[(size_t)(j * (j + 1) + am) * all->stride + r];
                    minus += *value * all->in[(size_t)(j * (j + 1) - am) * all->stride + r];
                }
                all->out[(size_t)(l * (l + 1) + am) * all->stride + r] = plus;
                all->out[(size_t)(l * (l + 1) - am) * all->stride + r] = minus;
            }
    }
}

static double receiver_error(const receivers *all, const alb_sh_law *law, alb_error *error)
{
    double largest = 0;
    for (size_t r = 0; r < all->count; r += 37) {
        alb_sh_scaling m;
        double in[ALB_SH_COUNT_MAX], out[16];
        if (!alb_sh_law_at(&m, law, (double)all->k[r], error))
            return INFINITY;
        for (int i = 0; i < law->order_in * law->order_in; i++)
            in[i] = (double)all->in[(size_t)i * all->stride + r];
        alb_sh_scaling_apply(out, &m, in);
        for (int i = 0; i < 16; i++)
            largest = fmax(largest, fabs(out[i] - (double)all->out[(size_t)i * all->stride + r]));
    }
    return largest;
}

static bool measure_batches(const receivers *all, alb_error *error)
{
    const alb_sh_law law = {ALB_SH_LAW_VISIBILITY, ALB_SH_MAP_CONE, 45, 4, 4};
    alb_sh_table table;
    if (!alb_sh_table_create(&table, &law, ALB_SH_SCHEME_LINEAR, 40, from, to, error))
        return false;
    printf("\n%-44s %8s %12s\n", "receivers, each with its own k", "ns", "error");
    for (int in_order = 4; in_order <= 8; in_order += 4)
        for (int cells = 128; cells <= 512; cells *= 2) {
            const alb_sh_law own = {in_order == 4 ? ALB_SH_LAW_VISIBILITY : ALB_SH_LAW_OCCLUSION, ALB_SH_MAP_CONE, 45,
                                    4, in_order};
            alb_sh_batch batch;
            double best[2] = {INFINITY, INFINITY}, off = 0;
            if (!alb_sh_batch_create(&batch, &own, cells, error))
                return false;
            for (int run = 0; run < 500; run++) {
                double start_s = alb_clock_s();
                naive_apply(all, &table);
                best[1] = fmin(best[1], alb_clock_s() - start_s);
                off = run ? off : receiver_error(all, &law, error);
                start_s = alb_clock_s();
                alb_sh_batch_apply(all->out, &batch, false, all->k, all->in, all->stride, all->count);
                best[0] = fmin(best[0], alb_clock_s() - start_s);
            }
            printf("order %d to 4, %3d cells, %6zu bytes %14.1f %12.1e\n", in_order, cells,
                   (size_t)(2 * cells) * (size_t)batch.padded * sizeof *batch.rows, 1e9 * best[0] / (double)all->count,
                   receiver_error(all, &own, error));
            if (in_order == 4 && cells == 128)
                printf("order 4, plain code, 40 k of the paper %14.1f %12.1e\n", 1e9 * best[1] / (double)all->count,
                       off);
            alb_sh_batch_free(&batch);
        }
    alb_sh_table_free(&table);
    return true;
}

static bool chart(const char *path, const schemes *found, alb_error *error)
{
    alb_curve bytes[STORED], times[STORED];
    static const char *const labels[STORED] = {"linear (the paper: 40 knots)", "spline", "Chebyshev"};
    for (int s = 0; s < STORED; s++) {
        bytes[s] =
            (alb_curve){labels[s], NULL, found->bytes[s], found->error[s], NULL, SETTINGS, ALB_MARK_LINE_AND_POINTS};
        times[s] = (alb_curve){NULL, NULL, found->ns[s], found->error[s], NULL, SETTINGS, ALB_MARK_LINE_AND_POINTS};
    }
    const alb_panel panels[2] = {{"Tables of the cone map, order 4, k from 1/4 to 8", "bytes", "largest error of M",
                                  true, true, 0, 0, bytes, STORED, 1},
                                 {NULL, "ns a matrix", "largest error of M", true, true, 0, 0, times, STORED, 1}};
    return alb_plot_write(path, panels, 2, 900, 760, error);
}

int main(int argc, char **argv)
{
    enum { COUNT = 4176, STRIDE = 4176 }; // no power of two: the rows would meet in the same lines of the cache
    static float k[COUNT], in[64 * STRIDE], out[16 * STRIDE];
    const receivers all = {COUNT, STRIDE, k, in, out};
    schemes found;
    alb_error error = {0};
    for (size_t r = 0; r < COUNT; r++) {
        alb_random random = alb_random_at(1, 0, r);
        k[r] = (float)(from * pow(to / from, alb_random_uniform(&random)));
        for (size_t i = 0; i < 64; i++)
            in[i * STRIDE + r] = (float)(alb_random_uniform(&random) - 0.5);
    }
    if (!measure_schemes(&found, &error) || !measure_tables(&error) || !measure_batches(&all, &error) ||
        (argc > 1 && !chart(argv[1], &found, &error))) {
        fprintf(stderr, "bench.sh_scaling: %s\n", error.text);
        return error.status;
    }
    return 0;
}
