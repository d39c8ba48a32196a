// From merged exposures to numbers per incident flux. With X the merged rate (DN/s), V the vignetting, L = k X / V the
// radiance (k the camera's unknown responsivity) and Phi = pi / rho * integral L dA from the white reference:
//   white reference:  E / Phi = pi L / (rho Phi)        slab:  L / Phi
// k cancels. Both need the same lens aperture and the same light; a lamp that drifts between the two photographs is
// an error of scale that nothing here can see.
#include "calibrate/products.h"
#include "calibrate/absolute.h"
#include "calibrate/flat.h"
#include "calibrate/merge.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

static bool spots(const alb_shot *shot)
{
    return shot->pattern.kind == ALB_PATTERN_SPOT || shot->pattern.kind == ALB_PATTERN_GRID;
}

static void remove_vignetting(alb_image *merged, const alb_calibration *c, const alb_lens *lens)
{
#pragma omp parallel for schedule(static)
    for (int y = 0; y < merged->height; y++)
        for (int x = 0; x < merged->width; x++) {
            float *p = alb_image_at(merged, x, y);
            for (int i = 0; i < c->channels; i++) {
                const double v = alb_flat_value(c->flat[i], lens, x, y);
                p[i] = (float)((double)p[i] / v);
                p[c->channels + i] = (float)((double)p[c->channels + i] / (v * v));
            }
        }
}

static void multiply(alb_image *image, const double factor[3], int channels)
{
    const size_t count = (size_t)image->width * (size_t)image->height;
    for (size_t k = 0; k < count; k++)
        for (int i = 0; i < channels; i++) {
            float *p = image->pixels + k * (size_t)image->channels + (size_t)i;
            p[0] = (float)((double)p[0] * factor[i]);
            p[channels] = (float)((double)p[channels] * factor[i] * factor[i]);
        }
}

static bool linear_image(alb_image *image, const alb_calibration *c, const alb_session *session, const alb_shot *shot,
                         const alb_noise *noise, alb_error *error)
{
    if (!c->views[shot->side].known)
        return alb_fail(error, ALB_BAD_DATA, "%s: no photograph of the board on the face seen in %s; shot %s needs it",
                        session->folder, alb_side_names[shot->side], shot->name);
    if (!alb_merge_shot(image, session, shot, noise, error))
        return false;
    remove_vignetting(image, c, &c->views[shot->side].camera.lens);
    return true;
}

// The pattern on the white reference: flux, then irradiance per flux.
static bool make_white(alb_calibration *c, alb_image *image, alb_estimate flux[3], const alb_session *session,
                       const alb_shot *shot, const alb_noise *noise, alb_error *error)
{
    if (shot->side != ALB_REFLECTION)
        return alb_fail(error, ALB_BAD_DATA, "%s: shot %s: the white reference is seen from the front (reflection)",
                        session->folder, shot->name);
    if (!linear_image(image, c, session, shot, noise, error) ||
        !alb_flux_measure(flux, image, &c->views[ALB_REFLECTION].camera, session->plan.white_reflectance, shot->name,
                          error))
        return false;
    double factor[3];
    for (int i = 0; i < c->channels; i++)
        factor[i] = M_PI / (session->plan.white_reflectance[i] * flux[i].value);
    multiply(image, factor, c->channels);
    return true;
}

static void add_product(alb_calibration *c, const alb_shot *shot, const alb_estimate flux[3])
{
    alb_product *p = &c->products[c->product_count++];
    *p = (alb_product){.side = shot->side, .target = shot->target, .pattern = shot->pattern};
    snprintf(p->shot, sizeof p->shot, "%s", shot->name);
    for (int i = 0; i < c->channels; i++)
        p->relative_scale_sd[i] = flux[i].sd / flux[i].value;
}

bool alb_products_make(alb_calibration *calibration, alb_image images[ALB_SHOTS_MAX], const alb_session *session,
                       const alb_noise *noise, alb_error *error)
{
    alb_estimate flux[ALB_SHOTS_MAX][3];
    const alb_plan *plan = &session->plan;
    for (int s = 0; s < plan->shot_count; s++) {
        const alb_shot *shot = &plan->shots[s];
        if (shot->target != ALB_TARGET_WHITE || !spots(shot))
            continue;
        const int at = calibration->product_count;
        if (!make_white(calibration, &images[at], flux[at], session, shot, noise, error))
            return false;
        add_product(calibration, shot, flux[at]);
    }
    const int whites = calibration->product_count;
    for (int s = 0; s < plan->shot_count; s++) {
        const alb_shot *shot = &plan->shots[s];
        if (shot->target != ALB_TARGET_SLAB || !spots(shot))
            continue;
        int white = 0;
        while (white < whites && !alb_pattern_same(&calibration->products[white].pattern, &shot->pattern))
            white++;
        if (white == whites)
            return alb_fail(error, ALB_BAD_DATA,
                            "%s: shot %s has no photograph of its pattern on the white reference; add one",
                            session->folder, shot->name);
        const int at = calibration->product_count;
        if (!linear_image(&images[at], calibration, session, shot, noise, error))
            return false;
        double factor[3];
        for (int i = 0; i < calibration->channels; i++)
            factor[i] = 1 / flux[white][i].value;
        multiply(&images[at], factor, calibration->channels);
        add_product(calibration, shot, flux[white]);
    }
    if (calibration->product_count == whites)
        return alb_fail(error, ALB_BAD_DATA, "%s: no shot of the slab under a spot or a grid", session->folder);
    return true;
}
