// Vertices i = 1 .. n drawn at random, each with two independent halves of its rays, a and b; x what the fields gave:
//     mean square error = mean of (x - a)(x - b),      as the rays' errors are independent and have no bias
// Upper bound: the mean plus 3 standard errors of it over the vertices (squares of errors have long tails, and the
// setting taken is the first that looked good), then the root. What receives only is no
// occluder for the rays either: the error stated is that of the fields, not of what the method leaves out (bounces,
// shadows that such objects would cast). Rays of the same error, aimed at what emits: that of N in cells
// falls as N^(-2/3) (measured, 64 to 1024), from half the mean of (a - b)^2 on.
#include "render/shadow_advisor.h"
#include "base/memory.h"
#include "base/progress.h"
#include "base/random.h"
#include "render/shadow_cut.h"
#include "render/shadow_rays.h"
#include <stdlib.h>

enum { VERTICES = 400, STRATA = 12 };

typedef struct samples {
    alb_vector points[VERTICES], normals[VERTICES];
    float found[VERTICES][3], halves[2][VERTICES][3];
    int rays; // of a half
} samples;

// The faces of all that casts or emits, and what they send.
static bool collect(alb_mesh *mesh, float (**radiance)[3], const alb_shadow_stage *stage, const alb_scene *scene,
                    alb_error *error)
{
    bool chosen[ALB_OBJECTS_MAX] = {false};
    for (size_t i = 0; i < stage->occluder_count + stage->light_count; i++)
        chosen[stage->objects[i]] = true;
    return alb_shadow_cut(mesh, radiance, scene, chosen, error);
}

static bool emits(const alb_shadow_stage *stage, const alb_scene *scene, size_t vertex)
{
    for (size_t i = stage->occluder_count; i < stage->occluder_count + stage->light_count; i++)
        if (alb_object_owns(&scene->objects[stage->objects[i]], vertex))
            return true;
    return false;
}

// Where scattering is part of the transport rays say nothing.
static bool scatters(const alb_shadow_stage *stage, size_t vertex)
{
    const alb_shadow_transport *t = &stage->transport;
    const uint32_t row = t->row_count ? t->rows[vertex] : ALB_TRANSPORT_NONE;
    return row != ALB_TRANSPORT_NONE && t->matrix_of[row] != ALB_TRANSPORT_NONE;
}

// Vertices that are seen, of what does not emit and does not scatter by transport. False where there are hardly any.
static bool draw(samples *s, const alb_tracer *tracer, const alb_shadow_stage *stage, const alb_scene *scene,
                 double offset_mm, uint64_t seed)
{
    alb_random random = alb_random_at(seed, 0xad71, 0);
    for (int n = 0; n < VERTICES; n++) {
        size_t v = 0;
        int tries = 0;
        do {
            if (++tries > 1000)
                return false;
            v = (size_t)(alb_random_uniform(&random) * (double)scene->mesh.vertex_count);
        } while (emits(stage, scene, v) || scatters(stage, v) ||
                 alb_shadow_buried(tracer, scene->mesh.vertices[v], stage->normals[v], offset_mm));
        s->points[n] = scene->mesh.vertices[v];
        s->normals[n] = stage->normals[v];
        for (int c = 0; c < 3; c++)
            s->found[n][c] = stage->irradiance[v][c];
    }
    return true;
}

// rays_s is that of one half's rays until here.
static void compare(alb_shadow_verdict *verdict, const samples *s)
{
    double upper = NAN, worst = NAN;
    for (int c = 0; c < 3; c++) {
        double mean = 0, square = 0, fourth = 0, random = 0;
        for (int n = 0; n < VERTICES; n++) {
            const double a = (double)s->halves[0][n][c], b = (double)s->halves[1][n][c], x = (double)s->found[n][c];
            mean += 0.5 * (a + b) / VERTICES;
            square += (x - a) * (x - b) / VERTICES;
            fourth += pow((x - a) * (x - b), 2) / VERTICES;
            random += 0.5 * (a - b) * (a - b) / VERTICES;
        }
        const double spread = sqrt(fmax(fourth - square * square, 0) / VERTICES),
                     percent = 100 * sqrt(fmax(square, 0)) / mean;
        if (!(mean > 0))
            continue;
        if (!(percent <= worst)) {
            worst = percent;
            verdict->rays = square > 0 ? pow(random / fmax(square, 1e-6 * mean * mean), 0.75) : (double)NAN;
        }
        upper = fmax(100 * sqrt(fmax(square + 3 * spread, 0)) / mean, isnan(upper) ? 0 : upper);
    }
    verdict->percent = worst;
    verdict->upper_percent = upper;
    verdict->rays_s *= verdict->rays;
    verdict->rays *= s->rays;
}

