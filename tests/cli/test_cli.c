// The real program on hostile command lines and inputs: the right exit code, one line on stderr that names the trouble,
// no crash, and whatever an earlier run left behind stays as it was, byte for byte.
#include "base/exr.h"
#include "base/file.h"
#include "program.h"

#include <dirent.h>
#include <sys/stat.h>
#include <unistd.h>

typedef enum look { FLAT, SPOT, ALL_NAN, CLIPPED, SOME_NAN } look;

static alb_image picture(look kind, int size)
{
    alb_error error = {0};
    alb_image image = {0};
    check_ok(alb_image_create(&image, size, size, "R,G,B", &error), &error);
    for (int y = 0; y < size; y++)
        for (int x = 0; x < size; x++)
            for (int c = 0; c < 3; c++) {
                const double r = 0.5 * hypot(x - size / 2, y - size / 2), spot = 1e3 * exp(-0.5 * r) + 10;
                float *value = &alb_image_at(&image, x, y)[c];
                *value = kind == FLAT ? 1 : kind == ALL_NAN ? NAN : (float)spot;
                if (kind == CLIPPED)
                    *value = (float)fmin(1e6 * spot, 65535);
                if (kind == SOME_NAN && x < 3)
                    *value = NAN;
            }
    return image;
}

static void save_picture(const char *path, look kind, int size)
{
    alb_error error = {0};
    alb_image image = picture(kind, size);
    const bool exr = strstr(path, ".exr") != NULL;
    check_ok(exr ? alb_exr_write(&image, NULL, path, &error) : alb_image_write_png16(&image, path, &error), &error);
    alb_image_free(&image);
}

