// What goes wrong in pictures: glints, oblique cameras and light, edges, curved samples. The photons are those of
// capture/photon.c (glow.h), or of the walk below where the slab or the beam is not the one they know.
#include "base/exr.h"
#include "fit/centre.h"
#include "fit/exit_angle.h"
#include "fit/photo.h"
#include "fit/product.h"
#include "fit/source.h"
#include "glow.h"
#include <unistd.h>

static glow_picture *picture;
static glow *light;

static int set_up(void **state)
{
    static char folder[] = "/tmp/alabaster_pixels_XXXXXX";
    picture = calloc(1, sizeof *picture);
    light = calloc(1, sizeof *light);
    *state = mkdtemp(folder);
    return !picture || !light || !*state || chdir(folder) != 0;
}

static int tear_down(void **state)
{
    alb_face_free(&picture->face);
    free(picture);
    free(light);
    remove("curved.exr");
    return chdir("/") != 0 || rmdir(*state) != 0;
}

// Relative difference of the rings beyond `from_px` from the clean light, means of five rings: the worst.
static double ring_bias(const alb_readings *readings, double pitch, double from_px)
{
    double worst = 0, sum = 0;
    int count = 0;
    for (int i = 0; i < readings->count; i++) {
        double truth = 0;
        for (int s = 0; s < ALB_RING_SAMPLES; s++)
            truth += readings->sample_share[i][s] * glow_at(light->lit, readings->sample_r_mm[i][s]);
        if (readings->r_mm[i] <= from_px * pitch || readings->r_mm[i] > 5)
            continue;
        sum += readings->value[i] / truth - 1;
        if (++count % 5 == 0) {
            worst = fmax(worst, fabs(sum / 5));
            sum = 0;
        }
    }
    return worst;
}

typedef enum disturbance { CLEAN, GLINTS, DUST, SECTOR } disturbance;

// Changes `share` of the pixels: spread glints and dust of 2 x 2 pixels, or a one-sided sector.
static void disturb(disturbance kind, double share, double x_mm, double y_mm)
{
    for (int i = 0; i < GLOW_SIZE * GLOW_SIZE; i++) {
        const int u = i % GLOW_SIZE, v = i / GLOW_SIZE;
        alb_random random = alb_random_at(41, (unsigned)kind, (unsigned)(v / 2 * GLOW_SIZE + u / 2));
        const double dx = picture->face.x_mm[i] - x_mm, dy = picture->face.y_mm[i] - y_mm,
                     draw = alb_random_uniform(&random);
        const double r = hypot(dx, dy), turn = atan2(dy, dx) / (2 * glow_pi) + 0.5;
        if (r < 0.4)
            continue;
        if (kind == SECTOR ? turn < share : draw < share)
            picture->value[i] *= kind == GLINTS ? 2 + 5 * alb_random_uniform(&random) : kind == DUST ? 0.5 : 0.7;
    }
}

static void glints_dust_veins(void **state)
{
    (void)state;
    static const double shares[] = {0.01, 0.05, 0.1};
    static const char *const names[] = {"clean", "glints", "dust", "sector"};
    const double pitch = 0.08, x = 8.03, y = 7.97;
    glow_make(light, 0, (glow_spot){false, 0.25});
    glow_paint(picture, light, pitch, x, y);
    for (int kind = CLEAN; kind <= SECTOR; kind++)
        for (int s = 0; s < (kind == CLEAN ? 1 : 3); s++) {
            alb_error error = {0};
            alb_readings readings = {0};
            glow_expose(picture, 0.01, 7);
            disturb((disturbance)kind, kind == CLEAN ? 0 : shares[s], x, y);
            const alb_channel channel = glow_channel(picture);
            check_ok(alb_observe(&readings, &channel, &error), &error);
            const double left_out = (double)readings.glints / (double)(readings.glints + readings.pixels),
                         centre = hypot(readings.x_mm - x, readings.y_mm - y) / pitch,
                         bias = ring_bias(&readings, pitch, 5);
            print_message("%-6s %2.0f %%: rings %.2f %% off, centre %.3f px, %.2f %% of the pixels left out\n",
                          names[kind], kind == CLEAN ? 0 : 100 * shares[s], 100 * bias, centre, 100 * left_out);
            check_below(bias, 0.005); // five rings of 30 pixels or more, 1.5 % noisy each: 0.1 %
            check_below(centre, 0.05);
            check_below(left_out, kind == CLEAN ? 0.002 : 1);
            assert_true(kind == CLEAN || left_out > 0.5 * shares[s]);
            alb_readings_free(&readings);
        }
}

