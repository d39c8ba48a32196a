// L = B / pi at the first hit of each line of sight (every patch is a Lambertian source), B interpolated linearly
// between corners. Stops being true at the scale of a patch: shadow edges are as wide as the mesh there.
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

bool alb_view_smooth(float (*corners)[3][3], const alb_patches *patches, const double (*radiosity)[3], alb_error *error)
{
    const alb_mesh *mesh = patches->mesh;
    touching around = {0};
    const bool ok = find_touching(&around, mesh, error);
#pragma omp parallel for schedule(static)
    for (size_t f = 0; f < (ok ? patches->count : 0); f++)
        for (int k = 0; k < 3; k++) {
            const uint32_t vertex = mesh->faces[f][k];
            double sum[3] = {0}, area = 0;
            for (size_t at = around.starts[vertex]; at < around.starts[vertex + 1]; at++) {
                const uint32_t g = around.patches[at];
                if (mesh->groups[g] != mesh->groups[f] ||
                    alb_dot(patches->normals[g], patches->normals[f]) < crease_cosine)
                    continue;
                area += patches->areas_mm2[g];
                for (int c = 0; c < 3; c++)
                    sum[c] += patches->areas_mm2[g] * radiosity[g][c];
            }
            for (int c = 0; c < 3; c++)
                corners[f][k][c] = (float)(sum[c] / area);
        }
    free(around.starts);
    free(around.patches);
    return ok;
}

static void add_radiance(double sum[3], const alb_scene *scene, const alb_tracer *tracer, const float (*corners)[3][3],
                         double u, double v)
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
        for (int c = 0; c < 3; c++)
            sum[c] += ((1 - hit.u - hit.v) * (double)corners[hit.face][0][c] + hit.u * (double)corners[hit.face][1][c] +
                       hit.v * (double)corners[hit.face][2][c]) /
                      M_PI;
}

bool alb_view_render(alb_image *picture, const alb_scene *scene, const alb_tracer *tracer, const float (*corners)[3][3],
                     alb_error *error)
{
    const alb_lens *lens = &scene->camera.lens;
    if (!alb_image_create(picture, lens->width, lens->height, "R,G,B", error))
        return false;
#pragma omp parallel for schedule(dynamic, 4)
    for (int y = 0; y < lens->height; y++)
        for (int x = 0; x < lens->width; x++) {
            double sum[3] = {0};
            for (int k = 0; k < 4; k++)
                add_radiance(sum, scene, tracer, corners, x + (k % 2 ? 0.25 : -0.25), y + (k / 2 ? 0.25 : -0.25));
            for (int c = 0; c < 3; c++)
                alb_image_at(picture, x, y)[c] = (float)(0.25 * sum[c]);
        }
    return true;
}
