// The error that rows of rays state, against irradiances known without rays.
#include "convex_room.h"
#include "render/solution.h"

enum { CASES = 14 };

typedef double rgb[3];

static const alb_box room = {.size_mm = {4, 4, 4}, .cells = {6, 6, 6}, .grading = 1, .inward = true};

typedef struct fields {
    rgb *radiosity, *truth, *found;
} fields;

static void fields_of(fields *f, const world *w, uint64_t number)
{
    const size_t n = w->patches.count;
    *f = (fields){calloc(n, sizeof(rgb)), calloc(n, sizeof(rgb)), calloc(n, sizeof(rgb))};
    random_radiosity(f->radiosity, w, 4, number);
    room_irradiance(f->truth, w, (const rgb *)f->radiosity, 1);
}

static void fields_free(fields *f)
{
    free(f->radiosity);
    free(f->truth);
    free(f->found);
}

static double true_error(const fields *f, const alb_form_factors *factors, size_t n)
{
    double worst = 0;
    alb_form_factors_apply(f->found, factors, (const rgb *)f->radiosity);
    for (int c = 0; c < 3; c++)
        worst = fmax(worst, rms_percent((const rgb *)f->found, (const rgb *)f->truth, n, 1, c));
    return worst;
}

// The stated error holds in at least 95 % of the cases, and does not say twice too much. It is asked with 64 rays
// for 12 % and 8 %: of 28 cases one may err more than it states.
static void stated_error_holds(void **state)
{
    (void)state;
    alb_error error = {0};
    world w;
    int over = 0, over_wanted = 0;
    double stated_sum = 0, true_sum = 0;
    world_of_box(&w, &room);
    for (uint64_t number = 0; number < CASES; number++) {
        fields f;
        fields_of(&f, &w, number);
        for (double wanted = 12; wanted > 7; wanted -= 4) {
            alb_form_factors factors;
            double stated, again;
            cast(&factors, &w, 64, number);
            check_ok(alb_form_factors_refine(&stated, &factors, &w.patches, &w.tracer, (const rgb *)f.radiosity, NULL,
                                             wanted, 4096, &error),
                     &error);
            check_ok(alb_form_factors_error(&again, NULL, &factors, (const rgb *)f.radiosity, NULL, NULL, &error),
                     &error);
            check_near(again, stated, 0);
            over_wanted += stated > wanted;
            const double found = true_error(&f, &factors, w.patches.count);
            over += found > stated;
            stated_sum += stated;
            true_sum += found;
            alb_form_factors_free(&factors);
        }
        fields_free(&f);
    }
    assert_true(over <= 1);
    assert_true(over_wanted <= 1);
    check_below(stated_sum, 2 * true_sum);
    world_free(&w);
}

// A bright ball of many small patches in a room of few large ones: the ball's own irradiance, smooth, is most of the
// mean over patches; that of the walls, by the few rays that meet the ball, most of the mean over area. The stated
// error holds for both. The truth: 16,384 rays, a hundredth of the error. Of 12 cases one may err more.
static void large_patches_count_by_their_area(void **state)
{
    (void)state;
    enum { TRIALS = 6 };
    alb_error error = {0};
    int over = 0;
    world w = {0};
    alb_mesh ball = {0};
    alb_form_factors fine;
    const alb_box walls = {.size_mm = {4, 4, 4}, .cells = {3, 3, 3}, .grading = 1, .inward = true};
    const alb_sphere sphere = {.radius_mm = 0.4, .subdivisions = 3};
    check_ok(alb_shape_box(&w.mesh, &walls, &error), &error);
    check_ok(alb_shape_sphere(&ball, &sphere, &error), &error);
    check_ok(alb_mesh_append(&w.mesh, &ball, 1, (alb_vector){0}, &error), &error);
    world_of(&w);
    const size_t n = w.patches.count, first = n - ball.face_count;
    rgb *radiosity = calloc(n, sizeof *radiosity), *truth = calloc(n, sizeof *truth), *found = calloc(n, sizeof *found);
    for (size_t p = 0; p < n; p++)
        for (int c = 0; c < 3; c++)
            radiosity[p][c] = p < first ? 0.5 : 5;
    cast(&fine, &w, 16384, 77);
    alb_form_factors_apply(truth, &fine, (const rgb *)radiosity);
    for (uint64_t trial = 0; trial < TRIALS; trial++) {
        alb_form_factors factors;
        double stated, off[2] = {0}, all[2] = {0};
        cast(&factors, &w, 64, trial);
        check_ok(alb_form_factors_error(&stated, NULL, &factors, (const rgb *)radiosity, NULL, NULL, &error), &error);
        alb_form_factors_apply(found, &factors, (const rgb *)radiosity);
        for (size_t p = 0; p < n; p++)
            for (int way = 0; way < 2; way++) {
                off[way] += (way ? w.patches.areas_mm2[p] : 1) * pow(found[p][0] - truth[p][0], 2);
                all[way] += (way ? w.patches.areas_mm2[p] : 1) * pow(truth[p][0], 2);
            }
        for (int way = 0; way < 2; way++)
            over += 100 * sqrt(off[way] / all[way]) > stated;
        alb_form_factors_free(&factors);
    }
    assert_true(over <= 1);
    alb_form_factors_free(&fine);
    alb_mesh_free(&ball);
    world_free(&w);
    free(radiosity);
    free(truth);
    free(found);
}