// A camera 0 to 65 degrees off the normal of a smooth face, whose light leaves as the photons did.
static void oblique_camera(void **state)
{
    (void)state;
    static const double tilts_deg[] = {0, 45, 65};
    static alb_photon_tally tally;
    alb_error error = {0};
    alb_lobe lobe;
    check_ok(alb_photon_trace(&tally, &glow_marble, glow_end_mm, 2000000, 12, 0, &error), &error);
    alb_lobe_from_photons(&lobe, &tally, 0);
    glow_make(light, 0, (glow_spot){false, 0.5});
    alb_calibration *calibration = calloc(1, sizeof *calibration);
    calibration->refractive_index = glow_marble.refractive_index;
    for (int t = 0; t < 3; t++) {
        const double tilt = tilts_deg[t] * glow_pi / 180;
        const alb_camera camera =
            alb_camera_look_at((alb_vector){0, -150 * sin(tilt), 150 * cos(tilt)}, (alb_vector){0, 0, 0},
                               (alb_vector){0, 1, 0}, 6, GLOW_SIZE, GLOW_SIZE);
        double *factor = NULL, corrected = 0, plain = 0;
        int count = 0;
        alb_text notes = {0};
        alb_readings readings = {0};
        alb_face_free(&picture->face);
        check_ok(alb_face_seen(&picture->face, &camera, &error), &error);
        check_ok(alb_exitance_factor(&factor, &notes, calibration, ALB_REFLECTION, &picture->face, &error), &error);
        for (int i = 0; i < GLOW_SIZE * GLOW_SIZE; i++) {
            double x, y, sum = 0;
            for (int k = 0; k < 9; k++) {
                alb_camera_on_plane(&x, &y, NULL, &camera, 0, i % GLOW_SIZE + (k % 3 - 1) / 3.0,
                                    i / GLOW_SIZE + (k / 3 - 1) / 3.0);
                sum += glow_at(light->lit, hypot(x, y)) / 9;
            }
            picture->clean[i] = sum * alb_lobe_value(&lobe, picture->face.cosine[i]) / glow_pi;
        }
        glow_expose(picture, 0.005, 9);
        for (int i = 0; i < GLOW_SIZE * GLOW_SIZE; i++)
            picture->value[i] *= factor[i], picture->variance[i] *= factor[i] * factor[i];
        const alb_channel channel = glow_channel(picture);
        check_ok(alb_observe(&readings, &channel, &error), &error);
        for (int i = 0; i < readings.count; i++)
            if (readings.r_mm[i] > 1 && readings.r_mm[i] < 5) {
                const double ratio = readings.value[i] / glow_at(light->lit, readings.r_mm[i]);
                corrected += ratio - 1, count++;
                plain += ratio * alb_lobe_value(&lobe, cos(tilt)) - 1;
            }
        print_message("camera %2.0f degrees off: exitance %+.2f %%; by Lambert's law %+.1f %%\n", tilts_deg[t],
                      100 * corrected / count, 100 * plain / count);
        check_near(corrected / count, 0, 2 * ALB_EXIT_RELATIVE_SD);
        assert_non_null(strstr(notes.bytes, "degrees off the normal of a smooth face"));
        alb_readings_free(&readings);
        alb_text_free(&notes);
        free(factor);
    }
    free(calibration);
}

