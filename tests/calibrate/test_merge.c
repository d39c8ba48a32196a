// The merge against the Cramer-Rao bound: sensor simulated here, by its own formula.
#include "base/random.h"
#include "calibrate/merge.h"
#include "check.h"

enum { TIMES = 5, LEVELS = 31, TRIALS = 4000 };
static const double times_s[TIMES] = {1.0 / 1000, 1.0 / 250, 1.0 / 60, 1.0 / 15, 1.0 / 4};

typedef struct sensor {
    double full_well_e, read_e, gain, black_dn;
    int bits;
} sensor;

static double frame_dn(alb_random *random, const sensor *s, double electrons)
{
    const double e =
        fmin(alb_random_poisson(random, electrons), s->full_well_e) + s->read_e * alb_random_normal(random);
    return fmax(0, fmin(ldexp(1, s->bits) - 1, nearbyint(s->black_dn + s->gain * e)));
}

// Fisher information of one exposure for the electron rate: t^2 / v + t^2 / (2 v^2), v = rate t + read^2 + q^2 / 12.
static double information(const sensor *s, double rate)
{
    double sum = 0;
    for (int i = 0; i < TIMES; i++) {
        const double t = times_s[i], q = 1 / s->gain, v = rate * t + s->read_e * s->read_e + q * q / 12;
        if (rate * t + 4 * sqrt(v) < s->full_well_e)
            sum += t * t / v + t * t / (2 * v * v);
    }
    return sum;
}

static void merge_reaches_the_bound(void **state)
{
    (void)state;
    const sensor s = {10000, 3, 4095.0 / 11000, 200, 12};
    const double read_dn = sqrt(pow(s.read_e * s.gain, 2) + 1.0 / 12);
    const double white = s.black_dn + s.gain * s.full_well_e - 12; // 4 sd of read noise below the clipped mean
    double efficiencies[LEVELS], worst_bias = 0, worst_variance = 0;
    for (int l = 0; l < LEVELS; l++) {
        const double rate = 10 * pow(10, 5.2 * l / (LEVELS - 1)); // electrons per second
        double squares = 0, sum = 0, predicted = 0;
        for (int k = 0; k < TRIALS; k++) {
            alb_random random = alb_random_at(3, (uint64_t)l, (uint64_t)k);
            alb_exposure exposures[TIMES];
            for (int i = 0; i < TIMES; i++) {
                const double y = frame_dn(&random, &s, rate * times_s[i]);
                exposures[i] = (alb_exposure){times_s[i], y, 1, y >= white};
            }
            double x, variance;
            assert_true(alb_merge_pixel(&x, &variance, exposures, TIMES, s.black_dn, read_dn, s.gain, white));
            sum += x / s.gain - rate;
            squares += pow(x / s.gain - rate, 2);
            predicted += variance / (s.gain * s.gain);
        }
        const double mse = squares / TRIALS, bias = sum / TRIALS;
        efficiencies[l] = 1 / (information(&s, rate) * mse);
        // Bias beyond what chance gives (4 standard errors), relative to the level.
        worst_bias = fmax(worst_bias, fmax(0, fabs(bias) - 4 * sqrt(mse / TRIALS)) / rate);
        worst_variance = fmax(worst_variance, fabs(predicted / TRIALS / mse - 1));
    }
    double least = 2;
    for (int l = 0; l < LEVELS; l++)
        least = fmin(least, efficiencies[l]);
    for (int l = 0; l < LEVELS; l++) // insertion sort for the median
        for (int k = l; k > 0 && efficiencies[k] < efficiencies[k - 1]; k--) {
            const double t = efficiencies[k];
            efficiencies[k] = efficiencies[k - 1], efficiencies[k - 1] = t;
        }
    print_message("merge: efficiency median %.3f, least %.3f; bias beyond chance %.2e; variance off by %.3f at most\n",
                  efficiencies[LEVELS / 2], least, worst_bias, worst_variance);
    assert_true(efficiencies[LEVELS / 2] > 0.97); // sampling error of an efficiency: sqrt(2 / 4000) = 2.2 %
    assert_true(least > 0.90);
    assert_true(worst_bias < 3e-3);
    assert_true(worst_variance < 0.15); // 5 % but for the level where the longest useful exposure is about to clip
}

static void saturated_in_all_is_not_measured(void **state)
{
    (void)state;
    const alb_exposure exposures[2] = {{0.01, 4095, 1, true}, {0.1, 4095, 1, true}};
    double x, variance;
    assert_false(alb_merge_pixel(&x, &variance, exposures, 2, 200, 1, 0.4, 4095));
    const alb_exposure one[2] = {{0.01, 1200, 1, false}, {0.1, 4095, 1, true}};
    assert_true(alb_merge_pixel(&x, &variance, one, 2, 200, 1, 0.4, 4095));
    check_relative(x, 1e5, 1e-12);
    check_relative(variance, (0.4 * 1000 + 1) / 1e-4, 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(merge_reaches_the_bound),
        cmocka_unit_test(saturated_in_all_is_not_measured),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
