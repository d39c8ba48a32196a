// The basis by recurrence. With P^_lm = K_l^m P_l^m and s = sin theta,
//     P^_00 = 1 / sqrt(4 pi)     P^_mm = sqrt((2m + 1) / 2m) s P^_m-1,m-1
//     P^_lm = a_lm (cos theta P^_l-1,m - P^_l-2,m / a_l-1,m)     a_lm = sqrt((4 l^2 - 1) / (l^2 - m^2))
// (Holmes & Featherstone 2002, eqs. 11-13). Left without s^m, which goes to (x + iy)^m = s^m (cos m phi + i sin m phi),
// Y is a polynomial in x, y, z: no angles, no poles. Without s^m the values near the poles grow like l^m: beyond order
// 256 they leave the range of double.
#include "render/sh.h"
#include "render/sh_lanes.h"
#include <pthread.h>

// a_lm and a_lm / a_l-1,m; zero where the recurrence begins. Those of the bands most in use are kept.
typedef struct step {
    double a, b;
} step;
enum { KEPT = 32, LONGEST = 256 }; // orders
static step kept[KEPT][KEPT];
static pthread_once_t once = PTHREAD_ONCE_INIT;

static double root(int l, int m) { return sqrt((4.0 * l * l - 1) / ((double)(l - m) * (l + m))); }

static step make_step(int l, int m)
{
    return (step){l > m ? root(l, m) : 0, l > m + 1 ? root(l, m) / root(l - 1, m) : 0};
}

static void make_kept(void)
{
    for (int l = 0; l < KEPT; l++)
        for (int m = 0; m <= l; m++)
            kept[l][m] = make_step(l, m);
}

static step step_to(int l, int m) { return l < KEPT ? kept[l][m] : make_step(l, m); }

// From P^_l-1,m and P^_l-2,m.
static double next(int l, int m, double cosine, double last, double before)
{
    const step s = step_to(l, m);
    return s.a * cosine * last - s.b * before;
}

void alb_sh_legendre(double *values, int order, double cosine, double sine)
{
    pthread_once(&once, make_kept);
    double first = 1 / sqrt(4 * M_PI);
    for (int m = 0; m < order; m++) {
        if (m)
            first *= sqrt((2 * m + 1) / (2.0 * m)) * sine;
        double last = first, before = 0;
        for (int l = m; l < order; l++) {
            const double value = l > m ? next(l, m, cosine, last, before) : first;
            before = l > m ? last : 0, last = value;
            values[l * (l + 1) / 2 + m] = value;
        }
    }
}

// What both Y and its derivative are made of: (x + iy)^m = re + i im, and the values of one m without s^m.
typedef struct column {
    double re, im, first;
} column;

static void begin_column(column *c, int m, alb_vector d)
{
    if (!m) {
        *c = (column){1, 0, 1 / sqrt(4 * M_PI)};
        return;
    }
    const double re = c->re * d.x - c->im * d.y;
    c->im = c->re * d.y + c->im * d.x, c->re = re;
    c->first *= sqrt((2 * m + 1) / (2.0 * m)) * (m == 1 ? M_SQRT2 : 1);
}

// The next column's values for l = m .. order - 1, without the azimuth.
static void next_column(double *values, column *c, int m, int order, alb_vector d)
{
    begin_column(c, m, d);
    double last = 0, before = 0;
    for (int l = m; l < order; l++) {
        const double value = l > m ? next(l, m, d.z, last, before) : c->first;
        before = last, last = value;
        values[l - m] = value;
    }
}

void alb_sh_evaluate(double *values, int order, alb_vector d)
{
    pthread_once(&once, make_kept);
    column c;
    double of_m[LONGEST];
    for (int m = 0; m < order; m++) {
        next_column(of_m, &c, m, order, d);
        for (int l = m; l < order; l++) {
            values[alb_sh_index(l, m)] = of_m[l - m] * c.re;
            if (m)
                values[alb_sh_index(l, -m)] = of_m[l - m] * c.im;
        }
    }
}

