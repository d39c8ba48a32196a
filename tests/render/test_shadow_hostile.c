// Scenes that break shadow renderers, through the command: one line of error or a right picture.
#include "base/exr.h"
#include "base/file.h"
#include "check.h"
#include "render/shadow_command.h"
#include "render/shape.h"
#include <dirent.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

enum { WIDTH = 40, HEIGHT = 30 };

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

static void write_ball(const char *path, alb_vector centre, double radius)
{
    alb_error error = {0};
    alb_mesh mesh = {0};
    alb_text text = {0};
    check_ok(alb_shape_sphere(&mesh, &(alb_sphere){centre, radius, 2, false}, &error), &error);
    for (size_t v = 0; v < mesh.vertex_count; v++)
        alb_text_add(&text, "v %.9g %.9g %.9g\n", mesh.vertices[v].x, mesh.vertices[v].y, mesh.vertices[v].z);
    for (size_t f = 0; f < mesh.face_count; f++)
        alb_text_add(&text, "f %u %u %u\n", mesh.faces[f][0] + 1, mesh.faces[f][1] + 1, mesh.faces[f][2] + 1);
    check_ok(alb_file_write_text(path, &text, &error), &error);
    alb_text_free(&text);
    alb_mesh_free(&mesh);
}

// A ground of 200 x 200 at height 0, all lengths times `scale`; the camera looks down from `eye` (in units of scale).
static void write_scene(const char *objects, double scale, alb_vector eye, int frames)
{
    char text[4096];
    snprintf(text, sizeof text,
             "{\"format\":1,\"frames\":%d,\"objects\":[{\"shape\":\"box\",\"size_mm\":[%.9g,%.9g,%.9g],"
             "\"centre_mm\":[0,0,%.9g],\"cells\":[20,20,1],\"material\":\"m\",\"shadow\":\"receives\"}%s],"
             "\"materials\":{\"m\":{\"reflectance\":[0.5,0.5,0.5]},\"lamp\":{\"reflectance\":[0,0,0],"
             "\"exitance\":[9,9,9]}},\"camera\":{\"position_mm\":[%.9g,%.9g,%.9g],\"look_at_mm\":[0,0,0],"
             "\"up\":[0,1,0],\"vertical_field_deg\":40,\"width\":%d,\"height\":%d}}",
             frames, 200 * scale, 200 * scale, 2 * scale, -scale, objects, scale * eye.x, scale * eye.y, scale * eye.z,
             WIDTH, HEIGHT);
    write_text("scene.json", text);
}

static const alb_vector above = {0, 1, 200};

static bool render(const char *picture, alb_error *error)
{
    return alb_shadow_render("scene.json", picture, NULL, NULL, NULL, true, error);
}

// The pictures' pixels, all finite and not negative.
static void picture_of(float out[HEIGHT][WIDTH], const char *objects, double scale, alb_vector eye)
{
    alb_error error = {0};
    alb_image picture;
    write_scene(objects, scale, eye, 1);
    check_ok(render("out.exr", &error), &error);
    check_ok(alb_exr_read(&picture, "out.exr", &error), &error);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            out[y][x] = alb_image_at(&picture, x, y)[0];
            assert_true(isfinite(out[y][x]) && out[y][x] >= 0);
        }
    alb_image_free(&picture);
}

#define LAMP ",{\"mesh\":\"lamp.obj\",\"material\":\"lamp\"}"
#define BALL ",{\"mesh\":\"ball.obj\",\"material\":\"m\"}"

static float open_sky[HEIGHT][WIDTH], found[HEIGHT][WIDTH];
enum { X = WIDTH / 2, Y = HEIGHT / 2 };

static void light_inside_an_object(void **state)
{
    (void)state;
    write_ball("lamp.obj", (alb_vector){0, 0, 60}, 5);
    write_ball("ball.obj", (alb_vector){0, 0, 60}, 15);
    picture_of(open_sky, LAMP, 1, (alb_vector){0, -200, 100});
    picture_of(found, LAMP BALL, 1, (alb_vector){0, -200, 100});
    print_message("in the middle %.4f of %.4f\n", (double)found[Y][X], (double)open_sky[Y][X]);
    check_below((double)found[Y][X], 0.1 * (double)open_sky[Y][X]); // what order 8 lets through its closed wall
}

static void lights_that_coincide(void **state)
{
    (void)state;
    write_ball("lamp.obj", (alb_vector){30, 0, 80}, 10);
    write_ball("ball.obj", (alb_vector){-10, 0, 30}, 10);
    picture_of(open_sky, LAMP BALL, 1, above);
    picture_of(found, LAMP LAMP BALL, 1, above);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            const double once = (double)open_sky[y][x], twice = (double)found[y][x];
            if (once < 1)                      // not the lamps themselves, of which the nearest is seen
                check_near(twice, once, 1e-5); // faces that stand there twice are left out
        }
}

static void receiver_on_a_light(void **state)
{
    (void)state;
    write_ball("lamp.obj", (alb_vector){0, 0, 10}, 10); // touches a vertex of the ground
    write_ball("ball.obj", (alb_vector){0, 0, 10}, 10); // the same again, of the ground's material
    picture_of(found, LAMP, 1, (alb_vector){0, -200, 60});
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++)
            check_below((double)found[y][x], 9 / M_PI * 1.001);
    picture_of(found, LAMP BALL, 1, (alb_vector){0, -200, 60});
}

