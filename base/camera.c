// The pinhole camera with Brown-Conrady distortion; formulas in camera.h. Stops being true for fish-eyes, and where the
// radial polynomial turns over (alb_lens_direction then says so instead of inventing a direction).
#include "base/camera.h"

// (x, y) -> (dx, dy) distorted, with the Jacobian j = d(dx, dy)/d(x, y).
static void distort(double *dx, double *dy, double j[2][2], const alb_lens *l, double x, double y)
{
    const double r2 = x * x + y * y, g = 1 + r2 * (l->k1 + r2 * (l->k2 + r2 * l->k3));
    const double dg = l->k1 + r2 * (2 * l->k2 + r2 * 3 * l->k3); // dg/dr2
    *dx = x * g + 2 * l->p1 * x * y + l->p2 * (r2 + 2 * x * x);
    *dy = y * g + l->p1 * (r2 + 2 * y * y) + 2 * l->p2 * x * y;
    j[0][0] = g + 2 * x * x * dg + 2 * l->p1 * y + 6 * l->p2 * x;
    j[0][1] = 2 * x * y * dg + 2 * l->p1 * x + 2 * l->p2 * y;
    j[1][0] = j[0][1];
    j[1][1] = g + 2 * y * y * dg + 6 * l->p1 * y + 2 * l->p2 * x;
}

bool alb_camera_project(double *u, double *v, const alb_camera *camera, alb_vector world)
{
    const alb_vector p = alb_apply(&camera->camera_from_world, world);
    const alb_lens *l = &camera->lens;
    double dx, dy, j[2][2];
    if (!(p.z > 0))
        return false;
    distort(&dx, &dy, j, l, p.x / p.z, p.y / p.z);
    *u = l->fx * dx + l->cx;
    *v = l->fy * dy + l->cy;
    return true;
}

bool alb_lens_direction(alb_vector *direction, const alb_lens *l, double u, double v)
{
    const double tx = (u - l->cx) / l->fx, ty = (v - l->cy) / l->fy;
    double x = tx, y = ty, dx, dy, j[2][2];
    for (int i = 0; i < 25; i++) {
        distort(&dx, &dy, j, l, x, y);
        const double ex = tx - dx, ey = ty - dy, det = j[0][0] * j[1][1] - j[0][1] * j[1][0];
        if (!(det > 1e-3) || !(j[0][0] > 0)) // beyond the turning point of the distortion
            return false;
        x += (j[1][1] * ex - j[0][1] * ey) / det;
        y += (j[0][0] * ey - j[1][0] * ex) / det;
        if (fabs(ex) + fabs(ey) < 1e-13) {
            *direction = alb_unit((alb_vector){x, y, 1});
            return true;
        }
    }
    return false;
}

bool alb_camera_ray(alb_vector *origin, alb_vector *direction, const alb_camera *camera, double u, double v)
{
    alb_vector d;
    if (!alb_lens_direction(&d, &camera->lens, u, v))
        return false;
    const alb_transform world_from_camera = alb_inverse(&camera->camera_from_world);
    *origin = world_from_camera.translation;
    *direction = alb_rotate(&world_from_camera, d);
    return true;
}

static bool on_plane(alb_vector *hit, const alb_camera *camera, double z, double u, double v)
{
    alb_vector o, d;
    if (!alb_camera_ray(&o, &d, camera, u, v))
        return false;
    const double t = (z - o.z) / d.z;
    if (!(t > 0 && isfinite(t)))
        return false;
    *hit = alb_add(o, alb_times(t, d));
    return true;
}

bool alb_camera_on_plane(double *x_mm, double *y_mm, double *area_mm2, const alb_camera *camera, double z_mm, double u,
                         double v)
{
    alb_vector p, a[2], b[2];
    if (!on_plane(&p, camera, z_mm, u, v))
        return false;
    *x_mm = p.x, *y_mm = p.y;
    if (!area_mm2)
        return true;
    for (int i = 0; i < 2; i++) // central differences over the pixel: the area of the quadrilateral to second order
        if (!on_plane(&a[i], camera, z_mm, u - 0.5 + i, v) || !on_plane(&b[i], camera, z_mm, u, v - 0.5 + i))
            return false;
    *area_mm2 = fabs((a[1].x - a[0].x) * (b[1].y - b[0].y) - (a[1].y - a[0].y) * (b[1].x - b[0].x));
    return true;
}

alb_camera alb_camera_look_at(alb_vector position, alb_vector target, alb_vector up, double vertical_field_deg,
                              int width, int height)
{
    const alb_vector z = alb_unit(alb_sub(target, position));
    alb_vector x = alb_cross(z, up);
    if (!(alb_length(x) > 1e-9 * alb_length(up))) // up along the line of sight: any other will do
        x = alb_cross(z, fabs(z.y) < 0.9 ? (alb_vector){0, 1, 0} : (alb_vector){1, 0, 0});
    x = alb_unit(x);
    const alb_vector y = alb_cross(z, x);
    const double f = 0.5 * height / tan(vertical_field_deg * M_PI / 360);
    alb_camera camera = {
        .lens = {.width = width, .height = height, .fx = f, .fy = f, .cx = 0.5 * (width - 1), .cy = 0.5 * (height - 1)},
        .camera_from_world = {.rotation = {{x.x, x.y, x.z}, {y.x, y.y, y.z}, {z.x, z.y, z.z}}}};
    camera.camera_from_world.translation = alb_times(-1, alb_rotate(&camera.camera_from_world, position));
    return camera;
}
