// A scene whose material is a table: the same light as the profile it was made of.
#include "base/file.h"
#include "base/random.h"
#include "check.h"
#include "render/scene.h"

static const char csv[] = "test_tabulated_scene.csv", json[] = "test_tabulated_scene.json";

static void write_table_to(const char *path, const alb_profile *of, double step_mm, int lines)
{
    alb_error error = {0};
    alb_text text = {0};
    alb_text_add(&text, "r_mm,value_per_mm2\n");
    for (int i = 0; i < lines; i++)
        alb_text_add(&text, "%.9g,%.9g\n", i * step_mm, alb_profile_value(of, i * step_mm));
    check_ok(alb_file_write_text(path, &text, &error), &error);
    alb_text_free(&text);
}

static void write_table(const alb_profile *of, double step_mm, int lines) { write_table_to(csv, of, step_mm, lines); }

static void add_scene(alb_text *text, const char *tabulated)
{
    alb_text_add(text, "{\"format\":1,\"objects\":[{\"shape\":\"box\",\"size_mm\":[40,40,10],\"centre_mm\":[0,0,0],"
                       "\"cells\":[20,20,5],\"material\":\"m\"}],\"materials\":{\"m\":{\"tabulated\":{");
    alb_text_add(text, "%s", tabulated);
    alb_text_add(text, "}}},\"camera\":{\"position_mm\":[0,0,100],\"look_at_mm\":[0,0,0],\"up\":[0,1,0],"
                       "\"vertical_field_deg\":12,\"width\":9,\"height\":9}}");
}

static bool read_scene(alb_scene *scene, const char *tabulated, alb_error *error)
{
    alb_provenance provenance = {0};
    alb_text text = {0};
    add_scene(&text, tabulated);
    check_ok(alb_file_write_text(json, &text, error), error);
    alb_text_free(&text);
    const bool ok = alb_scene_read(scene, &provenance, json, error);
    assert_true(!ok || provenance.input_count == 2);
    return ok;
}

#define THREE "[\"test_tabulated_scene.csv\",\"test_tabulated_scene.csv\",\"test_tabulated_scene.csv\"]"

// S'E of random light, of the table and of the exponential it was made of.
static void a_table_scatters_as_its_exponential(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene scene;
    alb_patches patches;
    alb_scatter scatter[2];
    const alb_profile truth = {ALB_FORM_EXPONENTIAL, {0.01, 0.3}};
    write_table(&truth, 0.5, 60);
    check_ok(read_scene(&scene, "\"reflection\":" THREE ",\"transmission\":" THREE ",\"thickness_mm\":10", &error),
             &error);
    alb_surface surface = scene.surfaces[0];
    assert_true(surface.scatters && surface.slab && surface.thickness_mm == 10);
    for (int k = 0; k < 3 * ALB_SIDES; k++)
        surface.profiles[k / 3][k % 3] = truth;
    check_ok(alb_patches_create(&patches, &scene.mesh, &error), &error);
    double(*in)[3] = calloc(patches.count, sizeof *in), (*out[2])[3];
    for (size_t i = 0; i < patches.count; i++)
        for (int c = 0; c < 3; c++) {
            alb_random random = alb_random_at(1, (uint64_t)c, i);
            in[i][c] = alb_random_uniform(&random);
        }
    for (int k = 0; k < 2; k++) {
        out[k] = calloc(patches.count, sizeof *in);
        check_ok(
            alb_scatter_create(&scatter[k], &patches, scene.mesh.groups, k ? &surface : scene.surfaces, 0.005, &error),
            &error);
        alb_scatter_apply(out[k], &scatter[k], (const double(*)[3])in);
    }
    for (size_t i = 0; i < patches.count; i++) // tables of scattering are in single precision; links are alike
        for (int c = 0; c < 3; c++)
            check_relative(out[0][i][c], out[1][i][c], 1e-5);
    for (int k = 0; k < 2; k++) {
        alb_scatter_free(&scatter[k]);
        free(out[k]);
    }
    free(in);
    alb_patches_free(&patches);
    alb_scene_free(&scene);
}

