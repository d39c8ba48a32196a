// A fitted material against the truth of a virtual rig (truth.json: radial kernel counted from photons, in bins).
//   deviation     = (recovered total - true total) / true total
//   z             = (recovered - true) / sqrt(sd^2 + true sd^2): 1 is what the error bars promise
//   rms of curve  = sqrt(mean over bins of (S_fit / S_true - 1)^2), each bin once, from r = 0.5 mm (outside the beam)
//   to
//                   the first bin whose own sd exceeds 10 %; S_fit is the fit's mean over the bin's ring, closed form
// The truth states each bin by its mean radius r = m + h^2 / (12 m), m its middle and h its width, and r_(i+1) -
// r_(i-1) = 2 h where widths grow evenly. Stops being true: widths that change otherwise; and the truth's own noise, up
// to 10 % in the last bins, is part of the rms.
#include "render/compare.h"

#include "base/memory.h"
#include "base/plot.h"
#include "base/record.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double first_mm = 0.5, worst_relative_sd = 0.1;
enum { BINS_MAX = 1000000 };

static bool read_list(double **values, size_t count, alb_node list, double minimum, alb_error *error)
{
    if (!(*values = alb_allocate(count, sizeof **values, error)))
        return false;
    for (size_t i = 0; i < count; i++)
        if (!alb_node_item_number(&(*values)[i], list, i, minimum, 1e300, error))
            return false;
    return true;
}

// Totals and bins of one side and channel.
static bool read_profile(alb_profile_check *p, alb_node node, alb_error *error)
{
    alb_node lists[3];
    size_t counts[3];
    const char *const keys[] = {"r_mm", "value_per_mm2", "sd_per_mm2"};
    if (!alb_node_allow(node, "total total_sd r_mm value_per_mm2 sd_per_mm2", error) ||
        !alb_node_number(&p->total, node, "total", 0, 1e300, error) ||
        !alb_node_number(&p->total_sd, node, "total_sd", 0, 1e300, error))
        return false;
    for (int i = 0; i < 3; i++)
        if (!alb_node_list(&lists[i], &counts[i], node, keys[i], error))
            return false;
    if (counts[0] != counts[1] || counts[0] != counts[2] || counts[0] > BINS_MAX)
        return alb_node_fail(error, node, NULL,
                             "r_mm, value_per_mm2 and sd_per_mm2 have %zu, %zu and %zu numbers; expected equally many, "
                             "at most %d",
                             counts[0], counts[1], counts[2], BINS_MAX);
    p->count = counts[0];
    if (!read_list(&p->r_mm, p->count, lists[0], 0, error) ||
        !read_list(&p->value_per_mm2, p->count, lists[1], -1e300, error) ||
        !read_list(&p->sd_per_mm2, p->count, lists[2], 0, error))
        return false;
    for (size_t i = 1; i < p->count; i++)
        if (!(p->r_mm[i] > p->r_mm[i - 1]))
            return alb_node_fail(error, node, "r_mm", "does not ascend at item %zu", i);
    return true;
}

// The fit's mean over the ring of bin i, 1/mm^2.
static double fitted_mean(const alb_profile_check *p, size_t i)
{
    const size_t before = i > 0 ? i - 1 : i, after = i + 1 < p->count ? i + 1 : i;
    const double r = p->r_mm[i];
    if (before == after || !(r > 0))
        return alb_profile_value(&p->fitted.profile, r);
    const double width = fmin((p->r_mm[after] - p->r_mm[before]) / (double)(after - before), 1.5 * r);
    const double middle = (r + sqrt(r * r - width * width / 3)) / 2;
    const double inner = fmax(middle - width / 2, 0), outer = middle + width / 2;
    return alb_profile_ring(&p->fitted.profile, inner, outer);
}

static void measure_curve(alb_profile_check *p)
{
    double squares = 0;
    p->curve_rms = (double)NAN;
    for (size_t i = 0; i < p->count; i++) {
        if (p->r_mm[i] < first_mm)
            continue;
        if (!(p->sd_per_mm2[i] <= worst_relative_sd * p->value_per_mm2[i]) || !(p->value_per_mm2[i] > 0))
            break;
        const double ratio = fitted_mean(p, i) / p->value_per_mm2[i];
        squares += (ratio - 1) * (ratio - 1);
        p->from_mm = p->bins++ ? p->from_mm : p->r_mm[i];
        p->to_mm = p->r_mm[i];
    }
    if (p->bins)
        p->curve_rms = sqrt(squares / p->bins);
}

