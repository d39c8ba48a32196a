// What a machine and its user can do to a running program: devices and folders in the way, full disks, closed streams,
// a second capture, names that are not text, numbers that overflow.
#include "base/exr.h"
#include "program.h"

#include <sys/stat.h>
#include <unistd.h>

static const char scene_start[] =
    "{\"format\":1,\"camera\":{\"position_mm\":[9,7,30],\"look_at_mm\":[0,0,0],\"up\":[0,1,0],\"vertical_field_deg\":9,"
    "\"width\":8,\"height\":8},\"rays_per_patch\":";

static void save_scene(const char *path, int rays, const char *object, const char *light)
{
    char text[2048];
    snprintf(text, sizeof text,
             "%s%d,\"materials\":{\"wall\":{\"reflectance\":[0.5,0.5,0.5]}},\"objects\":[%s],\"lights\":[%s]}",
             scene_start, rays, object, light);
    save_text(path, text);
}

static const char point[] = "{\"kind\":\"point\",\"position_mm\":[1,2,9],\"flux\":[1,1,1]}";
static const char box[] =
    "{\"shape\":\"box\",\"size_mm\":[4,4,4],\"centre_mm\":[0,0,0],\"cells\":[2,2,2],\"material\":\"wall\"}";

static int make_inputs(void **state)
{
    (void)state;
    (void)shell("rm -rf hostile");
    alb_error error = {0};
    check_ok(alb_file_make_directory("hostile", &error), &error);
    save_text("hostile/profile.csv", "r_mm,value_per_mm2\n1,0.5\n2,0.25\n3,0.13\n4,0.06\n5,0.031\n6,0.016\n");
    save_scene("hostile/scene.json", 16, box, point);
    return 0;
}

static int remove_inputs(void **state)
{
    (void)state;
    forget_runs();
    return shell("rm -rf hostile");
}

static void check_run(const char *arguments, alb_status status, const char *part)
{
    const int code = run(arguments);
    const size_t size = strlen(complaint);
    if (code != (int)status || !size || strchr(complaint, '\n') != complaint + size - 1 || !strstr(complaint, part)) {
        print_error("alabaster %s\n  exit %d (expected %d, '%s'), said: %s\n", arguments, code, (int)status, part,
                    complaint);
        fail();
    }
}

// The picture before stays, and nothing that is not an ordinary file is ever replaced.
static void outputs_in_the_way(void **state)
{
    (void)state;
    assert_int_equal(mkfifo("hostile/pipe", 0600), 0);
    save_text("hostile/old.exr", "old");
    check_run("render hostile/scene.json -o hostile/pipe", ALB_ACCESS, "a device or pipe stands there");
    check_run("render hostile/scene.json -o hostile", ALB_ACCESS, "a folder stands there");
    check_run("render hostile/scene.json -o hostile/old.exr --png /nowhere/a.png", ALB_ACCESS, "/nowhere");
    check_run("render hostile/scene.json -o hostile/old.exr --mesh hostile/old.exr", ALB_USAGE, "two files");
    check_run("render hostile/scene.json -o hostile/scene.json", ALB_USAGE, "two files");
    check_run("render hostile/scene.json -o hostile/./scene.json", ALB_USAGE, "two files");
    check_run("render hostile/scene.json -o hostile/new.exr --mesh hostile/../hostile/new.exr", ALB_USAGE, "two files");
    struct stat status;
    assert_true(!stat("hostile/pipe", &status) && S_ISFIFO(status.st_mode));
    char *old = slurp("hostile/old.exr");
    assert_string_equal(old, "old");
    free(old);
}

static void inputs_that_never_end(void **state)
{
    (void)state;
    check_run("fit --table /dev/zero --side reflection -o hostile/f", ALB_ACCESS, "device");
    check_run("calibrate --photographs hostile --board 99999999999x6 --square-mm 5", ALB_USAGE, "99999999999");
    assert_int_equal(shell("mkdir hostile/boards"), 0);
    assert_int_equal(run("render hostile/scene.json -o hostile/boards/a.exr --png hostile/a.png"), 0);
    check_run("calibrate --photographs hostile/boards --board 9999x9999 --square-mm 5", ALB_BAD_DATA, "9999 x 9999");
}

// The end of a message is what was wrong, however long the path.
static void long_paths_keep_the_reason(void **state)
{
    (void)state;
    char arguments[6000];
    snprintf(arguments, sizeof arguments, "fit --table %0*d --side reflection -o hostile/f", 5000, 7);
    check_run(arguments, ALB_ACCESS, "File name too long");
}

