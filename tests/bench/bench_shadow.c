// Shadow fields on the four animated scenes: frames a second by stages beside those of Wang et al. 2006, and error
// against time beside casting rays. Prints both tables, draws the chart and, beside it as CHART.png, one frame of each:
// bench.shadow CHART.svg [frames, 20]
//
// A frame: the meshes are given; spheres and pictures of all that moves, every vertex lit. Times are those that all
// threads take together over their number: the frame's on cores of its own, also where others use them. Error: rms of
// the irradiance over 2000 vertices (not of lights, not inside others) against 4050 rays each (and as many aimed at
// lights with a surface), whose own error is taken off, in percent of the mean, worst of three frames. Rays are cast
// from the same vertices on as many cores; their time is that of every vertex.
#include "base/plot.h"
#include "render/shadow_picture.h"
#include "render/view.h"
#include "scenes/shadow_full.h"
#include "scenes/shadow_scenes.h"
#include "scenes/shadow_truth.h"
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { WAYS = 11, PICTURED = 8, RAYS = 4, CHECKED = 3, SHADE = 160 };

static const struct {
    const char *name;
    enum { FIELDS, PAPER, REGRESSED, PROBES, TRANSPORT, FULL } kind;
    int order, outer, inner, cells, pixels;
    double cluster;
} ways[WAYS] = {{"as printed", PAPER, 4, 1, 0, 8, 32, 0},
                {"windowed", FIELDS, 4, 1, 0, 8, 64, 0.04},
                {"regressed", REGRESSED, 4, 1, 0, 8, 64, 0.04},
                {"order 8 to 4", FIELDS, 8, 1, 0, 8, 64, 0.04},
                {"2 shells", FIELDS, 4, 2, 0, 8, 64, 0.04},
                {"4 shells", FIELDS, 4, 1, 2, 8, 64, 0.04},
                {"4 shells, order 8", FIELDS, 8, 1, 2, 12, 64, 0.02},
                {"probes", PROBES, 4, 1, 0, 8, 64, 0.04},
                {"4 shells, probes", PROBES, 4, 1, 2, 8, 64, 0.04},
                {"transport", TRANSPORT, 4, 1, 0, 8, 64, 0.04},
                {"16 shells", FULL, 4, 1, 0, 8, 64, 0.04}};
#define BOTTOM 0.3                              // percent, of the chart
static const int strata[RAYS] = {4, 8, 16, 32}; // squared; lights with a surface get as many rays again, aimed

typedef struct result {
    double ms, sampling_ms, scaling_ms, products_ms, error_percent[2]; // on the ground, on the model
} result;

static double now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return ((double)now.tv_sec + 1e-9 * (double)now.tv_nsec) / omp_get_max_threads();
}

static bool take_regressed(alb_shadow_stage *stage, alb_error *error)
{
    const alb_sh_law law = {ALB_SH_LAW_REGRESSED, ALB_SH_MAP_CONE, 45, 4, 4};
    alb_sh_batch_free(&stage->laws.outer);
    return alb_sh_batch_create(&stage->laws.outer, &law, 256, error);
}

static alb_shadow_stage stage_of(int way)
{
    alb_shadow_stage stage = {.settings = alb_shadow_defaults, .paper = ways[way].kind == PAPER};
    stage.settings.order = ways[way].order;
    stage.settings.outer = ways[way].outer;
    stage.settings.inner = ways[way].inner;
    stage.settings.far = ways[way].inner > 0;
    stage.settings.cells = ways[way].cells;
    stage.settings.pixels = ways[way].pixels;
    stage.settings.cluster = ways[way].cluster;
    if (ways[way].kind != PROBES)
        stage.settings.probes = 0;
    return stage;
}

// Rigid objects get precomputed transport in the way of that name alone.
static bool create_scene(alb_scene *scene, int index, int frame, int way, alb_error *error)
{
    if (!shadow_scenes[index].create(scene, frame, error))
        return false;
    for (size_t o = 0; o < scene->object_count; o++)
        scene->objects[o].rigid &= ways[way].kind == TRANSPORT;
    return true;
}

// Transport is for what is rigid, the full field for one occluder under skies.
static bool applies(int way, const alb_scene *scene)
{
    return (ways[way].kind != TRANSPORT || scene->objects[scene->object_count - 1].rigid) &&
           (ways[way].kind != FULL || scene->light_count);
}

