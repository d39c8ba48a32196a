// The centre of a spot, in two steps.
//
// Start: the brightest 5 x 5 pixels (by the lesser of mean and median: a glint is small; by the mean where that finds
// none) that stand 8 sd above the median of the image, then the centroid of a window about them; unmeasured pixels
// count as the brightest there, for they are the saturated core. Refined: Gauss-Newton on the image itself against its
// own mean profile m(r), a quadratic in every ring (ring.h). A shift d of the centre changes a pixel at direction u by
// -m'(r) d.u, so that d solves the normal equations of v - m(r) ~ -m'(r) d.u with weights 1 / variance of the ring, the
// one seen where it is larger (few square pixels on a steep profile are no ring): rings are made as alike all around as
// they can be, without any form of profile, and pixels that were not measured do not pull. Rings count out to where a
// fiftieth of the light is left, and once the steps are small a thousandth: noise falls with the light, so the dim
// rings hold a third of what there is to know, but alone they lead astray. Glints are looked for about the start and
// again about the centre found with them left out. The covariance is that of the normal equations, times chi-square /
// freedom where that is above 1. Stops being true for profiles that are not round: oblique beams (anisotropy.c says
// so), edges of the sample near the spot.
#include "fit/centre.h"
#include "base/memory.h"
#include "base/statistics.h"
#include "fit/glint.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SMOOTH = 2, WINDOW = 10, ITERATIONS = 60, DRIFT = 50, SAMPLES_MAX = 100000 };

typedef struct level {
    double median, sd; // of the image; sd of one pixel in its dim parts
    size_t valid;
} level;

static bool level_of(level *out, const alb_channel *channel, alb_error *error)
{
    const size_t count = (size_t)channel->face->width * (size_t)channel->face->height;
    const size_t step = count / SAMPLES_MAX + 1;
    double *values = alb_allocate(count / step + 1, sizeof(double), error);
    double *steps = alb_allocate(count / step + 1, sizeof(double), error);
    const bool ok = values && steps;
    size_t value_count = 0, step_count = 0;
    for (size_t i = 0; ok && i + 1 < count; i += step) {
        const double value = channel->value[i], next = channel->value[i + 1];
        if (isfinite(value))
            values[value_count++] = value;
        if (isfinite(value) && isfinite(next))
            steps[step_count++] = fabs(next - value);
    }
    if (ok)
        *out = (level){.median = alb_median(values, value_count),
                       .sd = 1.4826 / M_SQRT2 * (step_count ? alb_median(steps, step_count) : 0),
                       .valid = value_count};
    free(values);
    free(steps);
    return ok;
}

// Mean of the valid pixels about (x, y), or their median where that is less and `least` (what interests) is passed; and
// the variance of the mean. NaN where fewer than half are valid.
static double smoothed(double *variance, const alb_channel *channel, int x, int y, bool by_median, double least)
{
    double values[(2 * SMOOTH + 1) * (2 * SMOOTH + 1)];
    const int width = channel->face->width, height = channel->face->height;
    double sum = 0, variances = 0;
    int count = 0;
    for (int v = y - SMOOTH; v <= y + SMOOTH; v++)
        for (int u = x - SMOOTH; u <= x + SMOOTH; u++) {
            if (u < 0 || v < 0 || u >= width || v >= height)
                continue;
            const size_t i = (size_t)v * (size_t)width + (size_t)u;
            if (!isfinite(channel->value[i]) || !isfinite(channel->face->x_mm[i]))
                continue;
            sum += values[count] = channel->value[i];
            variances += channel->variance && isfinite(channel->variance[i]) ? channel->variance[i] : 0;
            count++;
        }
    *variance = count ? variances / count / count : 0;
    if (2 * count <= (2 * SMOOTH + 1) * (2 * SMOOTH + 1))
        return NAN;
    return by_median && sum / count > least ? fmin(sum / count, alb_median(values, (size_t)count)) : sum / count;
}

typedef struct peak {
    double value, variance;
    int x, y;
} peak;

