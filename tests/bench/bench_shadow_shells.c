// Occlusion around the models of the four scenes and four objects made of balls (two apart, two that touch, an L of
// five, a plate of 5 x 5), inside and outside their bounding spheres: one shell scaled as printed, scaled by today's
// law, several shells, and the field of 16 shells without scaling that the paper compares itself with (figs. 5 and 7 in
// numbers). Prints a table by ranges of distance, with the memory and the time of a frame's sampling, and draws:
// bench.shadow_shells CHART.svg
//
// Error: rms over the sphere of directions of order-4 occlusion, against 8192 rays; mean square over 64 directions of
// the receiver at each distance (from .5 to .9 within .04 of it), those inside the model left out. Radii in radii of
// the bounding sphere.
#include "base/plot.h"
#include "base/progress.h"
#include "base/random.h"
#include "render/shadow_receivers.h"
#include "render/shape.h"
#include "render/tracer.h"
#include "scenes/shadow_scenes.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { WAYS = 13, PLACES = 15, RECEIVERS = 64, RAYS = 8192, FULL = 16, FULL_RAYS = 512, RANGES = 4 };
static const double places[PLACES] = {.4, .54, .62, .7, .78, .86, 1, 1.15, 1.3, 1.6, 2, 2.7, 4, 5.5, 8};
static const double range_ends[RANGES][2] = {{.5, .9}, {1, 2}, {2.7, 8}, {.4, 8}};
static const struct {
    const char *name;
    bool paper;
    int order, outer, inner;
    bool far;
    int cells;
    bool packed;
} ways[WAYS] = {{"1 shell, as printed", true, 4, 1, 0, false, 8, false},
                {"1 shell", false, 4, 1, 0, false, 8, false},
                {"2 shells", false, 4, 1, 1, false, 8, false},
                {"4 shells, near", false, 4, 2, 2, false, 8, false},
                {"4 shells", false, 4, 1, 2, true, 8, false},
                {"5 shells", false, 4, 1, 3, true, 8, false},
                {"6 shells", false, 4, 1, 4, true, 8, false},
                {"8 shells", false, 4, 1, 6, true, 8, false},
                {"8 shells, 12 cells", false, 4, 1, 6, true, 12, false},
                {"8 shells, 10 cells, bytes", false, 4, 1, 6, true, 10, true},
                {"8 shells, 12 cells, bytes", false, 4, 1, 6, true, 12, true},
                {"16 shells, uniform", false, 4, 0, 0, false, 8, false},
                {"left out", false, 4, 0, 0, false, 8, false}};

typedef struct ball {
    double x, y, radius;
} ball;
enum { OBJECTS = SHADOW_SCENES + 4, BALLS = 5 };
static const struct {
    const char *name;
    ball balls[BALLS];
    bool plate;
} made[OBJECTS - SHADOW_SCENES] = {
    {"dumbbell", {{-0.7, 0, 0.3}, {0.7, 0, 0.3}}, false},
    {"touching", {{-0.5, 0, 0.5}, {0.5, 0, 0.5}}, false},
    {"L", {{0, 0, 0.2}, {0.4, 0, 0.2}, {0.8, 0, 0.2}, {0, 0.4, 0.2}, {0, 0.8, 0.2}}, false},
    {"plate", {{0, 0, 0}}, true},
};

typedef struct object {
    const char *name;
    alb_mesh mesh;
    alb_tracer tracer;
    alb_shadow_sphere sphere;
    alb_vector points[PLACES][RECEIVERS];
    bool buried[PLACES][RECEIVERS];
    double truth[PLACES][RECEIVERS][16];
    float *full;                                               // [FULL][nodes][16]
    double rms[WAYS][PLACES], memory[WAYS], sampling_ms[WAYS]; // memory of that of 16 shells
} object;

static double full_radius(int shell) { return 0.2 + (8 - 0.2) * shell / (FULL - 1); }

