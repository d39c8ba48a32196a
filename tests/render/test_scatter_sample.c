// Sources that light is sampled from, against the products with S'.
#include "room_with_ball.h"

enum { SAMPLES = 256 };

// Of light that varies smoothly over a body, the mean over the samples of a patch is what S' sends out there, over the
// row sum; each channel by its own profile. An opaque patch has its own light alone.
static void samples_say_what_scattering_sends(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene scene;
    alb_solution s;
    begin(&scene, 2, 16, 1e-3);
    room_with_ball(&scene, 4);
    scene.light_count = 1;
    scene.surfaces[0] = diffuse(0.5, 0.6, 0.8), scene.surfaces[1] = wax(0.8, 0.3);
    for (int c = 0; c < 3; c++) { // 2 pi a / b^2 = 0.8
        const double rate_per_mm = 0.1 * (1 << c);
        scene.surfaces[1].profiles[0][c] =
            (alb_profile){ALB_FORM_EXPONENTIAL, {0.8 * rate_per_mm * rate_per_mm / (2 * M_PI), rate_per_mm}};
    }
    check_ok(alb_solution_create(&s, &scene, &error), &error);
    const size_t n = s.patches.count;
    alb_rgb *light = calloc(n, sizeof *light), *sent = calloc(n, sizeof *sent);
    uint32_t *first = calloc(n + 1, sizeof *first), *sources = calloc(n * SAMPLES, sizeof *sources);
    for (size_t p = 0; p < n; p++) {
        first[p + 1] = (uint32_t)(p + 1) * SAMPLES;
        const alb_vector at = s.patches.centroids[p];
        for (int c = 0; c < 3; c++)
            light[p][c] = 2 + sin(0.2 * at.x + c) * cos(0.15 * at.y) + 0.02 * at.z;
    }
    alb_scatter_apply(sent, &s.scatter, (const alb_rgb *)light);
    for (int c = 0; c < 3; c++) {
        check_ok(alb_scatter_sample(sources, &s.scatter, first, c, &error), &error);
        double off = 0, spread = 0;
        size_t count = 0;
        for (size_t p = 0; p < n; p++) {
            double mean = 0;
            for (int q = 0; q < SAMPLES; q++)
                mean += light[sources[p * SAMPLES + (size_t)q]][c] / SAMPLES;
            const double expected = sent[p][c] / s.scatter.row_sums[p][c];
            if (scene.mesh.groups[p] == 0) {
                check_relative(mean, light[p][c], 1e-12);
                continue;
            }
            off += pow(mean - expected, 2), spread += pow(light[p][c] - expected, 2), count++;
        }
        // 256 even steps through some hundred clusters, each drawn from as one point: a share of the clusters' size
        check_below(sqrt(off / (double)count), 0.01);
        assert_true(off < 0.01 * spread); // and far better than as if light stayed where it falls
    }
    free(light);
    free(sent);
    free(first);
    free(sources);
    alb_solution_free(&s);
    alb_scene_free(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(samples_say_what_scattering_sends)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