// The stage lit in any case: normals and skies are its own.
static bool light_full(double *frame_s, shadow_full *full, alb_shadow_stage *stage, const alb_scene *scene,
                       alb_error *error)
{
    const alb_object *object = &scene->objects[1];
    const alb_vector *vertices = scene->mesh.vertices;
    alb_mesh mesh = {0};
    bool ok = full->shells[0].samples ||
              (shadow_full_mesh(&mesh, scene, object, error) && shadow_full_create(full, &mesh, error));
    alb_mesh_free(&mesh);
    const double start_s = now_s();
    ok = ok && shadow_full_sample(full, vertices + object->first_vertex, error);
    if (ok)
        shadow_full_light(stage->irradiance, full, stage->skies, &stage->laws.sky, vertices, stage->normals,
                          scene->mesh.vertex_count);
    *frame_s = now_s() - start_s;
    return ok;
}

static bool check_frame(double error_percent[2], const alb_shadow_stage *stage, const alb_scene *scene,
                        alb_error *error)
{
    static shadow_truth t;
    static float found[SHADOW_TRUTH_SAMPLES][3];
    const bool ok = shadow_truth_find(&t, stage, scene, error);
    for (size_t i = 0; ok && i < t.count; i++)
        memcpy(found[i], stage->irradiance[t.vertices[i]], sizeof found[i]);
    for (int k = 0; ok && k < 2; k++)
        error_percent[k] = fmax(
            error_percent[k], shadow_truth_error(&t, (const float(*)[3])found, scene->objects[0].vertex_count, k == 1));
    shadow_truth_free(&t);
    return ok;
}

static int by_size(const void *a, const void *b)
{
    const double difference = *(const double *)a - *(const double *)b;
    return (difference > 0) - (difference < 0);
}

static bool run_way(result *out, int scene_index, int way, int frames, alb_error *error)
{
    const shadow_scene *which = &shadow_scenes[scene_index];
    alb_shadow_stage stage = stage_of(way);
    shadow_full full = {0};
    double *times = calloc((size_t)frames + 1, sizeof *times); // the first makes the tables and fields
    bool ok = times != NULL, apply = true;
    *out = (result){0};
    for (int n = 0; ok && apply && n <= frames; n++) {
        alb_scene scene;
        if (!create_scene(&scene, scene_index, n * which->frames / (frames + 1), way, error)) {
            ok = false;
            break;
        }
        apply = applies(way, &scene);
        const double start_s = now_s();
        ok = !apply || alb_shadow_stage_light(&stage, &scene, error);
        times[n] = now_s() - start_s;
        if (ok && apply && ways[way].kind == FULL)
            ok = light_full(&times[n], &full, &stage, &scene, error);
        if (ok && n && apply) {
            const double share = times[n] / (stage.sampling_s + stage.light_s) * 1e3 / frames;
            const double light = stage.light_s / (stage.seconds.scaling + stage.seconds.products);
            out->sampling_ms += share * stage.sampling_s;
            out->scaling_ms += share * light * stage.seconds.scaling;
            out->products_ms += share * light * stage.seconds.products;
        } else if (ok && apply && ways[way].kind == REGRESSED)
            ok = take_regressed(&stage, error);
        if (ok && apply && n && (n - 1) % ((frames + CHECKED - 1) / CHECKED) == 0)
            ok = check_frame(out->error_percent, &stage, &scene, error);
        alb_scene_free(&scene);
    }
    if (ok && apply) {
        qsort(times + 1, (size_t)frames, sizeof *times, by_size);
        out->ms = 1e3 * times[1 + frames / 2]; // the median
    }
    free(times);
    shadow_full_free(&full);
    alb_shadow_stage_free(&stage);
    return ok;
}

static bool run_rays(double *ms, double (*percent)[RAYS], int scene_index, alb_error *error)
{
    const shadow_scene *which = &shadow_scenes[scene_index];
    alb_scene scene;
    alb_shadow_stage stage = stage_of(1);
    static shadow_truth t;
    static float found[SHADOW_TRUTH_SAMPLES][3];
    bool ok = create_scene(&scene, scene_index, which->frames / 6, 1, error) &&
              alb_shadow_stage_light(&stage, &scene, error) && shadow_truth_find(&t, &stage, &scene, error);
    for (int k = 0; ok && k < RAYS; k++) {
        const double start_s = now_s();
        alb_shadow_cast_aimed(found, &t.tracer, &t.lamps, scene.lights, scene.light_count, t.points, t.normals, t.count,
                              strata[k], 256 * t.tracer.slack_mm, 77);
        ms[k] = 1e3 * (now_s() - start_s) * (double)scene.mesh.vertex_count / (double)t.count;
        for (int model = 0; model < 2; model++)
            percent[model][k] = shadow_truth_error(&t, (const float(*)[3])found, scene.objects[0].vertex_count, model);
        printf("%-8s %4d rays %53.1f %21.2f %10.2f\n", which->name, strata[k] * strata[k] * (t.lamps.count ? 2 : 1),
               ms[k], percent[0][k], percent[1][k]);
    }
    shadow_truth_free(&t);
    alb_shadow_stage_free(&stage);
    alb_scene_free(&scene);
    return ok;
}

