// Readings by distance: rings about the centre, one pixel wide out to 16 pixels, growing by a sixteenth each further
// out.
//
// A ring's value is the plain mean of its valid pixels (weights taken from noisy samples bias: dim pixels get too
// much). Its sd is what the variances of the pixels give, unless the scatter about a quadratic in r within the ring is
// larger than they allow (chi-square tail below 1e-3: texture, dust, a spot that is not round); then it is what the
// scatter gives. Without variances it is the scatter, pooled relative to the value over neighbouring rings until it has
// 30 degrees of freedom. To either, 1e-4 of the value (what the forward operator is good to) and 1e-6 of the highest
// are added in quadrature. Errors common to many rings (scale, black level) are not in it. Rings end where three in a
// row are below their sd (kept: they bind the tail), or where the image does. Negative means stay.
#include "fit/observe.h"
#include "base/memory.h"
#include "base/statistics.h"
#include "fit/centre.h"
#include <math.h>
#include <stdlib.h>

enum { FINE_RINGS = 16, RINGS_MAX = 400, POOL_FREEDOM = 30 };

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

void alb_face_free(alb_face *face)
{
    free(face->x_mm);
    free(face->y_mm);
    free(face->area_mm2);
    free(face->cosine);
    *face = (alb_face){0};
}

bool alb_readings_create(alb_readings *readings, int count, alb_error *error)
{
    *readings = (alb_readings){.count = count};
    const size_t n = (size_t)count;
    if ((readings->r_mm = alb_allocate(n, sizeof(double), error)) &&
        (readings->value = alb_allocate(n, sizeof(double), error)) &&
        (readings->sd = alb_allocate(n, sizeof(double), error)) &&
        (readings->area_mm2 = alb_allocate(n, sizeof(double), error)) &&
        (readings->sample_r_mm = alb_allocate(n, sizeof *readings->sample_r_mm, error)) &&
        (readings->sample_share = alb_allocate(n, sizeof *readings->sample_share, error)) &&
        (readings->sample_value = alb_allocate(n, sizeof *readings->sample_value, error)))
        return true;
    alb_readings_free(readings);
    return false;
}

void alb_readings_free(alb_readings *readings)
{
    free(readings->r_mm);
    free(readings->value);
    free(readings->sd);
    free(readings->area_mm2);
    free(readings->sample_r_mm);
    free(readings->sample_share);
    free(readings->sample_value);
    *readings = (alb_readings){0};
}

static double ring_edge(int k, double pitch_mm)
{
    return pitch_mm * (k <= FINE_RINGS ? k : FINE_RINGS * pow(1 + 1.0 / FINE_RINGS, k - FINE_RINGS));
}

static int ring_of(double r_mm, double pitch_mm)
{
    const double r = r_mm / pitch_mm;
    return r < FINE_RINGS ? (int)r : FINE_RINGS + (int)(log(r / FINE_RINGS) / log1p(1.0 / FINE_RINGS));
}

typedef struct pixel {
    double r_mm, value, variance, area_mm2;
} pixel;

typedef struct ring {
    double r_mm, value, propagated; // propagated: mean variance of its pixels
    double squares;                 // about the local trend
    int freedom;                    // of the squares; 0: too few pixels
    double area_mm2;                // of the valid pixels
    double sample_r_mm[ALB_RING_SAMPLES], sample_share[ALB_RING_SAMPLES], sample_value[ALB_RING_SAMPLES];
    size_t begin, count, missing; // pixels in the sorted list; pixels without a value
} ring;

// Sum of squares about the quadratic in t that fits best, by orthogonalising 1, t, t^2 over the pixels.
static double squares_about_trend(const pixel *pixels, size_t count, double middle_mm, double width_mm, double mean)
{
    double t1 = 0, t2 = 0, t3 = 0, t4 = 0, v1 = 0, v2 = 0, v0 = 0;
    double shift = 0;
    for (size_t i = 0; i < count; i++)
        shift += (pixels[i].r_mm - middle_mm) / width_mm / (double)count;
    for (size_t i = 0; i < count; i++) {
        const double t = (pixels[i].r_mm - middle_mm) / width_mm - shift, v = pixels[i].value - mean;
        t1 += t, t2 += t * t, t3 += t * t * t, t4 += t * t * t * t;
        v0 += v, v1 += v * t, v2 += v * t * t;
    }
    const double n = (double)count, linear = t2 > 0 ? v1 / t2 : 0;
    // q = t^2 - <t^2> - (t3/t2) t is orthogonal to 1 and t
    const double qq = t4 - t2 * t2 / n - (t2 > 0 ? t3 * t3 / t2 : 0),
                 qv = v2 - v0 * t2 / n - (t2 > 0 ? t3 / t2 * v1 : 0);
    const double bend = qq > 1e-9 * t4 ? qv / qq : 0;
    double sum = 0;
    for (size_t i = 0; i < count; i++) {
        const double t = (pixels[i].r_mm - middle_mm) / width_mm - shift;
        const double residual =
            pixels[i].value - mean - linear * t - bend * (t * t - t2 / n - (t2 > 0 ? t3 / t2 * t : 0));
        sum += residual * residual;
    }
    return sum;
}

