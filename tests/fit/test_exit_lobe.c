// Directions of the light that leaves a slab, against photons and against discrete ordinates, which share Fresnel's
// equations with adding-doubling and nothing else; and readings that they correct.
#include "base/memory.h"
#include "capture/lobe.h"
#include "check.h"
#include "discrete_ordinates.h"
#include "fit/exit_angle.h"
#include "fit/exit_correct.h"
#include "fit/exit_lobe.h"
#include <stdlib.h>

static alb_exit_lobe lobe_of(const alb_medium *medium)
{
    alb_streams streams;
    alb_exit_lobe lobe;
    alb_streams_create(&streams, ALB_OPTICAL_STREAMS, medium->refractive_index, medium->anisotropy);
    alb_exit_lobe_of(&lobe, &streams, medium->absorption_per_mm, medium->scattering_per_mm * (1 - medium->anisotropy),
                     medium->thickness_mm);
    return lobe;
}

// Marble, wax, dark, thin, nearly index-matched.
static const alb_medium media[] = {{0.0041, 2.62, 0, 1.5, 5}, {0.03, 3.4, 0.5, 1.45, 6}, {0.3, 1, 0, 1.5, 3},
                                   {0.01, 1, 0, 1.33, 2},     {0.01, 0.5, 0, 1.5, 2},    {0.02, 2, 0.3, 1.05, 3}};
enum { MEDIA = sizeof media / sizeof media[0] };

static void shares_all_light(void **state)
{
    (void)state;
    for (int m = 0; m < MEDIA; m++) {
        const alb_exit_lobe lobe = lobe_of(&media[m]);
        for (int side = 0; side < ALB_SIDES; side++) {
            double sum = 0;
            for (int i = 0; i < 20000; i++)
                sum += 2 * alb_exit_lobe_ratio(&lobe, (alb_side)side, (i + 0.5) / 20000) * (i + 0.5) / 20000 / 20000;
            check_near(sum, 1, 1e-4);
        }
    }
}

// Shares of the light in bins of the cosine. Photons carry weights below 1, so that a bin's variance is below that of
// counts: chi-square comes out at 1 a bin or less.
static void photons_leave_so(void **state)
{
    (void)state;
    static alb_photon_tally tally;
    enum { PHOTONS = 400000, PARTS = 8 };
    for (int m = 0; m < MEDIA; m++) {
        alb_error error = {0};
        const alb_exit_lobe lobe = lobe_of(&media[m]);
        check_ok(alb_photon_trace(&tally, &media[m], 100, PHOTONS, 3, (uint64_t)m, &error), &error);
        for (int side = 0; side < ALB_SIDES; side++) {
            double left = 0, chi_square = 0, formula = 0;
            const alb_exit face = alb_exit_of((alb_side)side, ALB_FINISH_SMOOTH, media[m].refractive_index);
            for (int i = 0; i < ALB_PHOTON_COSINES; i++)
                left += tally.cosine[side][i];
            for (int i = 0; i < ALB_PHOTON_COSINES; i++) {
                double share = 0, by_formula = 0;
                for (int k = 0; k < PARTS; k++) {
                    const double cosine = (i + (k + 0.5) / PARTS) / ALB_PHOTON_COSINES,
                                 part = 2 * cosine / PARTS / ALB_PHOTON_COSINES;
                    share += part * alb_exit_lobe_ratio(&lobe, (alb_side)side, cosine);
                    by_formula += part * alb_exit_ratio(&face, cosine);
                }
                const double seen = tally.cosine[side][i] / left;
                chi_square += pow(seen - share, 2) / share * left * PHOTONS;
                formula += pow(seen - by_formula, 2) / by_formula * left * PHOTONS;
            }
            print_message("medium %d side %d: chi-square a bin %.2f, by exit_angle.h %.2f\n", m, side,
                          chi_square / ALB_PHOTON_COSINES, formula / ALB_PHOTON_COSINES);
            check_below(chi_square / ALB_PHOTON_COSINES, 1 + 4 * sqrt(2.0 / ALB_PHOTON_COSINES));
        }
    }
}

static void ordinates_say_so(void **state)
{
    (void)state;
    for (int m = 0; m < MEDIA; m++) {
        double totals[2], worst = 0;
        ord_lobe angles;
        const alb_exit_lobe lobe = lobe_of(&media[m]);
        discrete_ordinates_lobe(totals, &angles, &media[m]);
        for (int side = 0; side < ALB_SIDES; side++)
            for (int i = 0; i < ORD_ABOVE; i++)
                if (angles.cosine[i] > cos(ALB_EXIT_MOST_DEG * M_PI / 180))
                    worst = fmax(
                        worst,
                        fabs(alb_exit_lobe_ratio(&lobe, (alb_side)side, angles.cosine[i]) / angles.ratio[side][i] - 1));
        print_message("medium %d, 0 to 75 degrees: %.4f %% at worst\n", m, 100 * worst);
        // 0.1 %: what exit_correct.c takes for its own sd; one mean free path thin, the kink that Fresnel's
        // reflectance makes on the other face is seen through the slab
        check_below(worst, m == 4 ? 0.003 : 0.001);
    }
}