static void camera_inside_the_caster(void **state)
{
    (void)state;
    write_ball("lamp.obj", (alb_vector){0, 0, 90}, 10);
    write_ball("ball.obj", (alb_vector){0, 0, 30}, 15);
    picture_of(found, LAMP BALL, 1, (alb_vector){0, 1, 30});
}

static void lengths_have_no_scale(void **state)
{
    (void)state;
    static const double scales[3] = {1, 1e-4, 1e4};
    for (int k = 0; k < 3; k++) {
        write_ball("lamp.obj", (alb_vector){30 * scales[k], 0, 80 * scales[k]}, 10 * scales[k]);
        write_ball("ball.obj", (alb_vector){-10 * scales[k], 0, 30 * scales[k]}, 10 * scales[k]);
        picture_of(k ? found : open_sky, LAMP BALL, scales[k], above);
        for (int y = 0; y < HEIGHT && k; y++)
            for (int x = 0; x < WIDTH; x++)
                if (open_sky[y][x] < 1 && found[y][x] < 1) // edges of the lamp may move a pixel
                    check_near((double)found[y][x], (double)open_sky[y][x], 0.02 * (double)open_sky[Y][X]);
    }
}

static void single_triangles(void **state)
{
    (void)state;
    write_text("ball.obj", "v -20 -20 40\nv 20 -20 40\nv 0 30 40\nf 1 2 3\n");
    write_text("lamp.obj", "v -20 -20 90\nv 20 -20 90\nv 0 30 90\nf 1 3 2\n"); // shines down
    picture_of(open_sky, LAMP, 1, (alb_vector){0, -200, 60});
    picture_of(found, LAMP BALL, 1, (alb_vector){0, -200, 60});
    double before = 0, behind = 0;
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++)
            before += (double)open_sky[y][x], behind += (double)found[y][x];
    check_below(behind, 0.97 * before);
    write_text("lamp.obj", "v -20 -20 90\nv 20 -20 90\nv 0 -20 90\nf 1 3 2\n"); // without area: dark
    alb_error error = {0};
    write_scene(LAMP BALL, 1, above, 1);
    if (!render("out.exr", &error))
        assert_true(error.status == ALB_BAD_DATA && !strchr(error.text, '\n'));
}

static void nothing_finite_in_the_third_mesh(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_image picture;
    static const char *const bad[] = {"v nan 0 30\n", "v inf 0 30\n", "v 1e300 0 30\n", "v 0 0\n"};
    write_ball("lamp.obj", (alb_vector){0, 0, 90}, 10);
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        char text[256];
        write_text("part_0.obj", "v -20 -20 40\nv 20 -20 40\nv 0 30 40\nf 1 2 3\n");
        write_text("part_1.obj", "v -20 -20 45\nv 20 -20 45\nv 0 30 45\nf 1 2 3\n");
        snprintf(text, sizeof text, "%sv 20 -20 40\nv 0 30 40\nf 1 2 3\n", bad[k]);
        write_text("part_2.obj", text);
        write_scene(LAMP ",{\"mesh\":\"part_#.obj\",\"material\":\"m\"}", 1, above, 3);
        check_fails(render("frame_#.exr", &error), &error, ALB_BAD_DATA, "part_2.obj");
        for (int frame = 0; frame < 2; frame++) {
            char name[32];
            snprintf(name, sizeof name, "frame_%d.exr", frame);
            check_ok(alb_exr_read(&picture, name, &error), &error);
            alb_image_free(&picture);
            remove(name);
        }
        assert_false(alb_file_exists("frame_2.exr"));
    }
}

// Killed at any moment: the files that have their names are whole.
static void killed_in_between(void **state)
{
    (void)state;
    char *const arguments[] = {"alabaster", "render", "scene.json", "--method", "shadow", "-o", "frame_##.exr", NULL};
    write_ball("lamp.obj", (alb_vector){0, 0, 90}, 10);
    write_ball("ball.obj", (alb_vector){0, 0, 30}, 15);
    write_scene(LAMP BALL, 1, above, 60);
    size_t whole = 0;
    for (int n = 0; n < 6; n++) {
        const pid_t child = fork();
        if (child == 0) {
            if (freopen("/dev/null", "w", stdout) && freopen("/dev/null", "w", stderr))
                execv(ALB_PROGRAM, arguments);
            _exit(127);
        }
        assert_true(child > 0);
        usleep((useconds_t)(60000 + 90000 * n));
        kill(child, SIGKILL);
        waitpid(child, NULL, 0);
        for (int frame = 0; frame < 60; frame++) {
            alb_error error = {0};
            alb_image picture;
            char name[32];
            snprintf(name, sizeof name, "frame_%02d.exr", frame);
            if (!alb_file_exists(name))
                continue;
            check_ok(alb_exr_read(&picture, name, &error), &error);
            alb_image_free(&picture);
            remove(name);
            whole++;
        }
    }
    print_message("%zu frames were whole\n", whole);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(light_inside_an_object),
        cmocka_unit_test(lights_that_coincide),
        cmocka_unit_test(receiver_on_a_light),
        cmocka_unit_test(camera_inside_the_caster),
        cmocka_unit_test(lengths_have_no_scale),
        cmocka_unit_test(single_triangles),
        cmocka_unit_test(nothing_finite_in_the_third_mesh),
        cmocka_unit_test(killed_in_between),
    };
    return cmocka_run_group_tests(tests, enter_folder, leave_folder);
}
