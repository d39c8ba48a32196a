// The fitted profiles as a table: channel,r_mm,reflection_per_mm2,sd,transmission_per_mm2,sd. 200 distances rise by one
// factor from where 0.1 % of a channel's light has left to where 99.9 % have. Empty cells were not measured, or are not
// decided.
#include "fit/export.h"
#include "fit/uncertainty.h"
#include <math.h>

enum { ROWS = 200 };

static double distance_of_share(const alb_profile *profile, double share)
{
    const double wanted = share * alb_profile_total(profile) / (2 * M_PI);
    double low = 1e-150, high = 1e150;
    for (int i = 0; i < 80; i++) {
        const double middle = sqrt(low) * sqrt(high);
        *(alb_profile_disc(profile, middle) < wanted ? &low : &high) = middle;
    }
    return high;
}

static void put_side(alb_text *text, const alb_fitted *fitted, double r_mm)
{
    if (fitted->profile.form == ALB_FORM_NONE)
        alb_text_add(text, ",,");
    else if (!fitted->identifiable)
        alb_text_add(text, ",%.9g,", alb_profile_value(&fitted->profile, r_mm));
    else
        alb_text_add(text, ",%.9g,%.4g", alb_profile_value(&fitted->profile, r_mm), alb_profile_sd(fitted, r_mm));
}

void alb_export_put_csv(alb_text *text, const alb_export *exported)
{
    const alb_material *material = exported->material;
    alb_text_add(text, "channel,r_mm,reflection_per_mm2,reflection_sd_per_mm2,transmission_per_mm2,"
                       "transmission_sd_per_mm2\n");
    for (int c = 0; c < material->channels; c++) {
        double from = INFINITY, to = 0;
        for (int side = 0; side < ALB_SIDES; side++)
            if (material->fitted[side][c].profile.form != ALB_FORM_NONE) {
                from = fmin(from, distance_of_share(&material->fitted[side][c].profile, 0.001));
                to = fmax(to, distance_of_share(&material->fitted[side][c].profile, 0.999));
            }
        for (int i = 0; i < ROWS && to > 0; i++) {
            const double r_mm = from * pow(to / from, i / (ROWS - 1.0));
            alb_text_add(text, "%s,%.9g", material->channel_names[c], r_mm);
            for (int side = 0; side < ALB_SIDES; side++)
                put_side(text, &material->fitted[side][c], r_mm);
            alb_text_add(text, "\n");
        }
    }
}