// Readings of a slab that sheds light as ordinates say, taken by exit_angle.h: e^-r / (2 pi) on rings 0.1 mm wide.
static void photograph(alb_fitting *fitting, const alb_medium *medium, const double totals[2], const ord_lobe *angles,
                       int at)
{
    enum { RINGS = 90 };
    fitting->material.thickness_mm = medium->thickness_mm;
    fitting->material.refractive_index = medium->refractive_index;
    fitting->material.channels = 1;
    for (int side = 0; side < ALB_SIDES; side++) {
        alb_error error = {0};
        alb_measurement *one = &fitting->sides[side][0];
        const alb_exit face = alb_exit_of((alb_side)side, ALB_FINISH_SMOOTH, medium->refractive_index);
        const double scale = totals[side] * angles->ratio[side][at] / alb_exit_ratio(&face, angles->cosine[at]);
        one->common.flux = ALB_EXIT_RELATIVE_SD;
        fitting->basis.own_sd[side][0] = ALB_EXIT_RELATIVE_SD;
        one->exit_cosine = angles->cosine[at];
        check_ok(alb_readings_create(&one->readings, RINGS, &error), &error);
        for (int i = 0; i < RINGS; i++) {
            const double low = 0.1 * i, high = low + 0.1, r = low + 0.05,
                         light = exp(-low) * (1 + low) - exp(-high) * (1 + high);
            one->readings.r_mm[i] = r;
            one->readings.area_mm2[i] = M_PI * (high * high - low * low);
            one->readings.value[i] = scale * light / one->readings.area_mm2[i];
            one->readings.sd[i] = 1e-9 * scale;
        }
    }
}

static double exitance(const alb_readings *readings)
{
    double sum = 0;
    for (int i = 0; i < readings->count; i++)
        sum += readings->value[i] * readings->area_mm2[i];
    return sum / (1 - exp(-9.0) * (1 + 9.0));
}

// Totals come back within 0.3 % where the formula is up to 18 % off, with the right anisotropy; within 3 of the sd that
// is claimed where that is not known.
static void totals_come_back(void **state)
{
    (void)state;
    for (int known = 0; known < 2; known++) {
        double worst = 0, before = 0, in_sd = 0;
        for (int m = 0; m < MEDIA; m++)
            for (int at = 21; at < ORD_ABOVE; at += 14) {
                double totals[2];
                ord_lobe angles;
                alb_text notes = {0};
                alb_fitting *fitting = calloc(1, sizeof *fitting);
                fitting->basis.anisotropy = known ? media[m].anisotropy : 0;
                discrete_ordinates_lobe(totals, &angles, &media[m]);
                photograph(fitting, &media[m], totals, &angles, at);
                for (int side = 0; side < ALB_SIDES; side++)
                    before = fmax(before, fabs(exitance(&fitting->sides[side][0].readings) / totals[side] - 1));
                alb_exit_correct(fitting, &notes);
                assert_non_null(strstr(notes.bytes, "of what Lambert's law says: corrected by"));
                for (int side = 0; side < ALB_SIDES; side++) {
                    const double off = exitance(&fitting->sides[side][0].readings) / totals[side] - 1;
                    worst = fmax(worst, fabs(off));
                    in_sd = fmax(in_sd, fabs(off) / fitting->basis.own_sd[side][0]);
                    check_relative(fitting->sides[side][0].common.flux, fitting->basis.own_sd[side][0], 1e-9);
                }
                alb_text_free(&notes);
                alb_fitting_free(fitting);
                free(fitting);
            }
        print_message("anisotropy %s: totals %.2f %% off at worst, %.2f %% by exit_angle.h; %.2f sd\n",
                      known ? "known" : "taken as 0", 100 * worst, 100 * before, in_sd);
        check_below(known ? worst : 0, 0.0035); // the slab of one mean free path at 70 degrees; others 0.1 %
        check_below(in_sd, 3);
        check_below(0.03, before);
    }
}

static void kept_as_it_is(const alb_medium *medium, const double totals[2], const ord_lobe *angles,
                          void (*spoil)(alb_fitting *))
{
    alb_text notes = {0};
    alb_fitting *fitting = calloc(1, sizeof *fitting);
    photograph(fitting, medium, totals, angles, 40);
    spoil(fitting);
    const double before = fitting->sides[0][0].readings.value[0], sd = fitting->sides[0][0].common.flux;
    alb_exit_correct(fitting, &notes);
    assert_null(notes.bytes);
    assert_true(fitting->sides[0][0].readings.value[0] == before && fitting->sides[0][0].common.flux == sd);
    alb_fitting_free(fitting);
    free(fitting);
}

static void grind(alb_fitting *fitting) { fitting->basis.finish = ALB_FINISH_GROUND; }
static void hide_one_side(alb_fitting *fitting) { fitting->sides[1][0].exit_cosine = 0; }
static void saturate(alb_fitting *fitting) { fitting->sides[0][0].readings.core_mm = 0.5; }
static void forget_thickness(alb_fitting *fitting) { fitting->material.thickness_mm = 0; }
static void darken(alb_fitting *fitting)
{
    for (int i = 0; i < fitting->sides[1][0].readings.count; i++)
        fitting->sides[1][0].readings.value[i] = 0;
}
static void brighten(alb_fitting *fitting)
{
    for (int i = 0; i < fitting->sides[0][0].readings.count; i++)
        fitting->sides[0][0].readings.value[i] *= 3;
}

static void where_no_slab_is_known_nothing_changes(void **state)
{
    (void)state;
    double totals[2];
    ord_lobe angles;
    discrete_ordinates_lobe(totals, &angles, &media[0]);
    void (*const ways[])(alb_fitting *) = {grind, hide_one_side, saturate, forget_thickness, darken, brighten};
    for (int i = 0; i < 6; i++)
        kept_as_it_is(&media[0], totals, &angles, ways[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(shares_all_light), cmocka_unit_test(photons_leave_so),
                                       cmocka_unit_test(ordinates_say_so), cmocka_unit_test(totals_come_back),
                                       cmocka_unit_test(where_no_slab_is_known_nothing_changes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
