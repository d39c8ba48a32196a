// The tables of a fit's page: what was found, how well it is known, what else was tried, and what it was read from.
#include "fit/report_tables.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

typedef void (*row)(alb_page *page, const char *side, const char *channel, const alb_measurement *measurement);

// A row, or some, for every side and channel that was measured.
static void put_rows(alb_page *page, const alb_fitting *fitting, row put)
{
    for (int side = 0; side < ALB_SIDES; side++)
        for (int c = 0; c < fitting->material.channels; c++)
            if (fitting->sides[side][c].measured)
                put(page, alb_side_names[side], fitting->material.channel_names[c], &fitting->sides[side][c]);
    alb_page_end_table(page);
}

// "1.2 to 3.4", an open end as "..".
static const char *interval(char text[64], const alb_certainty *certainty)
{
    char low[24] = "..", high[24] = "..";
    if (isfinite(certainty->lower))
        snprintf(low, sizeof low, "%.5g", certainty->lower);
    if (isfinite(certainty->upper))
        snprintf(high, sizeof high, "%.5g", certainty->upper);
    snprintf(text, 64, "%s to %s", low, high);
    return text;
}

const char *alb_sd_text(char text[ALB_SD_TEXT_SIZE], const char *sign, double sd)
{
    if (isfinite(sd))
        snprintf(text, ALB_SD_TEXT_SIZE, "%s %.2g", sign, sd);
    else
        snprintf(text, ALB_SD_TEXT_SIZE, "(undecided)");
    return text;
}

static void put_profile(alb_page *page, const char *side, const char *channel, const alb_measurement *measurement)
{
    const alb_outcome *outcome = &measurement->outcome;
    const alb_fitted *fitted = &outcome->fitted;
    char range[64], sd[ALB_SD_TEXT_SIZE];
    alb_page_row(page, "%s|%s|%s%s|%.5g %s|%s|%.4g / %d|%.2f|%.2f|%.1f|%s", side, channel,
                 alb_form_name(fitted->profile.form), outcome->tied ? ", b2 = 1.1 b1" : "", fitted->total,
                 alb_sd_text(sd, "±", fitted->total_sd), interval(range, &outcome->knowledge.total), fitted->chi_square,
                 fitted->degrees_of_freedom, 100 * outcome->discrepancy_relative, 100 * outcome->rms_relative,
                 100 * outcome->measured_share, *outcome->undecided ? outcome->undecided : "decided");
}

void alb_report_profiles(alb_page *page, const alb_fitting *fitting)
{
    alb_page_heading(page, "Profiles");
    alb_page_table(page, "side|channel|form|total|95 %|chi-square / dof|misfit %|rms %|measured %|the data");
    put_rows(page, fitting, put_profile);
    alb_page_paragraph(page,
                       "Misfit: by how much of itself the form misses the readings beyond their noise, which is in "
                       "the sd. Measured: the share of the total within the readings.");
}

static void put_parameters(alb_page *page, const char *side, const char *channel, const alb_measurement *measurement)
{
    const alb_outcome *outcome = &measurement->outcome;
    const alb_fitted *fitted = &outcome->fitted;
    char range[64];
    for (int p = 0; p < alb_form_parameter_count(fitted->profile.form); p++) {
        const alb_certainty *known = &outcome->knowledge.parameters[p];
        char sd[24] = "undecided", bound[24] = "–";
        if (isfinite(fitted->sd[p]))
            snprintf(sd, sizeof sd, "%.2g", fitted->sd[p]);
        if (isfinite(known->cramer_rao_sd))
            snprintf(bound, sizeof bound, "%.2g", known->cramer_rao_sd);
        alb_page_row(page, "%s|%s|%s|%.5g|%s|%s|%s|%s", side, channel, alb_form_parameter_name(fitted->profile.form, p),
                     fitted->profile.parameters[p], sd, interval(range, known), bound,
                     *known->because ? known->because : "identifiable");
    }
}

void alb_report_parameters(alb_page *page, const alb_fitting *fitting)
{
    alb_page_heading(page, "Parameters");
    alb_page_table(page, "side|channel|parameter|value|sd|95 %|Cramér-Rao sd|");
    put_rows(page, fitting, put_parameters);
    alb_page_paragraph(page,
                       "95 %%: by the profile likelihood, with what all readings share (flux, length). Cramér-Rao: "
                       "the least sd that the noise of the readings allows.");
}

static void put_correlations(alb_page *page, const char *side, const char *channel, const alb_measurement *measurement)
{
    const alb_fitted *fitted = &measurement->outcome.fitted;
    const int n = alb_form_parameter_count(fitted->profile.form);
    for (int p = 0; p < n; p++) {
        char cells[128] = "";
        for (int q = 0; q < ALB_PARAMETERS_MAX; q++) {
            const size_t used = strlen(cells);
            const double sds = fitted->sd[p] * fitted->sd[q < n ? q : 0];
            if (q < p && sds > 0)
                snprintf(cells + used, sizeof cells - used, "|%+.3f", fitted->covariance[p][q] / sds);
            else
                snprintf(cells + used, sizeof cells - used, q == p ? "|1" : "|");
        }
        alb_page_row(page, "%s|%s|%d  %s%s", p ? "" : side, p ? "" : channel, p + 1,
                     alb_form_parameter_name(fitted->profile.form, p), cells);
    }
}

