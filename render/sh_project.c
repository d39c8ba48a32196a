// Projection of functions and pictures. Functions: Gauss nodes in cos theta times equal steps in phi, exact for
// polynomials up to the degree of function and basis together. Pictures: the integral of Y over each pixel, for
// latitude and longitude in closed form in phi and by Gauss nodes in theta, for the texels of a cube by Gauss nodes in
// both with the weight (1 + s^2 + t^2)^(-3/2), so many that what is left is rounding.
#include "render/sh_project.h"
#include "base/memory.h"
#include "base/quadrature.h"
#include "render/sh_rotate.h"
#include <stdlib.h>
#include <string.h>

enum { GAUSS_MAX = 64, COUNT_MAX = ALB_SH_ROTATE_MAX * ALB_SH_ROTATE_MAX };

bool alb_sh_project(double *out, int order, int degree, alb_sh_function *function, const void *context,
                    alb_error *error)
{
    if (degree < 0 || degree > ALB_SH_DEGREE_MAX - (order - 1))
        return alb_fail(error, ALB_BAD_DATA, "projection of degree %d to order %d: at most degree %d can be had",
                        degree, order, ALB_SH_DEGREE_MAX - (order - 1));
    const int rings = (degree + order - 1) / 2 + 1, steps = degree + order;
    double nodes[GAUSS_MAX], weights[GAUSS_MAX], basis[COUNT_MAX], sums[COUNT_MAX] = {0};
    alb_quadrature_gauss(nodes, weights, rings, -1, 1);
    for (int i = 0; i < rings * steps; i++) {
        const double z = nodes[i / steps], s = sqrt(1 - z * z), phi = 2 * M_PI * (i % steps) / steps;
        const alb_vector d = {s * cos(phi), s * sin(phi), z};
        const double value = weights[i / steps] * 2 * M_PI / steps * function(context, d);
        alb_sh_evaluate(basis, order, d);
        for (int k = 0; k < order * order; k++)
            sums[k] += value * basis[k];
    }
    memcpy(out, sums, (size_t)(order * order) * sizeof *out);
    return true;
}

static bool check_picture(const alb_image *image, int channel, const char *what, alb_error *error)
{
    if (image->width < 1 || image->height < 1 || channel < 0 || channel >= image->channels)
        return alb_fail(error, ALB_BAD_DATA, "%s of %d x %d pixels has no channel %d", what, image->width,
                        image->height, channel);
    for (int y = 0; y < image->height; y++)
        for (int x = 0; x < image->width; x++)
            if (!isfinite(alb_image_at(image, x, y)[channel]))
                return alb_fail(error, ALB_BAD_DATA, "%s: pixel (%d, %d) is not finite", what, x, y);
    return true;
}

// The picture's frame: z up (+y), x in the middle of the picture (-z), phi towards its left.
static const double world_from_map[3][3] = {{0, -1, 0}, {0, 0, 1}, {-1, 0, 0}};

// Integrals over phi of a row times cos m phi at [m], sin m phi at [order + m].
static void sum_row(double *sums, int order, const alb_image *map, int channel, int y, const double (*turns)[2])
{
    const int width = map->width;
    for (int m = 0; m < order; m++) {
        double cosine = 0, sine = 0;
        for (int x = 0; x < width; x++) {
            const double value = (double)alb_image_at(map, x, y)[channel];
            const double *turn = turns[(size_t)m * (size_t)(2 * x + 1) % (size_t)(2 * width)];
            cosine += value * turn[0];
            sine -= value * turn[1];
        }
        // the middle of pixel x is at pi - 2 pi (x + 1/2) / width
        const double half = M_PI / width, share = m ? 2 / (double)m * sin(m * half) : 2 * half;
        sums[m] = (m & 1 ? -1 : 1) * share * cosine;
        sums[order + m] = (m & 1 ? -1 : 1) * share * sine;
    }
}

