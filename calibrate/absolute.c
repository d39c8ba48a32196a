// A Lambertian reference of reflectance rho under irradiance E shows the radiance L = rho E / pi, so that the flux of
// the projected pattern is Phi = integral E dA = pi / rho * integral L dA. dA is the area that a pixel covers on the
// reference. The integral runs over the circle about the lit pixels (above 1/1000 of the peak and 6 sd), widened by
// half, so that noise and an error of the black level are not summed over the whole picture. Stops being true for a
// reference that is itself translucent (the spot spreads) and for glare in the lens.
#include "calibrate/absolute.h"
#include <math.h>

typedef struct disc {
    double u, v, radius; // pixels
    double peak;
} disc;

static bool lit(const alb_image *m, int x, int y, int channels, const double *peak)
{
    const float *p = alb_image_at(m, x, y);
    for (int c = 0; c < channels; c++)
        if ((double)p[c] > 1e-3 * peak[c] && (double)p[c] > 6 * sqrt((double)p[channels + c]))
            return true;
    return false;
}

// A single hot value must not count: a lit pixel needs two lit ones among its four neighbours.
static bool lit_region(disc *region, const alb_image *m, int channels, const char *shot, alb_error *error)
{
    double peak[3] = {0}, su = 0, sv = 0;
    long count = 0, saturated = 0;
    bool at_edge = false;
    for (int y = 0; y < m->height; y++)
        for (int x = 0; x < m->width; x++)
            for (int c = 0; c < channels; c++) {
                const double value = (double)alb_image_at(m, x, y)[c];
                saturated += isnan(value);
                peak[c] = fmax(peak[c], value);
            }
    if (saturated)
        return alb_fail(error, ALB_BAD_DATA, "shot %s: %ld values are saturated at the shortest exposure; shorten it",
                        shot, saturated);
    for (int pass = 0; pass < 2; pass++) { // the middle, then the radius about it
        for (int y = 1; y + 1 < m->height; y++)
            for (int x = 1; x + 1 < m->width; x++) {
                if (!lit(m, x, y, channels, peak) ||
                    lit(m, x - 1, y, channels, peak) + lit(m, x + 1, y, channels, peak) +
                            lit(m, x, y - 1, channels, peak) + lit(m, x, y + 1, channels, peak) <
                        2)
                    continue;
                if (!pass) {
                    su += x, sv += y;
                    count++;
                    at_edge |= x < 3 || y < 3 || x > m->width - 4 || y > m->height - 4;
                } else
                    region->radius = fmax(region->radius, hypot(x - region->u, y - region->v));
            }
        region->u = su / (double)count, region->v = sv / (double)count;
    }
    if (!count)
        return alb_fail(error, ALB_BAD_DATA,
                        "shot %s: no light is to be seen on the white reference; lengthen the exposure", shot);
    if (at_edge)
        return alb_fail(error, ALB_BAD_DATA,
                        "shot %s: the light on the white reference reaches the edge of the picture", shot);
    region->radius = 1.5 * region->radius + 2;
    return true;
}

bool alb_flux_measure(alb_estimate flux[3], const alb_image *merged, const alb_camera *camera,
                      const double reflectance[3], const char *shot, alb_error *error)
{
    const int channels = merged->channels / 2;
    disc region = {0};
    if (!lit_region(&region, merged, channels, shot, error))
        return false;
    double sum[3] = {0}, variance[3] = {0};
    for (int y = 0; y < merged->height; y++)
        for (int x = 0; x < merged->width; x++) {
            double x_mm, y_mm, area;
            if (hypot(x - region.u, y - region.v) > region.radius ||
                !alb_camera_on_plane(&x_mm, &y_mm, &area, camera, 0, x, y))
                continue;
            const float *p = alb_image_at(merged, x, y);
            for (int c = 0; c < channels; c++) {
                sum[c] += (double)p[c] * area;
                variance[c] += (double)p[channels + c] * area * area;
            }
        }
    for (int c = 0; c < channels; c++) {
        const double factor = M_PI / reflectance[c];
        flux[c] = (alb_estimate){factor * sum[c], factor * sqrt(variance[c])};
        if (!(flux[c].value > 10 * flux[c].sd))
            return alb_fail(error, ALB_BAD_DATA, "shot %s: the flux in channel %s is %.3g +- %.3g: lost in noise", shot,
                            merged->name[c], flux[c].value, flux[c].sd);
    }
    return true;
}