void alb_report_correlations(alb_page *page, const alb_fitting *fitting)
{
    alb_page_heading(page, "Correlations of the parameters");
    alb_page_table(page, "side|channel|parameter|1|2|3|4|5|6");
    put_rows(page, fitting, put_correlations);
}

static void put_attempts(alb_page *page, const char *side, const char *channel, const alb_measurement *measurement)
{
    const alb_outcome *outcome = &measurement->outcome;
    for (int i = 0; i < outcome->attempt_count; i++) {
        const alb_attempt *attempt = &outcome->attempts[i];
        const char *why = *attempt->rejected ? attempt->rejected : "chosen";
        if (isfinite(attempt->chi_square))
            alb_page_row(page, "%s|%s|%s%s|%.5g / %d|%.2g|%+.2f|%+.4g|%s", i ? "" : side, i ? "" : channel,
                         alb_form_name(attempt->form), attempt->tied ? ", b2 = 1.1 b1" : "", attempt->chi_square,
                         attempt->degrees_of_freedom, attempt->p_value, attempt->lag_1, attempt->bic_excess, why);
        else
            alb_page_row(page, "%s|%s|%s%s|–|–|–|–|%s", i ? "" : side, i ? "" : channel, alb_form_name(attempt->form),
                         attempt->tied ? ", b2 = 1.1 b1" : "", why);
    }
}

void alb_report_attempts(alb_page *page, const alb_fitting *fitting)
{
    alb_page_heading(page, "Forms tried");
    alb_page_table(page, "side|channel|form|chi-square / dof|probability|lag 1|BIC above|rejected because");
    put_rows(page, fitting, put_attempts);
    alb_page_paragraph(page, "Lag 1: correlation of neighbouring residuals. BIC above: that of the form chosen.");
}

// Share of a total that no reading holds.
static double beyond(const alb_measurement *measurement)
{
    return measurement->measured ? measurement->outcome.fitted.total * (1 - measurement->outcome.measured_share) : 0;
}

void alb_report_energy(alb_page *page, const alb_fitting *fitting)
{
    alb_page_heading(page, "Energy");
    alb_page_table(page, "channel|reflection|transmission|together|the rest|beyond the readings|before it was "
                         "held at 1");
    for (int c = 0; c < fitting->material.channels; c++) {
        const alb_measurement *r = &fitting->sides[ALB_REFLECTION][c], *t = &fitting->sides[ALB_TRANSMISSION][c];
        const alb_fitted *one = &r->outcome.fitted, *other = &t->outcome.fitted;
        const double sum = one->total + other->total, sd = hypot(one->total_sd, other->total_sd);
        const double freely = r->outcome.free_total + t->outcome.free_total;
        char held[48] = "not held", cells[ALB_SIDES][64], text[ALB_SD_TEXT_SIZE];
        if (freely > sum * (1 + 1e-12))
            snprintf(held, sizeof held, "%.5g", freely);
        for (int side = 0; side < ALB_SIDES; side++) {
            const alb_fitted *fitted = side ? other : one;
            snprintf(cells[side], sizeof cells[side], "–");
            if (fitting->sides[side][c].measured)
                snprintf(cells[side], sizeof cells[side], "%.5g %s", fitted->total,
                         alb_sd_text(text, "±", fitted->total_sd));
        }
        alb_page_row(page, "%s|%s|%s|%.5g %s|%.5g|%.2g|%s", fitting->material.channel_names[c], cells[0], cells[1], sum,
                     alb_sd_text(text, "±", sd), 1 - sum, beyond(r) + beyond(t), held);
    }
    alb_page_end_table(page);
    if (!fitting->absolute)
        alb_page_paragraph(page,
                           "The values are in the unit of the picture or table: as shares of the light they stand "
                           "only where that unit is the incident flux.");
}

// By adding-doubling from the totals.
static void put_by_totals(alb_page *page, const char *channel, const alb_properties *p)
{
    const alb_optical *o = &p->optical;
    char flags[320] = "";
    if (!p->known) {
        alb_page_row(page, "%s|totals|–|–|–|–|–|%s", channel, *p->refused ? p->refused : "not tried");
        return;
    }
    for (int i = 0; i < ALB_OPTICAL_FLAGS; i++)
        if (o->flags >> i & 1)
            snprintf(flags + strlen(flags), sizeof flags - strlen(flags), "; %s", alb_optical_flag_text(i));
    if (p->half_space)
        alb_page_row(page, "%s|total|–|–|%.4g ± %.2g|%g assumed|–|as of a half-space%s", channel, o->reduced_albedo,
                     o->reduced_albedo_sd, p->anisotropy, flags);
    else
        alb_page_row(page,
                     "%s|totals|%.4g ± %.2g|%.4g ± %.2g|%.4g ± %.2g|%g assumed|%+.2f|1 %% of scale: %+.2g %%, "
                     "%+.2g %%%s",
                     channel, o->absorption_per_mm, o->absorption_sd, o->reduced_scattering_per_mm,
                     o->reduced_scattering_sd, o->reduced_albedo, o->reduced_albedo_sd, p->anisotropy, o->correlation,
                     o->by_scale[0], o->by_scale[1], flags);
}

