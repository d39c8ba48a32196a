// Readings of a profile on one side, evenly spaced rings, with relative noise, a floor of it and a constant.
#pragma once
#include "base/random.h"
#include "check.h"
#include "fit/energy.h"

typedef struct one_side {
    int readings;
    double range_mm;
    double noise, floor; // sd = noise hypot(value, floor S(0))
    double offset;
} one_side;

static inline void one_side_start(alb_fitting *fitting, bool absolute)
{
    *fitting = (alb_fitting){.material.channels = 1, .absolute = absolute};
    snprintf(fitting->material.channel_names[0], sizeof fitting->material.channel_names[0], "Y");
}

static inline void one_side_read(alb_fitting *fitting, alb_side side, const alb_profile *truth, one_side rig,
                                 alb_random *random)
{
    alb_error error = {0};
    alb_measurement *measurement = &fitting->sides[side][0];
    alb_readings *readings = &measurement->readings;
    check_ok(alb_readings_create(readings, rig.readings, &error), &error);
    const double step = rig.range_mm / rig.readings;
    for (int i = 0; i < rig.readings; i++) {
        const double r = step * (i + 0.5), value = alb_profile_value(truth, r);
        readings->r_mm[i] = r;
        readings->sd[i] = rig.noise * hypot(value, rig.floor * alb_profile_value(truth, 0));
        readings->value[i] = value + rig.offset + readings->sd[i] * alb_random_normal(random);
        readings->area_mm2[i] = 2 * M_PI * r * step;
    }
    readings->outer_mm = rig.range_mm;
    check_ok(alb_operator_identity(&measurement->forward, readings, &error), &error);
}
