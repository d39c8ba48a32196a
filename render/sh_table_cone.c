// Tables of the cone map in microseconds: both measures of many k from one set of points. Along the angle s half way
// (sh_map.c) the integrand is f(s + pi) = (-1)^(l+l'+1) f(s), analytic: over half a turn the points s_j = (j + 1/2)
// pi/n integrate it exactly but for its frequencies above n,
//     l + l' odd: weights pi/n      l + l' even: weights 4/n sum_(odd p < n) sin(p s_j)/p   (Fejer's)
// Its singularities lie at Im s = atanh(r), r the ratio of the axes of the ellipse that the map makes of a circle, so
// that n is some 15 / atanh(r). Where it stops being true: at k below 1/16 or above 16, n grows like sqrt(k).
#include "base/memory.h"
#include "base/vector_clones.h"
#include "render/sh_table.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LANES = 8, NODES_MAX = 384, LEGENDRES = ALB_SH_ORDER_MAX * (ALB_SH_ORDER_MAX + 1) / 2, VALUES_MAX = 204 };
typedef double lanes[LANES];
#define INLINE static inline __attribute__((always_inline))

typedef struct rule {
    int count;
    double cosine[NODES_MAX], sine[NODES_MAX], odd, even[NODES_MAX];
} rule;

static void make_rule(rule *r, int count)
{
    double now[NODES_MAX], before[NODES_MAX], turn[NODES_MAX]; // sin(p s), sin((p - 2) s), 2 cos(2 s)
    *r = (rule){.count = count, .odd = M_PI / count};
    for (int j = 0; j < count; j++) {
        const double s = (j + 0.5) * M_PI / count;
        now[j] = sin(s), before[j] = -now[j], turn[j] = 2 - 4 * now[j] * now[j];
        r->cosine[j] = cos(s), r->sine[j] = now[j];
    }
    for (int p = 1; p < count; p += 2) {
        const double factor = 4.0 / (count * p);
        for (int j = 0; j < count; j++) {
            const double next = turn[j] * now[j] - before[j];
            r->even[j] += factor * now[j];
            before[j] = now[j], now[j] = next;
        }
    }
}

// One side of the map for all lanes: the angle is atan2(scale sin s, cos s + shear sin s).
typedef struct side {
    lanes scale, shear, cosine, sine, slope;
    lanes legendre[LEGENDRES];
} side;

// Constants of the recurrence in l for the normalised functions: P_m^m = diagonal s P_(m-1)^(m-1),
// P_l = a (cos P_(l-1) - b P_(l-2)).
typedef struct recurrence {
    double diagonal[ALB_SH_ORDER_MAX], a[LEGENDRES], b[LEGENDRES];
} recurrence;

static void make_recurrence(recurrence *r, int order)
{
    for (int m = 0; m < order; m++) {
        r->diagonal[m] = (m ? sqrt((2 * m + 1) / (2. * m)) : sqrt(1 / (4 * M_PI)));
        for (int l = m + 1; l < order; l++) {
            const double ll = l * l, mm = m * m, below = (l - 1) * (l - 1);
            r->a[l * (l + 1) / 2 + m] = sqrt((4 * ll - 1) / (ll - mm));
            r->b[l * (l + 1) / 2 + m] = sqrt((below - mm) / (4 * below - 1));
        }
    }
}

INLINE void turn_to(side *angle, const recurrence *r, int order, double cosine, double sine)
{
#pragma omp simd
    for (int i = 0; i < LANES; i++) {
        const double x = cosine + angle->shear[i] * sine, y = angle->scale[i] * sine, inverse = 1 / sqrt(x * x + y * y);
        angle->cosine[i] = x * inverse, angle->sine[i] = y * inverse,
        angle->slope[i] = angle->scale[i] * inverse * inverse;
    }
#pragma GCC unroll 8
    for (int m = 0; m < order; m++) {
        double *diagonal = angle->legendre[m * (m + 1) / 2 + m];
#pragma omp simd
        for (int i = 0; i < LANES; i++)
            diagonal[i] = r->diagonal[m] * (m ? angle->legendre[(m - 1) * m / 2 + m - 1][i] * angle->sine[i] : 1);
#pragma GCC unroll 8
        for (int l = m + 1; l < order; l++) {
            const double *last = angle->legendre[(l - 1) * l / 2 + m],
                         *before = angle->legendre[l > m + 1 ? (l - 2) * (l - 1) / 2 + m : 0];
            const double a = r->a[l * (l + 1) / 2 + m], b = l > m + 1 ? r->b[l * (l + 1) / 2 + m] : 0;
#pragma omp simd
            for (int i = 0; i < LANES; i++)
                angle->legendre[l * (l + 1) / 2 + m][i] = a * (angle->cosine[i] * last[i] - b * before[i]);
        }
    }
}