// By transport in Hankel space from where the light leaves; their factor is fitted.
static void put_by_images(alb_page *page, const char *channel, const alb_image_properties *p)
{
    const alb_joint *j = &p->joint;
    if (!p->known) {
        if (*p->refused)
            alb_page_row(page, "%s|images|–|–|–|–|–|%s", channel, p->refused);
        return;
    }
    const double *sd = j->relative_sd;
    const double correlation = j->covariance[ALB_JOINT_ABSORPTION][ALB_JOINT_SCATTERING] /
                               sqrt(j->covariance[ALB_JOINT_ABSORPTION][ALB_JOINT_ABSORPTION] *
                                    j->covariance[ALB_JOINT_SCATTERING][ALB_JOINT_SCATTERING]);
    char anisotropy[48];
    snprintf(anisotropy, sizeof anisotropy, sd[ALB_JOINT_ANISOTROPY] > 0 ? "%.2f ± %.2f" : "%g assumed", j->anisotropy,
             sd[ALB_JOINT_ANISOTROPY]);
    alb_page_row(page, "%s|images|%.4g ± %.2g|%.4g ± %.2g|%.4g|%s|%+.2f|scale %.4f ± %.2g; chi-square %.4g / %d%s%s",
                 channel, j->absorption_per_mm, j->absorption_per_mm * sd[ALB_JOINT_ABSORPTION],
                 j->reduced_scattering_per_mm, j->reduced_scattering_per_mm * sd[ALB_JOINT_SCATTERING], j->albedo,
                 anisotropy, correlation, j->scale, j->scale * sd[ALB_JOINT_SCALE], j->chi_square,
                 j->degrees_of_freedom, *j->undecided ? "; " : "", j->undecided);
}

void alb_report_properties(alb_page *page, const alb_fitting *fitting)
{
    bool tried = false;
    for (int c = 0; c < fitting->material.channels; c++)
        tried |= fitting->properties[c].known || *fitting->properties[c].refused;
    if (!tried)
        return;
    alb_page_heading(page, "Optical properties");
    alb_page_table(page, "channel|from|absorption (1/mm)|reduced scattering (1/mm)|reduced albedo|anisotropy|"
                         "correlation|");
    for (int c = 0; c < fitting->material.channels; c++) {
        put_by_totals(page, fitting->material.channel_names[c], &fitting->properties[c]);
        put_by_images(page, fitting->material.channel_names[c], &fitting->properties[c].images);
    }
    alb_page_end_table(page);
    alb_page_paragraph(page, "By radiative transfer: from the totals by adding-doubling; from the images, whose common "
                             "factor is fitted, by spherical harmonics in Hankel space.");
}

static void put_readings(alb_page *page, const char *side, const char *channel, const alb_measurement *measurement)
{
    const alb_readings *r = &measurement->readings;
    if (r->pixels == 0) { // a table
        alb_page_row(page, "%s|%s|%d|%.4g to %.4g|–|–|–|–|–|–", side, channel, r->count, r->r_mm[0],
                     r->r_mm[r->count - 1]);
        return;
    }
    alb_page_row(page, "%s|%s|%d|%.4g to %.4g|%.4g, %.4g ± %.2g|%ld|%ld|%ld|%.4g|%.2g (%.2g), %.2g (%.2g)", side,
                 channel, r->count, r->r_mm[0], r->r_mm[r->count - 1], r->x_mm, r->y_mm,
                 sqrt(r->centre_covariance_mm2[0] + r->centre_covariance_mm2[2]), r->pixels, r->missing, r->glints,
                 r->core_mm, r->anisotropy[0].most, r->anisotropy[0].chance, r->anisotropy[1].most,
                 r->anisotropy[1].chance);
}

void alb_report_readings(alb_page *page, const alb_fitting *fitting)
{
    alb_page_heading(page, "Readings");
    alb_page_table(page,
                   "side|channel|rings|r (mm)|centre (mm)|pixels|not measured|glints|saturated out to (mm)|once, twice "
                   "round (by chance)");
    put_rows(page, fitting, put_readings);
    alb_page_paragraph(page,
                       "Once round: the largest part of a ring's light that goes with the cosine of direction (a "
                       "spot off its centre, a tilted beam), relative to its mean, and the probability that noise "
                       "makes as much; twice round: an ellipse, or a grain.");
}
