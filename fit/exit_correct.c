// The light that leaves both sides of a slab says what the slab is made of, that says into which directions it leaves
// (exit_lobe.c), and the directions how much light the camera's share of it stands for: rounds of
//   (R, T) -> (sigma_a, sigma_s') -> pi L / M at the camera's angle -> (R, T)
// from the totals by exit_angle.c, summed over the rings and continued beyond them by the exponential of the last ones.
// A round leaves a tenth of the error or less. Over the few degrees that one photograph spans the ratio of the two laws
// is taken as that at the centre.
//
// What is left is the anisotropy, which is assumed: half of what another one would do. Not true near the beam
// (exit_lobe.c), for rough faces, and where the slab ends within the light.
#include "fit/exit_correct.h"
#include "fit/exit_angle.h"
#include "fit/exit_lobe.h"
#include <math.h>

enum { ROUNDS = 6 };
static const double numerical_sd = 0.001; // of the lobe against discrete ordinates (tests/fit/test_exit_lobe.c)
static const double start_sd = 0.1;       // of exit_angle.h where it is worst: thin slabs, aslant

// Light beyond ring i by the exponential between it and the first beyond 0.7 of its distance.
static double beyond(const alb_readings *readings, int i)
{
    int from = 0;
    while (readings->r_mm[from] < 0.7 * readings->r_mm[i])
        from++;
    const double r = readings->r_mm[i], v = readings->value[i],
                 decay = log(readings->value[from] / v) / (r - readings->r_mm[from]);
    return decay > 0 ? 2 * M_PI * v * (r / decay + 1 / (decay * decay)) : 0;
}

// 2 pi int S r dr of the readings as they are.
static double sum_of(const alb_readings *readings)
{
    double sum = 0;
    int last = readings->count - 1;
    while (last > 0 && readings->value[last] < 5 * readings->sd[last])
        last--;
    for (int i = 0; i <= last; i++)
        sum += readings->area_mm2[i] * readings->value[i] * (i < last ? 1 : 0.5);
    return sum + (last > 0 ? beyond(readings, last) : 0);
}

// What is corrected, and how well it is known.
typedef struct correction {
    double factor[ALB_SIDES], ratio[ALB_SIDES], sd[ALB_SIDES];
} correction;

static bool slab_of(alb_exit_lobe *lobe, const alb_optical_model *model, const double total[ALB_SIDES],
                    double thickness_mm)
{
    const alb_measured_totals totals = {.reflection = total[0],
                                        .reflection_sd = start_sd * total[0],
                                        .transmission = total[1],
                                        .transmission_sd = start_sd * total[1],
                                        .thickness_mm = thickness_mm};
    alb_optical optical;
    if (!alb_optical_from_totals(&optical, model, &totals, NULL))
        return false;
    alb_exit_lobe_of(lobe, &model->fine, optical.absorption_per_mm, optical.reduced_scattering_per_mm, thickness_mm);
    return true;
}

// Rounds with the assumed anisotropy, then what the other one says at their end.
static bool find(correction *out, const alb_optical_model *assumed, const alb_optical_model *instead,
                 const double cosine[ALB_SIDES], const double sum[ALB_SIDES], double thickness_mm)
{
    double taken[ALB_SIDES], change = 1;
    alb_exit_lobe lobe;
    for (int side = 0; side < ALB_SIDES; side++) {
        const alb_exit face = alb_exit_of((alb_side)side, ALB_FINISH_SMOOTH, assumed->fine.refractive_index);
        taken[side] = alb_exit_ratio(&face, cosine[side]);
        out->factor[side] = 1;
    }
    for (int round = 0; round < ROUNDS && change > 1e-5; round++) {
        const double total[] = {out->factor[0] * sum[0], out->factor[1] * sum[1]};
        if (!slab_of(&lobe, assumed, total, thickness_mm))
            return false;
        change = 0;
        for (int side = 0; side < ALB_SIDES; side++) {
            out->ratio[side] = alb_exit_lobe_ratio(&lobe, (alb_side)side, cosine[side]);
            const double factor = taken[side] / out->ratio[side];
            change = fmax(change, fabs(factor / out->factor[side] - 1));
            out->factor[side] = factor;
        }
    }
    const double total[] = {out->factor[0] * sum[0], out->factor[1] * sum[1]};
    if (!(change < 1e-3) || !slab_of(&lobe, instead, total, thickness_mm))
        return false;
    for (int side = 0; side < ALB_SIDES; side++) {
        const double other = alb_exit_lobe_ratio(&lobe, (alb_side)side, cosine[side]);
        out->sd[side] = hypot(numerical_sd, 0.5 * (other / out->ratio[side] - 1));
    }
    return true;
}

static void scale(alb_measurement *one, double factor, double sd)
{
    alb_readings *readings = &one->readings;
    for (int i = 0; i < readings->count; i++) {
        readings->value[i] *= factor;
        readings->sd[i] *= factor;
        for (int k = 0; k < ALB_RING_SAMPLES; k++)
            readings->sample_value[i][k] *= factor;
    }
    readings->far_value *= factor;
    readings->far_sd *= factor;
    const double flux = one->common.flux;
    one->common.flux = sqrt(fmax(flux * flux - ALB_EXIT_RELATIVE_SD * ALB_EXIT_RELATIVE_SD, 0) + sd * sd);
}

static bool usable(const alb_measurement *one)
{
    return one->exit_cosine > 0 && one->readings.count > 2 && one->readings.core_mm == 0;
}

void alb_exit_correct(alb_fitting *fitting, alb_text *notes)
{
    const double n = fitting->material.refractive_index, d = fitting->material.thickness_mm,
                 g = fitting->basis.anisotropy;
    if (fitting->basis.finish != ALB_FINISH_SMOOTH || !(d > 0) || !(n >= 1))
        return;
    alb_optical_model assumed, instead;
    alb_optical_model_create(&assumed, ALB_OPTICAL_STREAMS, n, g);
    alb_optical_model_create(&instead, ALB_OPTICAL_STREAMS, n, alb_other_anisotropy(g));
    for (int c = 0; c < fitting->material.channels; c++) {
        alb_measurement *sides[] = {&fitting->sides[0][c], &fitting->sides[1][c]};
        correction found;
        if (!usable(sides[0]) || !usable(sides[1]))
            continue;
        const double cosine[] = {sides[0]->exit_cosine, sides[1]->exit_cosine},
                     sum[] = {sum_of(&sides[0]->readings), sum_of(&sides[1]->readings)};
        if (!find(&found, &assumed, &instead, cosine, sum, d))
            continue;
        for (int side = 0; side < ALB_SIDES; side++) {
            scale(sides[side], found.factor[side], found.sd[side]);
            fitting->basis.own_sd[side][c] = found.sd[side];
        }
        alb_text_add(notes,
                     "%s: by the transport of the slab that its totals speak of the faces shed, at the centre, %.4f "
                     "+- %.4f (reflection) and %.4f +- %.4f (transmission) of what Lambert's law says: corrected by "
                     "%+.2f and %+.2f %%.\n",
                     fitting->material.channel_names[c], found.ratio[0], found.sd[0] * found.ratio[0], found.ratio[1],
                     found.sd[1] * found.ratio[1], 100 * (found.factor[0] - 1), 100 * (found.factor[1] - 1));
    }
}
