// Spherical harmonics: nanoseconds an item and worst error, by order, of batches beside the plain way, one item after
// the other. Prints tables and draws the chart: bench.sh_basis CHART.svg
//
// Plain: values from associated Legendre functions by recurrence with factorials, sines and cosines for every (l, m);
// rotations by Ivanic and Ruedenberg's recurrence from the matrix of each item; products as the list of all ordered
// Gaunt coefficients that are not zero. Time: the least of several runs, the two ways in turn, one thread. Error: the
// largest of any coefficient against double precision, inputs of unit norm.
#include "base/plot.h"
#include "base/progress.h"
#include "base/random.h"
#include "render/sh_product.h"
#include "render/sh_project.h"
#include "render/sh_rotate.h"
#include "render/sh_window.h"
#include "render/sh_zonal.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ITEMS = 1000, STRIDE = 1008, ORDERS = ALB_SH_ORDER_MAX, COUNT = ALB_SH_COUNT_MAX, RUNS = 40, GAUNTS = 20000 };
enum { EVALUATE, TO_AXIS, ROTATE, PRODUCT, CAP, OPERATIONS };
static const char *const names[OPERATIONS] = {"values", "to an axis", "rotation", "product", "cap"};

typedef struct gaunt {
    int i, j, k;
    float value;
} gaunt;

static float directions[3 * STRIDE], quaternions[4 * STRIDE], cosines[STRIDE], first[COUNT * STRIDE],
    second[COUNT * STRIDE], out[COUNT * STRIDE], plain[ITEMS][COUNT];
static gaunt gaunts[GAUNTS];
static int gaunt_count;
static double ns[2][OPERATIONS][ORDERS], errors[OPERATIONS][ORDERS];

static void fill(int order)
{
    for (int r = 0; r < ITEMS; r++) {
        alb_random random = alb_random_at(1, (uint64_t)order, (uint64_t)r);
        double q[4], c[2][COUNT], sums[2] = {0}, length = 0;
        for (int i = 0; i < 4; i++)
            q[i] = alb_random_normal(&random);
        for (int i = 0; i < 2 * COUNT; i++) {
            c[i / COUNT][i % COUNT] = alb_random_normal(&random);
            sums[i / COUNT] += i % COUNT < order * order ? c[i / COUNT][i % COUNT] * c[i / COUNT][i % COUNT] : 0;
        }
        for (int i = 0; i < 3; i++)
            length += q[i] * q[i];
        cosines[r] = (float)(2 * alb_random_uniform(&random) - 1);
        for (int i = 0; i < 4; i++)
            quaternions[i * STRIDE + r] = (float)q[i];
        for (int i = 0; i < 3; i++)
            directions[i * STRIDE + r] = (float)(q[i] / sqrt(length));
        for (int i = 0; i < order * order; i++) {
            first[i * STRIDE + r] = (float)(c[0][i] / sqrt(sums[0]));
            second[i * STRIDE + r] = (float)(c[1][i] / sqrt(sums[1]));
        }
    }
}

static void take(double *c, const float *batch, int order, int r)
{
    for (int i = 0; i < order * order; i++)
        c[i] = (double)batch[i * STRIDE + r];
}

static alb_vector direction_of(int r)
{
    return alb_unit(
        (alb_vector){(double)directions[r], (double)directions[STRIDE + r], (double)directions[2 * STRIDE + r]});
}

static void matrix_of(double m[3][3], int r)
{
    double q[4], n = 0;
    for (int i = 0; i < 4; i++)
        q[i] = (double)quaternions[i * STRIDE + r], n += q[i] * q[i];
    const double x = q[0], y = q[1], z = q[2], w = q[3], f = 2 / n;
    const double made[3][3] = {{1 - f * (y * y + z * z), f * (x * y - z * w), f * (x * z + y * w)},
                               {f * (x * y + z * w), 1 - f * (x * x + z * z), f * (y * z - x * w)},
                               {f * (x * z - y * w), f * (y * z + x * w), 1 - f * (x * x + y * y)}};
    memcpy(m, made, sizeof made);
}

// The way of the textbooks.
static double textbook_value(int l, int m, double theta, double phi)
{
    const int n = abs(m);
    double norm = (2 * l + 1) / (4 * M_PI), x = cos(theta), last = 1, before = 0;
    for (int i = l - n + 1; i <= l + n; i++)
        norm /= i;
    for (int i = 1; i <= n; i++)
        last *= (2 * i - 1) * sin(theta);
    for (int i = n + 1; i <= l; i++) {
        const double value = ((2 * i - 1) * x * last - (i + n - 1) * before) / (i - n);
        before = last, last = value;
    }
    return sqrt(norm * (n ? 2 : 1)) * last * (m < 0 ? sin(n * phi) : cos(n * phi));
}

static void textbook_values(float *values, int order, int r)
{
    const alb_vector d = direction_of(r);
    const double theta = acos(d.z), phi = atan2(d.y, d.x);
    for (int l = 0; l < order; l++)
        for (int m = -l; m <= l; m++)
            values[alb_sh_index(l, m)] = (float)textbook_value(l, m, theta, phi);
}

