// Scenes for --method shadow: what their keys mean, frames and their names, what is refused; the command from end to
// end; the error that is stated.
#include "base/exr.h"
#include "program.h"
#include "render/shadow_advisor.h"
#include "render/shadow_command.h"
#include "scenes/shadow_scenes.h"
#include <dirent.h>
#include <unistd.h>

#define CAMERA                                                                                                         \
    "\"camera\":{\"position_mm\":[0,-200,120],\"look_at_mm\":[0,0,0],\"up\":[0,0,1],\"vertical_field_deg\":40,"        \
    "\"width\":64,\"height\":48}"
#define MATERIALS                                                                                                      \
    "\"materials\":{\"m\":{\"reflectance\":[0.5,0.5,0.5]},\"lamp\":{\"reflectance\":[0,0,0],\"exitance\":[9,9,9]}}"
#define GROUND                                                                                                         \
    "{\"shape\":\"box\",\"size_mm\":[200,200,2],\"centre_mm\":[0,0,-1],\"cells\":[20,20,1],\"material\":\"m\","        \
    "\"shadow\":\"receives\"}"
#define BALL "{\"mesh\":\"test_shadow_#.obj\",\"material\":\"m\"}"
#define RIGID "{\"mesh\":\"test_shadow_#.obj\",\"material\":\"m\",\"rigid\":true}"