static const char cube[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
static const char ply[] =
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
static const char plan[] =
    "{\"format\":1,\"sample\":{\"name\":\"wax\",\"thickness_mm\":6,\"refractive_index\":1.4},\"white_reference\":"
    "{\"reflectance\":[0.9,0.9,0.9]},\"board\":{\"columns\":9,\"rows\":6,\"square_mm\":5},\"shots\":[{\"name\":"
    "\"dark\","
    "\"target\":\"cap\",\"pattern\":{\"kind\":\"black\"},\"exposures_s\":[%s]%s}]}";

// A scene with one mesh.
static void save_scene(const char *path, const char *mesh, const char *extra)
{
    char text[1024];
    snprintf(
        text, sizeof text,
        "{\"format\":1,\"objects\":[{\"mesh\":\"%s\",\"material\":\"wall\"}],\"materials\":{\"wall\":{\"reflectance\":"
        "[0.5,0.5,0.5]}},\"lights\":[{\"kind\":\"point\",\"position_mm\":[3,3,3],\"flux\":[1,1,1]}],\"camera\":"
        "{\"position_mm\":[5,5,5],\"look_at_mm\":[0,0,0],\"up\":[0,0,1],\"vertical_field_deg\":30,\"width\":16,"
        "\"height\":16},\"rays_per_patch\":16%s}",
        mesh, extra);
    save_text(path, text);
}

static void make_pictures(void)
{
    alb_error error = {0};
    save_picture("cli/spot.exr", SPOT, 64);
    save_picture("cli/small.exr", SPOT, 32);
    save_picture("cli/some_nan.exr", SOME_NAN, 64);
    save_picture("cli/nan.exr", ALL_NAN, 64);
    save_picture("cli/flat.exr", FLAT, 64);
    save_picture("cli/spot.png", SPOT, 64);
    save_picture("cli/clipped.png", CLIPPED, 64);
    cut("cli/cut.exr", "cli/spot.exr");
    cut("cli/cut.png", "cli/spot.png");
    alb_image zero = {0};
    check_ok(alb_image_create(&zero, 64, 64, "R,G,B", &error), &error);
    check_ok(alb_exr_write(&zero, NULL, "cli/zero.exr", &error), &error);
    alb_image_free(&zero);
}

// A material of one channel, whose total must be that of its parameters.
static void save_material(const char *path, const char *form, const char *parameters, double total)
{
    char text[1024];
    snprintf(
        text, sizeof text,
        "{\"format\":1,\"name\":\"wax\",\"channels\":{\"Y\":{\"reflection\":{\"form\":\"%s\",\"identifiable\":false,"
        "\"parameters\":{%s},\"total\":{\"value\":%.17g},\"chi_square\":1,\"degrees_of_freedom\":1}}}}",
        form, parameters, total);
    save_text(path, text);
}

static void make_texts(void)
{
    char text[2048];
    const char *const empty[] = {"cli/empty.exr", "cli/empty.png", "cli/empty.json",
                                 "cli/empty.csv", "cli/empty.obj", "cli/empty.ply"};
    for (int i = 0; i < 6; i++)
        save_text(empty[i], "");
    snprintf(text, sizeof text, plan, "0.1", "");
    save_text("cli/plan.json", text);
    cut("cli/cut.json", "cli/plan.json");
    snprintf(text, sizeof text, plan, "-0.1", "");
    save_text("cli/negative_exposure.json", text);
    snprintf(text, sizeof text, plan, "0.1", ",\"gain\":3");
    save_text("cli/unknown_key.json", text);
    save_text("cli/profile.csv", "r_mm,value_per_mm2\n1,0.5\n2,0.25\n3,0.1");
    save_text("cli/cut.csv", "r_mm,value_per_mm2\n1,0.5\n2,");
    save_text("cli/nan.csv", "r_mm,value_per_mm2\n1,0.5\n2,nan\n");
    save_text("cli/header.csv", "radius,value\n1,0.5\n");
    save_text("cli/cube.obj", cube);
    save_text("cli/triangle.ply", ply);
    cut("cli/cut.ply", "cli/triangle.ply");
    save_text("cli/cut.obj", "v 0 0 0\nv 1 0 0\nv 0 1\n");
    save_scene("cli/scene.json", "cube.obj", "");
    save_scene("cli/scene_cut_obj.json", "cut.obj", "");
    save_scene("cli/scene_empty_obj.json", "empty.obj", "");
    save_scene("cli/scene_cut_ply.json", "cut.ply", "");
    save_scene("cli/scene_missing.json", "nowhere.obj", "");
    save_scene("cli/scene_unknown.json", "cube.obj", ",\"bounces\":3");
    save_material("cli/bright.json", "exponential",
                  "\"amplitude_1_per_mm2\":{\"value\":1},\"decay_1_per_mm\":{\"value\":1}", 2 * M_PI);
    save_material("cli/wax.json", "exponential",
                  "\"amplitude_1_per_mm2\":{\"value\":0.1},\"decay_1_per_mm\":{\"value\":1}", 0.2 * M_PI);
    save_text("cli/board/blank.txt", "");
    save_picture("cli/board/blank.png", FLAT, 64);
}

// What an earlier run left: every file that the commands write, with a content of its own.
static const char *const kept[] = {
    "cli/kept/session.json", "cli/kept/calibration.json", "cli/kept/material.json",
    "cli/kept/picture.exr",  "cli/kept/picture.png",      "cli/kept/index.html",
    "cli/kept/compare.json", "cli/kept/report/fit.csv",   "cli/kept/report/fit.html",
    "cli/kept/truth.json",   "cli/kept/pair1_photo.png",  "cli/kept/report/calibrate.html",
    "cli/kept/frames/a.exr"};
enum { KEPT = sizeof kept / sizeof *kept };

static int make_inputs(void **state)
{
    (void)state;
    alb_error error = {0};
    const char *const folders[] = {"cli/board", "cli/kept/report", "cli/kept/frames", "cli/empty_folder"};
    for (int i = 0; i < 4; i++)
        check_ok(alb_file_make_directory(folders[i], &error), &error);
    make_pictures();
    make_texts();
    remove("cli/board/blank.txt");
    for (int i = 0; i < KEPT; i++)
        save_text(kept[i], kept[i]);
    return 0;
}

static int remove_inputs(void **state)
{
    (void)state;
    forget_runs();
    return system("rm -rf cli") != 0;
}

static int entries_in(const char *folder)
{
    struct dirent **entries;
    const int count = scandir(folder, &entries, NULL, NULL);
    for (int i = 0; i < count; i++)
        free(entries[i]);
    free(entries);
    return count;
}

typedef struct scenario {
    const char *arguments;
    alb_status status;
    const char *part; // of what is said
} scenario;

// Runs each and holds it to the law; all failures are listed before the test fails.
static void check_scenarios(const scenario *scenarios, size_t count)
{
    int wrong = 0;
    const int before = entries_in("cli/kept") + entries_in("cli/kept/report") + entries_in("cli/kept/frames");
    for (size_t i = 0; i < count; i++) {
        const scenario *s = &scenarios[i];
        const int code = run(s->arguments);
        const size_t size = strlen(complaint);
        const bool one_line = size && strchr(complaint, '\n') == complaint + size - 1;
        bool intact = before == entries_in("cli/kept") + entries_in("cli/kept/report") + entries_in("cli/kept/frames");
        for (int k = 0; k < KEPT; k++) {
            char *bytes = slurp(kept[k]);
            intact = intact && strcmp(bytes, kept[k]) == 0;
            free(bytes);
        }
        if (code == (int)s->status && one_line && strncmp(complaint, "alabaster", 9) == 0 &&
            strstr(complaint, s->part) && !*output && intact)
            continue;
        print_error("alabaster %s\n  exit %d (expected %d, '%s')%s%s, said: %s%s\n", s->arguments, code, (int)s->status,
                    s->part, one_line ? "" : ", not one line", intact ? "" : ", EARLIER RESULTS CHANGED", complaint,
                    *output ? "  and printed to stdout" : "");
        wrong++;
    }
    assert_int_equal(wrong, 0);
}
#define check_all(scenarios) check_scenarios((scenarios), sizeof(scenarios) / sizeof *(scenarios))

static void help_and_version(void **state)
{
    (void)state;
    const char *const commands[] = {"capture", "calibrate", "fit", "export", "render", "compare"};
    const char *const general[] = {"", "help", "--help", "-h"};
    for (int i = 0; i < 4; i++) {
        assert_int_equal(run(general[i]), 0);
        assert_string_equal(complaint, "");
        for (int c = 0; c < 6; c++)
            assert_non_null(strstr(output, commands[c]));
    }
    for (int c = 0; c < 6; c++) {
        char arguments[64];
        snprintf(arguments, sizeof arguments, "help %s", commands[c]);
        assert_int_equal(run(arguments), 0);
        char *first = strdup(output);
        assert_non_null(strstr(first, "alabaster "));
        assert_non_null(strstr(first, commands[c]));
        snprintf(arguments, sizeof arguments, "%s --help", commands[c]);
        assert_int_equal(run(arguments), 0);
        assert_string_equal(output, first);
        free(first);
    }
    assert_int_equal(run("--version"), 0);
    assert_memory_equal(output, "alabaster ", 10);
}

static void usage_errors(void **state)
{
    (void)state;
    const scenario scenarios[] = {
        {"frobnicate", ALB_USAGE, "frobnicate"},
        {"--frobnicate", ALB_USAGE, "frobnicate"},
        {"help frobnicate", ALB_USAGE, "frobnicate"},
        {"capture", ALB_USAGE, "missing"},
        {"capture cli/plan.json -o cli/kept", ALB_USAGE, "--rig"},
        {"capture cli/plan.json -o cli/kept --rig teapot:x", ALB_USAGE, "teapot"},
        {"calibrate", ALB_USAGE, "SESSION"},
        {"calibrate cli/kept cli/kept", ALB_USAGE, "unexpected"},
        {"calibrate --photographs cli/board --board nine --square-mm 5", ALB_USAGE, "nine"},
        {"fit", ALB_USAGE, "--image"},
        {"fit --image cli/spot.exr -o cli/kept", ALB_USAGE, "--mm-per-pixel"},
        {"fit --image cli/spot.exr --mm-per-pixel -1 -o cli/kept", ALB_USAGE, "-1"},
        {"fit --image cli/spot.exr --mm-per-pixel nan -o cli/kept", ALB_USAGE, "nan"},
        {"fit --table cli/profile.csv -o cli/kept", ALB_USAGE, "--side"},
        {"fit --table cli/profile.csv --side up -o cli/kept", ALB_USAGE, "up"},
        {"fit cli/kept --wibble", ALB_USAGE, "--wibble"},
        {"fit cli/kept -o", ALB_USAGE, "-o"},
        {"export", ALB_USAGE, "missing"},
        {"export cli/material.json --to pbrt", ALB_USAGE, "-o"},
        {"export cli/material.json -o cli/kept/picture.exr", ALB_USAGE, "--to"},
        {"export cli/material.json --to teapot -o cli/kept/picture.exr", ALB_USAGE, "teapot"},
        {"export cli/material.json --to pbrt --unit-mm 0 -o cli/kept/picture.exr", ALB_USAGE, "--unit-mm"},
        {"export cli/material.json --to csv --unit-mm 5 -o cli/kept/picture.exr", ALB_USAGE, "millimetres"},
        {"render", ALB_USAGE, "missing"},
        {"render cli/scene.json", ALB_USAGE, "-o"},
        {"render cli/scene.json -o cli/kept/picture.exr -o twice.exr", ALB_USAGE, "twice"},
        {"render cli/scene.json -o cli/kept/picture.exr --error 0", ALB_USAGE, "--error"},
        {"compare -o cli/kept", ALB_USAGE, "pairs"},
        {"compare cli/spot.exr -o cli/kept", ALB_USAGE, "pairs"},
        {"compare cli/spot.exr cli/plan.json -o cli/kept", ALB_USAGE, "a pair is"},
        {"compare cli/spot.exr cli/spot.exr", ALB_USAGE, "-o"},
        {"compare cli/spot.exr cli/spot.exr -o cli/kept --limit-percent 2", ALB_USAGE, "--limit-percent"},
        {"compare cli/kept/material.json cli/plan.json -o cli/kept --mask cli/spot.exr", ALB_USAGE, "--mask"},
        {"compare cli/kept/material.json cli/plan.json -o cli/kept --limit-percent -1", ALB_USAGE, "-1"},
    };
    check_all(scenarios);
}

static void files_that_are_not_there(void **state)
{
    (void)state;
    const scenario scenarios[] = {
        {"capture nowhere.json -o cli/kept --rig virtual:cli/plan.json", ALB_ACCESS, "nowhere.json"},
        {"capture cli/plan.json -o cli/new --rig virtual:nowhere.json", ALB_ACCESS, "nowhere.json"},
        {"capture cli/plan.json -o cli/new --rig folder:nowhere", ALB_ACCESS, "nowhere"},
        {"calibrate nowhere", ALB_ACCESS, "nowhere"},
        {"calibrate cli/empty_folder", ALB_ACCESS, "session.json"},
        {"calibrate --photographs nowhere --board 9x6 --square-mm 5", ALB_ACCESS, "nowhere"},
        {"fit nowhere", ALB_ACCESS, "nowhere"},
        {"fit --image nowhere.exr --mm-per-pixel 1 -o cli/kept", ALB_ACCESS, "nowhere.exr"},
        {"fit --table nowhere.csv --side reflection -o cli/kept", ALB_ACCESS, "nowhere.csv"},
        {"export nowhere.json --to pbrt -o cli/kept/picture.exr", ALB_ACCESS, "nowhere.json"},
        {"export cli/wax.json --to pbrt -o nowhere/at/all.pbrt", ALB_ACCESS, "nowhere/at"},
        {"export cli/wax.json --to pbrt -o cli/kept", ALB_ACCESS, "cli/kept"},
        {"render nowhere.json -o cli/kept/picture.exr", ALB_ACCESS, "nowhere.json"},
        {"render cli/scene_missing.json -o cli/kept/picture.exr", ALB_ACCESS, "nowhere.obj"},
        {"render cli/scene.json -o /nowhere/at/all.exr", ALB_ACCESS, "/nowhere/at"},
        {"compare nowhere.exr cli/spot.exr -o cli/kept", ALB_ACCESS, "nowhere.exr"},
        {"compare cli/spot.exr cli/nowhere.exr -o cli/kept", ALB_ACCESS, "nowhere.exr"},
        {"compare cli/spot.exr cli/spot.exr -o cli/kept --mask nowhere.png", ALB_ACCESS, "nowhere.png"},
        {"compare nowhere.json cli/plan.json -o cli/kept", ALB_ACCESS, "nowhere.json"},
        {"compare cli/spot.exr cli/spot.exr -o /proc/nowhere", ALB_ACCESS, "/proc/nowhere"},
        {"compare cli/empty_folder cli/spot.exr -o cli/kept", ALB_ACCESS, "empty_folder"},
    };
    check_all(scenarios);
}

static void content_that_is_wrong(void **state)
{
    (void)state;
    const scenario scenarios[] = {
        {"capture cli/empty.json -o cli/kept --rig virtual:cli/plan.json", ALB_BAD_DATA, "empty.json"},
        {"capture cli/cut.json -o cli/kept --rig virtual:cli/plan.json", ALB_BAD_DATA, "cut.json"},
        {"capture cli/negative_exposure.json -o cli/kept --rig virtual:cli/plan.json", ALB_BAD_DATA, "exposures_s"},
        {"capture cli/unknown_key.json -o cli/kept --rig virtual:cli/plan.json", ALB_BAD_DATA, "gain"},
        {"capture cli/plan.json -o cli/new --rig virtual:cli/empty.json", ALB_BAD_DATA, "empty.json"},
        {"capture cli/plan.json -o cli/new --rig virtual:cli/cut.json", ALB_BAD_DATA, "cut.json"},
        {"calibrate cli/kept", ALB_BAD_DATA, "session.json"},
        {"fit cli/kept", ALB_BAD_DATA, "json"},
        {"export cli/empty.json --to pbrt -o cli/kept/picture.exr", ALB_BAD_DATA, "empty.json"},
        {"export cli/plan.json --to pbrt -o cli/kept/picture.exr", ALB_BAD_DATA, "plan.json"},
        {"export cli/bright.json --to pbrt -o cli/kept/picture.exr", ALB_BAD_DATA, "reflects 6.283 of the light"},
        {"render cli/empty.json -o cli/kept/picture.exr", ALB_BAD_DATA, "empty.json"},
        {"render cli/cut.json -o cli/kept/picture.exr", ALB_BAD_DATA, "cut.json"},
        {"render cli/scene_unknown.json -o cli/kept/picture.exr", ALB_BAD_DATA, "bounces"},
        {"render cli/scene_cut_obj.json -o cli/kept/picture.exr", ALB_BAD_DATA, "cut.obj"},
        {"render cli/scene_empty_obj.json -o cli/kept/picture.exr", ALB_BAD_DATA, "empty.obj"},
        {"render cli/scene_cut_ply.json -o cli/kept/picture.exr", ALB_BAD_DATA, "cut.ply"},
        {"compare cli/empty.exr cli/spot.exr -o cli/kept", ALB_BAD_DATA, "empty.exr"},
        {"compare cli/cut.exr cli/spot.exr -o cli/kept", ALB_BAD_DATA, "cut.exr"},
        {"compare cli/spot.png cli/cut.png -o cli/kept", ALB_BAD_DATA, "cut.png"},
        {"compare cli/spot.exr cli/small.exr -o cli/kept", ALB_BAD_DATA, "32 x 32"},
        {"compare cli/spot.exr cli/zero.exr -o cli/kept", ALB_BAD_DATA, "zero in all 4096"},
        {"compare cli/spot.exr cli/nan.exr -o cli/kept", ALB_BAD_DATA, "4096 in the render"},
        {"compare cli/spot.exr cli/spot.exr cli/nan.exr cli/spot.exr -o cli/kept", ALB_BAD_DATA, "4096 not finite"},
        {"compare cli/spot.exr cli/spot.exr -o cli/kept --mask cli/zero.exr", ALB_BAD_DATA, "4096 outside"},
        {"compare cli/empty.json cli/plan.json -o cli/kept", ALB_BAD_DATA, "empty.json"},
    };
    check_all(scenarios);
}

static void measurements_that_show_nothing(void **state)
{
    (void)state;
    const scenario scenarios[] = {
        {"calibrate --photographs cli/board --board 9x6 --square-mm 5", ALB_BAD_DATA, "board"},
        {"fit --image cli/empty.exr --mm-per-pixel 1 -o cli/kept", ALB_BAD_DATA, "empty.exr"},
        {"fit --image cli/cut.exr --mm-per-pixel 1 -o cli/kept", ALB_BAD_DATA, "cut.exr"},
        {"fit --image cli/cut.png --mm-per-pixel 1 -o cli/kept", ALB_BAD_DATA, "cut.png"},
        {"fit --image cli/nan.exr --mm-per-pixel 1 -o cli/kept", ALB_BAD_DATA, "nan.exr"},
        {"fit --image cli/flat.exr --mm-per-pixel 1 -o cli/kept", ALB_BAD_DATA, "spot"},
        {"fit --image cli/zero.exr --mm-per-pixel 1 -o cli/kept", ALB_BAD_DATA, "spot"},
        {"fit --image cli/clipped.png --mm-per-pixel 1 -o cli/kept", ALB_BAD_DATA, "clipped.png"},
        {"fit --table cli/empty.csv --side reflection -o cli/kept", ALB_BAD_DATA, "empty.csv"},
        {"fit --table cli/cut.csv --side reflection -o cli/kept", ALB_BAD_DATA, "cut.csv"},
        {"fit --table cli/nan.csv --side reflection -o cli/kept", ALB_BAD_DATA, "nan.csv"},
        {"fit --table cli/header.csv --side reflection -o cli/kept", ALB_BAD_DATA, "header.csv"},
    };
    check_all(scenarios);
}

static void good_input_still_works(void **state)
{
    (void)state;
    assert_int_equal(run("compare cli/spot.exr cli/some_nan.exr -o cli/report --json"), 0);
    assert_string_equal(complaint, "");
    assert_non_null(strstr(output, "\"compared_pixels\": 3904")); // 64 x 61
    char *json = slurp("cli/report/compare.json"), *page = slurp("cli/report/index.html");
    assert_string_equal(json, output);
    assert_null(strstr(json, ALB_SOURCE_FOLDER));
    assert_int_equal(run("compare cli/spot.exr cli/some_nan.exr -o cli/report2"), 0);
    assert_non_null(strstr(output, "3904 of 4096 pixels"));
    char *again = slurp("cli/report2/index.html"); // the same inputs, the same bytes
    assert_string_equal(again, page);
    free(json);
    free(page);
    free(again);
    assert_int_equal(run("render cli/scene.json -o cli/picture.exr"), 0);
    assert_int_equal(run("render cli/scene.json -o cli/picture.exr --error 5"), 0);
    assert_true(alb_file_exists("cli/picture.exr") && alb_file_exists("cli/picture.png"));
}

// A stated profile 0.01 e^(-r/2) through a table: its total is 0.08 pi = 0.2513, the truth says 0.25 and then 0.26.
// What is written says what was asked, and a file that stood there goes with it.
static void exported_files(void **state)
{
    (void)state;
    const char *const formats[] = {"cycles", "pbrt", "mitsuba", "openpbr", "arnold", "csv"};
    for (int i = 0; i < 6; i++) {
        char arguments[128];
        snprintf(arguments, sizeof arguments, "export cli/wax.json --to %s -o cli/exported%s", formats[i],
                 i < 5 ? " --unit-mm 1000" : "");
        assert_int_equal(run(arguments), 0);
        char *text = slurp("cli/exported");
        assert_non_null(strstr(text, i < 5 ? "1 unit of the scene = 1000 mm" : "channel,r_mm,"));
        assert_non_null(strstr(text, i < 5 ? "a best guess" : ",,,\nY,"));
        assert_null(strstr(text, "nan"));
        free(text);
    }
    assert_int_equal(run("export cli/wax.json --to pbrt -o cli/exported --json"), 0);
    assert_non_null(strstr(output, "\"burley_length_mm\""));
    assert_string_equal(complaint, "");
}

static void limits_decide_the_exit_code(void **state)
{
    (void)state;
    char table[8192] = "r_mm,value_per_mm2,sd_per_mm2\n";
    for (int i = 1; i < 60; i++) {
        const double r = 0.25 * i, value = 1e-2 * exp(-r / 2);
        snprintf(table + strlen(table), sizeof table - strlen(table), "%.17g,%.17g,%.17g\n", r, value, 0.01 * value);
    }
    save_text("cli/exact.csv", table);
    const char *const truth =
        "{\"format\":1,\"channels\":{\"Y\":{\"reflection\":{\"total\":%s,\"total_sd\":0,\"r_mm\":[],"
        "\"value_per_mm2\":[],\"sd_per_mm2\":[]}}}}";
    char text[512];
    snprintf(text, sizeof text, truth, "0.25");
    save_text("cli/near.json", text);
    snprintf(text, sizeof text, truth, "0.26");
    save_text("cli/far.json", text);
    assert_int_equal(run("fit --table cli/exact.csv --side reflection -o cli/exact"), 0);
    assert_int_equal(run("compare cli/exact/material.json cli/near.json -o cli/limit --limit-percent 2"), 0);
    assert_non_null(strstr(output, "+0.53 %"));
    assert_int_equal(run("compare cli/exact/material.json cli/far.json -o cli/limit --limit-percent 2"), ALB_DIFFERS);
    assert_non_null(strstr(complaint, "-3.34 %"));
    assert_non_null(strstr(output, "-3.34 %")); // the table is printed and the report written all the same
    char *json = slurp("cli/limit/compare.json");
    assert_non_null(strstr(json, "far.json"));
    free(json);
    assert_int_equal(run("compare cli/exact/material.json cli/far.json -o cli/limit"), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(help_and_version),
        cmocka_unit_test(usage_errors),
        cmocka_unit_test(files_that_are_not_there),
        cmocka_unit_test(content_that_is_wrong),
        cmocka_unit_test(measurements_that_show_nothing),
        cmocka_unit_test(good_input_still_works),
        cmocka_unit_test(exported_files),
        cmocka_unit_test(limits_decide_the_exit_code),
    };
    return cmocka_run_group_tests(tests, make_inputs, remove_inputs);
}
