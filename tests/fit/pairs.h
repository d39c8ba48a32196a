// Two exponentials whose rates come close, under noise: the grid on which intervals are tried.
#pragma once
#include "base/random.h"
#include "fit/observe.h"
#include "fit/operator.h"
#include <math.h>

enum { PAIR_READINGS = 120, PAIR_NOISES = 3, PAIR_RATIOS = 7, PAIR_AMPLITUDES = 4 };
static const double pair_noises[PAIR_NOISES] = {0.001, 0.01, 0.03};
static const double pair_ratios[PAIR_RATIOS] = {1.1, 1.25, 1.5, 2, 3, 5, 10};
static const double pair_amplitudes[PAIR_AMPLITUDES] = {0.03, 0.1, 0.3, 1};

typedef struct pair_cell {
    alb_profile truth;
    double noise;
    unsigned index;
} pair_cell;

static inline pair_cell pair_at(int noise, int ratio, int amplitude)
{
    return (pair_cell){{ALB_FORM_TWO_EXPONENTIALS, {1, 0.5, pair_amplitudes[amplitude], 0.5 * pair_ratios[ratio]}},
                       pair_noises[noise],
                       (unsigned)((noise * PAIR_RATIOS + ratio) * PAIR_AMPLITUDES + amplitude)};
}

// r from 0.05 to 12 mm, sd = noise hypot(S, S(0) / 100). Values are those of the truth.
static inline bool pair_readings(alb_readings *readings, alb_operator *forward, const alb_profile *truth, double noise,
                                 alb_error *error)
{
    if (!alb_readings_create(readings, PAIR_READINGS, error))
        return false;
    const double step = (12 - 0.05) / (PAIR_READINGS - 1);
    for (int i = 0; i < PAIR_READINGS; i++) {
        const double r = 0.05 + step * i;
        readings->r_mm[i] = r;
        readings->value[i] = alb_profile_value(truth, r);
        readings->sd[i] = noise * hypot(readings->value[i], 0.01 * alb_profile_value(truth, 0));
        readings->area_mm2[i] = 2 * M_PI * r * step;
    }
    readings->outer_mm = 12;
    return alb_operator_identity(forward, readings, error);
}

static inline void pair_noise(alb_readings *readings, const alb_profile *truth, uint64_t stream, uint64_t trial)
{
    alb_random random = alb_random_at(31, stream, trial);
    for (int i = 0; i < PAIR_READINGS; i++)
        readings->value[i] = alb_profile_value(truth, readings->r_mm[i]) + readings->sd[i] * alb_random_normal(&random);
}