// A block of n = 1 and isotropic scattering, 1 mean free path = 1 mm, albedo 0.99, lit aslant: where photons leave the
// front. The walls x = +-half_mm let them go too, unseen.
static void walk(double *out, int size, double pitch, double tilt_deg, double thickness_mm, double half_mm,
                 long photons)
{
    const double sine = sin(tilt_deg * glow_pi / 180);
    memset(out, 0, (size_t)(size * size) * sizeof *out);
    for (long n = 0; n < photons; n++) {
        alb_random random = alb_random_at(51, (uint64_t)(tilt_deg * 10 + half_mm), (uint64_t)n);
        // a disc of light of radius 0.5 mm across the beam
        const double s = 0.5 * sqrt(alb_random_uniform(&random)), phi = 2 * glow_pi * alb_random_uniform(&random);
        double x = s * cos(phi) / sqrt(1 - sine * sine), y = s * sin(phi), z = 0, ux = sine, uy = 0,
               uz = sqrt(1 - sine * sine), weight = 1;
        for (;;) {
            const double step = -log(1 - alb_random_uniform(&random));
            x += ux * step, y += uy * step, z += uz * step;
            if (z <= 0) {
                const double back = z / uz;
                const int u = (int)lround((x - ux * back) / pitch + size / 2),
                          v = (int)lround((y - uy * back) / pitch + size / 2);
                if (fabs(x - ux * back) < half_mm && u >= 0 && v >= 0 && u < size && v < size)
                    out[v * size + u] += weight / ((double)photons * pitch * pitch);
                break;
            }
            weight *= 0.99;
            if (z > thickness_mm || fabs(x) > half_mm || weight < 1e-3)
                break;
            uz = 2 * alb_random_uniform(&random) - 1;
            const double angle = 2 * glow_pi * alb_random_uniform(&random), across = sqrt(1 - uz * uz);
            ux = across * cos(angle), uy = across * sin(angle);
        }
    }
}

enum { WALK_SIZE = 120 };

static void observe_walk(alb_readings *readings, double *total, double tilt_deg, double half_mm, double pitch)
{
    static double value[WALK_SIZE * WALK_SIZE], variance[WALK_SIZE * WALK_SIZE];
    alb_error error = {0};
    alb_face face = {0};
    const double each = 1.0 / (300000 * pitch * pitch); // a photon of weight 1 in a pixel
    walk(value, WALK_SIZE, pitch, tilt_deg, 10, half_mm, 300000);
    check_ok(alb_face_flat(&face, WALK_SIZE, WALK_SIZE, pitch, &error), &error);
    *total = 0;
    for (int i = 0; i < WALK_SIZE * WALK_SIZE; i++) {
        *total += value[i] * pitch * pitch;
        variance[i] = each * (value[i] + each);
    }
    const alb_channel channel = {&face, value, variance, "walk"};
    check_ok(alb_observe(readings, &channel, &error), &error);
    alb_face_free(&face);
}

static void oblique_spot(void **state)
{
    (void)state;
    static const double tilts_deg[] = {0, 15, 30, 45, 60};
    const double pitch = 0.2;
    for (int t = 0; t < 5; t++) {
        alb_readings readings = {0};
        double total;
        observe_walk(&readings, &total, tilts_deg[t], 1e9, pitch);
        const alb_anisotropy *a = readings.anisotropy;
        print_message(
            "light %2.0f degrees aslant: centre %+.2f mm; once around %.1f %% (chance %.1g), twice %.1f %% (%.1g)\n",
            tilts_deg[t], readings.x_mm - pitch * WALK_SIZE / 2, 100 * a[0].most, a[0].chance, 100 * a[1].most,
            a[1].chance);
        if (t == 0)
            assert_true(a[0].chance > 1e-3 && a[1].chance > 1e-3);
        if (t >= 2)
            assert_true(a[0].chance < 1e-3 && a[0].most > 0.01);
        alb_readings_free(&readings);
    }
}

// Walls 2, 4 and 8 mm from the spot: what the fitted form says of the light beyond them, against what the walk lost.
static void finite_slab(void **state)
{
    (void)state;
    static const double half_mm[] = {2, 4, 8};
    const double pitch = 0.2;
    double whole;
    alb_readings unbounded = {0};
    observe_walk(&unbounded, &whole, 0, 1e9, pitch);
    alb_readings_free(&unbounded);
    for (int h = 0; h < 3; h++) {
        alb_error error = {0};
        alb_text notes = {0};
        alb_spot spot = {0};
        alb_fitting *fitting = calloc(1, sizeof *fitting);
        alb_measurement *one = &fitting->sides[0][0];
        double total;
        fitting->material.channels = 1;
        snprintf(fitting->material.channel_names[0], sizeof fitting->material.channel_names[0], "Y");
        observe_walk(&one->readings, &total, 0, half_mm[h], pitch);
        one->readings.complete_mm = half_mm[h]; // the image ends where the sample does
        check_ok(alb_spot_disc(&spot, 0.5, &error), &error);
        check_ok(alb_spot_see(&spot, pitch, &error), &error);
        check_ok(alb_operator_create(&one->forward, &one->readings, &spot, &error), &error);
        check_ok(alb_fitting_run(fitting, &error), &error);
        alb_photo_note_border(&notes, fitting);
        const double beyond =
            1 - 2 * glow_pi * alb_profile_disc(&one->outcome.fitted.profile, half_mm[h]) / one->outcome.fitted.total;
        print_message("walls at %.0f mm: %.2f %% of the light lost; fitted beyond the nearest wall: %.2f %%\n",
                      half_mm[h], 100 * (1 - total / whole), 100 * beyond);
        assert_non_null(strstr(notes.bytes, "the border of the image is"));
        // it is the order that counts: a fit of what the walls have changed
        check_below(beyond, 4 * (1 - total / whole) + 0.01);
        check_below((1 - total / whole) / 6, beyond + 0.005);
        alb_text_free(&notes);
        alb_spot_free(&spot);
        alb_fitting_free(fitting);
        free(fitting);
    }
}