bool alb_shadow_error(alb_shadow_verdict *verdict, const alb_shadow_stage *stage, const alb_scene *scene, uint64_t seed,
                      alb_error *error)
{
    alb_mesh mesh = {0};
    alb_tracer tracer = {0};
    alb_shadow_lamps lamps = {0};
    float(*radiance)[3] = NULL;
    samples *s = alb_allocate(1, sizeof *s, error);
    *verdict = (alb_shadow_verdict){NAN, NAN, NAN, NAN};
    const bool ok = s && collect(&mesh, &radiance, stage, scene, error) && alb_tracer_create(&tracer, &mesh, error) &&
                    alb_shadow_lamps_create(&lamps, &mesh, (const float(*)[3])radiance, error);
    const double offset_mm = 256 * tracer.slack_mm;
    if (ok && draw(s, &tracer, stage, scene, offset_mm, seed)) {
        const double start_s = alb_clock_s();
        for (int half = 0; half < 2; half++)
            alb_shadow_cast_aimed(s->halves[half], &tracer, &lamps, scene->lights, scene->light_count, s->points,
                                  s->normals, VERTICES, STRATA, offset_mm, seed + (uint64_t)half);
        s->rays = STRATA * STRATA * (lamps.count ? 2 : 1);
        verdict->rays_s = 0.5 * (alb_clock_s() - start_s) / VERTICES * (double)scene->mesh.vertex_count;
        compare(verdict, s);
    }
    alb_shadow_lamps_free(&lamps);
    alb_tracer_free(&tracer);
    alb_mesh_free(&mesh);
    free(radiance);
    free(s);
    return ok;
}

bool alb_shadow_advise(alb_shadow_stage *stage, alb_shadow_verdict *verdict, const alb_scene *scene,
                       double wanted_percent, uint64_t seed, alb_error *error)
{
    static const struct {
        int order, outer, inner, cells;
    } ladder[] = {{4, 1, 0, 8}, {8, 1, 0, 8}, {4, 1, 2, 8}, {4, 2, 3, 8}, {4, 1, 6, 10}, {6, 2, 6, 12}, {8, 3, 6, 16}};
    double best = INFINITY;
    for (size_t k = 0; k < sizeof ladder / sizeof *ladder; k++) {
        alb_shadow_settings settings = alb_shadow_defaults;
        settings.order = ladder[k].order;
        settings.outer = ladder[k].outer;
        settings.inner = ladder[k].inner;
        settings.far = ladder[k].inner > 0;
        settings.cells = ladder[k].cells;
        settings.packed = ladder[k].cells > alb_shadow_defaults.cells;
        alb_shadow_stage_set(stage, &settings);
        if (!alb_shadow_stage_light(stage, scene, error) || !alb_shadow_error(verdict, stage, scene, seed, error))
            return false;
        if (isnan(verdict->upper_percent))
            return alb_fail(error, ALB_UNDECIDED,
                            "nothing is lit where an error of shadow fields could be found; leave --error out");
        if (verdict->upper_percent <= wanted_percent)
            return true;
        best = fmin(best, verdict->upper_percent);
    }
    return alb_fail(error, ALB_UNDECIDED,
                    "shadow fields err by %.2g %% of the mean irradiance here, %g %% is wanted: lights or objects look "
                    "small or are close to each other; render by radiosity",
                    best, wanted_percent);
}