static void summarise(ring *out, const pixel *pixels, int k, double pitch_mm)
{
    const double low = ring_edge(k, pitch_mm), width = ring_edge(k + 1, pitch_mm) - low;
    double r = 0, value = 0, variance = 0, area = 0;
    double sample_r[ALB_RING_SAMPLES] = {0}, sample_n[ALB_RING_SAMPLES] = {0}, sample_v[ALB_RING_SAMPLES] = {0};
    const double n = (double)out->count;
    for (size_t i = 0; i < out->count; i++) {
        const double share = (pixels[i].r_mm - low) / width;
        const int s = (int)fmin(fmax(share * ALB_RING_SAMPLES, 0), ALB_RING_SAMPLES - 1);
        sample_r[s] += pixels[i].r_mm;
        sample_v[s] += pixels[i].value;
        sample_n[s]++;
        r += pixels[i].r_mm;
        value += pixels[i].value;
        variance += pixels[i].variance;
        area += pixels[i].area_mm2;
    }
    out->r_mm = r / n;
    out->value = value / n;
    out->propagated = variance / n;
    out->area_mm2 = area;
    for (int s = 0; s < ALB_RING_SAMPLES; s++) {
        out->sample_r_mm[s] = sample_n[s] > 0 ? sample_r[s] / sample_n[s] : 0;
        out->sample_value[s] = sample_n[s] > 0 ? sample_v[s] / sample_n[s] : 0;
        out->sample_share[s] = sample_n[s] / n;
    }
    out->freedom = out->count >= 6 ? (int)fmin(n - 3, 1e9) : 0;
    if (out->freedom)
        out->squares = squares_about_trend(pixels, out->count, low + width / 2, width, out->value);
}

// Pixels sorted into rings; *rings has RINGS_MAX of them.
static bool sort_into_rings(ring *rings, pixel **pixels, const alb_channel *channel, double x_mm, double y_mm,
                            double pitch_mm, alb_error *error)
{
    const alb_face *face = channel->face;
    const size_t count = (size_t)face->width * (size_t)face->height;
    int *ring_index = alb_allocate(count, sizeof(int), error);
    *pixels = alb_allocate(count, sizeof **pixels, error);
    if (!ring_index || !*pixels) {
        free(ring_index);
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        const double r = hypot(face->x_mm[i] - x_mm, face->y_mm[i] - y_mm);
        ring_index[i] = -1;
        if (!isfinite(r) || r >= ring_edge(RINGS_MAX, pitch_mm))
            continue;
        int k = ring_of(r, pitch_mm);
        k = k < RINGS_MAX ? k : RINGS_MAX - 1;
        const bool valid = isfinite(channel->value[i]) && (!channel->variance || channel->variance[i] >= 0);
        ring_index[i] = valid ? k : -1;
        rings[k].count += valid;
        rings[k].missing += !valid;
    }
    for (int k = 1; k < RINGS_MAX; k++)
        rings[k].begin = rings[k - 1].begin + rings[k - 1].count;
    size_t next[RINGS_MAX];
    for (int k = 0; k < RINGS_MAX; k++)
        next[k] = rings[k].begin;
    for (size_t i = 0; i < count; i++)
        if (ring_index[i] >= 0)
            (*pixels)[next[ring_index[i]]++] =
                (pixel){hypot(face->x_mm[i] - x_mm, face->y_mm[i] - y_mm), channel->value[i],
                        channel->variance ? channel->variance[i] : 0, face->area_mm2[i]};
    free(ring_index);
    return true;
}

