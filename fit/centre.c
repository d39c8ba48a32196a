// The centre of a spot, in two steps.
//
// Start: the brightest 5 x 5 pixels (by the lesser of mean and median: a glint is small; by the mean where that finds
// none) that stand 8 sd above the median of the image, then the centroid of a window about them; unmeasured pixels
// count as the brightest there, for they are the saturated core. Refined: Gauss-Newton on the image itself against its
// own mean profile m(r) in rings of one pixel. A shift d of the centre changes a pixel at direction u by -m'(r) d.u, so
// that d solves the normal equations of v - m(r) ~ -m'(r) d.u with weights 1 / variance of the ring: rings are made as
// alike all around as they can be, without any form of profile, and pixels that were not measured do not pull. Glints
// are looked for about the start and again about the centre found with them left out. The covariance is that of the
// normal equations, times chi-square / freedom where that is above 1. Stops being true for profiles that are not round:
// oblique beams (anisotropy.c says so), edges of the sample near the spot.
#include "fit/centre.h"
#include "base/memory.h"
#include "base/statistics.h"
#include "fit/glint.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SMOOTH = 2, WINDOW = 10, BINS = 2048, ITERATIONS = 40, SAMPLES_MAX = 100000 };

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

typedef struct bin {
    double count, sum, variance; // variance: summed over the pixels
} bin;

// Mean profile in rings one pixel wide about (x, y); returns how many of them stand above a fiftieth of the highest.
static int profile_about(bin bins[BINS], const alb_channel *channel, const bool *glint, double x_mm, double y_mm,
                         double pitch_mm, double background)
{
    const size_t count = (size_t)channel->face->width * (size_t)channel->face->height;
    for (int k = 0; k < BINS; k++)
        bins[k] = (bin){0};
    for (size_t i = 0; i < count; i++) {
        const double r = hypot(channel->face->x_mm[i] - x_mm, channel->face->y_mm[i] - y_mm) / pitch_mm;
        const double value = channel->value[i];
        if (!(r < BINS) || !isfinite(value) || glint[i])
            continue;
        bin *b = &bins[(int)r];
        b->count++;
        b->sum += value;
        b->variance += channel->variance && isfinite(channel->variance[i]) ? channel->variance[i] : 0;
    }
    double top = background;
    for (int k = 0; k < BINS; k++)
        if (bins[k].count > 0)
            top = fmax(top, bins[k].sum / bins[k].count);
    int used = 0;
    bool inside = false;
    for (int k = 0; k < BINS; k++, used = k) {
        const bool high = bins[k].count > 0 && bins[k].sum / bins[k].count - background > 0.02 * (top - background);
        if (inside && bins[k].count > 0 && !high && k >= 5)
            break;
        inside |= high;
    }
    return used < BINS - 1 ? used : BINS - 2;
}

// A pixel against the mean profile, which is taken as straight between the middles of the rings.
typedef struct comparison {
    int bin;
    double residual, slope_per_mm, cosine, sine;
} comparison;

static bool compare(comparison *out, const bin *bins, int used, const alb_channel *channel, const bool *glint, size_t i,
                    double x_mm, double y_mm, double pitch_mm)
{
    const double x = channel->face->x_mm[i] - x_mm, y = channel->face->y_mm[i] - y_mm, r = hypot(x, y);
    const double value = channel->value[i], t = fmax(r / pitch_mm - 0.5, 0);
    if (!(r < used * pitch_mm) || !isfinite(value) || r == 0 || glint[i])
        return false;
    const int k = (int)t;
    if (!(bins[k].count > 0 && bins[k + 1].count > 0))
        return false;
    const double low = bins[k].sum / bins[k].count, step = bins[k + 1].sum / bins[k + 1].count - low;
    *out = (comparison){k, value - (low + (t - k) * step), step / pitch_mm, x / r, y / r};
    return true;
}

// Where the pixels have no variances: the scatter about the profile.
static void scatter_about(bin bins[BINS], int used, const alb_channel *channel, const bool *glint, double x_mm,
                          double y_mm, double pitch_mm)
{
    const size_t count = (size_t)channel->face->width * (size_t)channel->face->height;
    for (size_t i = 0; i < count; i++) {
        comparison c;
        if (compare(&c, bins, used, channel, glint, i, x_mm, y_mm, pitch_mm))
            bins[c.bin].variance += c.residual * c.residual;
    }
}

// One Gauss-Newton step and its covariance; false where the equations do not determine it.
static bool shift_of(double shift_mm[2], double covariance_mm2[3], const bin *bins, int used,
                     const alb_channel *channel, const bool *glint, double x_mm, double y_mm, double pitch_mm)
{
    const size_t count = (size_t)channel->face->width * (size_t)channel->face->height;
    double xx = 0, xy = 0, yy = 0, hx = 0, hy = 0, squares = 0, freedom = -used - 2;
    for (size_t i = 0; i < count; i++) {
        comparison c;
        if (!compare(&c, bins, used, channel, glint, i, x_mm, y_mm, pitch_mm))
            continue;
        const bin *b = &bins[c.bin];
        const double low = b->sum / b->count, step = c.slope_per_mm * pitch_mm;
        const double weight = 1 / (b->variance / b->count + 1e-12 * (low * low + step * step));
        if (!(isfinite(weight) && weight > 0))
            continue;
        const double gx = -c.slope_per_mm * c.cosine, gy = -c.slope_per_mm * c.sine;
        xx += weight * gx * gx, xy += weight * gx * gy, yy += weight * gy * gy;
        hx += weight * gx * c.residual, hy += weight * gy * c.residual;
        squares += weight * c.residual * c.residual;
        freedom++;
    }
    const double determinant = xx * yy - xy * xy, scale = freedom > 0 ? fmax(1, squares / freedom) : 1;
    if (!(determinant > 1e-9 * xx * yy))
        return false;
    shift_mm[0] = (yy * hx - xy * hy) / determinant;
    shift_mm[1] = (xx * hy - xy * hx) / determinant;
    covariance_mm2[0] = scale * yy / determinant;
    covariance_mm2[1] = -scale * xy / determinant;
    covariance_mm2[2] = scale * xx / determinant;
    return true;
}

static bool refine(alb_centre *centre, const alb_channel *channel, const bool *glint, double background,
                   alb_error *error)
{
    bin *bins = alb_allocate(BINS, sizeof *bins, error);
    if (!bins)
        return false;
    const double pitch = centre->pitch_mm;
    for (int iteration = 0; iteration < ITERATIONS; iteration++) {
        const int used = profile_about(bins, channel, glint, centre->x_mm, centre->y_mm, pitch, background);
        double shift[2];
        if (!channel->variance)
            scatter_about(bins, used, channel, glint, centre->x_mm, centre->y_mm, pitch);
        if (!shift_of(shift, centre->covariance_mm2, bins, used, channel, glint, centre->x_mm, centre->y_mm, pitch))
            break;
        const double length = hypot(shift[0], shift[1]), most = 3 * pitch, share = length > most ? most / length : 1;
        centre->x_mm += share * shift[0];
        centre->y_mm += share * shift[1];
        if (length < 1e-4 * pitch)
            break;
    }
    free(bins);
    return true;
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
    const double moved = hypot(centre->x_mm - face->x_mm[i], centre->y_mm - face->y_mm[i]);
    if (!(moved < 50 * centre->pitch_mm))
        return alb_fail(error, ALB_BAD_DATA, "%s: no spot: it is not alike all around pixel (%d, %d)", channel->name, x,
                        y);
    return true;
}
