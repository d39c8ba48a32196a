// Random profiles of two exponentials, and the least chi-square there is: all pairs of a fine grid of decays, the best
// local optima of the table polished by Levenberg-Marquardt (Ceres). Nothing of the search under test enters.
#pragma once
#include "base/random.h"
#include "fit/search.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { EXHAUSTIVE_READINGS = 120, EXHAUSTIVE_GRID = 110, EXHAUSTIVE_POLISHED = 6 };

// 120 readings from 0.05 to 12 mm, without values.
static inline bool exhaustive_readings(alb_readings *readings, alb_error *error)
{
    if (!alb_readings_create(readings, EXHAUSTIVE_READINGS, error))
        return false;
    for (int i = 0; i < EXHAUSTIVE_READINGS; i++) {
        readings->r_mm[i] = 0.05 + i * (12 - 0.05) / (EXHAUSTIVE_READINGS - 1);
        readings->area_mm2[i] = 1;
    }
    readings->outer_mm = 12;
    return true;
}

// Noise 0.1 to 10 %, decays 1 : 1.1 to 1 : 10, amplitudes 1 : 0.03 to 1 : 1, negative where the form is signed.
static inline void exhaustive_profile(double *value, double *sd, alb_form form, uint64_t seed, uint64_t index)
{
    static const double noises[] = {0.001, 0.01, 0.03, 0.1}, amplitudes[] = {0.03, 0.1, 0.3, 1};
    static const double ratios[] = {1.1, 1.25, 1.5, 2, 3, 5, 10};
    alb_random random = alb_random_at(seed, (uint64_t)form, index);
    const double noise = noises[(int)(4 * alb_random_uniform(&random))];
    const double ratio = ratios[(int)(7 * alb_random_uniform(&random))];
    const double amplitude = amplitudes[(int)(4 * alb_random_uniform(&random))];
    const double a2 = form == ALB_FORM_SIGNED_EXPONENTIALS ? -0.95 * amplitude : amplitude;
    const double decay = 0.2 * pow(10, alb_random_uniform(&random));
    for (int i = 0; i < EXHAUSTIVE_READINGS; i++) {
        const double r = 0.05 + i * (12 - 0.05) / (EXHAUSTIVE_READINGS - 1);
        const double truth = exp(-decay * r) + a2 * exp(-decay * ratio * r);
        sd[i] = noise * hypot(truth, 0.01 * (1 + a2));
        value[i] = truth + sd[i] * alb_random_normal(&random);
    }
}

typedef struct exhaustive_pair {
    double gain, a1, a2, b1, b2;
} exhaustive_pair;

// The fall of chi-square by two columns of unit length with products c, h1, h2, lengths l1, l2; gain 0: wrong signs.
static inline exhaustive_pair exhaustive_solve(alb_form form, double c, double h1, double h2, double l1, double l2)
{
    const double a = h1 - c * h2, b = h2 - c * h1, rest = 1 - c * c, difference = h1 / l2 - h2 / l1;
    exhaustive_pair pair = {.a1 = a / rest / l1, .a2 = b / rest / l2};
    if (!(rest > 1e-13 && a > 0 && (form == ALB_FORM_SIGNED_EXPONENTIALS ? b < 0 : b > 0)))
        return pair;
    pair.gain = (h1 * a + h2 * b) / rest;
    if (pair.a1 + pair.a2 < 0) {
        const double square = 1 / l1 / l1 + 1 / l2 / l2 - 2 * c / l1 / l2;
        pair.a1 = difference / square / l1 / l2;
        pair.a2 = -pair.a1;
        pair.gain = difference > 0 ? difference * difference / square : 0;
    }
    return pair;
}

// Local optima of the table of all pairs, the best first; how many.
static inline int exhaustive_table(exhaustive_pair best[EXHAUSTIVE_POLISHED], alb_form form, const alb_weighing *w,
                                   const alb_basis *basis)
{
    enum { N = EXHAUSTIVE_READINGS, G = EXHAUSTIVE_GRID };
    double(*column)[N] = calloc(G, sizeof *column), x[G], h[G] = {0}, length[G] = {0};
    exhaustive_pair(*table)[G] = calloc(G, sizeof *table);
    int count = 0;
    for (int k = 0; k < G; k++) {
        x[k] = basis->lowest + (basis->highest - basis->lowest) * k / (G - 1);
        for (int i = 0; i < N; i++) {
            column[k][i] = exp(-exp(x[k]) * w->readings->r_mm[i]) / w->sd[i];
            length[k] += column[k][i] * column[k][i];
        }
        length[k] = sqrt(length[k]);
        for (int i = 0; i < N; i++) {
            column[k][i] /= length[k];
            h[k] += column[k][i] * w->readings->value[i] / w->sd[i];
        }
    }
    for (int i = 0; i < G; i++)
        for (int j = i + 1; j < G; j++) {
            double c = 0;
            for (int k = 0; k < N; k++)
                c += column[i][k] * column[j][k];
            table[i][j] = exhaustive_solve(form, c, h[i], h[j], length[i], length[j]);
            table[i][j].b1 = exp(x[i]);
            table[i][j].b2 = exp(x[j]);
        }
    for (int i = 0; i < G; i++)
        for (int j = i + 1; j < G; j++) {
            bool peak = table[i][j].gain > 0;
            for (int k = i > 0 ? i - 1 : 0; k <= i + 1; k++)
                for (int l = j - 1; l <= j + 1 && l < G; l++)
                    peak &= !(k < l && table[k][l].gain > table[i][j].gain);
            if (!peak || (count == EXHAUSTIVE_POLISHED && table[i][j].gain <= best[count - 1].gain))
                continue;
            int at = count < EXHAUSTIVE_POLISHED ? count++ : count - 1;
            for (; at > 0 && best[at - 1].gain < table[i][j].gain; at--)
                best[at] = best[at - 1];
            best[at] = table[i][j];
        }
    free(column);
    free(table);
    return count;
}

// The least chi-square reached from the table, from two close terms about the single exponential, and from `known`
// (form NONE: nothing).
static inline double exhaustive_minimum(alb_profile *at, alb_form form, const alb_profile *one,
                                        const alb_profile *known, const alb_weighing *weighing, const alb_basis *basis)
{
    exhaustive_pair best[EXHAUSTIVE_POLISHED];
    alb_profile starts[EXHAUSTIVE_POLISHED + 2];
    int count = exhaustive_table(best, form, weighing, basis);
    double least = (double)INFINITY;
    for (int k = 0; k < count; k++)
        starts[k] = (alb_profile){form, {best[k].a1, best[k].b1, best[k].a2, best[k].b2}};
    const double a = one->parameters[0], b = one->parameters[1];
    starts[count++] = form == ALB_FORM_SIGNED_EXPONENTIALS ? (alb_profile){form, {2 * a, 1.05 * b, -a, 1.3 * b}}
                                                           : (alb_profile){form, {a / 2, 0.9 * b, a / 2, 1.1 * b}};
    if (known->form != ALB_FORM_NONE)
        starts[count++] = *known;
    for (int k = 0; k < count; k++) {
        alb_error error = {0};
        double reached;
        if (alb_search_polish(&starts[k], &reached, (alb_candidate){form, false}, weighing, &error) &&
            reached < least) {
            least = reached;
            *at = starts[k];
        }
    }
    return least;
}