// Time that rays take for an error: straight lines between the logarithms, and beyond the last.
static double ray_time(const double *ms, const double *percent, double wanted)
{
    int k = 0;
    while (k + 2 < RAYS && percent[k + 1] > wanted)
        k++;
    return ms[k] * pow(ms[k + 1] / ms[k], log(wanted / percent[k]) / log(percent[k + 1] / percent[k]));
}

// The error that rays make in a time, likewise.
static double ray_error(const double *ms, const double *percent, double time)
{
    int k = 0;
    while (k + 2 < RAYS && ms[k + 1] < time)
        k++;
    return percent[k] * pow(percent[k + 1] / percent[k], log(time / ms[k]) / log(ms[k + 1] / ms[k]));
}

// Above the line of the rays they are as good in less time: hatched, up and down, evenly along the chart.
static void shade(double *x, double *y, const double *ms, const double *percent, double top)
{
    const double last = ray_time(ms, percent, fmax(percent[RAYS - 1] / 4, BOTTOM));
    for (int n = 0; n < SHADE; n++) {
        x[2 * n] = x[2 * n + 1] = ms[0] * pow(last / ms[0], (double)n / (SHADE - 1));
        y[2 * n + n % 2] = ray_error(ms, percent, x[2 * n]);
        y[2 * n + 1 - n % 2] = top;
    }
}

typedef struct figures {
    double ms[SHADOW_SCENES][WAYS], percent[SHADOW_SCENES][WAYS][2];
    double ray_ms[SHADOW_SCENES][RAYS], ray_percent[SHADOW_SCENES][2][RAYS];
} figures;

static bool chart(const char *path, const figures *f, alb_error *error)
{
    static const char *const colours[WAYS] = {"#d62728", "#1f77b4", "#17becf", "#9467bd", "#2ca02c", "#8c564b",
                                              "#e377c2", "#bcbd22", "#98df8a", "#000",    "#ff7f0e"};
    static double shade_x[SHADOW_SCENES][2 * SHADE], shade_y[SHADOW_SCENES][2 * SHADE], twice[SHADOW_SCENES][WAYS][2];
    alb_curve curves[SHADOW_SCENES][WAYS + 3];
    alb_panel panels[SHADOW_SCENES];
    char titles[SHADOW_SCENES][128];
    for (int i = 0; i < SHADOW_SCENES; i++) {
        const bool first = i == 0;
        alb_curve *c = curves[i];
        shade(shade_x[i], shade_y[i], f->ray_ms[i], f->ray_percent[i][0], 100);
        *c++ =
            (alb_curve){first ? "here rays win" : NULL, "#ddd", shade_x[i], shade_y[i], NULL, 2 * SHADE, ALB_MARK_LINE};
        for (int model = 0; model < 2; model++)
            *c++ = (alb_curve){.label = !first  ? NULL
                                        : model ? "rays, model"
                                                : "16 to 1024 rays, plane",
                               .colour = "#777",
                               .x = f->ray_ms[i],
                               .y = f->ray_percent[i][model],
                               .count = RAYS,
                               .mark = model ? ALB_MARK_DASHES : ALB_MARK_LINE_AND_POINTS};
        for (int w = 0; w < WAYS; w++) {
            twice[i][w][0] = twice[i][w][1] = f->ms[i][w];
            *c++ = (alb_curve){.label = first ? ways[w].name : NULL,
                               .colour = colours[w],
                               .x = twice[i][w],
                               .y = f->percent[i][w],
                               .count = 2,
                               .mark = ALB_MARK_LINE_AND_POINTS};
        }
        snprintf(titles[i], sizeof titles[i], "%s: plane (below) to model (above)", shadow_scenes[i].name);
        panels[i] = (alb_panel){.title = titles[i],
                                .x_label = i == SHADOW_SCENES - 1 ? "ms a frame" : NULL,
                                .y_label = "error, % of mean",
                                .log_x = true,
                                .log_y = true,
                                .y_minimum = BOTTOM,
                                .y_maximum = 100,
                                .curves = curves[i],
                                .curve_count = WAYS + 3,
                                .height = 1};
    }
    return alb_plot_write(path, panels, SHADOW_SCENES, 800, 1200, error);
}

