// Products of two, cut to their order, out_i = sum over j, k of G_ijk a_j b_k, G_ijk the integral of Y_i Y_j Y_k
// (Gaunt's coefficients, real). All that is not zero is found from the azimuths: with harmonics taken in pairs cos m
// phi, sin m phi, those of m1 >= m2 > 0 make
//     cos (m1 + m2): cc - ss    sin (m1 + m2): sc + cs    cos (m1 - m2): cc + ss    sin (m1 - m2): sc - cs
// where cc = a_c1 b_c2 + a_c2 b_c1 and so on, of both factors alike; each of the four goes to all l with one G for the
// sine and the cosine. m2 = 0 leaves c and s, m1 = m2 = 0 one product.
#include "base/quadrature.h"
#include "render/sh_lanes.h"
#include "render/sh_product.h"
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>

// out[plus] += gaunt * cosine part, out[minus] += gaunt * sine part; of m = 0 only the first.
typedef struct entry {
    float gaunt;
    uint8_t plus, minus;
} entry;

// Harmonics (l1, m1), (l2, m2), m1 >= m2 >= 0: their indices with +m and -m, and how many entries follow for the sum of
// the m, for the difference, and for the difference where it is zero.
typedef struct pair {
    uint8_t plus[2], minus[2], sums, differences, zeros;
} pair;

enum { HARMONICS = ALB_SH_ORDER_MAX * (ALB_SH_ORDER_MAX + 1) / 2, PAIRS = HARMONICS * (HARMONICS + 1) / 2 };
typedef struct table {
    int ends[3]; // of the pairs with m2 > 0, m1 > m2 = 0, m1 = m2 = 0
    pair pairs[PAIRS];
    entry entries[6 * PAIRS];
} table;
static table tables[ALB_SH_ORDER_MAX + 1];
static pthread_once_t once = PTHREAD_ONCE_INIT;

enum { RINGS = 3 * ALB_SH_ORDER_MAX / 2, STEPS = 2 * RINGS, NODES = RINGS * STEPS };
typedef struct grid {
    double weight[NODES], basis[ALB_SH_COUNT_MAX][NODES];
} grid;

// Exact for products of three: degree 3 (ALB_SH_ORDER_MAX - 1).
static void make_grid(grid *g)
{
    double nodes[RINGS], weights[RINGS], basis[ALB_SH_COUNT_MAX];
    alb_quadrature_gauss(nodes, weights, RINGS, -1, 1);
    for (int n = 0; n < NODES; n++) {
        const double z = nodes[n / STEPS], s = sqrt(1 - z * z), phi = 2 * M_PI * (n % STEPS) / STEPS;
        alb_sh_evaluate(basis, ALB_SH_ORDER_MAX, (alb_vector){s * cos(phi), s * sin(phi), z});
        g->weight[n] = weights[n / STEPS] * 2 * M_PI / STEPS;
        for (int i = 0; i < ALB_SH_COUNT_MAX; i++)
            g->basis[i][n] = basis[i];
    }
}

static double integral(const grid *g, int i, int j, int k)
{
    double sum = 0;
    for (int n = 0; n < NODES; n++)
        sum += g->weight[n] * g->basis[i][n] * g->basis[j][n] * g->basis[k][n];
    return sum;
}

// Entries of one pair to the bands of m: those of even l1 + l2 + l between |l1 - l2| and l1 + l2.
static uint8_t add_entries(table *t, int *count, const grid *g, int order, const int l[2], const pair *p, int m)
{
    const int before = *count;
    int from = abs(l[0] - l[1]);
    from = from >= m ? from : from + (m - from + 1) / 2 * 2;
    for (int k = from; k <= l[0] + l[1] && k < order; k += 2) {
        t->entries[(*count)++] = (entry){.gaunt = (float)integral(g, p->plus[0], p->plus[1], alb_sh_index(k, m)),
                                         .plus = (uint8_t)alb_sh_index(k, m),
                                         .minus = (uint8_t)alb_sh_index(k, -m)};
    }
    return (uint8_t)(*count - before);
}

// Of the kind: 0 where m2 > 0, 1 where m1 > m2 = 0, 2 where both are zero.
static void add_pairs(table *t, int *pairs, int *entries, const grid *g, int order, int kind)
{
    for (int first = 0; first < order * order; first++)
        for (int second = 0; second <= first; second++) {
            int l[2] = {(int)sqrt(first), (int)sqrt(second)},
                m[2] = {first - l[0] * (l[0] + 1), second - l[1] * (l[1] + 1)};
            if (!second || m[0] < 0 || m[1] < 0 || kind != (m[0] == 0) + (m[1] == 0))
                continue;
            const int big = m[1] > m[0], small = !big;
            pair *p = &t->pairs[(*pairs)++];
            for (int k = 0; k < 2; k++) {
                const int of = k ? small : big;
                p->plus[k] = (uint8_t)alb_sh_index(l[of], m[of]), p->minus[k] = (uint8_t)alb_sh_index(l[of], -m[of]);
            }
            if (kind < 2)
                p->sums = add_entries(t, entries, g, order, l, p, m[0] + m[1]);
            if (kind == 0 && m[0] != m[1])
                p->differences = add_entries(t, entries, g, order, l, p, abs(m[0] - m[1]));
            if (kind == 2 || (kind == 0 && m[0] == m[1]))
                p->zeros = add_entries(t, entries, g, order, l, p, 0);
        }
}

static void make_tables(void)
{
    static grid g;
    make_grid(&g);
    for (int order = 1; order <= ALB_SH_ORDER_MAX; order++) {
        int pairs = 0, entries = 0;
        for (int kind = 0; kind < 3; kind++) {
            add_pairs(&tables[order], &pairs, &entries, &g, order, kind);
            tables[order].ends[kind] = pairs;
        }
    }
}

