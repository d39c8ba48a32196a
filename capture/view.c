// A pixel is the quadrilateral of sight between its corners. The corners' directions are undistorted once
// (base/camera.h); inside a pixel directions are bilinear, which is right to 1e-5 px for ordinary lenses. A point (a,
// b, 1) of the normalised image sees the plane where z of R^T (a, b, 1) t + o is zero. Points within a pixel lie on a
// Fibonacci lattice: n distinct columns and rows, so that an edge along the pixels moves in steps of 1/n, not of
// 1/sqrt(n). No defocus, no diffraction, no glare.
#include "capture/view.h"
#include "base/memory.h"
#include "base/random.h"
#include <math.h>
#include <stdlib.h>

static const double degree = M_PI / 180;

bool alb_sight_open(alb_sight *sight, const alb_truth *truth, alb_error *error)
{
    const double tilt = truth->camera.tilt_deg * degree, distance = truth->camera.distance_mm;
    const int width = truth->camera.width, height = truth->camera.height, across = width + 1;
    const double *k = truth->camera.distortion;
    *sight = (alb_sight){.camera = alb_camera_look_at((alb_vector){0, -distance * sin(tilt), distance * cos(tilt)},
                                                      (alb_vector){0, 0, 0}, (alb_vector){0, 1, 0}, 30, width, height)};
    sight->camera.lens = (alb_lens){.width = width,
                                    .height = height,
                                    .fx = truth->camera.focal_px,
                                    .fy = truth->camera.focal_px,
                                    .cx = truth->camera.centre_px[0],
                                    .cy = truth->camera.centre_px[1],
                                    .k1 = k[0],
                                    .k2 = k[1],
                                    .p1 = k[2],
                                    .p2 = k[3],
                                    .k3 = k[4]};
    sight->corners_xy = alb_allocate((size_t)across * (size_t)(height + 1) * 2, sizeof(double), error);
    if (!sight->corners_xy)
        return false;
    int lost = 0;
#pragma omp parallel for reduction(+ : lost)
    for (int y = 0; y <= height; y++)
        for (int x = 0; x <= width; x++) {
            alb_vector d;
            double *out = sight->corners_xy + 2 * ((size_t)y * (size_t)across + (size_t)x);
            if (alb_lens_direction(&d, &sight->camera.lens, x - 0.5, y - 0.5))
                out[0] = d.x / d.z, out[1] = d.y / d.z;
            else
                lost++;
        }
    if (lost) {
        alb_sight_free(sight);
        return alb_fail(error, ALB_BAD_DATA,
                        "the camera's distortion folds the picture over at %d of its pixel corners; "
                        "use a milder one",
                        lost);
    }
    return true;
}

void alb_sight_free(alb_sight *sight)
{
    free(sight->corners_xy);
    *sight = (alb_sight){0};
}

// Normalised image point of (s, t) in 0..1 across pixel (x, y).
static void within_pixel(double *a, double *b, const alb_sight *sight, int x, int y, double s, double t)
{
    const size_t across = 2 * ((size_t)sight->camera.lens.width + 1);
    const double *p = sight->corners_xy + (size_t)y * across + 2 * (size_t)x, *q = p + across;
    *a = (1 - t) * ((1 - s) * p[0] + s * p[2]) + t * ((1 - s) * q[0] + s * q[2]);
    *b = (1 - t) * ((1 - s) * p[1] + s * p[3]) + t * ((1 - s) * q[1] + s * q[3]);
}

static void pixel(float *out, const alb_sight *sight, const alb_transform *plane_from_camera,
                  const alb_flat_scene *scene, int x, int y)
{
    const int n = scene->samples, step = (int)lrint(0.618 * n); // of the Fibonacci lattice: 3 for 5, 21 for 34
    const alb_vector o = plane_from_camera->translation;
    double sum[3] = {0, 0, 0};
    for (int i = 0; i < n; i++) {
        double a, b, radiance[3];
        within_pixel(&a, &b, sight, x, y, (i + 0.5) / n, (i * step % n + 0.5) / n);
        const alb_vector d = alb_rotate(plane_from_camera, (alb_vector){a, b, 1});
        const double t = -o.z / d.z;
        if (!(t > 0 && t < 1e9))
            continue;
        scene->radiance(radiance, scene->scene, o.x + t * d.x, o.y + t * d.y, fabs(d.z) / alb_length(d));
        for (int c = 0; c < 3; c++)
            sum[c] += radiance[c];
    }
    for (int c = 0; c < 3; c++)
        out[c] = (float)(sum[c] / n);
}