// Of each way the time of rays with its error on the plane and on the model.
static void compare(const figures *f)
{
    for (int i = 0; i < SHADOW_SCENES; i++)
        for (int w = 0; w < WAYS; w++)
            for (int model = 0; model < 2 && f->ms[i][w] > 0; model++) {
                const double rays = ray_time(f->ray_ms[i], f->ray_percent[i][model], f->percent[i][w][model]),
                             times = rays / f->ms[i][w];
                printf("%-8s %-17s on the %s: %5.2f %% takes rays %8.1f ms, %5.1f times %s\n", shadow_scenes[i].name,
                       ways[w].name, model ? "model" : "plane", f->percent[i][w][model], rays,
                       times > 1 ? times : 1 / times, times > 1 ? "as long" : "less: rays win");
            }
}

// A frame of each scene at half its size, two by two; 4 shells and probes.
static bool draw_frames(const char *chart_path, alb_error *error)
{
    char path[1024];
    alb_image all = {0};
    bool ok = alb_image_create(&all, 640, 480, "R,G,B", error);
    for (int i = 0; ok && i < SHADOW_SCENES; i++) {
        alb_scene scene;
        alb_image picture = {0};
        alb_shadow_stage stage = stage_of(PICTURED); // with transport where a scene has rigid objects
        double brightest, exposure;
        if (!shadow_scenes[i].create(&scene, 12, error))
            break;
        ok = alb_shadow_stage_light(&stage, &scene, error) &&
             alb_shadow_view(&picture, &brightest, &scene, &stage, error) &&
             alb_view_exposure(&exposure, &picture, brightest, error);
        for (int n = 0; ok && n < 640 * 480; n++) // four pixels become one
            for (int c = 0; c < 3; c++)
                alb_image_at(&all, n % 640 / 2 + 320 * (i % 2), n / 640 / 2 + 240 * (i / 2))[c] +=
                    0.25F * (float)exposure * alb_image_at(&picture, n % 640, n / 640)[c];
        alb_image_free(&picture);
        alb_shadow_stage_free(&stage);
        alb_scene_free(&scene);
    }
    const size_t stem = strlen(chart_path) > 4 ? strlen(chart_path) - 4 : 0;
    snprintf(path, sizeof path, "%.*s.png", (int)stem, chart_path);
    ok = ok && alb_image_write_png(&all, 1, path, error);
    alb_image_free(&all);
    return ok;
}

int main(int argc, char **argv)
{
    alb_error error = {0};
    const int frames = argc > 2 ? atoi(argv[2]) : 20;
    static figures f;
    bool ok = frames >= CHECKED && frames <= 60;
    printf("%-8s %-17s %8s %8s %9s %9s %8s %8s %10s %10s\n", "scene", "", "sampling", "scaling", "products",
           "frame, ms", "frames/s", "paper", "plane, %", "model, %");
    for (int i = 0; ok && i < SHADOW_SCENES; i++)
        for (int w = 0; ok && w < WAYS; w++) {
            result r;
            ok = run_way(&r, i, w, frames, &error);
            f.ms[i][w] = r.ms;
            memcpy(f.percent[i][w], r.error_percent, sizeof r.error_percent);
            if (r.ms > 0)
                printf("%-8s %-17s %8.2f %8.2f %9.2f %9.2f %8.1f %8.1f %10.2f %10.2f\n", shadow_scenes[i].name,
                       ways[w].name, r.sampling_ms, r.scaling_ms, r.products_ms, r.ms, 1e3 / r.ms,
                       shadow_scenes[i].paper_fps, r.error_percent[0], r.error_percent[1]);
            fflush(stdout);
        }
    for (int i = 0; ok && i < SHADOW_SCENES; i++)
        ok = run_rays(f.ray_ms[i], f.ray_percent[i], i, &error);
    if (ok)
        compare(&f);
    if (ok && argc > 1)
        ok = chart(argv[1], &f, &error) && draw_frames(argv[1], &error);
    if (!ok)
        fprintf(stderr, "bench.shadow: %s\n", error.status ? error.text : "3 to 60 frames");
    return ok ? 0 : 1;
}
