// Sequences by radiosity, from end to end: each frame is the picture that a still of it would be; what only the lights
// change is not made twice; what is refused, and what a failure leaves.
#include "base/exr.h"
#include "base/record.h"
#include "program.h"
#include <dirent.h>

#define SETTINGS                                                                                                       \
    "\"camera\":{\"position_mm\":[0,-60,40],\"look_at_mm\":[0,0,0],\"up\":[0,0,1],\"vertical_field_deg\":40,"          \
    "\"width\":48,\"height\":32},\"rays_per_patch\":128,\"residual\":1e-5,\"materials\":{\"floor\":{\"reflectance\":"  \
    "[0.6,0.5,0.4]},\"wax\":{\"dipole\":{\"absorption_per_mm\":[0.01,0.02,0.04],\"reduced_scattering_per_mm\":"        \
    "[1,1.2,1.5],\"refractive_index\":1.4}}}"
#define FLOOR                                                                                                          \
    "{\"shape\":\"box\",\"size_mm\":[60,60,2],\"centre_mm\":[0,0,-7],\"cells\":[12,12,1],\"material\":\"floor\"}"
#define BALL "{\"shape\":\"sphere\",\"radius_mm\":6,\"centre_mm\":[0,0,0],\"subdivisions\":2,\"material\":\"wax\"}"
#define BLOCK "{\"mesh\":\"block_#.obj\",\"subdivide_mm\":4,\"material\":\"wax\"}"

static int enter_folder(void **state)
{
    static char folder[] = "/tmp/alabaster_sequence_XXXXXX";
    *state = mkdtemp(folder);
    return !*state || chdir(*state) != 0;
}

static int leave_folder(void **state)
{
    DIR *folder = opendir(".");
    for (const struct dirent *file; folder && (file = readdir(folder));)
        if (file->d_name[0] != '.' || strlen(file->d_name) > 2)
            remove(file->d_name);
    if (folder)
        closedir(folder);
    return chdir("/") != 0 || rmdir(*state) != 0;
}

static void write_scene(const char *path, const char *objects, const char *lights, const char *rest)
{
    char text[2048];
    snprintf(text, sizeof text, "{\"format\":1,\"objects\":[%s],\"lights\":%s," SETTINGS "%s}", objects, lights, rest);
    save_text(path, text);
}

// A spot that wanders.
static const char *light_of(int frame)
{
    static char text[256];
    snprintf(text, sizeof text,
             "[{\"kind\":\"spot\",\"position_mm\":[%d,0,50],\"direction\":[0,0,-1],\"half_angle_deg\":20,\"flux\":"
             "[%g,1,1]}]",
             10 * frame - 10, frame == 2 ? 0.25 : 1);
    return text;
}

static void write_lights(void)
{
    for (int frame = 0; frame < 3; frame++) {
        char name[32], text[512];
        snprintf(name, sizeof name, "lights_%d.json", frame);
        snprintf(text, sizeof text, "{\"format\":1,\"lights\":%s}", light_of(frame));
        save_text(name, text);
    }
}

static void write_blocks(void)
{
    for (int frame = 0; frame < 3; frame++) {
        char name[32], text[512];
        const int low = -4 + 3 * frame, high = low + 8;
        snprintf(name, sizeof name, "block_%d.obj", frame);
        snprintf(text, sizeof text,
                 "v -5 -5 %d\nv 5 -5 %d\nv 5 5 %d\nv -5 5 %d\nv -5 -5 %d\nv 5 -5 %d\nv 5 5 %d\nv -5 5 %d\n"
                 "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n",
                 low, low, low, low, high, high, high, high);
        save_text(name, text);
    }
}

static void render(const char *arguments)
{
    char text[256];
    snprintf(text, sizeof text, "render %s --json", arguments);
    if (run(text))
        fail_msg("alabaster %s: %s", text, complaint);
}

static void refuses(const char *arguments, const char *part, alb_status status)
{
    char text[256];
    snprintf(text, sizeof text, "render %s", arguments);
    assert_int_equal(run(text), status);
    if (!strstr(complaint, part))
        fail_msg("alabaster %s: no \"%s\" in: %s", text, part, complaint);
}

// Whether the frame was solved with what was there, as the last run says.
static bool relit(int frame, double *exposure)
{
    alb_error error = {0};
    alb_node root, list, node;
    size_t count;
    bool value;
    save_text("said.json", output);
    alb_record *record = alb_record_read("said.json", &error);
    check_ok(record && alb_record_root(&root, record, &error) && alb_node_list(&list, &count, root, "frames", &error) &&
                 alb_node_item_object(&node, list, (size_t)frame, &error) &&
                 alb_node_boolean(&value, node, "relit", &error) &&
                 alb_node_number(exposure, node, "png_exposure", 0, 1e9, &error),
             &error);
    assert_int_equal(count, 3);
    alb_record_free(record);
    return value;
}

// The rms difference over the rms.
static double difference(const char *a, const char *b)
{
    alb_error error = {0};
    alb_image pictures[2];
    double off = 0, all = 0;
    check_ok(alb_exr_read(&pictures[0], a, &error) && alb_exr_read(&pictures[1], b, &error), &error);
    for (int y = 0; y < pictures[0].height; y++)
        for (int x = 0; x < pictures[0].width; x++)
            for (int c = 0; c < 3; c++) {
                const double one = (double)alb_image_at(&pictures[0], x, y)[c],
                             other = (double)alb_image_at(&pictures[1], x, y)[c];
                off += (one - other) * (one - other);
                all += other * other;
            }
    alb_image_free(&pictures[0]);
    alb_image_free(&pictures[1]);
    assert_true(all > 0);
    return sqrt(off / all);
}