void alb_sight_picture(alb_image *out, const alb_sight *sight, const alb_transform *camera_from_plane,
                       const alb_flat_scene *scene)
{
    const alb_transform plane_from_camera = alb_inverse(camera_from_plane);
#pragma omp parallel for schedule(dynamic, 4)
    for (int y = 0; y < out->height; y++)
        for (int x = 0; x < out->width; x++)
            pixel(alb_image_at(out, x, y), sight, &plane_from_camera, scene, x, y);
}

void alb_sight_vignette(alb_image *image, const alb_sight *sight, double vignetting)
{
    const double f = sight->camera.lens.fx, half = 0.25 * (image->width * image->width + image->height * image->height);
    const double corner = 1 - 1 / ((1 + half / (f * f)) * (1 + half / (f * f)));
#pragma omp parallel for schedule(static)
    for (int y = 0; y < image->height; y++)
        for (int x = 0; x < image->width; x++) {
            const double dx = (x - sight->camera.lens.cx) / f, dy = (y - sight->camera.lens.cy) / f;
            const double g = 1 + dx * dx + dy * dy, loss = (1 - 1 / (g * g)) / corner;
            for (int c = 0; c < image->channels; c++)
                alb_image_at(image, x, y)[c] *= (float)fmax(0, 1 - vignetting * loss);
        }
}

bool alb_sight_sees(const alb_sight *sight, const alb_transform *camera_from_plane, double half_x_mm, double half_y_mm)
{
    const alb_camera camera = {.lens = sight->camera.lens, .camera_from_world = *camera_from_plane};
    for (int i = 0; i < 8; i++) { // corners and middles of the sides
        static const int sx[8] = {-1, 0, 1, 1, 1, 0, -1, -1}, sy[8] = {-1, -1, -1, 0, 1, 1, 1, 0};
        double u, v;
        if (!alb_camera_project(&u, &v, &camera, (alb_vector){sx[i] * half_x_mm, sy[i] * half_y_mm, 0}) ||
            !(u >= 1 && v >= 1 && u <= camera.lens.width - 2 && v <= camera.lens.height - 2))
            return false;
    }
    return true;
}

bool alb_sight_hand_pose(alb_transform *camera_from_board, const alb_sight *sight, double half_x_mm, double half_y_mm,
                         uint64_t seed, uint64_t index, alb_error *error)
{
    alb_random random = alb_random_at(seed, 0x68616e64, index);
    const alb_lens *lens = &sight->camera.lens;
    const double distance = alb_length(sight->camera.camera_from_world.translation);
    for (int attempt = 0; attempt < 5000; attempt++) {
        double u[6];
        for (int i = 0; i < 6; i++)
            u[i] = 2 * alb_random_uniform(&random) - 1;
        const double a = 35 * degree * u[0], b = 35 * degree * u[1], c = 20 * degree * u[2];
        const double away = distance * (1.15 + 0.25 * u[3]);
        const alb_vector x = {cos(b) * cos(c), cos(b) * sin(c), sin(b)}; // the board's x axis in the camera
        const alb_vector level = alb_unit((alb_vector){sin(c), -cos(c), 0});
        const alb_vector side = alb_unit(alb_sub(level, alb_times(alb_dot(level, x), x))), front = alb_cross(x, side);
        const alb_vector y = alb_add(alb_times(cos(a), side), alb_times(sin(a), front)), z = alb_cross(x, y);
        *camera_from_board = (alb_transform){.rotation = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}},
                                             .translation = {away * 0.3 * u[4] * lens->width / lens->fx,
                                                             away * 0.3 * u[5] * lens->height / lens->fy, away}};
        if (alb_sight_sees(sight, camera_from_board, half_x_mm, half_y_mm))
            return true;
    }
    return alb_fail(error, ALB_BAD_DATA,
                    "a board of %g x %g mm with its margin does not fit into the camera's view, tilted "
                    "and up to %.3g mm away; use smaller squares",
                    2 * half_x_mm, 2 * half_y_mm, 1.4 * distance);
}