// A ball of radius 5, 10 and 20 mean free paths whose light follows the straight distance: fitted by chord, by arc,
// flat.
static void curved_sample(void **state)
{
    (void)state;
    static const double radii_free_paths[] = {5, 10, 20};
    glow_make(light, 0, (glow_spot){false, 0.25});
    for (int k = 0; k < 3; k++) {
        alb_error error = {0};
        alb_image image = {0};
        const double radius = radii_free_paths[k] * glow_free_path_mm, pitch = radius / 95;
        double slope[3];
        check_ok(alb_image_create(&image, GLOW_SIZE, GLOW_SIZE, "Y", &error), &error);
        for (int i = 0; i < GLOW_SIZE * GLOW_SIZE; i++) {
            const double aside = hypot(i % GLOW_SIZE - 100.2, i / GLOW_SIZE - 99.7) * pitch,
                         drop = aside < radius ? radius - sqrt(radius * radius - aside * aside) : 0;
            alb_random random = alb_random_at(61, 0, (unsigned)i);
            const double value = aside < radius ? glow_at(light->lit, sqrt(aside * aside + drop * drop)) : 0;
            alb_image_at(&image, i % GLOW_SIZE, i / GLOW_SIZE)[0] =
                (float)(value * (1 + 0.01 * alb_random_normal(&random)) + 1e-6 * alb_random_normal(&random));
        }
        check_ok(alb_exr_write(&image, NULL, "curved.exr", &error), &error);
        alb_image_free(&image);
        for (int way = 0; way < 3; way++) {
            alb_provenance provenance = {.command = "fit"};
            alb_text notes = {0};
            alb_fitting *fitting = calloc(1, sizeof *fitting);
            const char *const paths[ALB_SIDES] = {"curved.exr", NULL};
            const alb_image_setting setting = {.mm_per_pixel = pitch,
                                               .spot_radius_mm = 0.25,
                                               .curvature_radius_mm = way < 2 ? radius : 0,
                                               .distance = way == 1 ? ALB_DISTANCE_ARC : ALB_DISTANCE_CHORD};
            check_ok(alb_fitting_from_images(fitting, &provenance, &notes, paths, &setting, &error), &error);
            const alb_measurement *one = &fitting->sides[0][0];
            slope[way] = 0;
            for (int i = 0, n = 0; i < one->readings.count; i++)
                if (one->readings.r_mm[i] > 0.8 * radius && one->readings.r_mm[i] < radius)
                    slope[way] +=
                        (one->readings.value[i] / glow_at(light->lit, one->readings.r_mm[i]) - 1 - slope[way]) / ++n;
            assert_true(way == 2 || strstr(notes.bytes, way ? "by chord" : "by arc"));
            alb_text_free(&notes);
            alb_fitting_free(fitting);
            free(fitting);
        }
        print_message(
            "ball of %2.0f mean free paths, readings near its radius: chord %+.2f %%, arc %+.1f %%, flat %+.1f %%\n",
            radii_free_paths[k], 100 * slope[0], 100 * slope[1], 100 * slope[2]);
        check_near(slope[0], 0, 0.01);
        assert_true(fabs(slope[1]) > 0.01 && fabs(slope[2]) > 0.01); // the choice matters there
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(glints_dust_veins), cmocka_unit_test(oblique_camera),
                                       cmocka_unit_test(oblique_spot), cmocka_unit_test(finite_slab),
                                       cmocka_unit_test(curved_sample)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