static void check_profile(alb_profile_check *p, const alb_material *material)
{
    p->deviation_percent = p->deviation_sd = p->curve_rms = (double)NAN;
    for (int c = 0; c < material->channels; c++)
        if (strcmp(material->channel_names[c], p->channel) == 0)
            p->fitted = material->fitted[p->side][c];
    p->measured = p->fitted.profile.form != ALB_FORM_NONE;
    if (!p->measured)
        return;
    const double deviation = p->fitted.total - p->total;
    p->deviation_percent = 100 * deviation / p->total; // infinite for a truth of 0 is right
    p->deviation_sd = deviation / hypot(p->fitted.total_sd, p->total_sd);
    measure_curve(p);
}

// One side of every channel that has it.
static bool read_side(alb_material_check *out, alb_side side, alb_node channels, const alb_material *material,
                      alb_error *error)
{
    for (size_t i = 0; i < alb_node_key_count(channels); i++) {
        alb_node channel, node;
        if (!alb_node_object(&channel, channels, alb_node_key(channels, i), error) ||
            !alb_node_allow(channel, "reflection transmission", error))
            return false;
        if (!alb_node_has(channel, alb_side_names[side]))
            continue;
        if (!alb_node_object(&node, channel, alb_side_names[side], error))
            return false;
        alb_profile_check *p = &out->profiles[out->count++];
        p->side = side;
        snprintf(p->channel, sizeof p->channel, "%.7s", alb_node_key(channels, i));
        if (!read_profile(p, node, error))
            return false;
        check_profile(p, material);
    }
    return true;
}

bool alb_compare_material(alb_material_check *check, const alb_material *material, const char *truth_path,
                          alb_error *error)
{
    alb_material_check out = {0};
    alb_node root, channels;
    int measured = 0;
    alb_record *record = alb_record_read(truth_path, error);
    bool ok = record && alb_record_root(&root, record, error) &&
              alb_node_allow(root, "format provenance channels", error) &&
              alb_node_object(&channels, root, "channels", error);
    if (ok && alb_node_key_count(channels) > 3)
        ok = alb_node_fail(error, channels, NULL, "%zu channels; expected at most 3", alb_node_key_count(channels));
    for (int side = 0; ok && side < ALB_SIDES; side++)
        ok = read_side(&out, (alb_side)side, channels, material, error);
    for (int i = 0; i < out.count; i++)
        measured += out.profiles[i].measured;
    if (ok && measured == 0)
        ok = alb_fail(error, ALB_BAD_DATA, "%s: no channel and side of it is in the material '%s'", truth_path,
                      material->name);
    snprintf(out.name, sizeof out.name, "%s", material->name);
    alb_record_free(record);
    if (ok)
        *check = out;
    else
        alb_material_check_free(&out);
    return ok;
}

void alb_material_check_free(alb_material_check *check)
{
    for (int i = 0; i < check->count; i++) {
        free(check->profiles[i].r_mm);
        free(check->profiles[i].value_per_mm2);
        free(check->profiles[i].sd_per_mm2);
    }
    *check = (alb_material_check){0};
}

static void add_table(alb_page *page, const alb_material_check *check)
{
    alb_page_table(page, "side|channel|true total|recovered|sd|deviation|in sd|form|rms of curve|over (mm)");
    for (int i = 0; i < check->count; i++) {
        const alb_profile_check *p = &check->profiles[i];
        if (p->measured)
            alb_page_row(page, "%s|%s|%.5f|%.5f|%.5f|%+.2f %%|%+.2f|%s%s|%.2f %%|%.2f to %.2f", alb_side_names[p->side],
                         p->channel, p->total, p->fitted.total, p->fitted.total_sd, p->deviation_percent,
                         p->deviation_sd, alb_form_name(p->fitted.profile.form),
                         p->fitted.identifiable ? "" : " (best guess: not decided)", 100 * p->curve_rms, p->from_mm,
                         p->to_mm);
        else
            alb_page_row(page, "%s|%s|%.5f|||||not measured||", alb_side_names[p->side], p->channel, p->total);
    }
    alb_page_end_table(page);
    alb_page_paragraph(
        page, "Total: the share of the incident light that leaves by that face. In sd: deviation over the root of "
              "both variances. Rms of curve: of fit / truth \u2212 1 over the photons\u2019 bins, each bin once, from "
              "0.5 mm to the first bin whose own sd exceeds 10 %%.");
}