static void rotate_one(float *values, int order, int r, bool axis)
{
    double m[3][3], t[3][3], c[COUNT];
    if (axis) {
        alb_sh_axis_rotation(t, direction_of(r));
        for (int i = 0; i < 9; i++)
            m[i / 3][i % 3] = t[i % 3][i / 3];
    } else {
        matrix_of(m, r);
    }
    take(c, first, order, r);
    alb_sh_rotate(c, c, order, (const double(*)[3])m);
    for (int i = 0; i < order * order; i++)
        values[i] = (float)c[i];
}

static void multiply_one(float *values, int order, int r)
{
    float a[COUNT], b[COUNT];
    for (int i = 0; i < order * order; i++)
        a[i] = first[i * STRIDE + r], b[i] = second[i * STRIDE + r], values[i] = 0;
    for (const gaunt *g = gaunts; g < gaunts + gaunt_count; g++)
        values[g->i] += g->value * a[g->j] * b[g->k];
}

static void cap_one(float *values, int order, int r)
{
    double c[COUNT];
    alb_sh_project_cap(c, order, direction_of(r), acos((double)cosines[r]));
    for (int i = 0; i < order * order; i++)
        values[i] = (float)c[i];
}

static void run_plain(int operation, int order)
{
    for (int r = 0; r < ITEMS; r++)
        switch (operation) {
        case EVALUATE:
            textbook_values(plain[r], order, r);
            break;
        case PRODUCT:
            multiply_one(plain[r], order, r);
            break;
        case CAP:
            cap_one(plain[r], order, r);
            break;
        default:
            rotate_one(plain[r], order, r, operation == TO_AXIS);
        }
}

static void run_batch(int operation, int order)
{
    switch (operation) {
    case EVALUATE:
        alb_sh_evaluate_batch(out, order, directions, STRIDE, ITEMS);
        break;
    case TO_AXIS:
        alb_sh_to_axis_batch(out, first, order, directions, STRIDE, ITEMS);
        break;
    case ROTATE:
        alb_sh_rotate_batch(out, first, order, quaternions, STRIDE, ITEMS);
        break;
    case PRODUCT:
        alb_sh_product_batch(out, first, second, order, STRIDE, ITEMS);
        break;
    default:
        alb_sh_cap_batch(out, order, directions, cosines, STRIDE, ITEMS);
    }
}

// All ordered ones, from products of two units.
static bool list_gaunts(int order, alb_error *error)
{
    const int n = order * order;
    double c[2 * COUNT], product[COUNT];
    gaunt_count = 0;
    for (int j = 0; j < n; j++)
        for (int k = 0; k <= j; k++) {
            memset(c, 0, sizeof c);
            c[j] = 1, c[n + k] = 1;
            if (!alb_sh_product(product, order, c, order, 2, error))
                return false;
            for (int i = 0; i < n; i++)
                for (int turn = 0; fabs(product[i]) > 1e-12 && turn < (j == k ? 1 : 2); turn++)
                    gaunts[gaunt_count++] = (gaunt){i, turn ? k : j, turn ? j : k, (float)product[i]};
        }
    return true;
}

// Of the batch against double precision.
static bool worst_error(double *worst, int operation, int order, alb_error *error)
{
    *worst = 0;
    for (int r = 0; r < ITEMS; r += operation == PRODUCT ? 25 : 1) {
        double exact[COUNT], pair[2 * COUNT], m[3][3], t[3][3];
        take(pair, first, order, r);
        take(pair + order * order, second, order, r);
        if (operation == EVALUATE) {
            alb_sh_evaluate(exact, order,
                            (alb_vector){(double)directions[r], (double)directions[STRIDE + r],
                                         (double)directions[2 * STRIDE + r]});
        } else if (operation == PRODUCT) {
            if (!alb_sh_product(exact, order, pair, order, 2, error))
                return false;
        } else if (operation == CAP) {
            alb_sh_project_cap(exact, order, direction_of(r), acos((double)cosines[r]));
        } else {
            alb_sh_axis_rotation(t, direction_of(r));
            for (int i = 0; i < 9; i++)
                m[i / 3][i % 3] = t[i % 3][i / 3];
            if (operation == ROTATE)
                matrix_of(m, r);
            alb_sh_rotate(exact, pair, order, (const double(*)[3])m);
        }
        for (int i = 0; i < order * order; i++)
            *worst = fmax(*worst, fabs((double)out[i * STRIDE + r] - exact[i]));
    }
    return true;
}

static bool measure(int operation, int order, alb_error *error)
{
    double best[2] = {INFINITY, INFINITY};
    for (int k = 0; k < RUNS; k++) {
        double before_s = alb_clock_s();
        run_batch(operation, order);
        best[0] = fmin(best[0], alb_clock_s() - before_s);
        if (k % 10)
            continue;
        before_s = alb_clock_s();
        run_plain(operation, order);
        best[1] = fmin(best[1], alb_clock_s() - before_s);
    }
    for (int way = 0; way < 2; way++)
        ns[way][operation][order - 1] = 1e9 * best[way] / ITEMS;
    return worst_error(&errors[operation][order - 1], operation, order, error);
}