static void look(double out[16], const alb_tracer *tracer, alb_vector from, int rays)
{
    double basis[16];
    memset(out, 0, 16 * sizeof *out);
    for (int q = 0; q < rays; q++) {
        const double z = 1 - (2 * q + 1.0) / rays, turn = M_PI * (3 - sqrt(5)) * q, r = sqrt(1 - z * z);
        const alb_vector d = {r * cos(turn), r * sin(turn), z};
        alb_hit hit;
        if (!alb_tracer_closest(&hit, tracer, from, d))
            continue;
        alb_sh_evaluate(basis, 4, d);
        for (int i = 0; i < 16; i++)
            out[i] += 4 * M_PI / rays * basis[i];
    }
}

static bool cut_out(alb_mesh *mesh, int scene_index, alb_error *error)
{
    alb_scene scene;
    if (!shadow_scenes[scene_index].create(&scene, 7, error))
        return false;
    const alb_object *range = &scene.objects[1];
    const uint32_t first = (uint32_t)range->first_vertex;
    bool ok = true;
    for (size_t v = 0; ok && v < range->vertex_count; v++)
        ok = alb_mesh_add_vertex(mesh, scene.mesh.vertices[first + v], error);
    for (size_t f = 0; ok && f < scene.mesh.face_count; f++) {
        const uint32_t *v = scene.mesh.faces[f];
        if (v[0] >= first && v[0] - first < range->vertex_count)
            ok = alb_mesh_add_face(mesh, v[0] - first, v[1] - first, v[2] - first, 0, error);
    }
    alb_scene_free(&scene);
    return ok;
}

static bool add_ball(alb_mesh *mesh, ball b, alb_error *error)
{
    alb_mesh one = {0};
    const bool ok = alb_shape_sphere(&one, &(alb_sphere){{b.x, b.y, 0}, b.radius, 4, false}, error) &&
                    alb_mesh_append(mesh, &one, 1, (alb_vector){0}, error);
    alb_mesh_free(&one);
    return ok;
}

static bool make(alb_mesh *mesh, int which, alb_error *error)
{
    bool ok = true;
    for (int n = 0; ok && n < BALLS && made[which].balls[n].radius > 0; n++)
        ok = add_ball(mesh, made[which].balls[n], error);
    for (int n = 0; ok && made[which].plate && n < 25; n++)
        ok = add_ball(mesh, (ball){0.3 * (n % 5 - 2), 0.3 * (n / 5 - 2), 0.15}, error);
    return ok;
}

static bool create(object *o, int index, alb_error *error)
{
    const int which = index - SHADOW_SCENES;
    o->name = which < 0 ? shadow_scenes[index].name : made[which].name;
    bool ok = which < 0 ? cut_out(&o->mesh, index, error) : make(&o->mesh, which, error);
    ok = ok && alb_tracer_create(&o->tracer, &o->mesh, error) &&
         alb_shadow_sphere_follow(&o->sphere, o->mesh.vertices, o->mesh.vertex_count, "model", error) &&
         (o->full = calloc(FULL * 386 * 16, sizeof *o->full)) != NULL;
    alb_random random = alb_random_at(5, 7, 0);
    for (int p = 0; p < PLACES; p++)
        for (int r = 0; r < RECEIVERS; r++) {
            const double z = 2 * alb_random_uniform(&random) - 1, turn = 2 * M_PI * alb_random_uniform(&random);
            const alb_vector d = {sqrt(1 - z * z) * cos(turn), sqrt(1 - z * z) * sin(turn), z};
            // even over .5 to .9: shells must not be met at their own radii
            const double off = places[p] > .5 && places[p] < .9 ? .08 * (alb_random_uniform(&random) - .5) : 0;
            o->points[p][r] = alb_add(o->sphere.centre_mm, alb_times((places[p] + off) * o->sphere.radius_mm, d));
        }
#pragma omp parallel for schedule(dynamic, 8)
    for (int n = 0; n < (ok ? PLACES * RECEIVERS : 0); n++) {
        const alb_vector at = o->points[n / RECEIVERS][n % RECEIVERS];
        o->buried[n / RECEIVERS][n % RECEIVERS] =
            alb_tracer_crossings(&o->tracer, at, (alb_vector){0.36, 0.48, 0.8}) < 0;
        look(o->truth[n / RECEIVERS][n % RECEIVERS], &o->tracer, at, RAYS);
    }
#pragma omp parallel for schedule(dynamic, 8)
    for (int n = 0; n < (ok ? FULL * 386 : 0); n++) {
        const alb_vector d = alb_shadow_grid_direction((alb_shadow_grid){8}, n % 386);
        double sample[16];
        look(sample, &o->tracer, alb_add(o->sphere.centre_mm, alb_times(full_radius(n / 386) * o->sphere.radius_mm, d)),
             FULL_RAYS);
        for (int i = 0; i < 16; i++)
            o->full[16 * n + i] = (float)sample[i];
    }
    return ok;
}

