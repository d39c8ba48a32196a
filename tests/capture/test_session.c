// Plans, sessions and the capture command: round trips, refusals, and that an earlier session survives.
#include "capture/session.h"
#include "rigs.h"
#include <omp.h>

static void plan_is_read(void **state)
{
    (void)state;
    alb_plan plan;
    alb_error error = {0};
    check_ok(alb_plan_read(&plan, at("plan.json"), &error), &error);
    assert_string_equal(plan.sample, "wax");
    assert_int_equal(plan.shot_count, 3);
    assert_true(plan.shots[1].in_hand && plan.shots[1].repeats == 2 && plan.shots[1].side == ALB_REFLECTION);
    assert_true(plan.shots[2].side == ALB_TRANSMISSION && plan.shots[2].pattern.rows == 2);
    check_near(plan.shots[2].exposures_s[1], 0.04, 0);
    check_near(plan.white_reflectance[2], 0.97, 0);
}

static void hostile_plans(void **state)
{
    (void)state;
    static const struct {
        const char *from, *to, *says;
    } cases[] = {
        {"[0.01]", "[-0.01]", "exposures_s"},
        {"[0.01]", "[]", "exposures_s"},
        {"[0.0100004, 0.04]", "[0.04, 0.01]", "ascend"},
        {"[0.0100004, 0.04]", "[0.04, 0.04]", "ascend"},
        {"\"dark\"", "\"hand\"", "names must differ"},
        {"\"dark\"", "\"../dark\"", "a-z"},
        {"\"dark\"", "\"\"", "a-z"},
        {"\"cap\"", "\"hat\"", "expected one of slab"},
        {"\"cap\"", "\"board\"", "cannot be photographed"},
        {"\"target\": \"slab\"", "\"target\": \"white_reference\"", "opaque"},
        {"\"target\": \"slab\"", "\"in_hand\": true, \"target\": \"slab\"", "in the hand"},
        {"\"kind\": \"chessboard\"", "\"kind\": \"white\"", "cannot be photographed"},
        {"\"repeats\": 2", "\"repeats\": 0", "repeats"},
        {"\"repeats\": 2", "\"repeats\": 1e9", "repeats"},
        {"\"repeats\"", "\"repeat\"", "unknown key"},
        {"\"pitch_px\": 20", "\"pitch_px\": 1", "overlap"},
        {"\"thickness_mm\": 6", "\"thickness_mm\": 0", "thickness_mm"},
        {"\"format\": 1", "\"format\": 2", "format"},
        {"0.97]", "0.97", "not valid JSON"},
        {"{\"format\"", "[{\"format\"", ""},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        alb_plan plan;
        alb_error error = {0};
        put("hostile.json", replaced(plan_json, cases[i].from, cases[i].to));
        check_fails(alb_plan_read(&plan, at("hostile.json"), &error), &error, ALB_BAD_DATA, cases[i].says);
    }
    alb_plan plan;
    alb_error error = {0};
    check_fails(alb_plan_read(&plan, at("nowhere.json"), &error), &error, ALB_ACCESS, "nowhere.json");
}

static void hostile_truths(void **state)
{
    (void)state;
    static const struct {
        const char *from, *to, *says;
    } cases[] = {
        {"\"profile\"", "\"profil\"", "unknown key"},
        {"[[0.1, 0.1], [0.2], [0.1]]", "[[0.1], [0.2], [0.1]]", "as many decays"},
        {"[[0.1, 0.1], [0.2], [0.1]]", "[[0.1, 0.1], [0.9], [0.1]]", "sheds"},
        {"[[0.1, 0.1], [0.2], [0.1]]", "[[0.1, \"x\"], [0.2], [0.1]]", "amplitude"},
        {"[[0.1, 0.1], [0.2], [0.1]]", "[3, 4, 5]", "expected 1 to"},
        {"\"blur_sd_mm\": 0.12", "\"blur_sd_mm\": 0.01", "fifth"},
        {"\"bits\": 12", "\"bits\": 40", "bits"},
        {"\"width\": 96", "\"width\": 1000000", "width"},
        {"[-0.1, 0, 0, 0, 0]", "[-9, 0, 0, 0, 0]", "folds"},
        {"\"distance_mm\": 120", "\"distance_mm\": 20", "fit"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        alb_error error = {0};
        put("hostile_truth.json", replaced(truth_json, cases[i].from, cases[i].to));
        check_fails(capture("plan.json", "hostile", "virtual", "hostile_truth.json", NULL, &error), &error,
                    ALB_BAD_DATA, cases[i].says);
        assert_false(alb_file_exists(at("hostile"))); // nothing is written before all is checked
    }
}

static void round_trip(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_session session;
    char first[ALB_HASH_SIZE], second[ALB_HASH_SIZE], path[ALB_PATH_SIZE];
    check_ok(capture("plan.json", "one", "virtual", "truth.json", NULL, &error), &error);
    check_ok(alb_session_read(&session, at("one"), &error), &error);
    assert_string_equal(session.rig, "virtual:truth.json");
    assert_true(session.width == 96 && session.height == 72 && session.channels == 3);
    check_near(session.white_level_dn, 4095, 0);
    assert_string_equal(session.channel_names[2], "B");
    check_near(session.plan.shots[2].exposures_s[0], 0.0100004, 0);
    check_near(session.plan.shots[2].obtained_s[0], 0.01, 1e-15); // whole microseconds
    check_ok(alb_session_frame(path, &session, &session.plan.shots[2], 1, 0, &error), &error);
    assert_true(alb_file_exists(path));
    assert_false(alb_file_exists(at("one/capture.partial")));
    // Written again from what was read, it is the same but for the provenance.
    alb_provenance provenance = {.command = "capture"};
    alb_session again;
    check_ok(alb_session_write(&session, &provenance, &error), &error);
    check_ok(alb_session_read(&again, at("one"), &error), &error);
    check_near(memcmp(&session.plan.shots, &again.plan.shots, sizeof again.plan.shots), 0, 0);
    // Another folder, another number of threads: the same bytes.
    omp_set_num_threads(1);
    check_ok(capture("plan.json", "two", "virtual", "truth.json", NULL, &error), &error);
    check_ok(capture("plan.json", "one", "virtual", "truth.json", "--force", &error), &error);
    static const char *const files[] = {"session.json", "truth.json", "frames/slab_transmission_e1_r0.exr",
                                        "frames/hand_e0_r1.exr"};
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        char one[64], two[64];
        snprintf(one, sizeof one, "one/%s", files[i]);
        snprintf(two, sizeof two, "two/%s", files[i]);
        hash(first, one), hash(second, two);
        assert_string_equal(first, second);
    }
    unlink(path);
    check_fails(alb_session_read(&session, at("one"), &error), &error, ALB_ACCESS, "missing");
}

