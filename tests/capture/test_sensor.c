// The sensor's statistics against what the model says, in units of their own sampling error: 5 sd, for about 20
// comparisons.
#include "capture/sensor.h"
#include "check.h"
#include <omp.h>

enum { WIDTH = 300, HEIGHT = 200, PIXELS = WIDTH * HEIGHT };

static const alb_sensor sensor = {
    .full_well_e = 10000, .read_noise_e = 4, .gain_dn_per_e = 0.5, .black_level_dn = 100, .bits = 14};

static void exposed(alb_image *frame, double electrons_per_s, double exposure_s, const alb_sensor *s, uint64_t id)
{
    alb_error error = {0};
    alb_image rate = {0};
    check_ok(alb_image_create(&rate, WIDTH, HEIGHT, "R,G,B", &error), &error);
    check_ok(alb_image_create(frame, WIDTH, HEIGHT, "R,G,B", &error), &error);
    for (int i = 0; i < PIXELS * 3; i++)
        rate.pixels[i] = (float)electrons_per_s;
    alb_sensor_expose(frame, &rate, s, exposure_s, 5, id);
    alb_image_free(&rate);
}

static void moments(double *mean, double *variance, const alb_image *frame)
{
    double sum = 0, squares = 0;
    for (int i = 0; i < PIXELS * 3; i++) {
        const double d = (double)frame->pixels[i] - (double)frame->pixels[0];
        sum += d, squares += d * d;
    }
    *mean = (double)frame->pixels[0] + sum / (PIXELS * 3);
    *variance = (squares - sum * sum / (PIXELS * 3)) / (PIXELS * 3 - 1);
}

// Photon transfer: mean = black + K e; variance = K^2 (e + read^2) + 1/12 of rounding.
static void mean_and_variance(void **state)
{
    (void)state;
    const double electrons[] = {0, 3, 29, 31, 500, 5000};
    for (int i = 0; i < 6; i++) {
        alb_image frame = {0};
        double mean, variance;
        exposed(&frame, electrons[i] * 4, 0.25, &sensor, (uint64_t)i);
        moments(&mean, &variance, &frame);
        const double expected = 0.25 * (electrons[i] + 16) + 1.0 / 12;
        // var(s^2) = (mu4 - var^2) / n, mu4 of a Poisson 3 m^2 + m: at most 3 var^2 + var here
        check_near(mean, 100 + 0.5 * electrons[i], 5 * sqrt(expected / (3 * PIXELS)));
        check_near(variance, expected, 5 * sqrt((2 * expected * expected + expected) / (3 * PIXELS)));
        alb_image_free(&frame);
    }
}

static void saturation(void **state)
{
    (void)state;
    alb_sensor narrow = sensor;
    alb_image well = {0}, clipped = {0};
    exposed(&well, 1e9, 1, &sensor, 1); // full well below the converter's end: read noise around it
    double mean, variance;
    moments(&mean, &variance, &well);
    check_near(mean, 100 + 0.5 * 10000, 5 * sqrt(4.1 / (3 * PIXELS)));
    for (int i = 0; i < 3 * PIXELS; i++)
        assert_true((double)well.pixels[i] >= alb_sensor_white_level_dn(&sensor));
    narrow.bits = 12; // the converter ends first
    exposed(&clipped, 1e9, 1, &narrow, 1);
    check_near(alb_sensor_white_level_dn(&narrow), 4095, 0);
    for (int i = 0; i < 3 * PIXELS; i++)
        assert_true(clipped.pixels[i] == 4095.0F);
    alb_image_free(&well);
    alb_image_free(&clipped);
}

static void values_are_whole_and_in_range(void **state)
{
    (void)state;
    alb_sensor low = sensor;
    low.black_level_dn = 2; // read noise reaches below zero
    alb_image frame = {0};
    exposed(&frame, 0, 1, &low, 9);
    int zeros = 0;
    for (int i = 0; i < 3 * PIXELS; i++) {
        assert_true(frame.pixels[i] == rintf(frame.pixels[i]) && frame.pixels[i] >= 0);
        zeros += frame.pixels[i] == 0;
    }
    const double share = 0.5 * erfc(1.5 / (0.5 * 4) / sqrt(2)); // P(2 + 0.5 * 4 N(0,1) < 0.5)
    check_near(zeros / (3.0 * PIXELS), share, 5 * sqrt(share / (3 * PIXELS)));
    alb_image_free(&frame);
}

// Frames differ, pixels are independent, threads do not matter.
static void noise_is_indexed(void **state)
{
    (void)state;
    alb_image a = {0}, b = {0}, again = {0};
    exposed(&a, 400, 1, &sensor, 1);
    exposed(&b, 400, 1, &sensor, 2);
    omp_set_num_threads(1);
    exposed(&again, 400, 1, &sensor, 1);
    assert_memory_equal(a.pixels, again.pixels, sizeof(float) * 3 * PIXELS);
    double frames = 0, neighbours = 0, channels = 0;
    for (int i = 3; i < 3 * PIXELS; i++) {
        const double v = (double)a.pixels[i] - 300;
        frames += v * ((double)b.pixels[i] - 300);
        neighbours += v * ((double)a.pixels[i - 3] - 300);
        channels += v * ((double)a.pixels[i - 1] - 300);
    }
    const double limit = 5 * 104 * sqrt(3.0 * PIXELS); // variance 0.25 * 416 + 1/12
    check_near(frames, 0, limit);
    check_near(neighbours, 0, limit);
    check_near(channels, 0, limit);
    alb_image_free(&a);
    alb_image_free(&b);
    alb_image_free(&again);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(mean_and_variance), cmocka_unit_test(saturation),
                                       cmocka_unit_test(values_are_whole_and_in_range),
                                       cmocka_unit_test(noise_is_indexed)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
