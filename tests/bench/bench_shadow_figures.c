// Three figures of Wang et al. 2006 with numbers: bench.shadow_figures FOLDER
//     shadow_elements.svg    fig. 3: six elements of M against k, as printed and of the windowed law
//     shadow_visibility.png  fig. 5: what is visible from 0.5 to 2 radii; rows: by rays, their order 4, as printed from
//                            one radius, 4 shells. Its table: rms over 60 directions (those outside the model),
//                            occlusion against rays of order 4
//     shadow_full.png        fig. 7: rays; 16 uniform shells without scaling; one shell as printed; one shell and four
//                            by the laws of shadow_light.c. Its table: rms of the irradiance against 1024 rays, percent
#include "base/plot.h"
#include "base/random.h"
#include "render/sh_rotate.h"
#include "render/shadow_picture.h"
#include "render/shadow_rays.h"
#include "render/view.h"
#include "scenes/shadow_full.h"
#include "scenes/shadow_scenes.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ELEMENTS = 6, POINTS = 121, DISTANCES = 5, DIRECTIONS = 60, LOOKS = 8192, SIDE = 110, PICTURES = 5 };

static bool write_elements(const char *folder, alb_error *error)
{
    static const int of[ELEMENTS][3] = {{0, 1, 3}, {0, 2, 2}, {1, 1, 2}, {1, 3, 3}, {2, 2, 3}, {3, 3, 3}}; // m, out, in
    static double k[POINTS], value[2][ELEMENTS][POINTS];
    static char labels[ELEMENTS][32], path[1024];
    alb_curve curves[2 * ELEMENTS];
    for (int n = 0; n < POINTS; n++) {
        k[n] = 0.25 * pow(32, (double)n / (POINTS - 1));
        for (int windowed = 0; windowed < 2; windowed++) {
            const alb_sh_law law = {windowed ? ALB_SH_LAW_OCCLUSION : ALB_SH_LAW_VISIBILITY, ALB_SH_MAP_CONE, 45, 4, 4};
            alb_sh_scaling m;
            if (!alb_sh_law_at(&m, &law, k[n], error))
                return false;
            for (int e = 0; e < ELEMENTS; e++)
                value[windowed][e][n] = m.value[alb_sh_scaling_index(4, 4, of[e][0], of[e][1], of[e][2])];
        }
    }
    printf("elements of M at k = .25, .5, 1, 2, 4, 8, as printed\n");
    for (int e = 0; e < ELEMENTS; e++) {
        snprintf(labels[e], sizeof labels[e], "m %d, l %d from %d", of[e][0], of[e][1], of[e][2]);
        printf("  %-18s", labels[e]);
        for (int n = 0; n < POINTS; n += (POINTS - 1) / 5)
            printf(" %8.4f", value[0][e][n]);
        printf("\n");
        static const char *const colours[ELEMENTS] = {"#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#8c564b", "#e377c2"};
        curves[e] = (alb_curve){labels[e], colours[e], k, value[0][e], NULL, POINTS, ALB_MARK_LINE};
        curves[ELEMENTS + e] = (alb_curve){
            e ? NULL : "dashes: windowed, of occlusion", colours[e], k, value[1][e], NULL, POINTS, ALB_MARK_DASHES};
    }
    const alb_panel panel = {.title = "Elements of M, cone of 45 degrees, visibility as printed",
                             .x_label = "k, distance over the sample's",
                             .y_label = "element",
                             .log_x = true,
                             .curves = curves,
                             .curve_count = 2 * ELEMENTS,
                             .height = 1};
    snprintf(path, sizeof path, "%s/shadow_elements.svg", folder);
    return alb_plot_write(path, &panel, 1, 800, 420, error);
}

// The creature alone, its field as printed and with four shells, and rays.
typedef struct model {
    alb_mesh mesh;
    alb_tracer tracer;
    alb_shadow_field fields[2];
    alb_shadow_laws laws[2];
} model;

static bool make_model(model *m, const alb_scene *scene, alb_error *error)
{
    bool ok = shadow_full_mesh(&m->mesh, scene, &scene->objects[1], error);
    for (int k = 0; ok && k < 2; k++) {
        alb_shadow_settings settings = alb_shadow_defaults;
        settings.inner = k ? 2 : 0, settings.far = k, settings.distance = k ? 1.1 : 1.05;
        ok = alb_shadow_laws_create(&m->laws[k], 4, !k, error) &&
             alb_shadow_field_create(&m->fields[k], &settings, &m->mesh, NULL, "model", error) &&
             alb_shadow_field_sample(&m->fields[k], m->mesh.vertices, error);
    }
    return ok && alb_tracer_create(&m->tracer, &m->mesh, error);
}

static void free_model(model *m)
{
    for (int k = 0; k < 2; k++) {
        alb_shadow_laws_free(&m->laws[k]);
        alb_shadow_field_free(&m->fields[k]);
    }
    alb_tracer_free(&m->tracer);
    alb_mesh_free(&m->mesh);
}