// The derivative of (x + iy)^m along t is m (x + iy)^(m-1) (t_x + i t_y); that of the rest its derivative in z times
// t_z. Both of an extension of Y off the sphere, which a tangent does not leave.
void alb_sh_differentiate(double *values, int order, alb_vector d, alb_vector t)
{
    pthread_once(&once, make_kept);
    column c = {0};
    for (int m = 0; m < order; m++) {
        const double re = m * (c.re * t.x - c.im * t.y), im = m * (c.re * t.y + c.im * t.x);
        begin_column(&c, m, d);
        double last = 0, before = 0, slope = 0, slope_before = 0;
        for (int l = m; l < order; l++) {
            const double value = l > m ? next(l, m, d.z, last, before) : c.first;
            const double rise = l > m ? next(l, m, d.z, slope, slope_before) + step_to(l, m).a * last : 0;
            before = last, last = value;
            slope_before = slope, slope = rise;
            values[alb_sh_index(l, m)] = rise * t.z * c.re + value * re;
            if (m)
                values[alb_sh_index(l, -m)] = rise * t.z * c.im + value * im;
        }
    }
}

double alb_sh_value(const double *coefficients, int order, alb_vector direction)
{
    pthread_once(&once, make_kept);
    double sum = 0, of_m[LONGEST];
    column c;
    for (int m = 0; m < order; m++) {
        next_column(of_m, &c, m, order, direction);
        for (int l = m; l < order; l++)
            sum += of_m[l - m] * (coefficients[alb_sh_index(l, m)] * c.re + coefficients[alb_sh_index(l, -m)] * c.im);
    }
    return sum;
}

// Of the recurrence in single precision, l (l + 1) / 2 + m: a_lm, its quotient by a_l-1,m, and the first of each m.
typedef struct steps {
    float a[ALB_SH_COUNT_MAX], b[ALB_SH_COUNT_MAX], first[ALB_SH_ORDER_MAX];
} steps;

static void make_steps(steps *s, int order)
{
    pthread_once(&once, make_kept);
    column c;
    for (int m = 0; m < order && m < ALB_SH_ORDER_MAX; m++) {
        begin_column(&c, m, (alb_vector){0});
        s->first[m] = (float)c.first;
        for (int l = m + 1; l < order && l < ALB_SH_ORDER_MAX; l++) {
            s->a[l * (l + 1) / 2 + m] = (float)step_to(l, m).a;
            s->b[l * (l + 1) / 2 + m] = (float)step_to(l, m).b;
        }
    }
}

ALB_LANES_INLINE void evaluate_block(alb_lanes *out, int order, alb_lanes d[3], const steps *s)
{
    alb_lanes re = {0}, im = {0}, old, last, before;
    for (int m = 0; m < order; m++) {
        memcpy(old, re, sizeof re);
        ALB_EACH_LANE re[lane] = m ? re[lane] * d[0][lane] - im[lane] * d[1][lane] : 1;
        ALB_EACH_LANE im[lane] = m ? old[lane] * d[1][lane] + im[lane] * d[0][lane] : 0;
        ALB_EACH_LANE last[lane] = s->first[m];
        memset(before, 0, sizeof before);
        for (int l = m; l < order; l++) {
            if (l > m) {
                const float a = s->a[l * (l + 1) / 2 + m], b = s->b[l * (l + 1) / 2 + m];
                ALB_EACH_LANE
                {
                    const float value = a * d[2][lane] * last[lane] - b * before[lane];
                    before[lane] = last[lane], last[lane] = value;
                }
            }
            float *plus = out[alb_sh_index(l, m)], *minus = out[alb_sh_index(l, -m)];
            ALB_EACH_LANE minus[lane] = last[lane] * im[lane];
            ALB_EACH_LANE plus[lane] = last[lane] * re[lane];
        }
    }
}

ALB_LANES_CLONES
void alb_sh_evaluate_batch(float *values, int order, const float *directions, size_t stride, size_t count)
{
    steps s;
    make_steps(&s, order);
    for (size_t r = 0; r < count; r += ALB_LANES) {
        alb_lanes d[3], out[ALB_SH_COUNT_MAX];
        alb_lanes_load(d, directions + r, stride, count - r, 3);
        evaluate_block(out, order, d, &s);
        alb_lanes_store(values + r, out, stride, count - r, order * order);
    }
}

void alb_sh_condon_shortley(double *coefficients, int order)
{
    for (int l = 0; l < order; l++)
        for (int m = -l; m <= l; m++)
            if (m & 1)
                coefficients[alb_sh_index(l, m)] *= -1;
}

void alb_sh_complement(double *coefficients, int order)
{
    for (int i = 0; i < order * order; i++)
        coefficients[i] = (i ? 0 : sqrt(4 * M_PI)) - coefficients[i];
}