static int enter_folder(void **state)
{
    static char folder[] = "/tmp/alabaster_shadow_XXXXXX";
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

static void write_text(const char *path, const char *text)
{
    alb_error error = {0};
    check_ok(alb_file_write(path, text, strlen(text), &error), &error);
}

// Three frames of a block that rises.
static void write_frames(void)
{
    for (int frame = 0; frame < 3; frame++) {
        char name[32], text[512];
        const int low = 5 + 20 * frame, high = low + 20;
        snprintf(name, sizeof name, "test_shadow_%d.obj", frame);
        snprintf(text, sizeof text,
                 "v -20 -20 %d\nv 20 -20 %d\nv 20 20 %d\nv -20 20 %d\nv -20 -20 %d\nv 20 -20 %d\nv 20 20 %d\nv -20 20 "
                 "%d\nf 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n",
                 low, low, low, low, high, high, high, high);
        write_text(name, text);
    }
}

static void write_scene(const char *objects, const char *lights, int frames)
{
    char text[2048];
    snprintf(text, sizeof text, "{\"format\":1,\"frames\":%d,\"objects\":[%s],%s" MATERIALS "," CAMERA "}", frames,
             objects, lights);
    write_text("test_shadow.json", text);
}

static bool render(const char *picture, const char *mesh, const char *percent, alb_error *error)
{
    return alb_shadow_render("test_shadow.json", picture, NULL, mesh, percent, true, error);
}

static void reads_its_keys(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene scene;
    alb_provenance provenance = {0};
    write_frames();
    write_scene(GROUND "," RIGID,
                "\"lights\":[{\"kind\":\"environment\",\"radiance\":[1,1,1],\"centre_mm\":[1,2,3],"
                "\"radius_mm\":500}],",
                3);
    for (int frame = 0; frame < 3; frame++) {
        check_ok(alb_scene_read_frame(&scene, &provenance, "test_shadow.json", frame, &error), &error);
        assert_int_equal(scene.frames, 3);
        assert_int_equal(scene.object_count, 2);
        assert_true(scene.objects[0].receives_only && !scene.objects[1].receives_only);
        assert_true(!scene.objects[0].rigid && scene.objects[1].rigid);
        assert_int_equal(scene.objects[1].first_vertex, scene.objects[0].vertex_count);
        assert_int_equal(scene.objects[1].vertex_count, 8);
        check_near(scene.mesh.vertices[scene.objects[1].first_vertex].z, 5 + 20 * frame, 0);
        check_near(scene.lights[0].radius_mm, 500, 0);
        check_near(scene.lights[0].position_mm.y, 2, 0);
        alb_scene_free(&scene);
    }
}

static void frames_are_numbered(void **state)
{
    (void)state;
    char out[ALB_PATH_SIZE];
    alb_error error = {0};
    static const struct {
        const char *name;
        int frame;
        const char *expected;
    } cases[] = {{"a#.obj", 7, "a7.obj"},
                 {"####/a##b", 7, "0007/a07b"},
                 {"a##", 1234, "a1234"},
                 {"plain.obj", 3, "plain.obj"},
                 {"", 3, ""},
                 {"#", 0, "0"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        check_ok(alb_scene_frame_name(out, cases[i].name, cases[i].frame, &error), &error);
        assert_string_equal(out, cases[i].expected);
    }
    static char hashes[ALB_PATH_SIZE], names[ALB_PATH_SIZE];
    memset(hashes, '#', sizeof hashes - 1);
    check_ok(alb_scene_frame_name(out, hashes, 5, &error), &error);
    memset(names, 'a', sizeof names - 2);
    names[sizeof names - 2] = '#';
    check_fails(alb_scene_frame_name(out, names, 10, &error), &error, ALB_BAD_DATA, "too long");
}

static void refuses_what_is_wrong(void **state)
{
    (void)state;
    alb_error error = {0};
    write_frames();
    static const struct {
        const char *objects, *lights;
        int frames;
        const char *picture, *mesh, *percent, *part;
        alb_status status;
    } cases[] = {
        {GROUND "," BALL, "\"lights\":[{\"kind\":\"point\",\"position_mm\":[0,0,99],\"flux\":[1,1,1]}],", 3, "a_#.exr",
         NULL, NULL, "light 0 is a point", ALB_BAD_DATA},
        {GROUND "," BALL, "", 3, "a_#.exr", NULL, NULL, "no light", ALB_BAD_DATA},
        {GROUND "," BALL, "\"lights\":[{\"kind\":\"environment\",\"radiance\":[1,1,1]}],", 3, "a.exr", NULL, NULL,
         "put ####", ALB_USAGE},
        {GROUND "," BALL, "\"lights\":[{\"kind\":\"environment\",\"radiance\":[1,1,1]}],", 4, "a_#.exr", NULL, NULL,
         "test_shadow_3.obj", ALB_ACCESS},
        {GROUND "," BALL,
         "\"lights\":[{\"kind\":\"environment\",\"radiance\":[1,1,1],\"radius_mm\":99,\"centre_mm\":[0,0,0]}],", 3,
         "a_#.exr", NULL, NULL, "radius_mm must be larger", ALB_BAD_DATA},
        {GROUND "," BALL, "\"lights\":[{\"kind\":\"environment\",\"radiance\":[1,1,1],\"radius_mm\":-9}],", 3,
         "a_#.exr", NULL, NULL, "radius_mm", ALB_BAD_DATA},
        {GROUND, "\"lights\":[{\"kind\":\"environment\",\"radiance\":[1,1,1]}],", 0, "a.exr", NULL, NULL, "frames",
         ALB_BAD_DATA},
        {GROUND ",{\"mesh\":\"test_shadow_0.obj\",\"material\":\"m\",\"shadow\":\"no\"}", "", 1, "a.exr", NULL, NULL,
         "shadow", ALB_BAD_DATA},
        {GROUND ",{\"mesh\":\"test_shadow_0.obj\",\"material\":\"m\",\"rigid\":1}", "", 1, "a.exr", NULL, NULL, "rigid",
         ALB_BAD_DATA},
        {GROUND, "", 1, "a.exr", "a.ply", NULL, "--mesh", ALB_USAGE},
        {GROUND, "", 1, "a.exr", NULL, "many", "--error", ALB_USAGE},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        write_scene(cases[i].objects, cases[i].lights, cases[i].frames);
        check_fails(render(cases[i].picture, cases[i].mesh, cases[i].percent, &error), &error, cases[i].status,
                    cases[i].part);
    }
}

// Every frame is there, of one exposure, the same bytes every time; the shadow grows fainter as the block rises.
static void renders_a_sequence(void **state)
{
    (void)state;
    alb_error error = {0};
    char first[3][ALB_HASH_SIZE], again[ALB_HASH_SIZE], name[64];
    double dark[3];
    write_frames();
    write_scene(GROUND "," BALL, "\"lights\":[{\"kind\":\"environment\",\"radiance\":[1,1,1]}],", 3);
    for (int pass = 0; pass < 2; pass++) {
        check_ok(render("test_shadow_##.exr", NULL, NULL, &error), &error);
        for (int frame = 0; frame < 3; frame++) {
            alb_image picture;
            snprintf(name, sizeof name, "test_shadow_%02d.exr", frame);
            check_ok(alb_hash_file(pass ? again : first[frame], name, &error), &error);
            if (pass)
                assert_string_equal(first[frame], again);
            check_ok(alb_exr_read(&picture, name, &error), &error);
            dark[frame] = (double)alb_image_at(&picture, 20, 30)[0]; // ground beside the block
            alb_image_free(&picture);
            snprintf(name, sizeof name, "test_shadow_%02d.png", frame);
            assert_true(alb_file_exists(name));
        }
    }
    assert_true(dark[0] < dark[1] && dark[1] < dark[2]);
    check_below(dark[2], 0.5); // albedo 0.5 under an even sky of 1
}

// No number where there is none.
static void says_in_words_that_nothing_is_lit(void **state)
{
    (void)state;
    write_frames();
    write_scene(GROUND "," BALL, "\"lights\":[{\"kind\":\"environment\",\"radiance\":[0,0,0]}],", 3);
    assert_int_equal(run("render test_shadow.json --method shadow -o dark_#.exr"), 0);
    assert_non_null(strstr(output, "nothing is lit"));
    assert_null(strstr(output, "nan"));
    assert_int_equal(run("render test_shadow.json --method shadow -o dark_#.exr --error 5"), ALB_UNDECIDED);
    assert_non_null(strstr(complaint, "nothing is lit"));
    forget_runs();
}

static void says_what_error_it_makes(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene scene;
    alb_shadow_verdict made;
    check_ok(shadow_scenes[2].create(&scene, 20, &error), &error);
    alb_shadow_stage stage = {.settings = alb_shadow_defaults};
    check_ok(alb_shadow_stage_light(&stage, &scene, &error), &error);
    check_ok(alb_shadow_error(&made, &stage, &scene, 1, &error), &error);
    assert_true(made.percent > 0.5 && made.percent < made.upper_percent && made.upper_percent < 20);
    // what is spoilt by 30 % everywhere must be said to be so
    for (size_t v = 0; v < scene.mesh.vertex_count; v++)
        for (int c = 0; c < 3; c++)
            stage.irradiance[v][c] *= 1.3F;
    check_ok(alb_shadow_error(&made, &stage, &scene, 1, &error), &error);
    print_message("spoilt by 30 %%: %.1f, within %.1f\n", made.percent, made.upper_percent);
    assert_true(made.percent > 25 && made.upper_percent < 60);
    check_ok(alb_shadow_advise(&stage, &made, &scene, 8, 1, &error), &error);
    assert_true(made.upper_percent <= 8);
    check_fails(alb_shadow_advise(&stage, &made, &scene, 0.01, 1, &error), &error, ALB_UNDECIDED, "radiosity");
    alb_shadow_stage_free(&stage);
    alb_scene_free(&scene);
}

// Without skies shells that lines of sight to a light make no use of are not sampled; with the first sky they are.
static void lights_alone_need_fewer_shells(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene scene;
    alb_light sky = {.kind = ALB_LIGHT_ENVIRONMENT, .radiance = {1, 1, 1}};
    check_ok(shadow_scenes[1].create(&scene, 0, &error), &error);
    alb_light *const none = scene.lights;
    assert_int_equal(scene.light_count, 0);
    alb_shadow_stage stage = {.settings = alb_shadow_defaults};
    stage.settings.inner = 1, stage.settings.outer = 2, stage.settings.far = true;
    check_ok(alb_shadow_stage_light(&stage, &scene, &error), &error);
    assert_int_equal(stage.fields[0].shell_count, 2);
    scene.lights = &sky, scene.light_count = 1;
    check_ok(alb_shadow_stage_light(&stage, &scene, &error), &error);
    assert_int_equal(stage.fields[0].shell_count, 4);
    scene.lights = none, scene.light_count = 0;
    alb_shadow_stage_free(&stage);
    alb_scene_free(&scene);
}

static void four_scenes_have_their_counts(void **state)
{
    (void)state;
    for (int i = 0; i < SHADOW_SCENES; i++) {
        alb_error error = {0};
        alb_scene first, scene;
        check_ok(shadow_scenes[i].create(&first, 0, &error), &error);
        check_relative((double)first.objects[0].vertex_count, (double)shadow_scenes[i].plane_vertices, 0.02);
        check_relative((double)first.objects[1].vertex_count, (double)shadow_scenes[i].model_vertices, 0.05);
        check_ok(shadow_scenes[i].create(&scene, 17, &error), &error);
        assert_int_equal(first.mesh.face_count, scene.mesh.face_count);
        assert_memory_equal(first.mesh.faces, scene.mesh.faces, scene.mesh.face_count * sizeof *scene.mesh.faces);
        alb_shadow_stage stage = {.settings = alb_shadow_defaults};
        check_ok(alb_shadow_stage_light(&stage, &scene, &error), &error);
        const alb_shadow_field *fields = stage.fields;
        check_ok(alb_shadow_stage_light(&stage, &first, &error), &error);
        assert_ptr_equal(fields, stage.fields); // kept from frame to frame
        for (size_t v = 0; v < scene.mesh.vertex_count; v++)
            for (int c = 0; c < 3; c++)
                assert_true(stage.irradiance[v][c] >= 0 && (double)stage.irradiance[v][c] < 1e3);
        alb_shadow_stage_free(&stage);
        alb_scene_free(&first);
        alb_scene_free(&scene);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(reads_its_keys),
        cmocka_unit_test(frames_are_numbered),
        cmocka_unit_test(refuses_what_is_wrong),
        cmocka_unit_test(renders_a_sequence),
        cmocka_unit_test(says_in_words_that_nothing_is_lit),
        cmocka_unit_test(says_what_error_it_makes),
        cmocka_unit_test(four_scenes_have_their_counts),
        cmocka_unit_test(lights_alone_need_fewer_shells),
    };
    return cmocka_run_group_tests(tests, enter_folder, leave_folder);
}