static bool brightest(peak *out, const alb_channel *channel, bool by_median, alb_error *error)
{
    const int height = channel->face->height;
    peak *rows = alb_allocate((size_t)height, sizeof *rows, error);
    if (!rows)
        return false;
#pragma omp parallel for schedule(static)
    for (int y = 0; y < height; y++) {
        rows[y].value = -INFINITY;
        for (int x = 0; x < channel->face->width; x++) {
            double variance;
            const double value = smoothed(&variance, channel, x, y, by_median, rows[y].value);
            if (value > rows[y].value)
                rows[y] = (peak){value, variance, x, y};
        }
    }
    *out = rows[0];
    for (int y = 1; y < height; y++)
        if (rows[y].value > out->value)
            *out = rows[y];
    free(rows);
    return true;
}

// Centroid of a window of WINDOW pixels about (x, y) in pixels, above the level; unmeasured pixels count as the peak.
static void move_to_centroid(double *x, double *y, const alb_channel *channel, double background, double top)
{
    const int width = channel->face->width, height = channel->face->height;
    for (int iteration = 0; iteration < 20; iteration++) {
        double sum = 0, sum_x = 0, sum_y = 0;
        for (int v = (int)*y - WINDOW; v <= (int)*y + WINDOW; v++)
            for (int u = (int)*x - WINDOW; u <= (int)*x + WINDOW; u++) {
                if (u < 0 || v < 0 || u >= width || v >= height || hypot(u - *x, v - *y) > WINDOW)
                    continue;
                const double value = channel->value[(size_t)v * (size_t)width + (size_t)u];
                const double weight = fmax((isfinite(value) ? value : top) - background, 0);
                sum += weight;
                sum_x += weight * u;
                sum_y += weight * v;
            }
        if (!(sum > 0))
            return;
        const double moved = hypot(sum_x / sum - *x, sum_y / sum - *y);
        *x = sum_x / sum;
        *y = sum_y / sum;
        if (moved < 0.01)
            return;
    }
}

// The mean profile about a centre: the trends of its rings.
typedef struct mean_profile {
    alb_rings sorted;
    alb_trend trends[ALB_RINGS_MAX];
    int used; // rings out to where less than a share of the highest is left
} mean_profile;

static bool profile_about(mean_profile *out, const alb_channel *channel, const bool *glint, const alb_centre *centre,
                          double background, double least_share, alb_error *error)
{
    alb_rings *rings = &out->sorted;
    double top = 0;
    bool inside = false;
    if (!alb_rings_sort(rings, channel, glint, centre->x_mm, centre->y_mm, centre->pitch_mm, error))
        return false;
    for (int k = 0; k < ALB_RINGS_MAX; k++) {
        const size_t begin = rings->begin[k], count = rings->begin[k + 1] - begin;
        if (count)
            out->trends[k] = alb_trend_fit(rings->pixels + begin, NULL, count, alb_ring_edge(k, rings->pitch_mm),
                                           alb_ring_edge(k + 1, rings->pitch_mm));
        if (count)
            top = fmax(top, out->trends[k].mean - background);
    }
    for (out->used = 0; out->used < ALB_RINGS_MAX; out->used++) {
        const int k = out->used;
        const bool filled = rings->begin[k + 1] > rings->begin[k],
                   high = filled && out->trends[k].mean - background > least_share * top;
        if (inside && filled && !high && k >= 5)
            break;
        inside |= high;
    }
    return true;
}

// Sums of one ring towards the normal equations.
typedef struct equations {
    double xx, xy, yy, hx, hy, squares, freedom;
} equations;

