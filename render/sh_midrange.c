// The mid-range map's M in closed form. With x = cos theta, q = sqrt(1 - k^2 + k^2 x^2) (Wang et al. 2006 print that M
// is rarely analytic; here it is):
//     cos tau = x q + k (1 - x^2),  sin tau = sin theta (q - k x),  eta dtheta = dx or (q - k x)^2 / q dx
// so that the integrand is A(x) + q B(x), with 1/q for energy, A and B polynomials. A, B at Gauss nodes follow from the
// integrand at q and -q. int A is Gauss's rule; int q B and int A / q are rules on the same nodes with the weights
//     w_i sum_j (2j + 1)/2 P_j(x_i) mu_j,     mu_j = int q P_j dx or nu_j = int P_j / q dx,
// exact for the polynomials' degree. The moments: nu_0 = 2 atanh(k) / k, odd ones 0, and (by parts)
//     k^2 (j+2)^2/(2j+3) nu_(j+2) + ((2j+1)(1-k^2) + k^2 ((j+1)(j+2)/(2j+3) + j(j-1)/(2j-1))) nu_j
//         + k^2 (j-1)^2/(2j-1) nu_(j-2) = 0,
// of which they are the solution that shrinks: by its ratios, from high j down; near k = 1, where both solutions shrink
// alike, upwards.
#include "base/quadrature.h"
#include "render/sh_scale.h"
#include <math.h>
#include <string.h>

enum { NODES_MAX = 48, LEGENDRE_MAX = 136 };

typedef struct rules {
    int count;
    double node[NODES_MAX], plain[NODES_MAX], times_q[NODES_MAX], over_q[NODES_MAX];
} rules;

// nu_j for even j <= last (even).
static void find_moments(double *nu, double k, int last)
{
    const double kk = k * k, rest = (1 - k) * (1 + k), shrink = -log(fabs(k) / (1 + sqrt(rest)));
    nu[0] = fabs(k) < 1e-8 ? 2 : 2 * atanh(k) / k;
    if (2 * (last + 2) * shrink < 3) {                     // the other solution gains less than e^3
        const double second = (1 - rest * nu[0] / 2) / kk; // int x^2/q dx
        nu[2] = (3 * second - nu[0]) / 2;
        for (int j = 2; j < last; j += 2)
            nu[j + 2] =
                -(((2 * j + 1) * rest + kk * ((j + 1.) * (j + 2) / (2 * j + 3) + j * (j - 1.) / (2 * j - 1))) * nu[j] +
                  kk * (j - 1) * (j - 1) / (2 * j - 1) * nu[j - 2]) *
                (2 * j + 3) / (kk * (j + 2) * (j + 2));
        return;
    }
    double ratio = 0; // nu_(j+2) / nu_j
    for (int j = last + 2 * (int)(10 + fmin(20 / shrink, 1e6)); j >= 2; j -= 2) {
        ratio = -kk * (j - 1) * (j - 1) / (2 * j - 1) /
                ((2 * j + 1) * rest + kk * ((j + 1.) * (j + 2) / (2 * j + 3) + j * (j - 1.) / (2 * j - 1)) +
                 kk * (j + 2) * (j + 2) / (2 * j + 3) * ratio);
        if (j <= last)
            nu[j] = ratio;
    }
    for (int j = 2; j <= last; j += 2)
        nu[j] *= nu[j - 2];
}

static void make_rules(rules *r, double k)
{
    double nu[NODES_MAX + 4] = {0};
    const double kk = k * k;
    find_moments(nu, k, r->count + 2);
    alb_quadrature_gauss(r->node, r->plain, r->count, -1, 1);
    for (int i = 0; i < r->count; i++) {
        double before = 0, value = 1, q_sum = 0, inverse_sum = 0; // P_(j-1), P_j
        for (int j = 0; j < r->count; j++) {
            const double above = (j + 1.) * (j + 2) / ((2. * j + 1) * (2 * j + 3)),
                         own = (j + 1.) * (j + 1) / ((2. * j + 1) * (2 * j + 3)) +
                               (double)j * j / ((2. * j + 1) * (2 * j - 1)),
                         below = j * (j - 1.) / ((2. * j + 1) * (2 * j - 1));
            if (j % 2 == 0) {
                const double mu =
                    (1 - kk) * nu[j] + kk * (above * nu[j + 2] + own * nu[j] + (j ? below * nu[j - 2] : 0));
                q_sum += (j + 0.5) * value * mu, inverse_sum += (j + 0.5) * value * nu[j];
            }
            const double next = ((2 * j + 1) * r->node[i] * value - j * before) / (j + 1);
            before = value, value = next;
        }
        r->times_q[i] = r->plain[i] * q_sum, r->over_q[i] = r->plain[i] * inverse_sum;
    }
}

// The three weights of A and of B at a node.
static void weigh(double *of_a, double *of_b, const rules *r, int i, double k, double q, alb_sh_measure measure)
{
    const double x = r->node[i];
    if (measure == ALB_SH_VISIBILITY) {
        *of_a = r->plain[i], *of_b = r->times_q[i];
        return;
    }
    *of_a = -2 * k * x * r->plain[i] + 2 * r->times_q[i] - (1 - k) * (1 + k) * r->over_q[i];
    *of_b = (q * q + k * k * x * x) * r->plain[i] - 2 * k * x * r->times_q[i];
}

bool alb_sh_scaling_midrange(alb_sh_scaling *scaling, double k, alb_sh_measure measure, int order_out, int order_in,
                             alb_error *error)
{
    alb_sh_map map;
    rules r = {.count = (2 * order_in + order_out) / 2 * 2}; // above the degree 2 l_in + l_out; even: no node at x = 0
    if (!alb_sh_scaling_begin(scaling, order_out, order_in, error) || !alb_sh_map_midrange(&map, k, error))
        return false;
    make_rules(&r, k);
    for (int i = 0; i < r.count; i++) {
        const double x = r.node[i], s = sqrt((1 - x) * (1 + x)), q = sqrt((1 - k) * (1 + k) + k * k * x * x);
        double out[LEGENDRE_MAX], plus[LEGENDRE_MAX], minus[LEGENDRE_MAX], of_a, of_b;
        alb_sh_legendre(out, order_out, x, s);
        alb_sh_legendre(plus, order_in, x * q + k * s * s, s * (q - k * x));
        alb_sh_legendre(minus, order_in, -x * q + k * s * s, s * (-q - k * x));
        weigh(&of_a, &of_b, &r, i, k, q, measure);
        const double of_plus = M_PI * (of_a + of_b / q), of_minus = M_PI * (of_a - of_b / q);
        double *value = scaling->value;
        for (int m = 0; m < order_out && m < order_in; m++)
            for (int l = m; l < order_out; l++)
                for (int j = m; j < order_in; j++) {
                    const int at = j * (j + 1) / 2 + m;
                    *value++ += out[l * (l + 1) / 2 + m] * (of_plus * plus[at] + of_minus * minus[at]);
                }
    }
    return true;
}