// Six files, each an exponential of its own.
static void each_channel_and_face_has_its_file(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_provenance provenance = {0};
    alb_scene scene;
    alb_text text = {0};
    char names[6][32];
    for (int k = 0; k < 6; k++) {
        snprintf(names[k], sizeof names[k], "test_tabulated_%d.csv", k);
        write_table_to(names[k], &(alb_profile){ALB_FORM_EXPONENTIAL, {0.001 * (k + 1), 0.3}}, 0.5, 60);
    }
    add_scene(&text, "\"reflection\":[\"test_tabulated_0.csv\",\"test_tabulated_1.csv\",\"test_tabulated_2.csv\"],"
                     "\"transmission\":[\"test_tabulated_3.csv\",\"test_tabulated_4.csv\",\"test_tabulated_5.csv\"],"
                     "\"thickness_mm\":10");
    check_ok(alb_file_write_text(json, &text, &error), &error);
    check_ok(alb_scene_read(&scene, &provenance, json, &error), &error);
    assert_int_equal(provenance.input_count, 7);
    for (int k = 0; k < 6; k++) {
        const int side = k < 3 ? ALB_REFLECTION : ALB_TRANSMISSION;
        check_relative(alb_profile_value(&scene.surfaces[0].profiles[side][k % 3], 0), 0.001 * (k + 1), 1e-8);
        remove(names[k]);
    }
    remove(json);
    alb_text_free(&text);
    alb_scene_free(&scene);
}

static void what_is_wrong_is_named(void **state)
{
    (void)state;
    static const char *const cases[][2] = {
        {"\"reflection\":[\"test_tabulated_scene.csv\"]", "1 files"},
        {"\"transmission\":" THREE, "reflection"},
        {"\"reflection\":" THREE ",\"transmission\":" THREE, "thickness_mm"},
        {"\"reflection\":" THREE ",\"index\":1", "index"},
        {"\"reflection\":[\"test_tabulated_scene.csv\",\"test_tabulated_scene.csv\",1]", "reflection"},
    };
    write_table(&(alb_profile){ALB_FORM_EXPONENTIAL, {0.01, 0.3}}, 0.5, 60);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        alb_error error = {0};
        alb_scene scene;
        check_fails(read_scene(&scene, cases[i][0], &error), &error, ALB_BAD_DATA, cases[i][1]);
        assert_null(scene.surfaces);
    }
    alb_error error = {0};
    alb_scene scene;
    write_table(&(alb_profile){ALB_FORM_EXPONENTIAL, {0.1, 0.3}}, 0.5, 60);
    check_fails(read_scene(&scene, "\"reflection\":" THREE, &error), &error, ALB_BAD_DATA, csv);
    remove(csv);
    check_fails(read_scene(&scene, "\"reflection\":" THREE, &error), &error, ALB_ACCESS, csv);
    remove(json);
}

// The demonstration's tables are dipoles, in six digits: between lines 0.02 mm or 6 % apart |(ln S)''| h^2/8 is below
// 0.4 %.
static void the_demonstration_is_its_dipole(void **state)
{
    (void)state;
    static const double media[3][2] = {{0.0021, 2.19}, {0.0041, 2.62}, {0.0071, 3.0}};
    alb_error error = {0};
    alb_provenance provenance = {0};
    alb_scene scene;
    check_ok(alb_scene_read(&scene, &provenance, ALB_SOURCE_FOLDER "/demo/scene_tabulated.json", &error), &error);
    for (int c = 0; c < 3; c++) {
        const alb_profile dipole = {ALB_FORM_DIPOLE, {media[c][0], media[c][1], 1.5}},
                          *table = &scene.surfaces[0].profiles[ALB_REFLECTION][c];
        check_relative(alb_profile_total(table), alb_profile_total(&dipole), 2e-3);
        for (double r = 0.05; r < 50; r *= 1.01)
            check_relative(alb_profile_value(table, r), alb_profile_value(&dipole, r), 5e-3);
    }
    alb_scene_free(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_table_scatters_as_its_exponential),
        cmocka_unit_test(the_demonstration_is_its_dipole),
        cmocka_unit_test(each_channel_and_face_has_its_file),
        cmocka_unit_test(what_is_wrong_is_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