// Bins up to the last one that the photons know to half its value: what lies beyond is noise.
static size_t bins_to_show(const alb_profile_check *p)
{
    size_t count = p->count;
    while (count > 0 && !(p->value_per_mm2[count - 1] > 2 * p->sd_per_mm2[count - 1]))
        count--;
    return count;
}

// Truth as points with sd and the fit as a line, in one panel a side.
static bool add_plot(alb_page *page, const alb_material_check *check, const char *path, alb_error *error)
{
    static const char *const colours[] = {"#c8372d", "#2b8a3e", "#2b5fb8"};
    alb_curve curves[ALB_SIDES][6];
    alb_panel panels[ALB_SIDES];
    char labels[ALB_SIDES * 3][32];
    size_t total = 0, used = 0, counts[ALB_SIDES] = {0};
    for (int i = 0; i < check->count; i++)
        total += check->profiles[i].count;
    double *fit = alb_allocate(total, sizeof *fit, error);
    if (!fit)
        return false;
    for (int i = 0; i < check->count; i++) {
        const alb_profile_check *p = &check->profiles[i];
        const size_t k = counts[p->side], shown = bins_to_show(p);
        snprintf(labels[i], sizeof labels[i], "%s photons \u00b1 sd", p->channel);
        curves[p->side][k] = (alb_curve){.label = labels[i],
                                         .colour = colours[k / 2],
                                         .x = p->r_mm,
                                         .y = p->value_per_mm2,
                                         .sd = p->sd_per_mm2,
                                         .count = shown,
                                         .mark = ALB_MARK_POINTS};
        for (size_t b = 0; b < shown; b++)
            fit[used + b] = p->measured ? alb_profile_value(&p->fitted.profile, p->r_mm[b]) : (double)NAN;
        curves[p->side][k + 1] = (alb_curve){.label = p->measured ? "fit" : NULL,
                                             .colour = colours[k / 2],
                                             .x = p->r_mm,
                                             .y = fit + used,
                                             .count = shown,
                                             .mark = ALB_MARK_LINE};
        counts[p->side] += 2;
        used += p->count;
    }
    for (int side = 0; side < ALB_SIDES; side++)
        panels[side] = (alb_panel){.title = side ? "Transmission" : "Reflection",
                                   .x_label = "r (mm)",
                                   .y_label = "S(r) (1/mm\u00b2)",
                                   .log_y = true,
                                   .curves = curves[side],
                                   .curve_count = counts[side],
                                   .height = 1};
    const bool ok = alb_plot_write(path, panels, ALB_SIDES, 900, 720, error) &&
                    alb_page_picture(page, path,
                                     "Radiant exitance per incident flux: what the photons did, as far as they know it "
                                     "to half its value, and what "
                                     "was fitted",
                                     error);
    free(fit);
    return ok;
}

bool alb_material_check_draw(alb_page *page, const alb_material_check *check, const char *folder, const char *stem,
                             alb_error *error)
{
    char name[64], path[ALB_PATH_SIZE];
    snprintf(name, sizeof name, "%s_profiles.svg", stem);
    if (!alb_path_join(path, folder, name, error))
        return false;
    add_table(page, check);
    alb_page_begin_pictures(page);
    const bool ok = add_plot(page, check, path, error);
    alb_page_end_pictures(page);
    return ok;
}

void alb_material_check_put(alb_json *json, const alb_material_check *check)
{
    alb_json_string(json, "name", check->name);
    alb_json_list(json, "totals");
    for (int i = 0; i < check->count; i++) {
        const alb_profile_check *p = &check->profiles[i];
        alb_json_object(json, NULL);
        alb_json_string(json, "side", alb_side_names[p->side]);
        alb_json_string(json, "channel", p->channel);
        alb_json_estimate(json, "true_total", p->total, p->total_sd);
        alb_json_boolean(json, "measured", p->measured);
        if (p->measured) {
            alb_json_estimate(json, "recovered_total", p->fitted.total, p->fitted.total_sd);
            alb_json_number(json, "deviation_percent", p->deviation_percent);
            alb_json_number(json, "deviation_in_sd", p->deviation_sd);
            alb_json_string(json, "form", alb_form_name(p->fitted.profile.form));
            alb_json_boolean(json, "identifiable", p->fitted.identifiable);
            alb_json_number(json, "curve_relative_rms", p->curve_rms);
            alb_json_integer(json, "curve_bins", p->bins);
            alb_json_number(json, "curve_from_mm", p->from_mm);
            alb_json_number(json, "curve_to_mm", p->to_mm);
        }
        alb_json_end_object(json);
    }
    alb_json_end_list(json);
}
