// A grid of spots through the chain: captured, calibrated, fitted spot by spot.
#include "base/exr.h"
#include "chain.h"
#include "fit/material.h"

enum { COLUMNS = 3, ROWS = 2, SPOTS = COLUMNS * ROWS };

// The chain's plan with a grid in place of the spot.
static void save_grid_plan(const char *path)
{
    static const char spot[] = "{\"kind\": \"spot\", \"diameter_px\": 4}";
    alb_text text = {0};
    alb_error error = {0};
    for (const char *at = chain_plan; *at;) {
        const char *found = strstr(at, spot), *end = found ? found : at + strlen(at);
        alb_text_add_bytes(&text, at, (size_t)(end - at));
        if (found)
            alb_text_add(&text,
                         "{\"kind\": \"grid\", \"diameter_px\": 4, \"columns\": %d, \"rows\": %d, \"pitch_px\": 42}",
                         COLUMNS, ROWS);
        at = end + (found ? sizeof spot - 1 : 0);
    }
    check_ok(alb_file_write_text(path, &text, &error), &error);
    alb_text_free(&text);
}

static const char other_profile[] =
    "\"profile\": {\"reflection\": {\"amplitude_per_mm2\": [[0.011, 0.066], [0.0132, 0.055], [0.0165, 0.044]],\n"
    "  \"decay_per_mm\": [[0.4, 1.5], [0.45, 1.6], [0.55, 1.8]]}, \"transmission\": {\"amplitude_per_mm2\":\n"
    "  [[0.02, -0.016], [0.018, -0.014], [0.016, -0.012]], \"decay_per_mm\": [[0.6, 1.4], [0.65, 1.5], [0.7, 1.6]]}}";

static int make_sessions(void **state)
{
    (void)state;
    (void)shell("rm -rf map_a map_b map_step");
    save_grid_plan("map_plan.json");
    save_chain_truth("map_a.json", chain_profile, 15);
    save_chain_truth("map_b.json", other_profile, 15);
    assert_int_equal(run("capture map_plan.json -o map_a --rig virtual:map_a.json"), 0);
    assert_int_equal(run("capture map_plan.json -o map_b --rig virtual:map_b.json"), 0);
    assert_int_equal(run("calibrate map_a"), 0);
    assert_int_equal(run("calibrate map_b"), 0);
    return 0;
}

static int remove_sessions(void **state)
{
    (void)state;
    forget_runs();
    return shell("rm -rf map_a map_b map_step map_plan.json map_a.json map_b.json");
}

static alb_image read_map(const char *path)
{
    alb_error error = {0};
    alb_image image = {0};
    check_ok(alb_exr_read(&image, path, &error), &error);
    assert_int_equal(image.width, COLUMNS);
    assert_int_equal(image.height, ROWS);
    return image;
}

static double value_of(const alb_image *image, int x, int y, const char *channel)
{
    const int c = alb_image_channel(image, channel);
    assert_true(c >= 0);
    return (double)alb_image_at(image, x, y)[c];
}

// The mean is the truth, the spots are alike, and the maps hold them.
static void one_material(void **state)
{
    (void)state;
    static const double totals[3] = {0.5602506899, 0.4950553701, 0.3891330968}; // 2 pi (a1/b1^2 + a2/b2^2)
    assert_int_equal(run("fit map_a"), 0);
    assert_non_null(strstr(output, "the sample is alike everywhere"));
    alb_error error = {0};
    alb_material material;
    check_ok(alb_material_read(&material, "map_a/material.json", &error), &error);
    for (int c = 0; c < 3; c++) {
        const alb_fitted *fitted = &material.fitted[ALB_REFLECTION][c];
        // 2e-3: what the light of neighbours is known to
        check_near(fitted->total, totals[c], 3.5 * fitted->total_sd + 2e-3 * totals[c]);
        assert_int_equal(fitted->profile.form, ALB_FORM_TWO_EXPONENTIALS);
    }
    alb_image map = read_map("map_a/map/reflection.exr");
    for (int y = 0; y < ROWS; y++)
        for (int x = 0; x < COLUMNS; x++) {
            const double sd = value_of(&map, x, y, "total_sd.G");
            assert_true(sd > 0 && sd < 0.02 * totals[1]);
            check_near(value_of(&map, x, y, "total.G"), totals[1], 5 * sd);
            assert_true(value_of(&map, x, y, "half_light_mm.G") > 2);
        }
    alb_image_free(&map);
    map = read_map("map_a/map/transmission_B.exr");
    assert_int_equal(map.channels, 8); // four parameters and their sd
    alb_image_free(&map);
    assert_true(alb_file_exists("map_a/map.json") && alb_file_exists("map_a/report/map.html"));
}

// A product whose columns left of the split are those of the other session.
static void join(const char *product, int split)
{
    char path[128];
    alb_error error = {0};
    alb_image left = {0}, right = {0};
    snprintf(path, sizeof path, "map_b/calibration/%s.exr", product);
    check_ok(alb_exr_read(&left, path, &error), &error);
    snprintf(path, sizeof path, "map_step/calibration/%s.exr", product);
    check_ok(alb_exr_read(&right, path, &error), &error);
    for (int y = 0; y < left.height; y++)
        memcpy(alb_image_at(&right, 0, y), alb_image_at(&left, 0, y),
               (size_t)split * (size_t)left.channels * sizeof(float));
    check_ok(alb_exr_write(&right, NULL, path, &error), &error);
    alb_image_free(&left);
    alb_image_free(&right);
}

// The first column of spots is of a material that reflects a tenth more: the map says so, and where.
static void heterogeneous(void **state)
{
    (void)state;
    assert_int_equal(shell("cp -r map_a map_step"), 0);
    join("r", 88); // 240 pixels are 48 mm: half way between the columns at -12.6 and 0 mm
    assert_int_equal(run("fit map_step"), 0);
    assert_non_null(strstr(output, "NOT ALIKE"));
    alb_image map = read_map("map_step/map/reflection.exr");
    for (int y = 0; y < ROWS; y++)
        for (int x = 0; x < COLUMNS; x++) {
            const double expected = (x == 0 ? 1.1 : 1) * 0.4950553701;
            // half of the way between the two materials tells them apart
            check_near(value_of(&map, x, y, "total.G"), expected, 0.05 * 0.4950553701);
        }
    alb_image_free(&map);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(one_material), cmocka_unit_test(heterogeneous)};
    return cmocka_run_group_tests_name("map", tests, make_sessions, remove_sessions);
}