static void rays_occlusion(double out[16], const alb_tracer *tracer, alb_vector from)
{
    memset(out, 0, 16 * sizeof *out);
    for (int q = 0; q < LOOKS; q++) { // a Fibonacci lattice
        const double z = 1 - (2 * q + 1.0) / LOOKS, turn = M_PI * (3 - sqrt(5)) * q, r = sqrt(1 - z * z);
        const alb_vector d = {r * cos(turn), r * sin(turn), z};
        double basis[16];
        alb_hit hit;
        if (!alb_tracer_closest(&hit, tracer, from, d))
            continue;
        alb_sh_evaluate(basis, 4, d);
        for (int i = 0; i < 16; i++)
            out[i] += 4 * M_PI / LOOKS * basis[i];
    }
}

// Occlusion of order 4 at a point: by rays, as printed, by four shells.
static void three_ways(double out[3][16], const model *m, alb_vector at)
{
    rays_occlusion(out[0], &m->tracer, at);
    for (int k = 0; k < 2; k++) {
        static float found[ALB_SHADOW_VALUES * ALB_SHADOW_BLOCK];
        alb_shadow_receivers r;
        alb_shadow_receivers_at(&r, &m->fields[k], &at, 1);
        alb_shadow_receivers_occlusion(found, &r, &m->fields[k], &m->laws[k]);
        for (int i = 0; i < 16; i++)
            out[1 + k][i] = (double)found[i * ALB_SHADOW_BLOCK];
    }
}

// The sphere of directions as a disc about the way to the model's middle, angle by radius.
static void draw_view(alb_image *all, int column, const model *m, alb_vector at, alb_vector axis, double ways[3][16])
{
    double frame[3][3];
    alb_sh_axis_rotation(frame, axis);
    for (int row = 0; row < 4; row++)
        for (int p = 0; p < SIDE * SIDE; p++) {
            const double x = (p % SIDE + 0.5) / SIDE * 2.04 - 1.02, y = 1.02 - (p / SIDE + 0.5) / SIDE * 2.04,
                         r = hypot(x, y), s = r > 0 ? sin(M_PI * r) / r : 0;
            const alb_transform world_from_view = {{{frame[0][0], frame[0][1], frame[0][2]},
                                                    {frame[1][0], frame[1][1], frame[1][2]},
                                                    {frame[2][0], frame[2][1], frame[2][2]}},
                                                   {0, 0, 0}};
            const alb_vector d = alb_rotate(&world_from_view, (alb_vector){s * x, s * y, cos(M_PI * r)});
            alb_hit hit;
            double visible = 1;
            if (r > 1)
                visible = 0.6;
            else if (row == 0)
                visible = !alb_tracer_closest(&hit, &m->tracer, at, d);
            else
                visible = 1 - alb_sh_value(ways[row - 1], 4, d);
            for (int c = 0; c < 3; c++)
                alb_image_at(all, column * SIDE + p % SIDE, row * SIDE + p / SIDE)[c] =
                    (float)fmin(fmax(visible, 0), 1);
        }
}

static bool write_visibility(const char *folder, const model *m, alb_error *error)
{
    static const double distances[DISTANCES] = {0.5, 0.7, 0.9, 1.3, 2};
    const alb_shadow_sphere *sphere = &m->fields[0].sphere;
    double square[3][DISTANCES] = {{0}}, ways[3][16];
    int count[DISTANCES] = {0};
    char path[1024];
    alb_image all = {0};
    if (!alb_image_create(&all, DISTANCES * SIDE, 4 * SIDE, "R,G,B", error))
        return false;
    for (int k = 0; k < DISTANCES; k++)
        for (int n = 0; n < DIRECTIONS; n++) {
            alb_random random = alb_random_at(1, 5, (uint64_t)n);
            const double z = n ? 2 * alb_random_uniform(&random) - 1 : -0.3,
                         turn = n ? 7 * alb_random_uniform(&random) : -1, r = sqrt(1 - z * z);
            const alb_vector d = {r * cos(turn), r * sin(turn), z},
                             at = alb_add(sphere->centre_mm, alb_times(distances[k] * sphere->radius_mm, d));
            if (alb_shadow_buried(&m->tracer, at, d, 0)) // nobody looks from there
                continue;
            count[k]++;
            three_ways(ways, m, at);
            if (!n)
                draw_view(&all, k, m, at, alb_times(-1, d), ways);
            for (int w = 0; w < 3; w++)
                for (int i = 0; i < 16; i++)
                    square[w][k] += pow(ways[w][i] - (w ? ways[0][i] : 0), 2) / (4 * M_PI);
        }
    printf("occlusion at .5, .7, .9, 1.3, 2 radii, rms over %d directions\n", DIRECTIONS);
    static const char *const names[3] = {"the occlusion itself", "as printed, error", "4 shells, error"};
    for (int w = 0; w < 3; w++) {
        printf("  %-22s", names[w]);
        for (int k = 0; k < DISTANCES; k++)
            printf(" %6.3f", sqrt(square[w][k] / count[k]));
        printf("\n");
    }
    snprintf(path, sizeof path, "%s/shadow_visibility.png", folder);
    const bool ok = alb_image_write_png(&all, 1, path, error);
    alb_image_free(&all);
    return ok;
}

