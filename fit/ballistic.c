// Light that has not scattered, (1 - r)^2 e^(-(sigma_a + sigma_s) d) of what falls in, leaves where it fell in: on top
// of the profile the readings hold the spot itself, and no form of the table goes that high in so little room. The
// readings that the spot reaches, those whose distances under the operator begin at 0, are left out; what is fitted to
// the others goes on underneath, and sum (value - fit) area inside is the share that came straight through, uncertain
// by a tenth of what the form holds where it was not measured (slabs by Monte Carlo: 2 to 12 %). It is looked for where
// no form stands, its parameters are not decided, or a term is narrower than the spot, and taken where it is 3 sd and
// the misfit falls to half at least or the parameters become decided. Stops being true where light that has scattered
// little is as narrow as the spot (g near 1 and sigma_s' d < 1): that counts as straight.
#include "fit/ballistic.h"
#include "base/memory.h"
#include "fit/profile.h"
#include <math.h>
#include <stdlib.h>

static const double core_relative_sd = 0.1, narrow = 3; // narrow: decays times the reach of the spot

// How many of the first readings the spot reaches: where the share of distances within a quarter of the first spacing
// is a hundredth of the largest at least.
static int lit_readings(const alb_readings *readings, const alb_operator *forward)
{
    const double near = 0.25 * (readings->r_mm[1] - readings->r_mm[0]);
    double most = 0;
    int lit = 0;
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < readings->count; i++) {
            double mass = 0;
            for (int k = forward->first[i]; k <= forward->last[i] && forward->grid_mm[k] < near; k++)
                mass += forward->weight[forward->offset[i] + (size_t)(k - forward->first[i])];
            if (pass == 0)
                most = fmax(most, mass);
            else if (mass > 0.01 * most)
                lit = i + 1;
        }
    return most > 0 ? lit : 0;
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

// What lies above the fit in the first readings, its sd by the noise, and by what the fit is where it is not measured.
static bool find_excess(double *excess, double *sd, double *unmeasured, const alb_outcome *outcome,
                        const alb_readings *readings, const alb_operator *forward, int lit, alb_error *error)
{
    double *model = alb_operator_readings(forward, &outcome->fitted.profile, error), variance = 0;
    if (!model)
        return false;
    *excess = 0;
    double inside = 0;
    for (int i = 0; i < lit; i++) {
        inside += readings->area_mm2[i] * model[i];
        *excess += readings->area_mm2[i] * (readings->value[i] - model[i]);
        variance += pow(readings->area_mm2[i] * readings->sd[i], 2);
    }
    free(model);
    *sd = sqrt(variance);
    *unmeasured = core_relative_sd * inside;
    return true;
}

bool alb_choose_behind(alb_outcome *outcome, const alb_readings *readings, const alb_operator *forward,
                       alb_common_sd common, alb_error *error)
{
    if (!alb_choose(outcome, readings, forward, common, error))
        return false;
    const int lit = lit_readings(readings, forward);
    if (lit == 0 || readings->count - lit < 3)
        return true;
    const bool delta = alb_profile_fastest(&outcome->fitted.profile) * readings->r_mm[lit] > narrow;
    if (outcome->discrepancy_relative == 0 && outcome->fitted.identifiable && !delta)
        return true;
    alb_readings beyond;
    alb_operator operator_beyond;
    alb_error refused = {0};
    double excess, sd, unmeasured;
    bool ok = false;
    alb_outcome *other = alb_allocate(1, sizeof *other, error);
    if (!other)
        return false;
    look_beyond(&beyond, &operator_beyond, readings, forward, lit);
    if (!alb_choose(other, &beyond, &operator_beyond, common, &refused)) {
        ok = refused.status == ALB_UNDECIDED; // then what was found stays
        if (!ok)
            *error = refused;
        goto done;
    }
    if (!find_excess(&excess, &sd, &unmeasured, other, readings, forward, lit, error))
        goto done;
    ok = true;
    const bool better = outcome->discrepancy_relative > 0
                            ? other->discrepancy_relative <= 0.5 * outcome->discrepancy_relative
                            : other->discrepancy_relative == 0 && (other->fitted.identifiable || delta);
    if (better && excess > 3 * sd) {
        *outcome = *other;
        outcome->fitted.total_sd = hypot(outcome->fitted.total_sd, unmeasured);
        outcome->ballistic_share = excess;
        outcome->ballistic_sd = hypot(hypot(sd, unmeasured), excess * common.flux);
        outcome->ballistic_to_mm = beyond.core_mm;
    }
done:
    free(other);
    return ok;
}