INLINE void add_products(lanes *sum, const side *out, const side *in, const lanes of_odd, const lanes of_even,
                         int order)
{
#pragma GCC unroll 8
    for (int m = 0; m < order; m++)
#pragma GCC unroll 8
        for (int l = m; l < order; l++) {
            lanes weighted[2];
#pragma omp simd
            for (int i = 0; i < LANES; i++) {
                weighted[0][i] = of_even[i] * out->legendre[l * (l + 1) / 2 + m][i];
                weighted[1][i] = of_odd[i] * out->legendre[l * (l + 1) / 2 + m][i];
            }
#pragma GCC unroll 8
            for (int j = m; j < order; j++, sum++) {
                const double *factor = weighted[(l + j) % 2], *legendre = in->legendre[j * (j + 1) / 2 + m];
#pragma omp simd
                for (int i = 0; i < LANES; i++)
                    (*sum)[i] += factor[i] * legendre[i];
            }
        }
}

typedef struct block {
    side out, in;
    lanes visibility[VALUES_MAX], energy[VALUES_MAX];
} block;

INLINE void integrate(block *b, const rule *r, const recurrence *steps, int order)
{
    memset(b->visibility, 0, sizeof b->visibility);
    memset(b->energy, 0, sizeof b->energy);
    for (int j = 0; j < r->count; j++) {
        lanes odd[2], even[2];
        turn_to(&b->out, steps, order, r->cosine[j], r->sine[j]);
        turn_to(&b->in, steps, order, r->cosine[j], r->sine[j]);
#pragma omp simd
        for (int i = 0; i < LANES; i++) {
            const double visibility = 2 * M_PI * b->out.sine[i] * b->out.slope[i],
                         energy = 2 * M_PI * b->in.sine[i] * b->in.slope[i];
            odd[0][i] = visibility * r->odd, even[0][i] = visibility * r->even[j];
            odd[1][i] = energy * r->odd, even[1][i] = energy * r->even[j];
        }
        add_products(b->visibility, &b->out, &b->in, odd[0], even[0], order);
        add_products(b->energy, &b->out, &b->in, odd[1], even[1], order);
    }
}

// Order 4 apart, so that its loops have fixed bounds.
ALB_VECTOR_CLONES static void integrate_four(block *b, const rule *r, const recurrence *steps)
{
    integrate(b, r, steps, 4);
}

ALB_VECTOR_CLONES static void integrate_any(block *b, const rule *r, const recurrence *steps, int order)
{
    integrate(b, r, steps, order);
}

// Both sides of the map at k in a lane; the number of points it needs.
static int prepare(block *b, int lane, double k, double cot_alpha, int order)
{
    const double shear = (1 - k) * cot_alpha / (1 + k), stretch = sqrt(k) * hypot(1, shear);
    const double scale = 1 / stretch, turned = -shear / stretch, norm = 1 + scale * scale + turned * turned;
    const double long_axis = (norm + sqrt(fmax(0, norm * norm - 4 * scale * scale))) / 2; // squared
    b->out.scale[lane] = scale, b->out.shear[lane] = turned;
    b->in.scale[lane] = (k / stretch), b->in.shear[lane] = (k * shear / stretch);
    const int count = (int)((14 + 0.5 * order) / atanh(fmin(scale / long_axis, 0.99)) + 1.5 * order) / 2 * 2 + 2;
    return count < NODES_MAX ? count : NODES_MAX;
}

static bool check(const double *k, int count, double alpha_deg, int order, alb_error *error)
{
    if (!(alpha_deg >= 10 && alpha_deg <= 80) || order < 1 || order > ALB_SH_ORDER_MAX)
        return alb_fail(error, ALB_USAGE, "cone table: alpha %g, order %d; expected 10 to 80, 1 to %d", alpha_deg,
                        order, ALB_SH_ORDER_MAX);
    for (int i = 0; i < count; i++)
        if (!(k[i] >= 1 / 16. && k[i] <= 16))
            return alb_fail(error, ALB_USAGE, "cone table: k[%d] = %g; expected 1/16 to 16", i, k[i]);
    return true;
}

bool alb_sh_table_cone(float *visibility, float *energy, const double *k, int count, double alpha_deg, int order,
                       alb_error *error)
{
    if (!check(k, count, alpha_deg, order, error))
        return false;
    const double cot_alpha = 1 / tan(alpha_deg * M_PI / 180);
    const int values = alb_sh_scaling_count(order, order);
    recurrence steps;
    rule r = {0};
    block *b = alb_allocate(1, sizeof *b, error);
    if (!b)
        return false;
    make_recurrence(&steps, order);
    for (int first = 0; first < count; first += LANES) {
        int nodes = 0;
        for (int i = 0; i < LANES; i++) {
            const int own = prepare(b, i, k[first + i < count ? first + i : count - 1], cot_alpha, order);
            nodes = own > nodes ? own : nodes;
        }
        if (nodes != r.count)
            make_rule(&r, nodes);
        if (order == 4)
            integrate_four(b, &r, &steps);
        else
            integrate_any(b, &r, &steps, order);
        for (int i = 0; i < LANES && first + i < count; i++)
            for (int v = 0; v < values; v++) {
                visibility[(size_t)(first + i) * (size_t)values + (size_t)v] = (float)b->visibility[v][i];
                energy[(size_t)(first + i) * (size_t)values + (size_t)v] = (float)b->energy[v][i];
            }
    }
    free(b);
    return true;
}
