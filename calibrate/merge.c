// Iterated maximum likelihood. Exposure i with time t_i, n_i frames of mean y_i, black b, gain K, read noise s:
//   y_i = b + x t_i,                          Var y_i = (K max(x, 0) t_i + s^2) / n_i
//   x = sum w_i (y_i - b) / t_i / sum w_i,    w_i = t_i^2 / Var y_i
// with the variance from the current estimate of x, never from the noisy sample, which would favour samples that happen
// to be dark. Clipping is tested on the estimate as well: an exposure counts while b + x t + 4 sd stays below the white
// level. Var x = 1 / sum w_i. Tent weights (Debevec & Malik 1997) would ignore photon statistics: near black they lose
// nearly all. Stops being true where the sensor is not linear, or the light changes between exposures.
#include "calibrate/merge.h"
#include "base/memory.h"
#include "calibrate/frames.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ITERATIONS = 12 };

bool alb_merge_pixel(double *rate, double *variance, const alb_exposure *exposures, int count, double black_dn,
                     double read_noise_dn, double gain_dn_per_electron, double white_level_dn)
{
    int first = -1; // the shortest exposure that is not clipped starts the iteration
    for (int i = 0; i < count; i++)
        if (!exposures[i].clipped && (first < 0 || exposures[i].time_s < exposures[first].time_s))
            first = i;
    if (first < 0)
        return false;
    double x = (exposures[first].mean_dn - black_dn) / exposures[first].time_s, total = 0;
    for (int iteration = 0; iteration < ITERATIONS; iteration++) {
        const double before = x;
        double sum = 0;
        total = 0;
        for (int i = 0; i < count; i++) {
            const alb_exposure *e = &exposures[i];
            const double v = gain_dn_per_electron * fmax(before, 0) * e->time_s + read_noise_dn * read_noise_dn;
            if (e->clipped || (i != first && black_dn + before * e->time_s + 4 * sqrt(v) >= white_level_dn))
                continue;
            const double weight = e->time_s * e->time_s * e->frames / v;
            sum += weight * (e->mean_dn - black_dn) / e->time_s;
            total += weight;
        }
        x = sum / total;
        if (fabs(x - before) <= 1e-9 * fabs(x))
            break;
    }
    *rate = x;
    *variance = 1 / total;
    return true;
}

// Mean of all frames of one exposure, and whether any of them is clipped, per value.
static bool sum_frames(float *mean, unsigned char *clipped, const alb_session *session, const alb_shot *shot,
                       int exposure, alb_error *error)
{
    for (int r = 0; r < shot->repeats; r++) {
        alb_image frame;
        if (!alb_frame_read(&frame, session, shot, exposure, r, error))
            return false;
        const size_t count = (size_t)frame.width * (size_t)frame.height * (size_t)frame.channels;
        for (size_t i = 0; i < count; i++) {
            mean[i] += frame.pixels[i] / (float)shot->repeats;
            clipped[i] |= (double)frame.pixels[i] >= session->white_level_dn;
        }
        alb_image_free(&frame);
    }
    return true;
}

static void merge_row(alb_image *merged, int y, float *const *means, unsigned char *const *clipped,
                      const alb_session *session, const alb_shot *shot, const alb_noise *noise)
{
    const int channels = session->channels;
    for (int x = 0; x < merged->width; x++)
        for (int c = 0; c < channels; c++) {
            const size_t i = ((size_t)y * (size_t)merged->width + (size_t)x) * (size_t)channels + (size_t)c;
            alb_exposure exposures[ALB_EXPOSURES_MAX];
            for (int e = 0; e < shot->exposure_count; e++)
                exposures[e] = (alb_exposure){shot->obtained_s[e], (double)means[e][i], shot->repeats, clipped[e][i]};
            double rate = NAN, variance = NAN;
            alb_merge_pixel(&rate, &variance, exposures, shot->exposure_count, noise->black_dn[c].value,
                            noise->read_noise_dn[c].value, noise->gain_dn_per_electron[c].value,
                            session->white_level_dn);
            float *out = alb_image_at(merged, x, y);
            out[c] = (float)rate;
            out[channels + c] = (float)variance;
        }
}

bool alb_merge_shot(alb_image *merged, const alb_session *session, const alb_shot *shot, const alb_noise *noise,
                    alb_error *error)
{
    bool ok = false;
    float *means[ALB_EXPOSURES_MAX] = {0};
    unsigned char *clipped[ALB_EXPOSURES_MAX] = {0};
    const size_t count = (size_t)session->width * (size_t)session->height * (size_t)session->channels;
    char names[128] = "";
    for (int part = 0; part < 2; part++)
        for (int c = 0; c < session->channels; c++)
            snprintf(names + strlen(names), sizeof names - strlen(names), "%s%s%s", *names ? "," : "",
                     part ? "variance." : "", session->channel_names[c]);
    if (!alb_image_create(merged, session->width, session->height, names, error))
        goto done;
    for (int e = 0; e < shot->exposure_count; e++) {
        means[e] = alb_allocate(count, sizeof *means[e], error);
        clipped[e] = alb_allocate(count, 1, error);
        if (!means[e] || !clipped[e])
            goto done;
    }
    alb_error reasons[ALB_EXPOSURES_MAX] = {{0}};
#pragma omp parallel for schedule(dynamic)
    for (int e = 0; e < shot->exposure_count; e++)
        sum_frames(means[e], clipped[e], session, shot, e, &reasons[e]);
    for (int e = 0; e < shot->exposure_count; e++)
        if (reasons[e].status != ALB_OK) {
            alb_fail(error, reasons[e].status, "%s", reasons[e].text);
            goto done;
        }
#pragma omp parallel for schedule(static)
    for (int y = 0; y < session->height; y++)
        merge_row(merged, y, means, clipped, session, shot, noise);
    ok = true;
done:
    for (int e = 0; e < ALB_EXPOSURES_MAX; e++) {
        free(means[e]);
        free(clipped[e]);
    }
    if (!ok)
        alb_image_free(merged);
    return ok;
}
