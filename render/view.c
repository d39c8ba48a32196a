// L = e_r(mu) (B - B_t) / pi + e_t(mu) B_t / pi at the first hit of each line of sight, mu its cosine to the normal,
// B_t what crossed a slab, e = pi L / M of the face (fit/exit_angle.h): 1 for a Lambertian one. B, B_t and the normal
// are interpolated linearly between corners; at a corner they are the means over the patches around it that belong to
// the same object and material and whose normals lie within 40 degrees, weighted by area. Stops being true at the scale
// of a patch: shadow edges are as wide as the mesh there. Between patches light goes by the form factors as from a
// Lambertian source; what crossed a solid leaves as what was reflected.
#include "render/view.h"
#include "base/memory.h"
#include <stdlib.h>
#include <string.h>

static const double crease_cosine = 0.766; // 40 degrees

// Which patches touch each vertex: patches[starts[v]] .. patches[starts[v + 1]].
typedef struct touching {
    size_t *starts;
    uint32_t *patches;
} touching;

static bool find_touching(touching *out, const alb_mesh *mesh, alb_error *error)
{
    if (!(out->starts = alb_allocate(mesh->vertex_count + 2, sizeof *out->starts, error)) ||
        !(out->patches = alb_allocate(3 * mesh->face_count, sizeof *out->patches, error)))
        return false;
    for (size_t f = 0; f < mesh->face_count; f++)
        for (int k = 0; k < 3; k++)
            out->starts[mesh->faces[f][k] + 2]++;
    for (size_t v = 0; v < mesh->vertex_count; v++)
        out->starts[v + 2] += out->starts[v + 1];
    for (size_t f = 0; f < mesh->face_count; f++)
        for (int k = 0; k < 3; k++)
            out->patches[out->starts[mesh->faces[f][k] + 1]++] = (uint32_t)f;
    return true;
}

// At the three corners of each patch.
typedef struct corners {
    float (*radiosity)[3][3], (*across)[3][3], (*normals)[3][3]; // across: NULL where nothing crossed
} corners;

static bool smooth(float (**out)[3][3], const touching *around, const alb_patches *patches, const double (*values)[3],
                   alb_error *error)
{
    const alb_mesh *mesh = patches->mesh;
    if (!(*out = alb_allocate(patches->count, sizeof **out, error)))
        return false;
#pragma omp parallel for schedule(static)
    for (size_t f = 0; f < patches->count; f++)
        for (int k = 0; k < 3; k++) {
            const uint32_t vertex = mesh->faces[f][k];
            double sum[3] = {0}, area = 0;
            for (size_t at = around->starts[vertex]; at < around->starts[vertex + 1]; at++) {
                const uint32_t g = around->patches[at];
                if (mesh->groups[g] != mesh->groups[f] ||
                    alb_dot(patches->normals[g], patches->normals[f]) < crease_cosine)
                    continue;
                area += patches->areas_mm2[g];
                for (int c = 0; c < 3; c++)
                    sum[c] += patches->areas_mm2[g] * values[g][c];
            }
            for (int c = 0; c < 3; c++)
                (*out)[f][k][c] = (float)(sum[c] / area);
        }
    return true;
}

static bool smooth_all(corners *out, const alb_solution *s, alb_error *error)
{
    _Static_assert(sizeof(alb_vector) == sizeof(double[3]), "normals are smoothed as rows of three numbers");
    touching around = {0};
    const bool ok = find_touching(&around, s->patches.mesh, error) &&
                    smooth(&out->radiosity, &around, &s->patches, (const double(*)[3])s->radiosity, error) &&
                    smooth(&out->normals, &around, &s->patches, (const double(*)[3])s->patches.normals, error) &&
                    (!s->across || smooth(&out->across, &around, &s->patches, (const double(*)[3])s->across, error));
    free(around.starts);
    free(around.patches);
    return ok;
}

static void between(double out[3], const float (*corner)[3], const alb_hit *hit)
{
    for (int c = 0; c < 3; c++)
        out[c] = (1 - hit->u - hit->v) * (double)corner[0][c] + hit->u * (double)corner[1][c] +
                 hit->v * (double)corner[2][c];
}