static equations of_ring(const alb_ring_pixel *pixels, size_t count, const alb_trend *trend, bool with_variance,
                         bool with_seen)
{
    equations sum = {.freedom = (double)count - 3};
    double variance = 0, squares = 0;
    for (size_t i = 0; i < count; i++) {
        const double r = pixels[i].r_mm, t = (r - trend->middle_mm) / trend->width_mm - trend->shift;
        const double slope = (trend->linear + trend->bend * (2 * t - trend->skew)) / trend->width_mm;
        const double residual = pixels[i].value - alb_trend_at(trend, r), cosine = r > 0 ? pixels[i].x_mm / r : 0,
                     sine = r > 0 ? pixels[i].y_mm / r : 0;
        const double gx = -slope * cosine, gy = -slope * sine;
        sum.xx += gx * gx, sum.xy += gx * gy, sum.yy += gy * gy;
        sum.hx += gx * residual, sum.hy += gy * residual;
        squares += residual * residual;
        variance += pixels[i].variance / (double)count;
    }
    const double seen = sum.freedom > 0 ? squares / sum.freedom : 0;
    if (with_seen) // the pixels' lattice bends steep rings
        variance = with_variance ? fmax(variance, seen) : seen;
    const double weight = 1 / (variance + 1e-12 * (trend->mean * trend->mean + trend->linear * trend->linear));
    if (!(sum.freedom > 0 && isfinite(weight)))
        return (equations){0};
    return (equations){weight * sum.xx, weight * sum.xy,  weight * sum.yy, weight * sum.hx,
                       weight * sum.hy, weight * squares, sum.freedom};
}

// One Gauss-Newton step and its covariance; false where the equations do not determine it.
static bool shift_of(double shift_mm[2], double covariance_mm2[3], const mean_profile *profile, bool with_variance,
                     bool with_seen)
{
    equations sum = {.freedom = -2};
    for (int k = 0; k < profile->used; k++) {
        const size_t begin = profile->sorted.begin[k], count = profile->sorted.begin[k + 1] - begin;
        if (!count)
            continue;
        const equations one =
            of_ring(profile->sorted.pixels + begin, count, &profile->trends[k], with_variance, with_seen);
        sum.xx += one.xx, sum.xy += one.xy, sum.yy += one.yy, sum.hx += one.hx, sum.hy += one.hy;
        sum.squares += one.squares, sum.freedom += one.freedom;
    }
    const double determinant = sum.xx * sum.yy - sum.xy * sum.xy,
                 scale = sum.freedom > 0 ? fmax(1, sum.squares / sum.freedom) : 1;
    if (!(determinant > 1e-9 * sum.xx * sum.yy))
        return false;
    shift_mm[0] = (sum.yy * sum.hx - sum.xy * sum.hy) / determinant;
    shift_mm[1] = (sum.xx * sum.hy - sum.xy * sum.hx) / determinant;
    covariance_mm2[0] = scale * sum.yy / determinant;
    covariance_mm2[1] = -scale * sum.xy / determinant;
    covariance_mm2[2] = scale * sum.xx / determinant;
    return true;
}

// First by the bright rings; then by the dim ones too, unless they lead more than a pixel away.
static bool refine(alb_centre *centre, const alb_channel *channel, const bool *glint, double background,
                   alb_error *error)
{
    const double bright = 0.02, dim = 0.001, pitch = centre->pitch_mm;
    enum { BRIGHT, DIM, BRIGHT_AGAIN } stage = BRIGHT;
    alb_centre by_bright = *centre;
    mean_profile *profile = alb_allocate(1, sizeof *profile, error);
    bool ok = profile != NULL;
    for (int iteration = 0; ok && iteration < ITERATIONS; iteration++) {
        const bool seen = stage == DIM || !channel->variance;
        double shift[2], length = 0;
        ok = profile_about(profile, channel, glint, centre, background, stage == DIM ? dim : bright, error);
        if (ok && shift_of(shift, centre->covariance_mm2, profile, channel->variance != NULL, seen)) {
            length = hypot(shift[0], shift[1]);
            centre->x_mm += fmin(3 * pitch / length, 1) * shift[0];
            centre->y_mm += fmin(3 * pitch / length, 1) * shift[1];
        }
        alb_rings_free(&profile->sorted);
        if (stage == DIM && hypot(centre->x_mm - by_bright.x_mm, centre->y_mm - by_bright.y_mm) > pitch) {
            *centre = by_bright;
            stage = BRIGHT_AGAIN;
        } else if (length == 0 || (stage != BRIGHT && !(length > 1e-4 * pitch))) {
            break;
        } else if (stage == BRIGHT && length < 0.02 * pitch) {
            by_bright = *centre;
            stage = DIM;
        }
    }
    free(profile);
    return ok;
}