static void earlier_sessions_survive(void **state)
{
    (void)state;
    alb_error error = {0};
    char before[ALB_HASH_SIZE], after[ALB_HASH_SIZE];
    check_ok(capture("plan.json", "kept", "virtual", "truth.json", NULL, &error), &error);
    put("kept/calibration.json", "of another stage");
    hash(before, "kept/frames/hand_e0_r0.exr");
    check_ok(capture("plan.json", "kept", "virtual", "truth.json", NULL, &error), &error); // the same again
    put("other.json", replaced(truth_json, "\"seed\": 1", "\"seed\": 2"));
    check_fails(capture("plan.json", "kept", "virtual", "other.json", NULL, &error), &error, ALB_USAGE,
                "another plan or rig");
    hash(after, "kept/frames/hand_e0_r0.exr");
    assert_string_equal(before, after);
    // A rig that fails half-way: a frame of another size in the folder it replays.
    put("short.json", replaced(plan_json, "\"repeats\": 2", "\"repeats\": 1"));
    check_ok(capture("plan.json", "source", "virtual", "truth.json", NULL, &error), &error);
    put("small.json", replaced(truth_json, "\"height\": 72", "\"height\": 70"));
    check_ok(capture("short.json", "small", "virtual", "small.json", NULL, &error), &error);
    assert_int_equal(
        rename(at("small/frames/slab_transmission_e1_r0.exr"), at("source/frames/slab_transmission_e1_r0.exr")), 0);
    check_fails(capture("plan.json", "kept", "folder", "source/frames", "--force", &error), &error, ALB_BAD_DATA,
                "96 x 70");
    hash(after, "kept/frames/hand_e0_r0.exr");
    assert_string_equal(before, after);
    assert_false(alb_file_exists(at("kept/capture.partial")));
    // Forced, the frames change and other stages' results stay.
    check_ok(capture("plan.json", "kept", "virtual", "other.json", "--force", &error), &error);
    hash(after, "kept/frames/hand_e0_r0.exr");
    assert_string_not_equal(before, after);
    assert_true(alb_file_exists(at("kept/calibration.json")));
}

static void damaged_sessions(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_session session;
    char *text = NULL;
    size_t size;
    check_ok(capture("plan.json", "broken", "virtual", "truth.json", NULL, &error), &error);
    check_ok(alb_file_read(&text, &size, at("broken/session.json"), &error), &error);
    for (size_t cut = 0; cut < size - 2; cut += 97) { // truncated anywhere
        check_ok(alb_file_write(at("broken/session.json"), text, cut, &error), &error);
        check_fails(alb_session_read(&session, at("broken"), &error), &error, ALB_BAD_DATA, "session.json");
    }
    put("broken/session.json", replaced(text, "\"white_level_dn\": 4095", "\"white_level_dn\": 0"));
    check_fails(alb_session_read(&session, at("broken"), &error), &error, ALB_BAD_DATA, "white_level_dn");
    put("broken/session.json", replaced(text, "hand_e0_r0.exr", "hand_e9_r0.exr"));
    check_fails(alb_session_read(&session, at("broken"), &error), &error, ALB_BAD_DATA, "hand_e9_r0.exr");
    check_fails(capture("plan.json", "broken", "nothing", "truth.json", NULL, &error), &error, ALB_USAGE, "--rig");
    put("broken/session.json", "{");
    check_fails(capture("plan.json", "broken", "virtual", "truth.json", NULL, &error), &error, ALB_USAGE, "--force");
    check_fails(alb_session_read(&session, at("absent"), &error), &error, ALB_ACCESS, "session.json");
    put("a_file", "");
    check_fails(capture("plan.json", "a_file", "virtual", "truth.json", NULL, &error), &error, ALB_ACCESS, "is a file");
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(plan_is_read),
        cmocka_unit_test(hostile_plans),
        cmocka_unit_test(hostile_truths),
        cmocka_unit_test(round_trip),
        cmocka_unit_test(earlier_sessions_survive),
        cmocka_unit_test(damaged_sessions),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