// A room with a ball under a point light, to a stated error: fewer rays than even rows that state the same.
static void rays_go_where_light_needs_them(void **state)
{
    (void)state;
    alb_error error = {0};
    world w;
    alb_form_factors even, grown;
    double stated, reached;
    const alb_box fine = {.size_mm = {4, 4, 4}, .cells = {12, 12, 12}, .grading = 1, .inward = true};
    world_of_box(&w, &fine);
    const size_t n = w.patches.count;
    rgb *spot = calloc(n, sizeof *spot);
    for (size_t p = 0; p < n; p++) { // in a corner of the floor: most of the room sees it far away
        const alb_vector c = w.patches.centroids[p];
        spot[p][0] = c.x < -1.4 && c.y < -1.4 && w.patches.normals[p].z > 0.9;
    }
    cast(&even, &w, 1024, 1);
    check_ok(alb_form_factors_error(&stated, NULL, &even, (const rgb *)spot, NULL, NULL, &error), &error);
    cast(&grown, &w, 64, 1);
    check_ok(alb_form_factors_refine(&reached, &grown, &w.patches, &w.tracer, (const rgb *)spot, NULL, stated, 16384,
                                     &error),
             &error);
    check_below(reached, 1.02 * stated);
    check_below((double)alb_hit_rows_rays(&grown.rows), (double)alb_hit_rows_rays(&even.rows) / 1.25);
    alb_form_factors_free(&even);
    alb_form_factors_free(&grown);
    free(spot);
    world_free(&w);
}

// From the scene's key to the rows: the error that was asked for is what the solution states, and light stays balanced.
static void a_scene_reaches_its_error(void **state)
{
    (void)state;
    alb_error error = {0};
    const alb_surface wall = {.name = "wall", .reflectance = {0.7, 0.5, 0.3}};
    alb_light lights[2] = {{.kind = ALB_LIGHT_POINT, .position_mm = {1, 1, 1.5}, .flux = {1, 1, 1}},
                           {.kind = ALB_LIGHT_ENVIRONMENT, .radiance = {0.1, 0.1, 0.1}}};
    for (size_t open = 0; open < 2; open++) {
        alb_solution s;
        alb_surface surface = wall;
        alb_scene scene = {.rays_per_patch = 64,
                           .residual = 1e-4,
                           .error_percent = 2,
                           .seed = 3,
                           .surfaces = &surface,
                           .surface_count = 1,
                           .lights = lights,
                           .light_count = 2};
        check_ok(alb_shape_box(&scene.mesh, &room, &error), &error);
        scene.mesh.face_count -= open * 72; // without its last wall
        check_ok(alb_solution_create(&s, &scene, &error), &error);
        check_below(s.rays_error_percent, 2);
        assert_true(alb_hit_rows_rays(&s.factors.rows) > 64 * s.patches.count);
        assert_true((s.factors.sky_rays > 0) == (open > 0));
        check_relative(s.balance.absorbed[0] + s.balance.escaped[0], s.balance.in[0], 0.02);
        alb_solution_free(&s);
        alb_mesh_free(&scene.mesh);
    }
}

// Irradiance of a patch from lights and patches.
static void all_irradiance(rgb *out, const alb_solution *s)
{
    alb_form_factors_apply(out, &s->factors, (const rgb *)s->radiosity);
    for (size_t p = 0; p < s->patches.count; p++)
        for (int c = 0; c < 3; c++)
            out[p][c] += s->irradiance[p][c];
}

// The error stated of a solution is of all light: in a room whose walls send almost nothing it is next to nothing,
// however few rays see that. Truth: 64 times as many rays, which err a 32nd to a 64th as much.
static void what_is_stated_is_of_all_light(void **state)
{
    (void)state;
    alb_error error = {0};
    const double albedos[4] = {0, 1e-3, 0.1, 0.7};
    alb_light light = {.kind = ALB_LIGHT_POINT, .position_mm = {1, 1, 1.5}, .flux = {1, 2, 3}};
    for (int k = 0; k < 4; k++) {
        alb_solution s[2];
        rgb *all[2];
        const double albedo = albedos[k];
        alb_surface wall = {.name = "wall", .reflectance = {albedo, 0.5 * albedo, albedo}};
        alb_scene scene = {
            .residual = 1e-5, .seed = 3, .surfaces = &wall, .surface_count = 1, .lights = &light, .light_count = 1};
        check_ok(alb_shape_box(&scene.mesh, &room, &error), &error);
        for (int many = 0; many < 2; many++) {
            scene.rays_per_patch = many ? 4096 : 64;
            check_ok(alb_solution_create(&s[many], &scene, &error), &error);
            all[many] = calloc(s[many].patches.count, sizeof(rgb));
            all_irradiance(all[many], &s[many]);
        }
        double worst = 0;
        for (int c = 0; c < 3; c++)
            worst = fmax(worst, rms_percent((const rgb *)all[0], (const rgb *)all[1], s[0].patches.count, 1, c));
        // the halves differ by up to 1.6 times the error, the bound lies two standard errors above: 1.3 at 432 patches
        check_below(worst, s[0].irradiance_error_percent + 1e-12);
        check_below(s[0].irradiance_error_percent, 2.1 * worst + 1e-12);
        check_below(s[0].stated_error_percent, s[0].irradiance_error_percent + 0.01);
        if (k == 1)
            check_below(s[0].stated_error_percent, 0.05 * s[0].rays_error_percent);
        for (int many = 0; many < 2; many++) {
            alb_solution_free(&s[many]);
            free(all[many]);
        }
        alb_mesh_free(&scene.mesh);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stated_error_holds),
        cmocka_unit_test(large_patches_count_by_their_area),
        cmocka_unit_test(rays_go_where_light_needs_them),
        cmocka_unit_test(a_scene_reaches_its_error),
        cmocka_unit_test(what_is_stated_is_of_all_light),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
