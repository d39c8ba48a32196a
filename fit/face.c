// Where the pixels of an image lie on a face, how much of it they cover and at what cosine to the normal they see it.
#include "base/memory.h"
#include "fit/observe.h"
#include <math.h>
#include <stdlib.h>

static bool face_allocate(alb_face *face, int width, int height, alb_error *error)
{
    *face = (alb_face){.width = width, .height = height};
    const size_t count = (size_t)width * (size_t)height;
    if ((face->x_mm = alb_allocate(count, sizeof(double), error)) &&
        (face->y_mm = alb_allocate(count, sizeof(double), error)) &&
        (face->area_mm2 = alb_allocate(count, sizeof(double), error)) &&
        (face->cosine = alb_allocate(count, sizeof(double), error)))
        return true;
    alb_face_free(face);
    return false;
}

bool alb_face_flat(alb_face *face, int width, int height, double mm_per_pixel, alb_error *error)
{
    if (!face_allocate(face, width, height, error))
        return false;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            const size_t i = (size_t)y * (size_t)width + (size_t)x;
            face->x_mm[i] = x * mm_per_pixel;
            face->y_mm[i] = y * mm_per_pixel;
            face->area_mm2[i] = mm_per_pixel * mm_per_pixel;
            face->cosine[i] = 1;
        }
    return true;
}

bool alb_face_seen(alb_face *face, const alb_camera *camera, alb_error *error)
{
    if (!face_allocate(face, camera->lens.width, camera->lens.height, error))
        return false;
    const alb_vector eye = alb_inverse(&camera->camera_from_world).translation;
#pragma omp parallel for schedule(static)
    for (int y = 0; y < face->height; y++)
        for (int x = 0; x < face->width; x++) {
            const size_t i = (size_t)y * (size_t)face->width + (size_t)x;
            if (!alb_camera_on_plane(&face->x_mm[i], &face->y_mm[i], &face->area_mm2[i], camera, 0, x, y))
                face->x_mm[i] = face->y_mm[i] = face->area_mm2[i] = NAN;
            face->cosine[i] = fabs(eye.z) / hypot(hypot(eye.x - face->x_mm[i], eye.y - face->y_mm[i]), eye.z);
        }
    return true;
}

double alb_face_cosine(const alb_face *face, double x_mm, double y_mm)
{
    const size_t count = (size_t)face->width * (size_t)face->height;
    double nearest = INFINITY, cosine = 0;
    for (size_t i = 0; i < count; i++) {
        const double distance = hypot(face->x_mm[i] - x_mm, face->y_mm[i] - y_mm);
        if (distance < nearest)
            nearest = distance, cosine = face->cosine[i];
    }
    return cosine;
}

void alb_face_free(alb_face *face)
{
    free(face->x_mm);
    free(face->y_mm);
    free(face->area_mm2);
    free(face->cosine);
    *face = (alb_face){0};
}
