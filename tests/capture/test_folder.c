// The folder rig: replay bit for bit, responses of 8-bit files, and what it refuses.
#include "base/exr.h"
#include "base/image.h"
#include "capture/session.h"
#include "rigs.h"

static const char *const one_shot =
    "{\"format\": 1, \"sample\": {\"name\": \"wax\", \"thickness_mm\": 6, \"refractive_index\": 1.45},\n"
    " \"white_reference\": {\"reflectance\": [0.99, 0.98, 0.97]}, \"board\": {\"columns\": 9, \"rows\": 6, "
    "\"square_mm\": 3},\n"
    " \"shots\": [{\"name\": \"a\", \"target\": \"slab\", \"pattern\": {\"kind\": \"white\"}, \"exposures_s\": "
    "[0.5]}]}\n";

static void replay_is_bit_for_bit(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_session session;
    char one[ALB_HASH_SIZE], two[ALB_HASH_SIZE];
    check_ok(capture("plan.json", "original", "virtual", "truth.json", NULL, &error), &error);
    check_ok(capture("plan.json", "replay", "folder", "original/frames", NULL, &error), &error);
    static const char *const frames[] = {
        "dark_e0_r0", "dark_e0_r1", "hand_e0_r0", "hand_e0_r1", "slab_transmission_e0_r0", "slab_transmission_e1_r0"};
    for (size_t i = 0; i < sizeof frames / sizeof *frames; i++) {
        char a[96], b[96];
        snprintf(a, sizeof a, "original/frames/%s.exr", frames[i]);
        snprintf(b, sizeof b, "replay/frames/%s.exr", frames[i]);
        hash(one, a), hash(two, b);
        assert_string_equal(one, two);
    }
    check_ok(alb_session_read(&session, at("replay"), &error), &error);
    check_near(session.white_level_dn, 4095, 0);
    check_near(session.plan.shots[2].obtained_s[0], 0.01, 1e-15); // as the original obtained, not as asked
    assert_false(alb_file_exists(at("replay/truth.json")));
}

// A grey wedge of 256 steps as an 8-bit PNG holding the steps as they are.
static void put_wedge(const char *name)
{
    alb_error error = {0};
    alb_image wedge = {0};
    check_ok(alb_image_create(&wedge, 256, 2, "Y", &error), &error);
    for (int i = 0; i < 512; i++) { // alb_image_write_png encodes sRGB: give it what encodes to i
        const double v = i % 256 / 255.0;
        wedge.pixels[i] = (float)(v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4));
    }
    check_ok(alb_image_write_png(&wedge, 1, at(name), &error), &error);
    alb_image_free(&wedge);
}

static void check_response(const char *camera, double at_128, double white)
{
    alb_error error = {0};
    alb_image frame = {0};
    alb_session session;
    put("wedge/camera.json", camera);
    check_ok(capture("one.json", "wedges", "folder", "wedge/", "--force", &error), &error);
    check_ok(alb_image_read(&frame, NULL, at("wedges/frames/a_e0_r0.exr"), &error), &error);
    check_near((double)alb_image_at(&frame, 0, 0)[0], 0, 0);
    check_relative((double)alb_image_at(&frame, 128, 1)[0], at_128, 1e-6);
    check_ok(alb_session_read(&session, at("wedges"), &error), &error);
    check_near(session.white_level_dn, white, 1e-9);
    alb_image_free(&frame);
}

static void responses(void **state)
{
    (void)state;
    alb_error error = {0};
    char table[4096] = "{\"format\": 1, \"response\": {\"table\": [0";
    put("one.json", one_shot);
    check_ok(alb_file_make_directory(at("wedge"), &error), &error);
    put_wedge("wedge/a_e0_r0.png");
    check_fails(capture("one.json", "wedges", "folder", "wedge", NULL, &error), &error, ALB_BAD_DATA, "response");
    check_response("{\"format\": 1, \"response\": \"linear\"}", 128, 255);
    check_response("{\"format\": 1, \"response\": \"linear\", \"white_level_dn\": 250}", 128, 250);
    check_response("{\"format\": 1, \"response\": \"srgb\"}", 255 * 0.21586050011389926, 255); // IEC 61966-2-1 at 128
    check_response("{\"format\": 1, \"response\": {\"gamma\": 2.2}}", 255 * 0.2195197180748679, 255);
    for (int v = 1; v < 256; v++)
        snprintf(table + strlen(table), sizeof table - strlen(table), ", %d", v * 3);
    strcat(table, "]}}");
    check_response(table, 384, 765);
}

static void refusals(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_image image = {0};
    put("one.json", one_shot);
    check_ok(alb_file_make_directory(at("bad"), &error), &error);
    check_fails(capture("one.json", "out", "folder", "nowhere", NULL, &error), &error, ALB_ACCESS, "no such folder");
    check_fails(capture("one.json", "out", "folder", "bad", NULL, &error), &error, ALB_ACCESS,
                "a_e0_r0: no such frame");
    check_ok(alb_image_create(&image, 5, 4, "Y", &error), &error);
    check_ok(alb_exr_write(&image, NULL, at("bad/a_e0_r0.exr"), &error), &error);
    check_fails(capture("one.json", "out", "folder", "bad", NULL, &error), &error, ALB_BAD_DATA, "white_level_dn");
    put("bad/camera.json", "{\"format\": 1, \"white_level_dn\": 1}");
    alb_image_at(&image, 3, 2)[0] = NAN;
    check_ok(alb_exr_write(&image, NULL, at("bad/a_e0_r0.exr"), &error), &error);
    check_fails(capture("one.json", "out", "folder", "bad", NULL, &error), &error, ALB_BAD_DATA, "column 3, row 2");
    static const char *const cameras[] = {"{\"format\": 1, \"white_level_dn\": -1}",
                                          "{\"format\": 1, \"response\": \"log\"}",
                                          "{\"format\": 1, \"response\": {\"gamma\": 0}}",
                                          "{\"format\": 1, \"response\": {\"table\": [1, 2]}}",
                                          "{\"format\": 1, \"response\": {}}",
                                          "{\"format\": 1, \"response\": 3}",
                                          "{\"format\": 1, \"obtained_s\": {}}",
                                          "{\"format\": 1, \"obtained_s\": {\"a\": [-1]}}",
                                          "{\"format\": 1, \"black\": 3}",
                                          "{"};
    for (size_t i = 0; i < sizeof cameras / sizeof *cameras; i++) {
        put("bad/camera.json", cameras[i]);
        check_fails(capture("one.json", "out", "folder", "bad", NULL, &error), &error, ALB_BAD_DATA, "camera.json");
    }
    put("bad/camera.json", "{\"format\": 1, \"white_level_dn\": 1}");
    put("bad/a_e0_r0.exr", "v/1\x01 not an image");
    check_fails(capture("one.json", "out", "folder", "bad", NULL, &error), &error, ALB_BAD_DATA, "a_e0_r0.exr");
    assert_false(alb_file_exists(at("out")));
    alb_image_free(&image);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(replay_is_bit_for_bit), cmocka_unit_test(responses),
                                       cmocka_unit_test(refusals)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
