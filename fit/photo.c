// From the pixels of a photograph to readings, and the sentences that warn of what the pixels show.
//
// Warned of are: a saturated core; more than a five-hundredth of the pixels left out as glints; rings that are not
// round (a harmonic above 2 % of the value that noise makes less than once in a thousand times); light beyond the
// readings, or at the border of the image, that a tail cannot be told from. What lies beyond the border is estimated by
// the fitted form: 1 - 2 pi P(border) / total, a lower bound of what a sample that ends there has lost.
#include "fit/photo.h"
#include "fit/product.h"
#include <math.h>
#include <stdio.h>

static void note_round(alb_text *notes, const char *name, const alb_readings *readings)
{
    static const char *const turns[] = {"once", "twice"};
    for (int h = 0; h < 2; h++) {
        const alb_anisotropy *seen = &readings->anisotropy[h];
        if (seen->chance < 1e-3 && seen->most > 0.02)
            alb_text_add(
                notes,
                "%s: not round: a part that goes %s around is up to %.2g %% of the light (at %.4g mm); oblique "
                "light, an edge or a vein. The mean of each ring is fitted.\n",
                name, turns[h], 100 * seen->most, seen->most_r_mm);
    }
}

static void note_dark(alb_text *notes, const char *name, const alb_readings *readings)
{
    const int last = readings->count - 1;
    double top = 0;
    for (int i = 0; i <= last; i++)
        top = fmax(top, readings->value[i]);
    if (readings->far_sd > 0 && fabs(readings->far_value) > 4 * readings->far_sd &&
        fabs(readings->far_value) > 1e-5 * top)
        alb_text_add(notes,
                     "%s: beyond %.4g mm the image is not dark but %.2g +- %.1g, %.2g %% of its brightest ring: stray "
                     "light, or the black level is off.\n",
                     name, readings->outer_mm, readings->far_value, readings->far_sd, 100 * readings->far_value / top);
    if (last >= 0 && !readings->drowned && readings->value[last] > 3 * readings->sd[last])
        alb_text_add(notes,
                     "%s: at the border of the image there is %.2g %% of the brightest ring, %.3g sd: stray light "
                     "there would pass for a tail.\n",
                     name, 100 * readings->value[last] / top, readings->value[last] / readings->sd[last]);
}

static void note_readings(alb_text *notes, const char *name, const alb_readings *readings)
{
    if (readings->core_mm > 0)
        alb_text_add(notes,
                     "%s: pixels out to %.4g mm of the centre are not measured (saturated); the core is the form's.\n",
                     name, readings->core_mm);
    if (500 * readings->glints > readings->pixels)
        alb_text_add(notes, "%s: %ld of %ld pixels are taken for glints, dust or veins and left out.\n", name,
                     readings->glints, readings->pixels + readings->glints);
    note_round(notes, name, readings);
    note_dark(notes, name, readings);
}

// Observes one channel and builds its forward model.
static bool observe_channel(alb_fitting *fitting, const alb_photo *seen, int channel, alb_text *notes, alb_error *error)
{
    char name[64], full_name[1024];
    alb_plane pixels = {0};
    const char *channel_name = fitting->material.channel_names[channel];
    alb_measurement *measurement = &fitting->sides[seen->side][channel];
    alb_readings *readings = &measurement->readings;
    snprintf(name, sizeof name, "%s %s", alb_side_names[seen->side], channel_name);
    snprintf(full_name, sizeof full_name, "%.900s: %s", seen->from, name);
    bool ok = alb_plane_take(&pixels, seen->image, channel_name, seen->factor, seen->saturation, error);
    const alb_channel observed = {seen->face, pixels.value, pixels.variance, full_name};
    ok = ok && alb_observe(readings, &observed, error) &&
         alb_operator_create(&measurement->forward, readings, seen->spots[channel], error);
    alb_plane_free(&pixels);
    if (ok)
        note_readings(notes, name, readings);
    return ok;
}

// Notes and the first error come in the order of the channels.
bool alb_photo_observe(alb_fitting *fitting, const alb_photo *seen, alb_text *notes, alb_error *error)
{
    alb_text own_notes[3] = {{0}};
    alb_error reasons[3] = {{0}};
    bool ok[3] = {true, true, true}, all = true;
#pragma omp parallel for schedule(dynamic)
    for (int c = 0; c < fitting->material.channels; c++)
        ok[c] = observe_channel(fitting, seen, c, &own_notes[c], &reasons[c]);
    for (int c = 0; c < 3; c++) {
        if (all && own_notes[c].bytes)
            alb_text_add(notes, "%s", own_notes[c].bytes);
        notes->failed = notes->failed || own_notes[c].failed;
        if (all && !ok[c])
            all = alb_fail(error, reasons[c].status, "%s", reasons[c].text);
        alb_text_free(&own_notes[c]);
    }
    return all;
}

void alb_photo_note_border(alb_text *notes, const alb_fitting *fitting)
{
    for (int side = 0; side < ALB_SIDES; side++)
        for (int c = 0; c < fitting->material.channels; c++) {
            const alb_measurement *one = &fitting->sides[side][c];
            const double total = one->outcome.fitted.total, border_mm = one->readings.complete_mm;
            if (!one->measured || !(total > 0) || !(border_mm > 0))
                continue;
            const double beyond = 1 - 2 * M_PI * alb_profile_disc(&one->outcome.fitted.profile, border_mm) / total;
            if (beyond > 1e-4)
                alb_text_add(
                    notes,
                    "%s %s: the border of the image is %.4g mm from the spot, with %.2g %% of the fitted total "
                    "beyond it; a sample that ends there has lost about as much.\n",
                    alb_side_names[side], fitting->material.channel_names[c], border_mm, 100 * beyond);
        }
}