static void closed_streams(void **state)
{
    (void)state;
    const char *const streams[] = {">&-", ">/dev/full", "<&- >&- 2>&-"};
    for (int i = 0; i < 3; i++) {
        const int status =
            shell("'%s' render hostile/scene.json -o hostile/closed.exr 2>/dev/null %s", ALB_PROGRAM, streams[i]);
        assert_int_equal(WEXITSTATUS(status), ALB_ACCESS);
        char *picture = slurp("hostile/closed.exr");
        assert_memory_equal(picture, "\x76\x2f\x31\x01", 4); // and not what should have been printed
        free(picture);
    }
}

// Files are as small as the shell allows: 512 bytes, less than a picture of 8 x 8.
static void files_that_cannot_grow(void **state)
{
    (void)state;
    save_text("hostile/full.exr", "old");
    const int status = shell("(trap '' XFSZ; ulimit -f 1; exec timeout 600 '%s' render hostile/scene.json -o "
                             "hostile/full.exr --mesh hostile/full.ply 2>/dev/null >/dev/null)",
                             ALB_PROGRAM);
    assert_int_equal(WEXITSTATUS(status), ALB_ACCESS);
    assert_int_equal(shell("ls hostile | grep -q tmp"), 256); // nothing left behind
}

static void names_that_are_not_text(void **state)
{
    (void)state;
    assert_int_equal(shell("cp hostile/profile.csv \"$(printf 'hostile/caf\\351.csv')\""), 0);
    assert_int_equal(
        shell("'%s' fit --table \"$(printf 'hostile/caf\\351.csv')\" --side reflection -o hostile/latin 2>/dev/null",
              ALB_PROGRAM) /
            256 % ALB_UNDECIDED,
        0);
    char *json = slurp("hostile/latin/material.json");
    assert_non_null(strstr(json, "caf\xef\xbf\xbd.csv"));
    assert_null(strstr(json, "\351"));
    free(json);
}

static void tables_at_their_ends(void **state)
{
    (void)state;
    save_text("hostile/mac.csv", "r_mm,value_per_mm2\r1,0.5\r2,0.25\r");
    save_text("hostile/huge.csv", "r_mm,value_per_mm2\n1,1e290\n2,1e289\n3,1e288\n");
    check_run("fit --table hostile/mac.csv --side reflection -o hostile/f", ALB_BAD_DATA, "CR alone");
    check_run("fit --table hostile/huge.csv --side reflection -o hostile/f", ALB_BAD_DATA, "huge.csv:2: column 2");
}

static void scenes_at_their_ends(void **state)
{
    (void)state;
    const char *const disc = "{\"kind\":\"projector\",\"centre_mm\":[0,0,0],\"direction\":[0,0,-1],\"pixel_mm\":1,"
                             "\"diameter_px\":1.2,\"flux\":[1,1,1]}";
    save_scene("hostile/disc.json", 16, box, disc);
    check_run("render hostile/disc.json -o hostile/x.exr", ALB_BAD_DATA, "1.2 pixels");
    save_scene("hostile/many.json", 65537, box, point);
    check_run("render hostile/many.json -o hostile/x.exr", ALB_BAD_DATA, "rays_per_patch");
    save_text("hostile/sliver.obj", "v 0 0 0\nv 1e7 0 0\nv 0 1e-2 0\nf 1 2 3\n");
    save_scene("hostile/sliver.json", 16, "{\"mesh\":\"sliver.obj\",\"material\":\"wall\",\"subdivide_mm\":1}", point);
    check_run("render hostile/sliver.json -o hostile/x.exr", ALB_BAD_DATA, "triangles");
    // one triangle whose first corner is the origin sees the light above it: no ray meets the patch it starts from
    save_text("hostile/one.obj", "v 0 0 0\nv 4 0 0\nv 0 4 0\nf 1 2 3\n");
    save_scene("hostile/one.json", 16, "{\"mesh\":\"one.obj\",\"material\":\"wall\"}", point);
    assert_int_equal(run("render hostile/one.json -o hostile/one.exr --json"), 0);
    assert_string_equal(complaint, "");
    assert_null(strstr(output, "\"in\": [0, 0, 0]"));
}