static void look_up_full(float out[16], const object *o, double place, alb_vector direction)
{
    const alb_shadow_place at = alb_shadow_grid_place((alb_shadow_grid){8}, direction);
    const double s = (place - full_radius(0)) / (full_radius(1) - full_radius(0));
    const int low = s >= FULL - 2 ? FULL - 2 : (int)s;
    memset(out, 0, 16 * sizeof *out);
    for (int k = 0; k < 8; k++) {
        const double weight = (double)at.weights[k % 4] * (k / 4 ? s - low : 1 - (s - low));
        const float *from = o->full + 16 * ((low + k / 4) * 386 + at.nodes[k % 4]);
        for (int i = 0; i < 16; i++)
            out[i] += (float)weight * from[i];
    }
}

// Frames are what counts, not the first one: the object is moved a little and back. Best of five.
static bool time_sampling(double *ms, alb_shadow_field *field, alb_mesh *mesh, alb_error *error)
{
    bool ok = alb_shadow_field_sample(field, mesh->vertices, error);
    const double x = mesh->vertices[0].x;
    *ms = INFINITY;
    for (int frame = 0; ok && frame < 5; frame++) {
        mesh->vertices[0].x = frame % 2 ? x : x + 1e-9 * field->sphere.radius_mm;
        const double start_s = alb_clock_s();
        ok = alb_shadow_field_sample(field, mesh->vertices, error);
        *ms = fmin(*ms, 1e3 * (alb_clock_s() - start_s));
    }
    mesh->vertices[0].x = x;
    return ok && alb_shadow_field_sample(field, mesh->vertices, error);
}

static bool measure(object *o, int way, alb_error *error)
{
    alb_shadow_settings settings = alb_shadow_defaults;
    alb_shadow_field field = {0};
    alb_shadow_laws laws = {0};
    bool ok = true;
    settings.order = ways[way].order, settings.outer = ways[way].outer, settings.inner = ways[way].inner;
    settings.far = ways[way].far, settings.cells = ways[way].cells;
    settings.packed = ways[way].packed;
    if (settings.outer)
        ok = alb_shadow_laws_create(&laws, settings.order, ways[way].paper, error) &&
             alb_shadow_field_create(&field, &settings, &o->mesh, NULL, "model", error);
    ok = ok && (!settings.outer || time_sampling(&o->sampling_ms[way], &field, &o->mesh, error));
    const size_t full_bytes = FULL * 386 * 16 * sizeof *o->full,
                 bytes = ok && settings.outer ? alb_shadow_field_bytes(&field) : 0;
    o->memory[way] = way == WAYS - 2 ? 1 : (double)bytes / (double)full_bytes;
    for (int p = 0; ok && p < PLACES; p++) {
        static float found[16 * ALB_SHADOW_BLOCK];
        static alb_shadow_receivers receivers;
        double sum = 0;
        int count = 0;
        memset(found, 0, sizeof found);
        if (settings.outer) {
            alb_shadow_receivers_at(&receivers, &field, o->points[p], RECEIVERS);
            alb_shadow_receivers_occlusion(found, &receivers, &field, &laws);
        }
        for (int r = 0; r < RECEIVERS; r++) {
            float one[16];
            for (int i = 0; i < 16; i++)
                one[i] = found[i * ALB_SHADOW_BLOCK + r];
            if (way == WAYS - 2)
                look_up_full(one, o, alb_length(alb_sub(o->points[p][r], o->sphere.centre_mm)) / o->sphere.radius_mm,
                             alb_sub(o->points[p][r], o->sphere.centre_mm));
            count += !o->buried[p][r];
            for (int i = 0; i < 16 && !o->buried[p][r]; i++)
                sum += pow((double)one[i] - o->truth[p][r][i], 2) / (4 * M_PI);
        }
        o->rms[way][p] = count ? sqrt(sum / count) : (double)NAN;
    }
    alb_shadow_field_free(&field);
    alb_shadow_laws_free(&laws);
    return ok;
}

