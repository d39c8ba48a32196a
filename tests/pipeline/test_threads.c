// Same input, same bytes: the whole chain with one thread and with two, into two folders, compared file by file.
#include "chain.h"

static const char scene[] =
    "{\"format\": 1, \"objects\": [{\"shape\": \"box\", \"size_mm\": [40, 40, 6], \"centre_mm\": [0, 0, -3],\n"
    "  \"cells\": [12, 12, 2], \"grading\": 8, \"material\": \"slab\"}],\n"
    " \"materials\": {\"slab\": {\"measured\": \"session/material.json\", \"path\": \"slab\"}},\n"
    " \"lights\": [{\"kind\": \"projector\", \"centre_mm\": [0, 0, 0], \"direction\": [0, 0, -1], \"pixel_mm\": 0.3,\n"
    "   \"diameter_px\": 4, \"blur_sd_mm\": 0.15, \"flux\": [1, 1, 1]},\n"
    "  {\"kind\": \"point\", \"position_mm\": [10, 5, 40], \"flux\": [1, 1, 1]},\n"
    "  {\"kind\": \"environment\", \"radiance\": [0.1, 0.1, 0.1]}],\n"
    " \"camera\": {\"calibration\": \"session\", \"side\": \"reflection\"}, \"rays_per_patch\": 64}\n";

// Everything the chain makes, in `folder`; a fit that the data do not decide (exit code 5) is as good here.
static void make(const char *folder, const char *slab, int threads)
{
    alb_error error = {0};
    char path[64];
    check_ok(alb_file_make_directory(folder, &error), &error);
    snprintf(path, sizeof path, "%s/plan.json", folder);
    save_text(path, chain_plan);
    if (slab == chain_medium)
        assert_int_equal(shell("sed -i s/ground/smooth/ %s/plan.json", folder), 0);
    snprintf(path, sizeof path, "%s/truth.json", folder);
    save_chain_truth(path, slab, 15);
    snprintf(path, sizeof path, "%s/scene.json", folder);
    save_text(path, scene);
    static const char *const commands[] = {
        "capture plan.json -o session --rig virtual:truth.json", "calibrate session", "fit session",
        "render scene.json -o picture.exr --mesh mesh.ply",
        "compare session/calibration/r.exr picture.exr session/material.json session/truth.json -o report"};
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++) {
        const int status = shell("cd %s && OMP_NUM_THREADS=%d '%s' %s >out%zu.txt 2>err%zu.txt", folder, threads,
                                 ALB_PROGRAM, commands[i], i, i);
        const int code = WEXITSTATUS(status);
        if (!WIFEXITED(status) || (code && !(i == 2 && code == ALB_UNDECIDED))) {
            print_error("%s, %d threads: %s: status %d\n", folder, threads, commands[i], status);
            fail();
        }
    }
}

static void check_same(const char *slab)
{
    assert_int_equal(shell("rm -rf threads1 threads2"), 0);
    make("threads1", slab, 1);
    make("threads2", slab, 2);
    // render says how many seconds it took
    assert_int_equal(shell("rm threads1/out3.txt threads2/out3.txt && diff -r threads1 threads2"), 0);
    assert_true(alb_file_exists("threads2/report/index.html") && alb_file_exists("threads2/mesh.ply"));
    assert_int_equal(shell("rm -rf threads1 threads2"), 0);
}

static void stated_profile(void **state)
{
    (void)state;
    check_same(chain_profile);
}

static void scattered_photons(void **state)
{
    (void)state;
    check_same(chain_medium); // and the directions that they leave in
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(stated_profile), cmocka_unit_test(scattered_photons)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