// A residual below what single precision holds is not reached: the picture is made, and what was reached is said.
static void residuals_below_rounding(void **state)
{
    (void)state;
    static const char *const asked[2] = {"1e-12", "1e-4"};
    for (int k = 0; k < 2; k++) {
        char text[1024];
        snprintf(text, sizeof text,
                 "%s16,\"residual\":%s,\"seed\":3,\"materials\":{\"wall\":{\"reflectance\":[0.97,0.9,0.8]}},"
                 "\"objects\":[{\"shape\":\"box\",\"size_mm\":[9,9,9],\"centre_mm\":[0,0,0],\"cells\":[6,6,6],"
                 "\"inward\":true,\"material\":\"wall\"}],\"lights\":[{\"kind\":\"point\",\"position_mm\":[1,2,3],"
                 "\"flux\":[1,1,1]}]}",
                 scene_start, asked[k]);
        save_text("hostile/residual.json", text);
        assert_int_equal(run("render hostile/residual.json -o hostile/x.exr --json"), 0);
        assert_true((strstr(complaint, "1e-12 asked for") != NULL) == (k == 0));
        assert_non_null(strstr(output, k ? "\"residual_reached\": true" : "\"residual_reached\": false"));
    }
}

// A fit's files change together or not at all: here the table fits on the disk and the page does not.
static void results_that_do_not_fit(void **state)
{
    (void)state;
    char table[4096] = "r_mm,value_per_mm2,sd_per_mm2\n";
    for (int i = 1; i < 40; i++)
        snprintf(table + strlen(table), sizeof table - strlen(table), "%g,%.9g,%.9g\n", 0.5 * i, 0.03 * exp(-0.5 * i),
                 3e-4 * exp(-0.5 * i));
    save_text("hostile/other.csv", table);
    assert_int_equal(run("fit --table hostile/profile.csv --side reflection -o hostile/whole --json") % ALB_UNDECIDED,
                     0);
    assert_int_equal(shell("cp -r hostile/whole hostile/before"), 0);
    const int status = shell("(trap '' XFSZ; ulimit -f 16; exec timeout 600 '%s' fit --table hostile/other.csv --side "
                             "reflection -o hostile/whole 2>/dev/null >/dev/null)",
                             ALB_PROGRAM);
    assert_int_equal(WEXITSTATUS(status), ALB_ACCESS);
    assert_int_equal(shell("diff -r hostile/before hostile/whole"), 0);
    assert_int_equal(run("fit --table hostile/other.csv --side reflection -o hostile/whole"), 0);
    assert_int_not_equal(shell("diff -rq hostile/before hostile/whole >/dev/null"), 0);
    assert_int_equal(shell("find hostile/whole | grep -q tmp"), 256);
}

// What stands in a comment of another program's file stays there, whatever a file is called.
static void exports_of_odd_names(void **state)
{
    (void)state;
    assert_int_equal(run("fit --table hostile/other.csv --side reflection -o hostile/odd"), 0);
    assert_int_equal(shell("cp hostile/odd/material.json \"$(printf 'hostile/a\\nimport os\\n--b.json')\""), 0);
    const char *const formats[] = {"cycles", "mitsuba"};
    for (int i = 0; i < 2; i++) {
        assert_int_equal(
            shell("'%s' export \"$(printf 'hostile/a\\nimport os\\n--b.json')\" --to %s -o hostile/odd.txt "
                  ">/dev/null",
                  ALB_PROGRAM, formats[i]),
            0);
        char *text = slurp("hostile/odd.txt");
        assert_non_null(strstr(text, "a_import os_-_b.json"));
        free(text);
    }
    char *before = slurp("hostile/odd/material.json");
    check_run("export hostile/odd/material.json --to csv -o hostile/odd/../odd/material.json", ALB_USAGE,
              "the material itself");
    char *after = slurp("hostile/odd/material.json");
    assert_string_equal(before, after);
    free(before);
    free(after);
}

static void materials_that_lie(void **state)
{
    (void)state;
    static const char part[] = "{\"format\":1,\"name\":\"wax\",\"channels\":{\"%s\":{%s}}}",
                      side[] =
                          "\"reflection\":{\"form\":\"exponential\",\"identifiable\":true,\"parameters\":{"
                          "\"amplitude_1_per_mm2\":{\"value\":0.1,\"sd\":1},\"decay_1_per_mm\":{\"value\":1,\"sd\":1}},"
                          "\"covariance\":[%s],\"total\":{\"value\":0.62831853071795862,\"sd\":1},\"chi_square\":1,"
                          "\"degrees_of_freedom\":1}";
    static const struct {
        const char *channel, *covariance, *said;
    } cases[] = {{"Y", "[-1,0],[0,1]", "do not make a covariance"},
                 {"Y", "[1,2],[2,1]", "do not make a covariance"},
                 {"Y", "[1,0.5],[-0.5,1]", "do not make a covariance"},
                 {"a\\nb", "[1,0],[0,1]", "a channel's name"},
                 {"--", "[1,0],[0,1]", "a channel's name"},
                 {"Y", "", "no profile"}};
    for (int i = 0; i < 6; i++) {
        char content[1024] = "", text[2048];
        if (*cases[i].covariance)
            snprintf(content, sizeof content, side, cases[i].covariance);
        snprintf(text, sizeof text, part, cases[i].channel, content);
        save_text("hostile/lie.json", text);
        check_run("export hostile/lie.json --to csv -o hostile/x.csv", ALB_BAD_DATA, cases[i].said);
    }
}

