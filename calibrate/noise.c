// Photon transfer (Janesick 2007; EMVA 1288, sec. 6). With b the black level, K the gain in DN per electron, s the
// signal:
//   E[y] = b + s,   Var[y] = K s + sigma_r^2        (sigma_r: read noise with quantisation, in DN)
// From two frames of one scene, d = y1 - y2 has mean zero and E[d^2] / 2 = K s + sigma_r^2 in every pixel, so that
// averages over pixels give K = (mean(d^2) / 2 - sigma_r^2) / mean(s) whether the field is even or not. Stops being
// true where the light flickers between the two frames, and near full well.
#include "calibrate/noise.h"
#include "calibrate/frames.h"
#include <math.h>

typedef struct pair {
    double mean[3];     // of both frames
    double variance[3]; // mean of d^2 / 2
    double maximum;
    double count; // pixels
} pair;

static bool pair_read(pair *p, const alb_session *session, const alb_shot *shot, int exposure, int repeat,
                      alb_error *error)
{
    alb_image a = {0}, b = {0};
    *p = (pair){0};
    const bool ok = alb_frame_read(&a, session, shot, exposure, repeat, error) &&
                    alb_frame_read(&b, session, shot, exposure, repeat + 1, error);
    if (ok) {
        const size_t count = (size_t)a.width * (size_t)a.height;
        for (size_t i = 0; i < count; i++)
            for (int c = 0; c < a.channels; c++) {
                const double y1 = (double)a.pixels[i * (size_t)a.channels + (size_t)c];
                const double y2 = (double)b.pixels[i * (size_t)a.channels + (size_t)c];
                p->mean[c] += (y1 + y2) / 2;
                p->variance[c] += (y1 - y2) * (y1 - y2) / 2;
                p->maximum = fmax(p->maximum, fmax(y1, y2));
            }
        for (int c = 0; c < a.channels; c++) {
            p->mean[c] /= (double)count;
            p->variance[c] /= (double)count;
        }
        p->count = (double)count;
    }
    alb_image_free(&a);
    alb_image_free(&b);
    return ok;
}

static bool measure_dark(alb_noise *noise, const alb_session *session, alb_error *error)
{
    double mean[3] = {0}, variance[3] = {0}, pixels = 0;
    int pairs = 0;
    for (int s = 0; s < session->plan.shot_count; s++) {
        const alb_shot *shot = &session->plan.shots[s];
        if (shot->target != ALB_TARGET_CAP)
            continue;
        for (int e = 0; e < shot->exposure_count; e++)
            for (int r = 0; r + 1 < shot->repeats; r += 2) {
                pair p;
                if (!pair_read(&p, session, shot, e, r, error))
                    return false;
                if (p.maximum >= session->white_level_dn)
                    return alb_fail(error, ALB_BAD_DATA, "%s: the dark frames of shot %s reach the white level",
                                    session->folder, shot->name);
                for (int c = 0; c < session->channels; c++) {
                    mean[c] += p.mean[c];
                    variance[c] += p.variance[c];
                }
                pixels += p.count;
                pairs++;
            }
    }
    if (!pairs)
        return alb_fail(error, ALB_BAD_DATA, "%s: no pair of dark frames; add a shot of the cap with 2 repeats",
                        session->folder);
    for (int c = 0; c < session->channels; c++) {
        const double v = variance[c] / pairs;
        noise->black_dn[c] = (alb_estimate){mean[c] / pairs, sqrt(v / (2 * pixels))};
        noise->read_noise_dn[c] = (alb_estimate){sqrt(v), sqrt(v / (2 * pixels))};
    }
    return true;
}

static bool measure_gain(alb_noise *noise, const alb_session *session, alb_error *error)
{
    double excess[3] = {0}, signal[3] = {0}, pixels = 0, rates[ALB_EXPOSURES_MAX * ALB_SHOTS_MAX][3];
    int pairs = 0, exposures = 0;
    for (int s = 0; s < session->plan.shot_count; s++) {
        const alb_shot *shot = &session->plan.shots[s];
        if (shot->target != ALB_TARGET_DIFFUSER)
            continue;
        for (int e = 0; e < shot->exposure_count; e++)
            for (int r = 0; r + 1 < shot->repeats; r += 2) {
                pair p;
                if (!pair_read(&p, session, shot, e, r, error))
                    return false;
                if (p.maximum >= session->white_level_dn)
                    continue;
                for (int c = 0; c < session->channels; c++) {
                    const double s_dn = p.mean[c] - noise->black_dn[c].value;
                    excess[c] += p.variance[c] - noise->read_noise_dn[c].value * noise->read_noise_dn[c].value;
                    signal[c] += s_dn;
                    if (!r)
                        rates[exposures][c] = s_dn / shot->obtained_s[e];
                }
                exposures += !r;
                pixels += p.count;
                pairs++;
            }
    }
    if (!pairs)
        return alb_fail(error, ALB_BAD_DATA,
                        "%s: no pair of unsaturated frames of the diffuser; add a shot of it with 2 repeats",
                        session->folder);
    for (int c = 0; c < session->channels; c++) {
        const double gain = excess[c] / signal[c];
        if (!(gain > 0) || !isfinite(gain))
            return alb_fail(
                error, ALB_BAD_DATA,
                "%s: channel %s of the diffuser shows no photon noise (signal %.3g DN, excess variance %.3g DN^2)",
                session->folder, session->channel_names[c], signal[c] / pairs, excess[c] / pairs);
        noise->gain_dn_per_electron[c] = (alb_estimate){gain, gain * sqrt(2 / pixels)};
        double mean = 0;
        for (int e = 0; e < exposures; e++)
            mean += rates[e][c] / exposures;
        for (int e = 0; e < exposures; e++)
            noise->linearity = fmax(noise->linearity, fabs(rates[e][c] / mean - 1));
    }
    return true;
}

bool alb_noise_measure(alb_noise *noise, const alb_session *session, alb_error *error)
{
    *noise = (alb_noise){0};
    return measure_dark(noise, session, error) && measure_gain(noise, session, error);
}
