// Scene files: strict reading, and the command from end to end on a measured slab.
#include "base/exr.h"
#include "base/file.h"
#include "check.h"
#include "render/solution.h"

#define CAMERA                                                                                                         \
    "\"camera\":{\"position_mm\":[0,0,200],\"look_at_mm\":[0,0,0],\"up\":[0,1,0],\"vertical_field_deg\":12,\"width\":" \
    "81,\"height\":81}"
#define BOX                                                                                                            \
    "\"objects\":[{\"shape\":\"box\",\"size_mm\":[30,30,10],\"centre_mm\":[0,0,-5],\"cells\":[40,40,4],\"grading\":1." \
    "5,"                                                                                                               \
    "\"material\":\"m\"}]"
#define WHITE "\"materials\":{\"m\":{\"reflectance\":[0.5,0.5,0.5]}}"
#define WAX "\"materials\":{\"m\":{\"measured\":\"test_scene_material.json\",\"path\":\"slab\"}}"

static bool read_text(alb_scene *scene, const char *text, alb_error *error)
{
    alb_provenance provenance = {.command = "render"};
    check_ok(alb_file_write("test_scene.json", text, strlen(text), error), error);
    return alb_scene_read(scene, &provenance, "test_scene.json", error);
}

static void reads_a_scene(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene scene;
    check_ok(read_text(&scene,
                       "{\"format\":1," BOX "," WHITE ",\"lights\":[{\"kind\":\"environment\",\"radiance\":[1,2,3]},"
                       "{\"kind\":\"spot\",\"position_mm\":[0,0,9],\"direction\":[0,0,-2],\"half_angle_deg\":5,"
                       "\"flux\":[1,1,1]}]," CAMERA
                       ",\"rays_per_patch\":32,\"error_percent\":2,\"memory_mb\":3,\"residual\":1e-3,\"seed\":9}",
                       &error),
             &error);
    assert_int_equal(scene.mesh.face_count, 4 * 40 * 40 + 8 * 40 * 4);
    assert_int_equal(scene.light_count, 2);
    assert_int_equal(scene.rays_per_patch, 32);
    check_near(scene.error_percent, 2, 0);
    assert_int_equal(scene.memory_bytes, 3 << 20);
    check_near(scene.lights[1].direction.z, -1, 1e-15);
    alb_scene_free(&scene);
}