// A picture of 64 x 64: a spot at (centre, centre), or a line, and beside it the variance that it is said to have.
static void save_lit(const char *path, bool line, double centre, double decay, float variance)
{
    alb_error error = {0};
    alb_image image = {0};
    check_ok(alb_image_create(&image, 64, 64, "Y,variance.Y", &error), &error);
    for (int y = 0; y < 64; y++)
        for (int x = 0; x < 64; x++) {
            float *pixel = alb_image_at(&image, x, y);
            pixel[0] = (float)exp(-decay * (line ? abs(x - 32) : hypot(x - centre, y - centre)));
            pixel[1] = variance;
        }
    check_ok(alb_exr_write(&image, NULL, path, &error), &error);
    alb_image_free(&image);
}

static void pictures_that_lie(void **state)
{
    (void)state;
    static const float variances[] = {-1, NAN, INFINITY};
    for (int i = 0; i < 3; i++) {
        save_lit("hostile/lie.exr", false, 32, 0.5, variances[i]);
        check_run("fit --image hostile/lie.exr --mm-per-pixel 0.5 -o hostile/f", ALB_BAD_DATA, "no pixel holds");
    }
    save_lit("hostile/line.exr", true, 32, 0.5, 1e-8F);
    assert_int_equal(run("fit --image hostile/line.exr --mm-per-pixel 0.5 -o hostile/f"), ALB_UNDECIDED);
    assert_non_null(strstr(complaint, "the data do not decide"));
}

// Nine tenths of the light beyond the border: what the rings hold is not whole.
static void spot_in_a_corner(void **state)
{
    (void)state;
    static const double centres[] = {0, 1, 3};
    for (int i = 0; i < 3; i++) {
        save_lit("hostile/corner.exr", false, centres[i], 0.1, 1e-6F);
        assert_int_equal(run("fit --image hostile/corner.exr --mm-per-pixel 0.5 -o hostile/f"), ALB_UNDECIDED);
        assert_non_null(strstr(complaint, "of its light lies beyond: bring the spot to the middle"));
    }
}

// The peak alone is above the noise, so any decay will do: no sd at all, which is not an sd of 0.
static void undecided_total(void **state)
{
    (void)state;
    save_text("hostile/peak.csv", "r_mm,value_per_mm2,sd_per_mm2\n1,1,1e-4\n2,0,1e-4\n3,0,1e-4\n4,0,1e-4\n5,0,1e-4\n");
    assert_int_equal(run("fit --table hostile/peak.csv --side reflection -o hostile/f"), ALB_UNDECIDED);
    assert_int_equal(shell("'%s' fit --table hostile/peak.csv --side reflection -o hostile/f 2>/dev/null | grep -q "
                           "'total .*undecided'",
                           ALB_PROGRAM),
                     0);
    assert_int_equal(shell("grep -q '(undecided)' hostile/f/report/fit.html && ! grep -q '± 0[|<]' "
                           "hostile/f/report/fit.html"),
                     0);
    assert_int_equal(shell("tr -d '\\n ' < hostile/f/material.json | grep -q "
                           "'\"total\":{\"value\":[^,]*,\"sd\":null,.*\"identifiable\":false,\"because\":\"the'"),
                     0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(outputs_in_the_way),         cmocka_unit_test(inputs_that_never_end),
        cmocka_unit_test(long_paths_keep_the_reason), cmocka_unit_test(closed_streams),
        cmocka_unit_test(files_that_cannot_grow),     cmocka_unit_test(names_that_are_not_text),
        cmocka_unit_test(tables_at_their_ends),       cmocka_unit_test(scenes_at_their_ends),
        cmocka_unit_test(results_that_do_not_fit),    cmocka_unit_test(exports_of_odd_names),
        cmocka_unit_test(materials_that_lie),         cmocka_unit_test(pictures_that_lie),
        cmocka_unit_test(spot_in_a_corner),           cmocka_unit_test(undecided_total),
        cmocka_unit_test(residuals_below_rounding),
    };
    return cmocka_run_group_tests(tests, make_inputs, remove_inputs);
}
