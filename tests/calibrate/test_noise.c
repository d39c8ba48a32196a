// Photon transfer on frames drawn here: gain, read noise and black level come back within what their number of pixels
// allows.
#include "base/exr.h"
#include "base/random.h"
#include "calibrate/noise.h"
#include "check.h"

enum { WIDTH = 160, HEIGHT = 120, REPEATS = 4 };

typedef struct sensor {
    double gain, read_e, black_dn;
} sensor;

static void write_frame(const alb_session *session, const alb_shot *shot, int exposure, int repeat, const sensor *s,
                        double electrons_per_s)
{
    alb_error error = {0};
    char path[ALB_PATH_SIZE];
    alb_image frame;
    check_ok(alb_image_create(&frame, WIDTH, HEIGHT, "R,G,B", &error), &error);
    for (int i = 0; i < WIDTH * HEIGHT * 3; i++) {
        alb_random random =
            alb_random_at(1000 * (uint64_t)shot->target + 100 * (uint64_t)exposure + (uint64_t)repeat, 1, (uint64_t)i);
        const double slope = 1 - 0.4 * (i / 3 % WIDTH) / WIDTH; // an uneven field must not matter
        const double e = alb_random_poisson(&random, electrons_per_s * slope * shot->obtained_s[exposure]) +
                         s->read_e * alb_random_normal(&random);
        frame.pixels[i] = (float)fmin(fmax(nearbyint(s->black_dn + s->gain * e), 0), 4095);
    }
    check_ok(alb_session_frame(path, session, shot, exposure, repeat, &error), &error);
    check_ok(alb_exr_write(&frame, NULL, path, &error), &error);
    alb_image_free(&frame);
}

static alb_session make_session(const sensor *s)
{
    alb_error error = {0};
    alb_session session = {.folder = "noise_session",
                           .width = WIDTH,
                           .height = HEIGHT,
                           .channels = 3,
                           .channel_names = {"R", "G", "B"},
                           .white_level_dn = 4095};
    check_ok(alb_file_make_directory("noise_session/frames", &error), &error);
    session.plan.shots[0] = (alb_shot){.name = "dark",
                                       .target = ALB_TARGET_CAP,
                                       .exposures_s = {0.01},
                                       .obtained_s = {0.01},
                                       .exposure_count = 1,
                                       .repeats = REPEATS};
    session.plan.shots[1] = (alb_shot){.name = "flat",
                                       .target = ALB_TARGET_DIFFUSER,
                                       .exposures_s = {0.01, 0.1, 1},
                                       .obtained_s = {0.01, 0.1, 1},
                                       .exposure_count = 3,
                                       .repeats = REPEATS};
    session.plan.shot_count = 2;
    for (int k = 0; k < 2; k++)
        for (int e = 0; e < session.plan.shots[k].exposure_count; e++)
            for (int r = 0; r < REPEATS; r++)
                write_frame(&session, &session.plan.shots[k], e, r, s, k ? 60000 : 0); // saturates at 1 s
    return session;
}

static void photon_transfer(void **state)
{
    (void)state;
    const sensor truth = {0.37, 4, 101.3};
    const alb_session session = make_session(&truth);
    alb_error error = {0};
    alb_noise noise;
    check_ok(alb_noise_measure(&noise, &session, &error), &error);
    const double read_dn = sqrt(pow(truth.gain * truth.read_e, 2) + 1.0 / 12); // rounding adds q^2 / 12
    for (int c = 0; c < 3; c++) {
        print_message("gain %.5f +- %.5f, read %.4f (%.4f), black %.4f\n", noise.gain_dn_per_electron[c].value,
                      noise.gain_dn_per_electron[c].sd, noise.read_noise_dn[c].value, read_dn, noise.black_dn[c].value);
        check_near(noise.gain_dn_per_electron[c].value, truth.gain, 4 * noise.gain_dn_per_electron[c].sd);
        check_near(noise.black_dn[c].value, truth.black_dn, 4 * noise.black_dn[c].sd);
        check_near(noise.read_noise_dn[c].value, read_dn, 4 * noise.read_noise_dn[c].sd);
        check_below(noise.gain_dn_per_electron[c].sd, 0.01 * truth.gain);
    }
    assert_true(noise.linearity < 0.002);
}

static void missing_frames_are_named(void **state)
{
    (void)state;
    const sensor truth = {0.37, 4, 101.3};
    alb_session session = make_session(&truth);
    alb_error error = {0};
    alb_noise noise;
    session.plan.shots[1].obtained_s[0] = session.plan.shots[1].exposures_s[0] = 1;
    session.plan.shot_count = 1;
    check_fails(alb_noise_measure(&noise, &session, &error), &error, ALB_BAD_DATA, "diffuser");
    session.plan.shots[0].target = ALB_TARGET_SLAB;
    check_fails(alb_noise_measure(&noise, &session, &error), &error, ALB_BAD_DATA, "dark frames");
    session.plan.shots[0].target = ALB_TARGET_CAP;
    session.plan.shots[0].repeats = 6;
    check_fails(alb_noise_measure(&noise, &session, &error), &error, ALB_ACCESS, "dark_e0_r4");
    session.width = 64;
    check_fails(alb_noise_measure(&noise, &session, &error), &error, ALB_BAD_DATA, "160 x 120");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(photon_transfer),
        cmocka_unit_test(missing_frames_are_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