static void frames_of_meshes_are_stills(void **state)
{
    (void)state;
    double exposure, first;
    write_blocks();
    write_scene("moves.json", FLOOR "," BLOCK, light_of(1), ",\"frames\":3");
    render("moves.json -o moves_##.exr --mesh moves_##.ply");
    assert_false(relit(0, &first));
    for (int frame = 1; frame < 3; frame++) {
        assert_false(relit(frame, &exposure));
        check_near(exposure, first, 0);
    }
    for (int frame = 0; frame < 3; frame++) {
        char objects[512], picture[32], mesh[32];
        snprintf(objects, sizeof objects, FLOOR ",{\"mesh\":\"block_%d.obj\",\"subdivide_mm\":4,\"material\":\"wax\"}",
                 frame);
        write_scene("still.json", objects, light_of(1), "");
        render("still.json -o still.exr");
        snprintf(picture, sizeof picture, "moves_%02d.exr", frame);
        check_near(difference(picture, "still.exr"), 0, 0);
        snprintf(mesh, sizeof mesh, "moves_%02d.ply", frame);
        assert_true(alb_file_exists(mesh));
        if (frame)
            assert_true(difference("moves_00.exr", picture) > 0.05);
    }
}

static void frames_of_lights_are_stills(void **state)
{
    (void)state;
    double exposure, first;
    write_lights();
    write_scene("lit.json", FLOOR "," BALL, "\"lights_#.json\"", ",\"frames\":3");
    render("lit.json -o lit_#.exr");
    assert_false(relit(0, &first));
    for (int frame = 1; frame < 3; frame++) {
        assert_true(relit(frame, &exposure));
        check_near(exposure, first, 0);
    }
    for (int frame = 0; frame < 3; frame++) {
        char picture[32];
        write_scene("still.json", FLOOR "," BALL, light_of(frame), "");
        render("still.json -o still.exr");
        snprintf(picture, sizeof picture, "lit_%d.exr", frame);
        check_below(difference(picture, "still.exr"), 3e-5); // twice the residual, and rounding to single precision
        if (frame)
            assert_true(difference("lit_0.exr", picture) > 0.05);
    }
}

// Rays that were enough for the light of one frame may not be for that of the next.
static void other_light_gets_the_rays_that_it_asks_for(void **state)
{
    (void)state;
    double exposure;
    save_text("lights_0.json", "{\"format\":1,\"lights\":[{\"kind\":\"environment\",\"radiance\":[1,1,1]}]}");
    for (int frame = 1; frame < 3; frame++)
        save_text(frame == 1 ? "lights_1.json" : "lights_2.json",
                  "{\"format\":1,\"lights\":[{\"kind\":\"spot\",\"position_mm\":[0,0,50],\"direction\":[0,0,-1],"
                  "\"half_angle_deg\":10,\"flux\":[1,1,1]}]}");
    write_scene("lit.json", FLOOR "," BALL, "\"lights_#.json\"", ",\"frames\":3,\"error_percent\":2");
    render("lit.json -o lit_#.exr");
    assert_false(relit(1, &exposure));
    assert_true(relit(2, &exposure));
    render("lit.json -o lit_#.exr --error 0.01"); // every row has as many as there can be
    assert_true(relit(1, &exposure));
    assert_true(relit(2, &exposure));
}

static void refuses_what_is_wrong(void **state)
{
    (void)state;
    write_lights();
    write_scene("lit.json", FLOOR "," BALL, "\"lights_#.json\"", ",\"frames\":3");
    refuses("lit.json -o lit.exr", "put ####", ALB_USAGE);
    refuses("lit.json -o lit_#.exr --mesh lit.ply", "put ####", ALB_USAGE);
    refuses("lit.json -o lit_#.exr --mesh lit_#.exr", "two files", ALB_USAGE);
    refuses("lit.json -o lit_#.txt", ".exr", ALB_USAGE);
    refuses("lit.json -o lit_#.exr --mesh lit_#.obj", ".ply", ALB_USAGE);
    refuses("lit.json -o lit_#.exr --png lit_#.jpg", ".png", ALB_USAGE);
    static const struct {
        const char *lights, *part;
        alb_status status;
    } cases[] = {
        {"{\"format\":1,\"lights\":[],\"light\":1}", "light", ALB_BAD_DATA},
        {"{\"format\":1,\"lights\":\"lights_1.json\"}", "lights", ALB_BAD_DATA},
        {"{\"format\":1}", "lights", ALB_BAD_DATA},
        {"[]", "lights_1.json", ALB_BAD_DATA},
        {"{\"format\":1,\"lights\":[{\"kind\":\"environment\",\"file\":\"none.exr\"}]}", "none.exr", ALB_ACCESS}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        remove("lit_0.exr");
        remove("lit_1.exr");
        save_text("lights_1.json", cases[i].lights);
        refuses("lit.json -o lit_#.exr", cases[i].part, cases[i].status);
        assert_true(alb_file_exists("lit_0.exr")); // what was done stays
        assert_false(alb_file_exists("lit_1.exr"));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_of_meshes_are_stills), cmocka_unit_test(frames_of_lights_are_stills),
        cmocka_unit_test(other_light_gets_the_rays_that_it_asks_for), cmocka_unit_test(refuses_what_is_wrong)};
    return cmocka_run_group_tests(tests, enter_folder, leave_folder);
}