static void refuses_what_is_wrong(void **state)
{
    (void)state;
    static const char *const cases[][2] = {
        {"{\"format\":1}", "materials"},
        {"{\"format\":1," WHITE "," CAMERA "}", "objects"},
        {"{\"format\":1,\"objects\":[]," WHITE "," CAMERA "}", "0 objects"},
        {"{\"format\":1," BOX "," WHITE "}", "camera"},
        {"{\"format\":1," BOX "," WHITE "," CAMERA ",\"rays\":3}", "rays"},
        {"{\"format\":1," BOX "," WHITE "," CAMERA ",\"rays_per_patch\":1}", "rays_per_patch"},
        {"{\"format\":1," BOX "," WHITE "," CAMERA ",\"error_percent\":0}", "error_percent"},
        {"{\"format\":1," BOX "," WHITE "," CAMERA ",\"memory_mb\":0}", "memory_mb"},
        {"{\"format\":1," BOX ",\"materials\":{\"m\":{\"reflectance\":[0.5,0.5,1.5]}}," CAMERA "}", "reflectance"},
        {"{\"format\":1," BOX ",\"materials\":{\"x\":{\"reflectance\":[0,0,0]}}," CAMERA "}", "no material 'm'"},
        {"{\"format\":1," BOX ",\"materials\":{\"m\":{\"dipole\":{\"absorption_per_mm\":[1,1,1]}}}," CAMERA "}",
         "reduced"},
        {"{\"format\":1," BOX "," WHITE "," CAMERA ",\"lights\":[{\"kind\":\"lamp\"}]}", "found \"lamp\""},
        {"{\"format\":1," BOX "," WHITE "," CAMERA
         ",\"lights\":[{\"kind\":\"projector\",\"centre_mm\":[0,0,0],\"direction\":[0,0,0],"
         "\"diameter_mm\":1,\"flux\":[1,1,1]}]}",
         "length zero"},
        {"{\"format\":1,\"objects\":[{\"shape\":\"cone\",\"material\":\"m\"}]," WHITE "," CAMERA "}", "found \"cone\""},
        {"{\"format\":1,\"objects\":[{\"shape\":\"box\",\"size_mm\":[1,1,1],\"centre_mm\":[0,0,0],\"cells\":[4096,4096,"
         "4096],"
         "\"material\":\"m\"}]," WHITE "," CAMERA "}",
         "triangles"},
        {"{\"format\":1,\"objects\":[{\"shape\":\"box\",\"size_mm\":[1,1,1],\"centre_mm\":[0,0,0],\"cells\":[1,1,1],"
         "\"subdivide_mm\":1e-5,\"material\":\"m\"}]," WHITE "," CAMERA "}",
         "longer"},
        {"{\"format\":1," BOX "," WHITE ",\"camera\":{\"position_mm\":[0,0,1],\"look_at_mm\":[0,0,0],\"up\":[0,0,1],"
         "\"vertical_field_deg\":12,\"width\":9,\"height\":9}}",
         "up"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        alb_error error = {0};
        alb_scene scene;
        check_fails(read_text(&scene, cases[i][0], &error), &error, ALB_BAD_DATA, cases[i][1]);
        assert_null(scene.surfaces);
    }
    alb_error error = {0};
    alb_scene scene;
    check_fails(read_text(&scene,
                          "{\"format\":1,\"objects\":[{\"mesh\":\"absent.obj\",\"material\":\"m\"}]," WHITE "," CAMERA
                          "}",
                          &error),
                &error, ALB_ACCESS, "absent.obj");
}

// a e^(-b r) on both faces, with the total that belongs to it.
static void write_material(double a, double b, double transmitted)
{
    alb_error error = {0};
    alb_json json;
    alb_json_begin(&json, NULL);
    alb_json_string(&json, "name", "wax");
    alb_json_number(&json, "thickness_mm", 10);
    alb_json_object(&json, "channels");
    for (int c = 0; c < 3; c++) {
        alb_json_object(&json, (const char *[]){"R", "G", "B"}[c]);
        for (int side = 0; side < ALB_SIDES; side++) {
            const alb_profile profile = {ALB_FORM_EXPONENTIAL, {side ? transmitted : a, b}};
            const double zero = 0;
            alb_json_object(&json, alb_side_names[side]);
            alb_json_string(&json, "form", "exponential");
            alb_json_boolean(&json, "identifiable", true);
            alb_json_object(&json, "parameters");
            for (int p = 0; p < 2; p++)
                alb_json_estimate(&json, alb_form_parameter_name(profile.form, p), profile.parameters[p], 0);
            alb_json_end_object(&json);
            alb_json_list(&json, "covariance");
            for (int p = 0; p < 2; p++)
                alb_json_numbers(&json, NULL, (const double[]){zero, zero}, 2);
            alb_json_end_list(&json);
            alb_json_estimate(&json, "total", alb_profile_total(&profile), 0);
            alb_json_number(&json, "chi_square", 1);
            alb_json_integer(&json, "degrees_of_freedom", 1);
            alb_json_end_object(&json);
        }
        alb_json_end_object(&json);
    }
    alb_json_end_object(&json);
    check_ok(alb_json_write(&json, "test_scene_material.json", &error), &error);
}

static int render(const char *threads, const char *name)
{
    char command[2048];
    snprintf(command, sizeof command,
             "OMP_NUM_THREADS=%s '%s' render test_scene.json -o %s.exr --mesh %s.ply >/dev/null 2>&1", threads,
             ALB_PROGRAM, name, name);
    const int status = system(command);
    return status == -1 ? -1 : status >> 8;
}

static void same_file(const char *a, const char *b)
{
    alb_error error = {0};
    char *bytes[2];
    size_t size[2];
    check_ok(alb_file_read(&bytes[0], &size[0], a, &error), &error);
    check_ok(alb_file_read(&bytes[1], &size[1], b, &error), &error);
    assert_int_equal(size[0], size[1]);
    assert_memory_equal(bytes[0], bytes[1], size[0]);
    free(bytes[0]);
    free(bytes[1]);
}

// A projector's narrow beam of flux 1 on a measured slab: away from the beam, the picture is S(r) / pi.
static void a_measured_slab_gives_its_profile_back(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_image picture = {0};
    const double a = 0.015, b = 0.4;
    write_material(a, b, 0.003);
    static const char scene[] =
        "{\"format\":1," BOX "," WAX ",\"lights\":[{\"kind\":\"projector\",\"centre_mm\":[0,0,0],"
        "\"direction\":[0,0,-1],\"pixel_mm\":0.2,\"diameter_px\":4,\"blur_sd_mm\":0.1,\"flux\":[1,1,1]}]," CAMERA "}";
    check_ok(alb_file_write("test_scene.json", scene, strlen(scene), &error), &error);
    assert_int_equal(render("1", "test_scene_1"), 0);
    assert_int_equal(render("2", "test_scene_2"), 0);
    same_file("test_scene_1.exr", "test_scene_2.exr");
    same_file("test_scene_1.png", "test_scene_2.png");
    same_file("test_scene_1.ply", "test_scene_2.ply");
    check_ok(alb_exr_read(&picture, "test_scene_1.exr", &error), &error);
    const double mm_per_px = 2 * 200 * tan(6 * M_PI / 180) / 81;
    for (int x = 6; x < 81; x += 3)
        for (int y = 5; y < 81; y += 4) {
            const double r = mm_per_px * hypot(x - 40, y - 40);
            // Outside the spot. Averaging over the patches around a corner and interpolating between corners each lift
            // a convex profile by about (b h)^2 / 10, h = 1.2 mm the longest edge; the spot itself widens S by 0.4 %.
            if (r > 2 && r < 11)
                check_relative((double)alb_image_at(&picture, x, y)[1], a * exp(-b * r) / M_PI, 0.05);
        }
    alb_image_free(&picture);
}

// Light leaves a face by Fresnel's law where the material says that it is smooth and of which index; else by Lambert's.
static void the_finish_decides_the_directions(void **state)
{
    (void)state;
    static const char measured[] = "{\"format\":1," BOX "," WAX "," CAMERA "}";
    static const char *const said[] = {"\"refractive_index\": 1.5, \"finish\": \"smooth\",",
                                       "\"refractive_index\": 1.5, \"finish\": \"ground\",",
                                       "\"refractive_index\": 1.5,", "\"finish\": \"smooth\",", ""};
    for (int k = 0; k < 5; k++) {
        alb_error error = {0};
        alb_scene scene;
        char *bytes, *at;
        size_t size;
        alb_text text = {0};
        write_material(0.015, 0.4, 0.003);
        check_ok(alb_file_read(&bytes, &size, "test_scene_material.json", &error), &error);
        assert_non_null(at = strstr(bytes, "\"channels\""));
        alb_text_add_bytes(&text, bytes, (size_t)(at - bytes));
        alb_text_add(&text, "%s%s", said[k], at);
        check_ok(alb_file_write_text("test_scene_material.json", &text, &error), &error);
        check_ok(read_text(&scene, measured, &error), &error);
        for (int side = 0; side < ALB_SIDES; side++) {
            assert_int_equal(scene.surfaces[0].exits[side].smooth, k == 0);
            assert_int_equal(scene.surfaces[0].exits[side].side, k < 2 ? side : 0);
        }
        alb_scene_free(&scene);
        alb_text_free(&text);
        free(bytes);
    }
    for (int k = 0; k < 3; k++) {
        alb_error error = {0};
        alb_scene scene;
        char dipole[1024];
        snprintf(dipole, sizeof dipole,
                 "{\"format\":1,%s,\"materials\":{\"m\":{\"dipole\":{\"absorption_per_mm\":[1,1,1],"
                 "\"reduced_scattering_per_mm\":[1,1,1],\"refractive_index\":1.5%s}}},%s}",
                 BOX, (const char *[]){"", ",\"finish\":\"smooth\"", ",\"finish\":\"ground\""}[k], CAMERA);
        check_ok(read_text(&scene, dipole, &error), &error);
        assert_int_equal(scene.surfaces[0].exits[ALB_REFLECTION].smooth, k < 2);
        alb_scene_free(&scene);
    }
}

// A render that is refused leaves what an earlier one wrote.
static void a_refused_scene_leaves_earlier_results(void **state)
{
    (void)state;
    alb_error error = {0};
    static const char scene[] = "{\"format\":1," BOX "," WAX ",\"lights\":[]," CAMERA "}";
    write_material(0.05, 0.4, 0.003); // total 1.96
    check_ok(alb_file_write("test_scene.json", scene, strlen(scene), &error), &error);
    assert_int_equal(render("2", "test_scene_1"), ALB_BAD_DATA);
    same_file("test_scene_1.exr", "test_scene_2.exr");
    static const char *const made[] = {"test_scene.json",  "test_scene_material.json", "test_scene_1.exr",
                                       "test_scene_1.png", "test_scene_1.ply",         "test_scene_2.exr",
                                       "test_scene_2.png", "test_scene_2.ply"};
    for (size_t i = 0; i < sizeof made / sizeof *made; i++)
        remove(made[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(reads_a_scene),
        cmocka_unit_test(refuses_what_is_wrong),
        cmocka_unit_test(a_measured_slab_gives_its_profile_back),
        cmocka_unit_test(the_finish_decides_the_directions),
        cmocka_unit_test(a_refused_scene_leaves_earlier_results),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
