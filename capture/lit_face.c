// Irradiance: E = E0 sum over pixels of Phi_x Phi_y, Phi = (erf((x - x0 + p/2) / (s sqrt 2)) - erf((x - x0 - p/2) / (s
// sqrt 2))) / 2. White reference: L = rho E / pi. Slab: M = E0 sum over points q of k(|x - q|) dA + unscattered E, L =
// f M / pi, where f is the kernel's lobe (lobe.h) and k is the kernel already blurred by s, so that a pixel is an even
// square; points at most 0.8 s apart sum it to e^(-2 pi^2 / 0.64) of itself (Poisson's summation formula).
//
// The unscattered light, a beam, is given the directions of the scattered (of demo slabs it is below 1e-4), and the
// slab is taken as wider than the view. Not true near the slab's edges, or where the pattern's grid of discs stands off
// the middle.
#include "capture/lit_face.h"
#include "base/memory.h"
#include <math.h>
#include <stdlib.h>

enum { POINTS_MOST = 20000 };

// Lists a disc's pixels and the points inside them.
static bool fill_disc(alb_lit_face *face, const alb_pattern *pattern, alb_error *error)
{
    const int across = (int)ceil(pattern->diameter_px), n = (int)ceil(face->pixel_mm / (0.8 * face->blur_sd_mm));
    const double p = face->pixel_mm;
    long pixels = 0;
    for (int i = 0; i < across * across; i++)
        pixels += alb_disc_lights(pattern->diameter_px, i % across, i / across);
    if (!pixels)
        return alb_fail(error, ALB_BAD_DATA,
                        "a disc of diameter_px %g holds the centre of no pixel; 1, or 1.42 and more",
                        pattern->diameter_px);
    const long points = pixels * n * n, discs = face->disc_count;
    if (points * discs > POINTS_MOST)
        return alb_fail(error, ALB_BAD_DATA,
                        "a pattern of %ld lit pixels, %d points each, is more than the %d points that "
                        "the virtual rig sums; use fewer or smaller discs",
                        pixels * discs, n * n, POINTS_MOST);
    face->pixel = alb_allocate((size_t)pixels, sizeof *face->pixel, error);
    face->point = alb_allocate((size_t)points, sizeof *face->point, error);
    if (!face->pixel || !face->point)
        return false;
    for (int i = 0; i < across * across; i++) {
        if (!alb_disc_lights(pattern->diameter_px, i % across, i / across))
            continue;
        const double x = (i % across - 0.5 * (across - 1)) * p, y = ((double)(i / across) - 0.5 * (across - 1)) * p;
        face->pixel[face->pixel_count][0] = x;
        face->pixel[face->pixel_count++][1] = y;
        face->disc_radius_mm = fmax(face->disc_radius_mm, hypot(x, y) + p);
        for (int j = 0; j < n * n; j++) {
            face->point[face->point_count][0] = x + ((j % n + 0.5) / n - 0.5) * p;
            face->point[face->point_count++][1] = y + ((j / n + 0.5) / n - 0.5) * p; // NOLINT: whole rows
        }
    }
    face->point_mm2 = p * p / (n * n);
    return true;
}

bool alb_lit_face_create(alb_lit_face *face, const alb_truth *truth, const alb_pattern *pattern,
                         const alb_kernel *kernels, const double white_reflectance[3], alb_error *error)
{
    *face = (alb_lit_face){.kind = pattern->kind,
                           .kernels = kernels,
                           .pixel_mm = truth->projector.pixel_mm,
                           .blur_sd_mm = truth->projector.blur_sd_mm};
    for (int c = 0; c < 3; c++) {
        face->reflectance[c] = white_reflectance[c];
        face->irradiance[c] = truth->projector.irradiance_w_per_mm2[c];
    }
    if (pattern->kind != ALB_PATTERN_SPOT && pattern->kind != ALB_PATTERN_GRID)
        return true;
    const bool grid = pattern->kind == ALB_PATTERN_GRID;
    const int columns = grid ? pattern->columns : 1, rows = grid ? pattern->rows : 1;
    face->disc_count = columns * rows;
    face->disc = alb_allocate((size_t)face->disc_count, sizeof *face->disc, error);
    if (!face->disc || !fill_disc(face, pattern, error)) {
        alb_lit_face_free(face);
        return false;
    }
    for (int i = 0; i < face->disc_count; i++) {
        face->disc[i][0] = (i % columns - 0.5 * (columns - 1)) * pattern->pitch_px * face->pixel_mm;
        face->disc[i][1] = (i / columns - 0.5 * (rows - 1)) * pattern->pitch_px * face->pixel_mm; // NOLINT: whole rows
    }
    return true;
}

void alb_lit_face_free(alb_lit_face *face)
{
    free(face->disc);
    free(face->pixel);
    free(face->point);
    *face = (alb_lit_face){0};
}

// Light that falls on the point, per irradiance of a white pixel.
static double irradiance_at(const alb_lit_face *face, double x_mm, double y_mm)
{
    if (face->kind == ALB_PATTERN_WHITE)
        return 1;
    const double scale = 1 / (face->blur_sd_mm * sqrt(2)), half = face->pixel_mm / 2;
    const double reach = face->disc_radius_mm + 7 * face->blur_sd_mm;
    double sum = 0;
    for (int i = 0; i < face->disc_count; i++) {
        const double dx = x_mm - face->disc[i][0], dy = y_mm - face->disc[i][1];
        if (dx * dx + dy * dy > reach * reach)
            continue;
        for (int j = 0; j < face->pixel_count; j++) {
            const double x = dx - face->pixel[j][0], y = dy - face->pixel[j][1];
            sum += 0.25 * (erf((x + half) * scale) - erf((x - half) * scale)) *
                   (erf((y + half) * scale) - erf((y - half) * scale));
        }
    }
    return sum;
}

// Exitance per irradiance of a white pixel.
static void exitance(double out[3], const alb_lit_face *face, double x_mm, double y_mm)
{
    double sum[3] = {0, 0, 0};
    for (int i = 0; i < face->disc_count; i++)
        for (int j = 0; j < face->point_count; j++) {
            const double dx = x_mm - face->disc[i][0] - face->point[j][0],
                         dy = y_mm - face->disc[i][1] - face->point[j][1];
            const double r = sqrt(dx * dx + dy * dy);
            for (int c = 0; c < 3; c++)
                sum[c] += alb_kernel_value(&face->kernels[c], r);
        }
    const double e = irradiance_at(face, x_mm, y_mm);
    for (int c = 0; c < 3; c++)
        out[c] = face->kind == ALB_PATTERN_WHITE ? face->kernels[c].total
                                                 : sum[c] * face->point_mm2 + face->kernels[c].unscattered * e;
}

void alb_lit_face_radiance(double out[3], const void *scene, double x_mm, double y_mm, double cosine)
{
    const alb_lit_face *face = scene;
    if (face->kernels) {
        exitance(out, face, x_mm, y_mm);
        for (int c = 0; c < 3; c++)
            out[c] *= alb_lobe_value(&face->kernels[c].lobe, cosine);
    } else {
        const double e = irradiance_at(face, x_mm, y_mm);
        for (int c = 0; c < 3; c++)
            out[c] = face->reflectance[c] * e;
    }
    for (int c = 0; c < 3; c++)
        out[c] *= face->irradiance[c] / M_PI;
}
