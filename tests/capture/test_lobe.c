// Directions of the light that leaves, against Milne's problem: out of a thick slab that neither absorbs nor refracts
// comes pi L / M = H(mu) / (2 int H mu dmu), Chandrasekhar's H of albedo 1 (Radiative Transfer, 1950, section 13).
#include "capture/lobe.h"
#include "check.h"

enum { NODES = 400 };

// H(mu) = 1 + mu H(mu) / 2 int_0^1 H(t) / (mu + t) dt, iterated as 1 / H = sqrt(1 - albedo) + 1/2 int t H / (mu + t).
static void chandrasekhar(double h[NODES])
{
    for (int i = 0; i < NODES; i++)
        h[i] = 1;
    for (int pass = 0; pass < 3000; pass++) {
        double next[NODES];
        for (int i = 0; i < NODES; i++) {
            const double mu = (i + 0.5) / NODES;
            double sum = 0;
            for (int j = 0; j < NODES; j++)
                sum += (j + 0.5) / NODES * h[j] / (mu + (j + 0.5) / NODES);
            next[i] = 1 / (0.5 * sum / NODES);
        }
        for (int i = 0; i < NODES; i++)
            h[i] = sqrt(h[i] * next[i]);
    }
}

static void milne(void **state)
{
    (void)state;
    static double h[NODES];
    static alb_photon_tally tally;
    alb_error error = {0};
    alb_lobe lobe;
    const alb_medium medium = {0, 1, 0, 1, 8};
    double moment = 0, left = 0;
    chandrasekhar(h);
    for (int i = 0; i < NODES; i++)
        moment += (i + 0.5) / NODES * h[i] / NODES;
    check_relative(moment, 2 / sqrt(3), 2e-3); // exact; the midpoint rule knows H to that
    check_ok(alb_photon_trace(&tally, &medium, 100, 2000000, 1, 0, &error), &error);
    for (int i = 0; i < ALB_PHOTON_COSINES; i++)
        left += tally.cosine[1][i];
    check_near(left, tally.leaving[1] - tally.unscattered[1], 1e-12);
    alb_lobe_from_photons(&lobe, &tally, 1);
    for (double mu = 0.15; mu < 1; mu += 0.1) {
        const double expected = h[(int)(mu * NODES)] / (2 * moment);
        print_message("cosine %.2f: %.4f, H gives %.4f\n", mu, alb_lobe_value(&lobe, mu), expected);
        // 290 000 photons leave: 0.4 % near the normal, 0.6 % where the window is narrow
        check_relative(alb_lobe_value(&lobe, mu), expected, 4 * 0.006);
    }
}

// 2 int value mu dmu = 1, whatever left; and a tally of Lambert's own shares is a Lambertian lobe.
static void keeps_the_light(void **state)
{
    (void)state;
    static alb_photon_tally tally;
    alb_lobe lobe;
    for (int i = 0; i < ALB_PHOTON_COSINES; i++) {
        tally.cosine[0][i] = 0.3 * (2 * i + 1);
        tally.cosine[1][i] = (i * 7919 % 13) + 1.0;
    }
    alb_lobe_from_photons(&lobe, &tally, 0);
    for (double mu = 0; mu <= 1; mu += 0.01)
        check_near(alb_lobe_value(&lobe, mu), 1, 1e-12);
    alb_lobe_from_photons(&lobe, &tally, 1);
    double sum = 0;
    for (int i = 0; i < 40000; i++)
        sum += 2 * alb_lobe_value(&lobe, (i + 0.5) / 40000) * (i + 0.5) / 40000 / 40000;
    check_near(sum, 1, 0.01); // lines between the middles of the bins
    const alb_lobe none = {0};
    check_near(alb_lobe_value(&none, 0.3), 1, 0);
    tally = (alb_photon_tally){0};
    alb_lobe_from_photons(&lobe, &tally, 0);
    check_near(alb_lobe_value(&lobe, 0.3), 1, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(milne), cmocka_unit_test(keeps_the_light)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
