// Light that has not scattered, (1 - r)^2 e^(-(sigma_a + sigma_s) d) of what falls in, leaves where it fell in: on top
// of the profile the readings hold u e_i, e the irradiance of the spot (integral 1), and no form of the table goes that
// high in so little room. The readings that the spot reaches are left out; what is fitted to the others goes on
// underneath, and u follows from what lies above it inside by weighted least squares. e_i is what the operator says of
// the spot: the share of its light within a small distance q of the ring, over pi q^2.
//
// It is looked for where no form stands, its parameters are not decided, or a term is narrower than the spot. It is
// taken where the misfit falls to half at least, or, where it was below 3 % (a fast term holds the spike), does not
// grow by half; what lies above has the shape of the spot (P >= 1e-3, with
// a tenth of what the form holds there and 5 % of u e_i allowed for), and u is 3 sd: of the noise where all forms
// missed by more than 3 %, else also of that tenth (by which forms miss there: 2 to 12 % on slabs by Monte Carlo). The
// tenth is in the sd of u and of the total. Stops being true where light that has scattered little is as narrow as the
// spot (g near 1 and sigma_s' d < 1): that counts as straight.
#include "fit/ballistic.h"
#include "base/memory.h"
#include "base/statistics.h"
#include "fit/profile.h"
#include <math.h>
#include <stdlib.h>

static const double core_relative_sd = 0.1, spot_relative_sd = 0.05, reject_tail = 1e-3;
static const double misfit_of_a_spike = 0.03; // it leaves 5 % and more
static const double narrow = 1.5;             // decays times the reach of the spot

// Irradiance of the spot at the readings, 1/mm^2, and how many of the first readings it reaches with a hundredth of the
// most; *most 0: the readings are values of S, and none is at 0.
static int spot_at(double *irradiance, double *most, const alb_readings *readings, const alb_operator *forward)
{
    const double near = 0.25 * (readings->r_mm[1] - readings->r_mm[0]);
    int lit = 0;
    *most = 0;
    for (int i = 0; i < readings->count; i++) {
        irradiance[i] = 0;
        for (int k = forward->first[i]; k <= forward->last[i] && forward->grid_mm[k] < near; k++)
            irradiance[i] +=
                forward->weight[forward->offset[i] + (size_t)(k - forward->first[i])] / (M_PI * near * near);
        *most = fmax(*most, irradiance[i]);
    }
    for (int i = 0; i < readings->count; i++)
        lit = irradiance[i] > 0.01 * *most ? i + 1 : lit;
    return lit;
}

// The readings from `first` on, borrowed.
static void look_beyond(alb_readings *beyond, alb_operator *operator_beyond, const alb_readings *readings,
                        const alb_operator *forward, int first)
{
    *beyond = *readings;
    beyond->count -= first;
    beyond->r_mm += first;
    beyond->value += first;
    beyond->sd += first;
    beyond->area_mm2 += first;
    beyond->sample_r_mm += first;
    beyond->sample_share += first;
    beyond->sample_value += first;
    beyond->core_mm = (readings->r_mm[first - 1] + readings->r_mm[first]) / 2;
    *operator_beyond = *forward;
    operator_beyond->row_count -= first;
    operator_beyond->first += first;
    operator_beyond->last += first;
    operator_beyond->offset += first;
}

typedef struct straight {
    double share, sd, unmeasured; // u; by the noise; by what the fit is where it is not measured
    bool like_spot;
} straight;

static bool find_straight(straight *out, const alb_outcome *outcome, const alb_readings *readings,
                          const alb_operator *forward, const double *irradiance, double most, int lit, alb_error *error)
{
    double *model = alb_operator_readings(forward, &outcome->fitted.profile, error);
    if (!model)
        return false;
    double ee = 0, ev = 0, chi_square = 0, inside = 0;
    int within = 0;
    for (int i = 0; i < lit; i++) {
        const double e = irradiance[i], w = 1 / (readings->sd[i] * readings->sd[i]);
        inside += readings->area_mm2[i] * model[i];
        if (e < 0.5 * most) // the rim
            continue;
        ee += w * e * e;
        ev += w * e * (readings->value[i] - model[i]);
        within++;
    }
    *out = (straight){ev / ee, 1 / sqrt(ee), core_relative_sd * inside, true};
    for (int i = 0; i < lit; i++) {
        const double light = out->share * irradiance[i], miss = readings->value[i] - model[i] - light;
        const double sd = hypot(readings->sd[i], hypot(core_relative_sd * model[i], spot_relative_sd * light));
        chi_square += irradiance[i] < 0.5 * most ? 0 : miss * miss / (sd * sd);
    }
    free(model);
    out->like_spot = within < 2 || alb_chi_square_tail(chi_square, within - 1) >= reject_tail;
    return true;
}

static bool worth_looking(const alb_outcome *outcome, double reach_mm)
{
    return outcome->discrepancy_relative > 0 || !outcome->fitted.identifiable ||
           alb_profile_fastest(&outcome->fitted.profile) * reach_mm > narrow;
}

static void take(alb_outcome *outcome, const alb_outcome *beyond, const straight *light, double to_mm,
                 alb_common_sd common)
{
    const alb_outcome before = *outcome;
    *outcome = *beyond;
    outcome->offset = before.offset; // the readings are without it
    outcome->offset_sd = before.offset_sd;
    outcome->fitted.total_sd = hypot(outcome->fitted.total_sd, light->unmeasured);
    outcome->ballistic_share = light->share;
    outcome->ballistic_sd = hypot(hypot(light->sd, light->unmeasured), light->share * common.flux);
    outcome->ballistic_to_mm = to_mm;
}

bool alb_ballistic_find(alb_outcome *outcome, const alb_readings *readings, const alb_operator *forward,
                        alb_common_sd common, alb_error *error)
{
    bool ok = false;
    alb_error refused = {0};
    alb_readings beyond;
    alb_operator operator_beyond;
    straight light;
    double most;
    alb_outcome *other = alb_allocate(1, sizeof *other, error);
    double *irradiance = alb_allocate((size_t)readings->count, sizeof *irradiance, error);
    if (!other || !irradiance)
        goto done;
    const int lit = spot_at(irradiance, &most, readings, forward);
    ok = lit == 0 || readings->count - lit < 3 || !worth_looking(outcome, readings->r_mm[lit]);
    if (ok)
        goto done;
    look_beyond(&beyond, &operator_beyond, readings, forward, lit);
    if (!alb_choose(other, &beyond, &operator_beyond, common, &refused)) {
        ok = refused.status == ALB_UNDECIDED; // then what was found stays
        if (!ok)
            *error = refused;
        goto done;
    }
    if (!find_straight(&light, other, readings, forward, irradiance, most, lit, error))
        goto done;
    ok = true;
    const bool missed = outcome->discrepancy_relative > misfit_of_a_spike;
    const double sd = missed ? light.sd : hypot(light.sd, light.unmeasured);
    if (light.share > 3 * sd && light.like_spot &&
        other->discrepancy_relative <= (missed ? 0.5 : 1.5) * outcome->discrepancy_relative)
        take(outcome, other, &light, beyond.core_mm, common);
done:
    free(irradiance);
    free(other);
    return ok;
}