bool alb_sh_project_map(double *out, int order, const alb_image *map, int channel, alb_error *error)
{
    if (!check_picture(map, channel, "latitude-longitude map", error))
        return false;
    double(*turns)[2] = alb_allocate(2 * (size_t)map->width, sizeof *turns, error);
    if (!turns)
        return false;
    for (int k = 0; k < 2 * map->width; k++)
        turns[k][0] = cos(M_PI * k / map->width), turns[k][1] = sin(M_PI * k / map->width);
    double nodes[GAUSS_MAX], weights[GAUSS_MAX], legendre[COUNT_MAX], sums[2 * ALB_SH_ROTATE_MAX], c[COUNT_MAX] = {0};
    const int count = 8 + (2 * order + map->height - 1) / map->height;
    alb_quadrature_gauss(nodes, weights, count, 0, 1);
    for (int y = 0; y < map->height; y++) {
        sum_row(sums, order, map, channel, y, (const double(*)[2])turns);
        for (int i = 0; i < count; i++) {
            const double theta = M_PI * (y + nodes[i]) / map->height;
            const double weight = weights[i] * M_PI / map->height * sin(theta);
            alb_sh_legendre(legendre, order, cos(theta), sin(theta));
            for (int l = 0; l < order; l++)
                for (int m = -l; m <= l; m++)
                    c[alb_sh_index(l, m)] +=
                        weight * (m ? M_SQRT2 : 1) * legendre[l * (l + 1) / 2 + abs(m)] * sums[m < 0 ? order - m : m];
        }
    }
    free(turns);
    alb_sh_rotate(out, c, order, world_from_map);
    return true;
}

// The direction of (s, t), both -1 to 1, s to the right and t down on the face.
static alb_vector on_cube(int face, double s, double t)
{
    const alb_vector directions[6] = {{1, -t, -s}, {-1, -t, s}, {s, 1, t}, {s, -1, -t}, {s, -t, 1}, {-s, -t, -1}};
    return directions[face];
}

static void add_texel(double *c, int order, int face, const double corner[2], int count, const double *nodes,
                      const double *weights, double value)
{
    double basis[COUNT_MAX];
    for (int i = 0; i < count * count; i++) {
        const alb_vector d = on_cube(face, corner[0] + nodes[i % count], corner[1] + nodes[i / count]);
        const double length = alb_length(d);
        alb_sh_evaluate(basis, order, alb_times(1 / length, d));
        for (int k = 0; k < order * order; k++)
            c[k] += value * weights[i % count] * weights[i / count] / (length * length * length) * basis[k];
    }
}

bool alb_sh_project_cube(double *out, int order, const alb_image faces[6], int channel, alb_error *error)
{
    const int side = faces[0].width;
    for (int f = 0; f < 6; f++) {
        if (!check_picture(&faces[f], channel, "cube map", error))
            return false;
        if (faces[f].width != side || faces[f].height != side)
            return alb_fail(error, ALB_BAD_DATA, "cube map: face %d has %d x %d pixels, not %d x %d", f, faces[f].width,
                            faces[f].height, side, side);
    }
    // Gauss nodes leave rho^(-2 count), rho of the ellipse through the nearest poles, i times `side` half texels away
    const double rho = side + sqrt((double)side * side + 1);
    const int count = (int)ceil((16 + 0.3 * order) / (2 * log10(rho))) + order / 4;
    double nodes[GAUSS_MAX], weights[GAUSS_MAX], c[COUNT_MAX] = {0};
    alb_quadrature_gauss(nodes, weights, count, 0, 2.0 / side);
    for (int f = 0; f < 6; f++)
        for (int y = 0; y < side; y++)
            for (int x = 0; x < side; x++) {
                const double corner[2] = {2.0 * x / side - 1, 2.0 * y / side - 1};
                add_texel(c, order, f, corner, count, nodes, weights, (double)alb_image_at(&faces[f], x, y)[channel]);
            }
    memcpy(out, c, (size_t)(order * order) * sizeof *out);
    return true;
}