// Relative variance of one pixel from the scatter in rings about k (variance itself where the values are not positive).
static double pooled_variance(const ring *rings, int k)
{
    double squares = 0, relative = 0, freedom = 0;
    bool positive = rings[k].value > 0;
    for (int width = 0; width < RINGS_MAX && freedom < POOL_FREEDOM; width++)
        for (int side = -1; side <= (width ? 1 : -1); side += 2) {
            const int j = k + side * width;
            if (j < 0 || j >= RINGS_MAX || rings[j].freedom == 0)
                continue;
            freedom += rings[j].freedom;
            squares += rings[j].squares;
            positive &= rings[j].value > 0;
            relative += positive ? rings[j].squares / (rings[j].value * rings[j].value) : 0;
        }
    if (freedom <= 0)
        return 0;
    return positive ? relative / freedom * rings[k].value * rings[k].value : squares / freedom;
}

static double ring_sd(const ring *rings, int k, bool with_variance, double top)
{
    const ring *one = &rings[k];
    double variance = with_variance ? one->propagated : pooled_variance(rings, k);
    if (with_variance && one->freedom &&
        (variance <= 0 || alb_chi_square_tail(one->squares / variance, one->freedom) < 1e-3))
        variance = fmax(variance, one->squares / one->freedom);
    return sqrt(variance / (double)one->count + 1e-8 * one->value * one->value + 1e-12 * top * top);
}

// Distance from the centre to the nearest pixel of the image's border.
static double border_distance(const alb_face *face, double x_mm, double y_mm)
{
    double nearest = INFINITY;
    for (int y = 0; y < face->height; y++)
        for (int x = 0; x < face->width; x += y == 0 || y == face->height - 1 ? 1 : face->width - 1) {
            const size_t i = (size_t)y * (size_t)face->width + (size_t)x;
            nearest = fmin(nearest, hypot(face->x_mm[i] - x_mm, face->y_mm[i] - y_mm));
        }
    return nearest;
}

static bool rings_to_readings(alb_readings *readings, const ring *rings, bool with_variance, double pitch_mm,
                              double complete_mm, alb_error *error)
{
    double top = 0, sd[RINGS_MAX];
    int end = 0, drowned = 0, kept = 0;
    for (int k = 0; k < RINGS_MAX; k++)
        top = fmax(top, rings[k].count ? fabs(rings[k].value) : 0);
    for (int k = 0; k < RINGS_MAX && drowned < 3; k++) {
        if (rings[k].count == 0)
            continue;
        sd[k] = ring_sd(rings, k, with_variance, top);
        drowned = rings[k].value < sd[k] ? drowned + 1 : 0;
        end = k + 1;
        kept++;
    }
    if (!alb_readings_create(readings, kept, error))
        return false;
    readings->drowned = drowned >= 3;
    readings->outer_mm = ring_edge(end, pitch_mm);
    readings->complete_mm = complete_mm;
    for (int k = 0; k < end && rings[k].missing; k++)
        readings->core_mm = ring_edge(k + 1, pitch_mm);
    for (int k = 0, i = 0; k < end; k++) {
        if (rings[k].count == 0)
            continue;
        const double low = ring_edge(k, pitch_mm), high = ring_edge(k + 1, pitch_mm);
        const bool whole = rings[k].missing == 0 && high < complete_mm;
        readings->r_mm[i] = rings[k].r_mm;
        readings->value[i] = rings[k].value;
        readings->sd[i] = sd[k];
        readings->area_mm2[i] = whole ? rings[k].area_mm2 : M_PI * (high * high - low * low);
        for (int s = 0; s < ALB_RING_SAMPLES; s++) {
            readings->sample_r_mm[i][s] = rings[k].sample_r_mm[s];
            readings->sample_share[i][s] = rings[k].sample_share[s];
            readings->sample_value[i][s] = rings[k].sample_value[s];
        }
        i++;
    }
    return true;
}

bool alb_observe(alb_readings *readings, const alb_channel *channel, alb_error *error)
{
    bool ok = false;
    double x_mm, y_mm, pitch_mm;
    pixel *pixels = NULL;
    *readings = (alb_readings){0};
    ring *rings = alb_allocate(RINGS_MAX, sizeof *rings, error);
    if (!rings || !alb_centre_find(&x_mm, &y_mm, &pitch_mm, channel, error) ||
        !sort_into_rings(rings, &pixels, channel, x_mm, y_mm, pitch_mm, error))
        goto done;
#pragma omp parallel for schedule(dynamic)
    for (int k = 0; k < RINGS_MAX; k++)
        if (rings[k].count)
            summarise(&rings[k], pixels + rings[k].begin, k, pitch_mm);
    if (!rings_to_readings(readings, rings, channel->variance != NULL, pitch_mm,
                           border_distance(channel->face, x_mm, y_mm), error))
        goto done;
    readings->x_mm = x_mm;
    readings->y_mm = y_mm;
    ok = true;
done:
    free(rings);
    free(pixels);
    return ok;
}