static double over_range(const object *o, int way, const double ends[2])
{
    double sum = 0;
    int count = 0;
    for (int p = 0; p < PLACES; p++)
        if (places[p] >= ends[0] - 1e-9 && places[p] <= ends[1] + 1e-9 && isfinite(o->rms[way][p])) {
            sum += pow(o->rms[way][p], 2);
            count++;
        }
    return sqrt(sum / count);
}

static bool chart(const char *path, object *objects, alb_error *error)
{
    alb_curve curves[SHADOW_SCENES][WAYS] = {{{0}}};
    alb_panel panels[SHADOW_SCENES] = {{0}};
    for (int s = 0; s < SHADOW_SCENES; s++) {
        for (int w = 0; w < WAYS; w++)
            curves[s][w] = (alb_curve){.label = s ? NULL : ways[w].name,
                                       .x = places,
                                       .y = objects[s].rms[w],
                                       .count = PLACES,
                                       .mark = w == WAYS - 1 ? ALB_MARK_DASHES : ALB_MARK_LINE_AND_POINTS};
        panels[s] = (alb_panel){.title = shadow_scenes[s].name,
                                .x_label = s == SHADOW_SCENES - 1 ? "distance, radii of the bounding sphere" : NULL,
                                .y_label = "error of occlusion, rms",
                                .log_x = true,
                                .log_y = true,
                                .curves = curves[s],
                                .curve_count = WAYS,
                                .height = 1};
    }
    return alb_plot_write(path, panels, SHADOW_SCENES, 800, 1200, error);
}

int main(int argc, char **argv)
{
    static object objects[OBJECTS];
    alb_error error = {0};
    bool ok = true;
    printf("%-8s %-25s %9s %9s %9s %9s %9s %9s\n", "", "distance", ".5 - .9", "1 - 2", "2.7 - 8", "all", "memory",
           "ms");
    for (int s = 0; ok && s < OBJECTS; s++) {
        ok = create(&objects[s], s, &error);
        for (int w = 0; ok && w < WAYS; w++) {
            ok = measure(&objects[s], w, &error);
            printf("%-8s %-25s", objects[s].name, ways[w].name);
            for (int k = 0; k < RANGES; k++)
                printf(" %9.4f", over_range(&objects[s], w, range_ends[k]));
            printf(" %9.3f %9.2f\n", objects[s].memory[w], objects[s].sampling_ms[w]);
            fflush(stdout);
        }
        alb_tracer_free(&objects[s].tracer);
        alb_mesh_free(&objects[s].mesh);
        free(objects[s].full);
    }
    ok = ok && (argc < 2 || chart(argv[1], objects, &error));
    if (!ok)
        fprintf(stderr, "bench.shadow_shells: %s\n", error.text);
    return ok ? 0 : 1;
}