static void add_face(double sum[3], const alb_surface *surface, const corners *at, const alb_hit *hit,
                     alb_vector direction)
{
    double radiosity[3], across[3] = {0}, normal[3];
    between(radiosity, (const float(*)[3])at->radiosity[hit->face], hit);
    between(normal, (const float(*)[3])at->normals[hit->face], hit);
    if (at->across)
        between(across, (const float(*)[3])at->across[hit->face], hit);
    const alb_vector n = alb_unit((alb_vector){normal[0], normal[1], normal[2]});
    const double cosine = fmin(fmax(-alb_dot(n, direction), 0), 1);
    const double reflected = alb_exit_ratio(&surface->exits[ALB_REFLECTION], cosine) / M_PI,
                 crossed = alb_exit_ratio(&surface->exits[ALB_TRANSMISSION], cosine) / M_PI;
    for (int c = 0; c < 3; c++)
        sum[c] += reflected * (radiosity[c] - across[c]) + crossed * across[c];
}

static void add_radiance(double sum[3], const alb_scene *scene, const alb_tracer *tracer, const corners *at, double u,
                         double v)
{
    alb_vector origin, direction;
    alb_hit hit;
    if (!alb_camera_ray(&origin, &direction, &scene->camera, u, v))
        return;
    if (!alb_tracer_closest(&hit, tracer, origin, direction)) {
        for (size_t i = 0; i < scene->light_count; i++) {
            double sky[3];
            alb_light_sky(sky, &scene->lights[i], direction);
            for (int c = 0; c < 3; c++)
                sum[c] += sky[c];
        }
    } else if (hit.front)
        add_face(sum, &scene->surfaces[scene->mesh.groups[hit.face]], at, &hit, direction);
}

bool alb_view_render(alb_image *picture, const alb_scene *scene, const alb_solution *solution, alb_error *error)
{
    const alb_lens *lens = &scene->camera.lens;
    corners at = {0};
    const bool ok =
        smooth_all(&at, solution, error) && alb_image_create(picture, lens->width, lens->height, "R,G,B", error);
#pragma omp parallel for schedule(dynamic, 4)
    for (int y = 0; y < (ok ? lens->height : 0); y++)
        for (int x = 0; x < lens->width; x++) {
            double sum[3] = {0};
            for (int k = 0; k < 4; k++)
                add_radiance(sum, scene, &solution->tracer, &at, x + (k % 2 ? 0.25 : -0.25),
                             y + (k / 2 ? 0.25 : -0.25));
            for (int c = 0; c < 3; c++)
                alb_image_at(picture, x, y)[c] = (float)(0.25 * sum[c]);
        }
    free(at.radiosity);
    free(at.across);
    free(at.normals);
    return ok;
}

double alb_view_brightest(const alb_scene *scene, const alb_solution *s)
{
    double brightest = 0;
    for (size_t p = 0; p < s->patches.count; p++) {
        const alb_surface *surface = &scene->surfaces[scene->mesh.groups[p]];
        if (s->exitance[p][0] + s->exitance[p][1] + s->exitance[p][2] > 0)
            continue;
        for (int c = 0; c < 3; c++) { // brightest along the normal
            const double across = s->across ? s->across[p][c] : 0;
            brightest =
                fmax(brightest, (alb_exit_ratio(&surface->exits[ALB_REFLECTION], 1) * (s->radiosity[p][c] - across) +
                                 alb_exit_ratio(&surface->exits[ALB_TRANSMISSION], 1) * across) /
                                    M_PI);
        }
    }
    return brightest;
}

static int by_size(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

bool alb_view_exposure(double *exposure, const alb_image *picture, double brightest, alb_error *error)
{
    const size_t pixels = (size_t)picture->width * (size_t)picture->height;
    float *values = alb_allocate(pixels, sizeof *values, error);
    size_t count = 0;
    if (!values)
        return false;
    for (size_t i = 0; i < pixels; i++) {
        const float *p = picture->pixels + 3 * i, value = fmaxf(p[0], fmaxf(p[1], p[2]));
        if (value > 0 && (double)value <= 1.001 * brightest)
            values[count++] = value;
    }
    qsort(values, count, sizeof *values, by_size);
    *exposure = count ? 0.9 / (double)values[(size_t)(0.99 * (double)(count - 1))] : 1;
    free(values);
    return true;
}
