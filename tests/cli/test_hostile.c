// What a machine and its user can do to a running program: devices and folders in the way, full disks, closed streams,
// a second capture, names that are not text, numbers that overflow.
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
    const int status = shell("(trap '' XFSZ; ulimit -f 1; exec timeout 60 '%s' render hostile/scene.json -o "
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
    save_scene(
        "hostile/many.json", 65536,
        "{\"shape\":\"box\",\"size_mm\":[4,4,4],\"centre_mm\":[0,0,0],\"cells\":[60,60,2],\"material\":\"wall\"}",
        point);
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(outputs_in_the_way),         cmocka_unit_test(inputs_that_never_end),
        cmocka_unit_test(long_paths_keep_the_reason), cmocka_unit_test(closed_streams),
        cmocka_unit_test(files_that_cannot_grow),     cmocka_unit_test(names_that_are_not_text),
        cmocka_unit_test(tables_at_their_ends),       cmocka_unit_test(scenes_at_their_ends),
    };
    return cmocka_run_group_tests(tests, make_inputs, remove_inputs);
}