// From the start to the centre, glints left out.
static bool refine_without_glints(alb_centre *centre, bool *glint, bool leave_out, const alb_channel *channel,
                                  double background, alb_error *error)
{
    memset(glint, 0, (size_t)channel->face->width * (size_t)channel->face->height * sizeof *glint);
    for (int pass = 0; pass < 2; pass++) {
        if (leave_out && !alb_glints_find(glint, channel, centre->x_mm, centre->y_mm, centre->pitch_mm, error))
            return false;
        const double x_mm = centre->x_mm, y_mm = centre->y_mm;
        if (!refine(centre, channel, glint, background, error))
            return false;
        if (!leave_out || hypot(centre->x_mm - x_mm, centre->y_mm - y_mm) < 0.02 * centre->pitch_mm)
            break;
    }
    return true;
}

// Whether the centre lies within DRIFT pixels of (x, y) and off the border of the image.
static bool within_sight(const alb_face *face, const alb_centre *centre, int x, int y)
{
    double nearest = INFINITY;
    int nearest_x = x, nearest_y = y;
    for (int v = y > DRIFT ? y - DRIFT : 0; v <= y + DRIFT && v < face->height; v++)
        for (int u = x > DRIFT ? x - DRIFT : 0; u <= x + DRIFT && u < face->width; u++) {
            const size_t i = (size_t)v * (size_t)face->width + (size_t)u;
            const double distance = hypot(face->x_mm[i] - centre->x_mm, face->y_mm[i] - centre->y_mm);
            if (distance < nearest)
                nearest = distance, nearest_x = u, nearest_y = v;
        }
    return nearest < 2 * centre->pitch_mm && nearest_x >= 2 && nearest_y >= 2 && nearest_x <= face->width - 3 &&
           nearest_y <= face->height - 3;
}

bool alb_centre_find(alb_centre *centre, bool *glint, bool leave_out_glints, const alb_channel *channel,
                     alb_error *error)
{
    const alb_face *face = channel->face;
    level image;
    peak top;
    if (face->width < 8 || face->height < 8)
        return alb_fail(error, ALB_BAD_DATA, "%s: %d x %d pixels are too few for a spot; 8 x 8 at least", channel->name,
                        face->width, face->height);
    if (!level_of(&image, channel, error) || !brightest(&top, channel, true, error))
        return false;
    if (image.valid == 0)
        return alb_fail(error, ALB_BAD_DATA, "%s: no spot: no pixel holds a finite value", channel->name);
    const double box = (2 * SMOOTH + 1) * (2 * SMOOTH + 1), least_sd = image.sd / sqrt(box);
    double sd = fmax(sqrt(top.variance), least_sd);
    if (!(top.value - image.median > 8 * sd)) {
        if (!brightest(&top, channel, false, error))
            return false;
        sd = fmax(sqrt(top.variance), least_sd);
    }
    if (!(top.value - image.median > 8 * sd) || !(top.value > 0))
        return alb_fail(error, ALB_BAD_DATA,
                        "%s: no spot: the brightest place (%g) is not 8 sd (%g each) above the median (%g)",
                        channel->name, top.value, sd, image.median);
    double u = top.x, v = top.y;
    move_to_centroid(&u, &v, channel, image.median, top.value);
    const int x = (int)lround(u), y = (int)lround(v);
    if (x < 2 || y < 2 || x > face->width - 3 || y > face->height - 3)
        return alb_fail(error, ALB_BAD_DATA,
                        "%s: no spot: the brightest place, pixel (%d, %d), lies on the border of the image",
                        channel->name, x, y);
    const size_t i = (size_t)y * (size_t)face->width + (size_t)x;
    if (!isfinite(face->x_mm[i]))
        return alb_fail(error, ALB_BAD_DATA, "%s: the spot, pixel (%d, %d), does not lie on the face", channel->name, x,
                        y);
    *centre = (alb_centre){face->x_mm[i], face->y_mm[i], sqrt(face->area_mm2[i]), {0}};
    if (!refine_without_glints(centre, glint, leave_out_glints, channel, image.median, error))
        return false;
    if (!within_sight(face, centre, x, y))
        return alb_fail(error, ALB_BAD_DATA, "%s: no spot: it is not alike all around pixel (%d, %d)", channel->name, x,
                        y);
    return true;
}