// --- fig. 7 --------------------------------------------------------------------------------------------------------

typedef struct pictures {
    alb_image all;
    double exposure;
    float (*truth)[3];
} pictures;

// The picture of the irradiance in the stage, and its error.
static bool show(pictures *p, int number, const char *name, const alb_scene *scene, const alb_shadow_stage *stage,
                 alb_error *error)
{
    alb_image picture = {0};
    double brightest, square[2] = {0}, mean[2] = {0};
    if (!alb_shadow_view(&picture, &brightest, scene, stage, error) ||
        (!number && !alb_view_exposure(&p->exposure, &picture, brightest, error)))
        return false;
    for (int n = 0; n < 640 * 480; n++) // four pixels become one
        for (int c = 0; c < 3; c++)
            alb_image_at(&p->all, 320 * number + n % 640 / 2, n / 640 / 2)[c] +=
                0.25F * (float)p->exposure * alb_image_at(&picture, n % 640, n / 640)[c];
    alb_image_free(&picture);
    for (size_t v = 0; v < scene->mesh.vertex_count; v++)
        for (int c = 0; c < 3; c++) {
            const int of = v >= scene->objects[0].vertex_count;
            square[of] += pow((double)(stage->irradiance[v][c] - p->truth[v][c]), 2);
            mean[of] += (double)p->truth[v][c];
        }
    printf("  %-24s", name);
    for (int of = 0; of < 2; of++) {
        const double count = 3 * (double)scene->objects[of].vertex_count;
        printf(" %8.2f", 100 * sqrt(square[of] / count) / (mean[of] / count));
    }
    printf("\n");
    return true;
}

static bool write_full(const char *folder, const model *m, const alb_scene *scene, alb_error *error)
{
    static shadow_full full;
    pictures p = {0};
    alb_shadow_stage stage = {.settings = alb_shadow_defaults};
    stage.settings.probes = 0;
    const size_t n = scene->mesh.vertex_count;
    float(*black)[3] = calloc(scene->mesh.face_count, sizeof *black);
    bool ok = black && (p.truth = calloc(n, sizeof *p.truth)) && alb_shadow_stage_light(&stage, scene, error) &&
              alb_image_create(&p.all, 320 * PICTURES, 240, "R,G,B", error) &&
              shadow_full_create(&full, &m->mesh, error) && shadow_full_sample(&full, m->mesh.vertices, error);
    printf("irradiance, rms error in percent of the mean: plane, model\n");
    if (ok)
        alb_shadow_cast(p.truth, &m->tracer, (const float(*)[3])black, scene->lights, scene->light_count,
                        scene->mesh.vertices, stage.normals, n, 32, 1e-2, 1);
    if (ok)
        memcpy(stage.irradiance, p.truth, n * sizeof *p.truth);
    ok = ok && show(&p, 0, "1024 rays", scene, &stage, error);
    if (ok)
        shadow_full_light(stage.irradiance, &full, stage.skies, &stage.laws.sky, scene->mesh.vertices, stage.normals,
                          n);
    ok = ok && show(&p, 1, "16 shells, not scaled", scene, &stage, error);
    for (int k = 0; ok && k < 3; k++) {
        static const char *const names[3] = {"1 shell, as printed", "1 shell", "4 shells"};
        alb_shadow_stage_free(&stage);
        stage = (alb_shadow_stage){.settings = alb_shadow_defaults, .paper = !k};
        stage.settings.probes = 0; // fields alone
        stage.settings.inner = k == 2 ? 2 : 0, stage.settings.far = k == 2;
        ok = alb_shadow_stage_light(&stage, scene, error) && show(&p, 2 + k, names[k], scene, &stage, error);
    }
    char path[1024];
    snprintf(path, sizeof path, "%s/shadow_full.png", folder);
    ok = ok && alb_image_write_png(&p.all, 1, path, error);
    shadow_full_free(&full);
    alb_shadow_stage_free(&stage);
    alb_image_free(&p.all);
    free(p.truth);
    free(black);
    return ok;
}

int main(int argc, char **argv)
{
    alb_error error = {0};
    alb_scene scene = {0};
    static model m;
    const bool ok = argc == 2 && write_elements(argv[1], &error) && shadow_scenes[0].create(&scene, 12, &error) &&
                    make_model(&m, &scene, &error) && write_visibility(argv[1], &m, &error) &&
                    write_full(argv[1], &m, &scene, &error);
    free_model(&m);
    alb_scene_free(&scene);
    if (!ok)
        fprintf(stderr, "bench.shadow_figures: %s\n", error.status ? error.text : "one argument, a folder");
    return ok ? 0 : 1;
}
