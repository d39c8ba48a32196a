// Wide slabs of a multipole's profiles give back, and let through, what the closed form of the plane problem says
// (digits of an independent evaluation); a wide half-space of a dipole's likewise.
#include "check.h"
#include "render/shape.h"
#include "render/solution.h"

typedef struct truth {
    double thickness_mm, reflected, transmitted; // transport mean free path 1 mm, albedo 0.99, index 1.3
} truth;

static const double medium[3] = {0.01, 0.99, 1.3};

static alb_surface multipole(const double thickness_mm[3])
{
    static const alb_form forms[ALB_SIDES] = {ALB_FORM_MULTIPOLE_REFLECTION, ALB_FORM_MULTIPOLE_TRANSMISSION};
    alb_surface surface = {.name = "slab", .scatters = true, .slab = true, .thickness_mm = thickness_mm[0]};
    for (int side = 0; side < ALB_SIDES; side++)
        for (int c = 0; c < 3; c++)
            surface.profiles[side][c] = (alb_profile){forms[side], {medium[0], medium[1], medium[2], thickness_mm[c]}};
    return surface;
}

// What patches near the middle of both faces send out of even light on one face, by side.
static void middle_of(double found[ALB_SIDES][3], const alb_box *box, const alb_surface *surface)
{
    alb_error error = {0};
    alb_mesh mesh = {0};
    alb_patches patches;
    alb_scatter scatter;
    check_ok(alb_shape_box(&mesh, box, &error), &error);
    check_ok(alb_patches_create(&patches, &mesh, &error), &error);
    check_ok(alb_scatter_create(&scatter, &patches, mesh.groups, surface, 0.005, &error), &error);
    double(*light)[3] = calloc(patches.count, sizeof *light), (*out)[3] = calloc(patches.count, sizeof *out);
    double areas[ALB_SIDES] = {0};
    for (size_t p = 0; p < patches.count; p++)
        for (int c = 0; c < 3 && patches.normals[p].z > 0.9; c++)
            light[p][c] = 1;
    alb_scatter_apply(out, &scatter, (const double(*)[3])light);
    memset(found, 0, ALB_SIDES * sizeof *found);
    for (size_t p = 0; p < patches.count; p++) {
        if (fabs(patches.normals[p].z) < 0.9 || hypot(patches.centroids[p].x, patches.centroids[p].y) > 10)
            continue;
        const alb_side side = patches.normals[p].z > 0 ? ALB_REFLECTION : ALB_TRANSMISSION;
        areas[side] += patches.areas_mm2[p];
        for (int c = 0; c < 3; c++)
            found[side][c] += patches.areas_mm2[p] * out[p][c];
    }
    for (int side = 0; side < ALB_SIDES; side++)
        for (int c = 0; c < 3; c++)
            found[side][c] /= areas[side];
    free(light);
    free(out);
    alb_scatter_free(&scatter);
    alb_patches_free(&patches);
    alb_mesh_free(&mesh);
}

// 50 mm from the middle even the widest, e^(-r / 5.8 mm), has less than 0.1 % left; the rest is the links' error.
static void slabs_of_a_multipole(void **state)
{
    (void)state;
    static const truth truths[3] = {
        {2, 0.464430979, 0.464430979}, {5, 0.587359768, 0.247869117}, {10, 0.634858641, 0.099650990}};
    const alb_box box = {.size_mm = {120, 120, 5}, .cells = {60, 60, 3}, .grading = 1};
    const alb_surface surface = multipole((const double[3]){2, 5, 10});
    double found[ALB_SIDES][3];
    middle_of(found, &box, &surface); // its profiles say how thick it is, not its mesh
    for (int c = 0; c < 3; c++) {
        check_relative(found[ALB_REFLECTION][c], truths[c].reflected, 0.01);
        check_relative(found[ALB_TRANSMISSION][c], truths[c].transmitted, 0.01);
    }
}

// The far face of a block so thick is as good as none.
static void half_space_of_a_dipole(void **state)
{
    (void)state;
    const alb_box box = {.size_mm = {160, 160, 80}, .cells = {80, 80, 20}, .grading = 1};
    alb_surface surface = {.name = "block", .scatters = true};
    static const double albedos[3] = {0.9, 0.99, 0.99}, indices[3] = {1.3, 1.3, 1.3},
                        totals[3] = {0.299129164, 0.644525488, 0.644525488};
    for (int c = 0; c < 3; c++)
        surface.profiles[ALB_REFLECTION][c] = (alb_profile){ALB_FORM_DIPOLE, {1 - albedos[c], albedos[c], indices[c]}};
    double found[ALB_SIDES][3];
    middle_of(found, &box, &surface);
    for (int c = 0; c < 3; c++)
        check_relative(found[ALB_REFLECTION][c], totals[c], 0.01);
}

// The example: a pane of marble lit from behind. Light comes through, reds most, and none is lost.
static void pane_lit_from_behind(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene scene;
    alb_provenance provenance = {0};
    alb_solution s;
    check_ok(alb_scene_read(&scene, &provenance, ALB_SOURCE_FOLDER "/demo/scene_pane.json", &error), &error);
    check_ok(alb_solution_create(&s, &scene, &error), &error);
    double through[3] = {0};
    for (size_t p = 0; p < s.patches.count; p++)
        if (scene.surfaces[scene.mesh.groups[p]].slab && s.patches.normals[p].z > 0.9)
            for (int c = 0; c < 3; c++)
                through[c] += s.patches.areas_mm2[p] * s.across[p][c];
    assert_true(through[0] > through[1] && through[1] > through[2] && through[2] > 0.02 && through[0] < 0.5);
    for (int c = 0; c < 3; c++) // rays are reciprocal to the percent in sum
        check_relative(s.balance.absorbed[c] + s.balance.escaped[c] + s.balance.lost[c], s.balance.in[c], 0.02);
    alb_solution_free(&s);
    alb_scene_free(&scene);
}

static void too_thin_for_a_multipole(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_scene scene;
    alb_provenance provenance = {0};
    const char *path = "too_thin.json";
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(
        "{\"format\": 1, \"objects\": [], \"materials\": {\"pane\": {\"multipole\": {\"absorption_per_mm\": [1, 1, 1], "
        "\"reduced_scattering_per_mm\": [9, 4, 9], \"refractive_index\": 1.5, \"finish\": \"smooth\", "
        "\"thickness_mm\": 0.15}}}}",
        file);
    fclose(file);
    check_fails(alb_scene_read(&scene, &provenance, path, &error), &error, ALB_BAD_DATA,
                "0.15 mm is thinner than a transport mean free path, 0.2 mm in channel G");
    remove(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(slabs_of_a_multipole),
        cmocka_unit_test(half_space_of_a_dipole),
        cmocka_unit_test(pane_lit_from_behind),
        cmocka_unit_test(too_thin_for_a_multipole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