static void print_time(const char *what, double before_s, int runs)
{
    printf("%-48s %10.2f us\n", what, 1e6 * (alb_clock_s() - before_s) / runs);
}

// What is done once a light, a map or a probe, in double precision.
static bool single_ones(alb_error *error)
{
    enum { RUNS_EACH = 50 };
    double c[COUNT], eight[8 * COUNT];
    const alb_vector square[4] = {{-1, -1, 2}, {1, -1, 2}, {1, 1, 2}, {-1, 1, 2}};
    const alb_vector axis = alb_unit((alb_vector){1, 2, 3});
    bool ok = true;
    for (int order = 4; order <= 8 && ok; order += 4) {
        printf("\nin double precision, order %d\n", order);
        double before_s = alb_clock_s();
        for (int k = 0; k < RUNS_EACH; k++)
            ok = ok && alb_sh_project_polygon(c, order, square, 4, error);
        print_time("square", before_s, RUNS_EACH);
        before_s = alb_clock_s();
        for (int k = 0; k < RUNS_EACH; k++)
            ok = ok && alb_sh_project_disc(c, order, square[2], axis, 0.5, error);
        print_time("disc", before_s, RUNS_EACH);
        for (int k = 0; k < 8; k++)
            alb_sh_project_cap(eight + k * order * order, order, alb_unit(square[k % 4]), 0.3 + 0.05 * k);
        before_s = alb_clock_s();
        for (int k = 0; k < RUNS_EACH; k++)
            ok = ok && alb_sh_product(c, order, eight, order, 8, error);
        print_time("exact product of eight", before_s, RUNS_EACH);
        before_s = alb_clock_s();
        for (int k = 0; k < 5; k++) {
            alb_sh_project_cap(c, order, axis, M_PI / 4);
            alb_sh_complement(c, order);
            ok = ok && alb_sh_dering(c, NULL, order, 0, error);
        }
        print_time("window against ringing", before_s, 5);
        alb_image map = {0};
        ok = ok && alb_image_create(&map, 1024, 512, "Y", error);
        before_s = alb_clock_s();
        ok = ok && alb_sh_project_map(c, order, &map, 0, error);
        print_time("map of 1024 x 512", before_s, 1);
        alb_image_free(&map);
    }
    return ok;
}

static bool draw(const char *path, alb_error *error)
{
    static double order[ORDERS];
    static char labels[OPERATIONS][32];
    alb_curve times[2 * OPERATIONS], worst[OPERATIONS];
    static const char *const colours[OPERATIONS] = {"#1b6ca8", "#c8553d", "#8e5ea2", "#3c8d40", "#b8860b"};
    for (int k = 0; k < ORDERS; k++)
        order[k] = k + 1;
    for (int o = 0; o < OPERATIONS; o++) {
        snprintf(labels[o], sizeof labels[o], "%s, plain", names[o]);
        const alb_curve curve = {names[o], colours[o], order, ns[0][o], NULL, ORDERS, ALB_MARK_LINE_AND_POINTS};
        times[2 * o] = worst[o] = curve;
        worst[o].y = errors[o];
        times[2 * o + 1] = (alb_curve){labels[o], colours[o], order, ns[1][o], NULL, ORDERS, ALB_MARK_DASHES};
    }
    const alb_panel panels[2] = {{.title = "Spherical harmonics: one thread, batches and plain",
                                  .x_label = "order",
                                  .y_label = "ns an item",
                                  .log_y = true,
                                  .curves = times,
                                  .curve_count = 2 * OPERATIONS,
                                  .height = 1.4},
                                 {.title = "Worst error of a coefficient, single precision",
                                  .x_label = "order",
                                  .y_label = "error",
                                  .log_y = true,
                                  .curves = worst,
                                  .curve_count = OPERATIONS,
                                  .height = 1}};
    return alb_plot_write(path, panels, 2, 760, 720, error);
}

int main(int count, char **arguments)
{
    alb_error error = {0};
    bool ok = true;
    printf("%-12s", "ns an item");
    for (int order = 1; order <= ORDERS; order++)
        printf("      order %d", order);
    printf("\n");
    for (int order = 1; order <= ORDERS && ok; order++) {
        fill(order);
        ok = list_gaunts(order, &error);
        for (int o = 0; o < OPERATIONS && ok; o++)
            ok = measure(o, order, &error);
    }
    static const char *const rows[3] = {"batch", "plain", "error"};
    for (int o = 0; o < OPERATIONS && ok; o++)
        for (int row = 0; row < 3; row++) {
            printf("%-11s %s", row ? "" : names[o], rows[row]);
            for (int k = 0; k < ORDERS; k++)
                printf(row == 2 ? " %11.1e" : " %11.1f", row == 2 ? errors[o][k] : ns[row][o][k]);
            printf("\n");
        }
    ok = ok && single_ones(&error) && (count < 2 || draw(arguments[1], &error));
    if (!ok)
        fprintf(stderr, "%s\n", error.text);
    return (int)error.status;
}