// x_i y_j + x_j y_i, of one harmonic x_i y_i
ALB_LANES_INLINE void cross(alb_lanes out, alb_lanes *x, alb_lanes *y, int i, int j)
{
    if (i == j)
        ALB_EACH_LANE out[lane] = x[i][lane] * y[i][lane];
    else
        ALB_EACH_LANE out[lane] = x[i][lane] * y[j][lane] + x[j][lane] * y[i][lane];
}

ALB_LANES_INLINE void add_both(alb_lanes *out, const entry **e, int count, const alb_lanes cosine, const alb_lanes sine)
{
    for (const entry *end = *e + count; *e < end; ++*e) {
        const float gaunt = (*e)->gaunt;
        float *plus = out[(*e)->plus], *minus = out[(*e)->minus];
        ALB_EACH_LANE plus[lane] += gaunt * cosine[lane];
        ALB_EACH_LANE minus[lane] += gaunt * sine[lane];
    }
}

ALB_LANES_INLINE void add_one(alb_lanes *out, const entry **e, int count, const alb_lanes value)
{
    for (const entry *end = *e + count; *e < end; ++*e) {
        const float gaunt = (*e)->gaunt;
        float *plus = out[(*e)->plus];
        ALB_EACH_LANE plus[lane] += gaunt * value[lane];
    }
}

// All that has Y_00 in it: (a_0 b + b_0 a) / sqrt(4 pi), a_0 b_0 once.
ALB_LANES_INLINE void begin_block(alb_lanes *out, alb_lanes *a, alb_lanes *b, int values)
{
    const float gaunt = 0.28209479F;
    alb_lanes x, y;
    ALB_EACH_LANE x[lane] = gaunt * a[0][lane];
    ALB_EACH_LANE y[lane] = gaunt * b[0][lane];
    ALB_EACH_LANE out[0][lane] = gaunt * (a[0][lane] * b[0][lane]);
    for (int i = 1; i < values; i++)
        ALB_EACH_LANE out[i][lane] = x[lane] * b[i][lane] + y[lane] * a[i][lane];
}

ALB_LANES_INLINE void multiply_block(alb_lanes *out, alb_lanes *a, alb_lanes *b, const table *t)
{
    const entry *e = t->entries;
    const pair *p = t->pairs;
    alb_lanes cc, ss, cs, sc, cosine, sine;
    for (; p < t->pairs + t->ends[0]; p++) {
        cross(cc, a, b, p->plus[0], p->plus[1]);
        cross(ss, a, b, p->minus[0], p->minus[1]);
        const bool same = p->plus[0] == p->plus[1];
        if (p->sums || p->differences) {
            cross(cs, a, b, p->plus[0], p->minus[1]);
            if (!same)
                cross(sc, a, b, p->minus[0], p->plus[1]);
        }
        if (p->sums) {
            ALB_EACH_LANE cosine[lane] = cc[lane] - ss[lane];
            if (!same)
                ALB_EACH_LANE sine[lane] = sc[lane] + cs[lane];
            add_both(out, &e, p->sums, cosine, same ? cs : sine);
        }
        ALB_EACH_LANE cosine[lane] = cc[lane] + ss[lane];
        if (p->differences) {
            ALB_EACH_LANE sine[lane] = sc[lane] - cs[lane];
            add_both(out, &e, p->differences, cosine, sine);
        }
        add_one(out, &e, p->zeros, cosine);
    }
    for (; p < t->pairs + t->ends[1]; p++) {
        cross(cc, a, b, p->plus[0], p->plus[1]);
        cross(sc, a, b, p->minus[0], p->plus[1]);
        add_both(out, &e, p->sums, cc, sc);
    }
    for (; p < t->pairs + t->ends[2]; p++) {
        cross(cc, a, b, p->plus[0], p->plus[1]);
        add_one(out, &e, p->zeros, cc);
    }
}

ALB_LANES_CLONES
static void multiply(float *out, const float *a, const float *b, int order, size_t stride, size_t count)
{
    const int values = order * order;
    for (size_t r = 0; r < count; r += ALB_LANES) {
        alb_lanes x[ALB_SH_COUNT_MAX], y[ALB_SH_COUNT_MAX], z[ALB_SH_COUNT_MAX];
        alb_lanes_load(x, a + r, stride, count - r, values);
        alb_lanes_load(y, b + r, stride, count - r, values);
        begin_block(z, x, y, values);
        multiply_block(z, x, y, &tables[order]);
        alb_lanes_store(out + r, z, stride, count - r, values);
    }
}

void alb_sh_product_batch(float *out, const float *a, const float *b, int order, size_t stride, size_t count)
{
    pthread_once(&once, make_tables);
    multiply(out, a, b, order, stride, count);
}

ALB_LANES_CLONES
void alb_sh_dot_batch(float *out, const float *a, const float *b, int order, size_t stride, size_t count)
{
    for (size_t r = 0; r < count; r += ALB_LANES) {
        alb_lanes x[ALB_SH_COUNT_MAX], y[ALB_SH_COUNT_MAX], sum[1] = {{0}};
        alb_lanes_load(x, a + r, stride, count - r, order * order);
        alb_lanes_load(y, b + r, stride, count - r, order * order);
        for (int i = 0; i < order * order; i++)
            ALB_EACH_LANE sum[0][lane] += x[i][lane] * y[i][lane];
        alb_lanes_store(out + r, sum, stride, count - r, 1);
    }
}
