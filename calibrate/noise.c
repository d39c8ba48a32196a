// Photon transfer (Janesick 2007; EMVA 1288, sec. 6). With b the black level, K the gain in DN per electron, s the
// signal:
//   E[y] = b + s,   Var[y] = K s + sigma_r^2        (sigma_r: read noise with quantisation, in DN)
// From two frames of one scene, d = y1 - y2 has mean zero and E[d^2] / 2 = K s + sigma_r^2 in every pixel, so that
// averages over pixels give K = (mean(d^2) / 2 - sigma_r^2) / mean(s) whether the field is even or not. Dark frames of
// a sensor quieter than its converter's step repeat themselves; their rounding error is still 1/12 DN^2, which is the
// least sigma_r^2 of whole numbers. Stops being true where the light flickers between the two frames, and near full
// well.
#include "calibrate/noise.h"
#include "base/memory.h"
#include "calibrate/frames.h"
#include <math.h>
#include <stdlib.h>

typedef struct pair {
    double mean[3];     // of both frames
    double variance[3]; // mean of d^2 / 2
    double maximum;
    double exposure_s;
    bool first; // of its exposure
    bool whole; // all values are whole numbers
} pair;

typedef struct pairs {
    pair *items;
    int count;
    double pixels; // of one pair
} pairs;

static bool pair_read(pair *p, const alb_session *session, const alb_shot *shot, int exposure, int repeat,
                      alb_error *error)
{
    alb_image a = {0}, b = {0};
    *p = (pair){.exposure_s = shot->obtained_s[exposure], .first = repeat == 0, .whole = true};
    const bool ok = alb_frame_read(&a, session, shot, exposure, repeat, error) &&
                    alb_frame_read(&b, session, shot, exposure, repeat + 1, error);
    const size_t count = (size_t)session->width * (size_t)session->height, channels = (size_t)session->channels;
    for (size_t i = 0; ok && i < count; i++)
        for (size_t c = 0; c < channels; c++) {
            const double y1 = (double)a.pixels[i * channels + c], y2 = (double)b.pixels[i * channels + c];
            p->mean[c] += (y1 + y2) / 2 / (double)count;
            p->variance[c] += (y1 - y2) * (y1 - y2) / 2 / (double)count;
            p->maximum = fmax(p->maximum, fmax(y1, y2));
            p->whole &= y1 == rint(y1) && y2 == rint(y2);
        }
    alb_image_free(&a);
    alb_image_free(&b);
    return ok;
}

// All pairs of frames of one target.
static bool pairs_read(pairs *out, const alb_session *session, alb_target target, alb_error *error)
{
    int most = 0;
    for (int s = 0; s < session->plan.shot_count; s++)
        most += session->plan.shots[s].exposure_count * session->plan.shots[s].repeats / 2;
    *out = (pairs){.pixels = (double)session->width * session->height};
    if (!(out->items = alb_allocate((size_t)most, sizeof *out->items, error)))
        return false;
    for (int s = 0; s < session->plan.shot_count; s++) {
        const alb_shot *shot = &session->plan.shots[s];
        for (int e = 0; shot->target == target && e < shot->exposure_count; e++)
            for (int r = 0; r + 1 < shot->repeats; r += 2, out->count++)
                if (!pair_read(&out->items[out->count], session, shot, e, r, error))
                    return false;
    }
    return true;
}

static bool measure_dark(alb_noise *noise, const alb_session *session, const pairs *dark, alb_error *error)
{
    if (!dark->count)
        return alb_fail(error, ALB_BAD_DATA, "%s: no pair of dark frames; add a shot of the cap with 2 repeats",
                        session->folder);
    for (int c = 0; c < session->channels; c++) {
        double mean = 0, variance = 0;
        bool whole = true;
        for (int k = 0; k < dark->count; k++) {
            whole &= dark->items[k].whole;
            if (dark->items[k].maximum >= session->white_level_dn)
                return alb_fail(error, ALB_BAD_DATA, "%s: dark frames of %g s reach the white level", session->folder,
                                dark->items[k].exposure_s);
            mean += dark->items[k].mean[c] / dark->count;
            variance += dark->items[k].variance[c] / dark->count;
        }
        variance = fmax(variance, whole ? 1.0 / 12 : 0);
        if (!(variance > 0))
            return alb_fail(error, ALB_BAD_DATA,
                            "%s: the dark frames are copies of each other in channel %s: no noise to measure",
                            session->folder, session->channel_names[c]);
        const double frames = 2 * dark->count * dark->pixels;
        noise->black_dn[c] = (alb_estimate){mean, sqrt(variance / frames)};
        noise->read_noise_dn[c] = (alb_estimate){sqrt(variance), sqrt(variance / frames)};
    }
    return true;
}

// Largest relative departure of signal / exposure from its mean over the exposures.
static double linearity_of(const pairs *flat, int channel, double black_dn, double white_level_dn)
{
    double mean = 0, worst = 0;
    int count = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (int k = 0; k < flat->count; k++) {
            const pair *p = &flat->items[k];
            if (!p->first || p->maximum >= white_level_dn)
                continue;
            const double rate = (p->mean[channel] - black_dn) / p->exposure_s;
            if (pass)
                worst = fmax(worst, fabs(rate / mean - 1));
            else
                mean += rate, count++;
        }
        mean /= pass ? 1 : fmax(count, 1);
    }
    return worst;
}

static bool measure_gain(alb_noise *noise, const alb_session *session, const pairs *flat, alb_error *error)
{
    for (int c = 0; c < session->channels; c++) {
        const double black = noise->black_dn[c].value, read2 = pow(noise->read_noise_dn[c].value, 2);
        double excess = 0, signal = 0;
        int used = 0;
        for (int k = 0; k < flat->count; k++) {
            const pair *p = &flat->items[k];
            if (p->maximum >= session->white_level_dn)
                continue;
            excess += p->variance[c] - read2;
            signal += p->mean[c] - black;
            used++;
        }
        if (!used)
            return alb_fail(error, ALB_BAD_DATA,
                            "%s: no pair of unsaturated frames of the diffuser; add a shot of it with 2 repeats",
                            session->folder);
        const double gain = excess / signal;
        if (!(gain > 0) || !isfinite(gain))
            return alb_fail(
                error, ALB_BAD_DATA,
                "%s: channel %s of the diffuser shows no photon noise (signal %.3g DN, excess variance %.3g DN^2)",
                session->folder, session->channel_names[c], signal / used, excess / used);
        noise->gain_dn_per_electron[c] = (alb_estimate){gain, gain * sqrt(2 / (used * flat->pixels))};
        noise->linearity = fmax(noise->linearity, linearity_of(flat, c, black, session->white_level_dn));
    }
    return true;
}

bool alb_noise_measure(alb_noise *noise, const alb_session *session, alb_error *error)
{
    pairs dark = {0}, flat = {0};
    *noise = (alb_noise){0};
    const bool ok = pairs_read(&dark, session, ALB_TARGET_CAP, error) && measure_dark(noise, session, &dark, error) &&
                    pairs_read(&flat, session, ALB_TARGET_DIFFUSER, error) &&
                    measure_gain(noise, session, &flat, error);
    free(dark.items);
    free(flat.items);
    return ok;
}
