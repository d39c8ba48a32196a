// material.json: written by fit, read strictly by render.
#include "base/record.h"
#include "fit/ballistic.h"
#include "fit/energy.h"
#include "fit/material_check.h"
#include "fit/offset.h"
#include "fit/profile.h"
#include "fit/search.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

void alb_fitting_find_properties(alb_fitting *fitting)
{
    for (int i = 0; i < ALB_SIDES * 3; i++)
        fitting->basis.common_sd[i / 3][i % 3] = fitting->sides[i / 3][i % 3].common.flux;
    alb_properties_find(fitting->properties, &fitting->material, &fitting->basis);
    for (int c = 0; c < 3; c++) {
        const alb_optical *optical = &fitting->properties[c].optical;
        fitting->material.optical[c] =
            (alb_optical_estimate){fitting->properties[c].known && !fitting->properties[c].half_space,
                                   optical->absorption_per_mm, optical->reduced_scattering_per_mm};
    }
}

// The same slabs by their images. The anisotropy is the caller's guess: left open, as far as the images decide it.
static void find_images(alb_fitting *fitting)
{
    const double anisotropy_sd = 0.5;
    if (!fitting->absolute || !(fitting->material.thickness_mm > 0) || fitting->basis.finish != ALB_FINISH_SMOOTH)
        return;
    for (int c = 0; c < fitting->material.channels; c++) {
        alb_joint_side sides[ALB_SIDES] = {{0}};
        for (int side = 0; side < ALB_SIDES; side++)
            if (fitting->sides[side][c].measured)
                sides[side] = (alb_joint_side){&fitting->sides[side][c].readings, &fitting->sides[side][c].forward};
        const alb_joint_known known = {
            fitting->material.thickness_mm,   fitting->material.refractive_index,
            fitting->basis.anisotropy,        anisotropy_sd,
            fitting->sides[0][c].common.flux, hypot(fitting->basis.own_sd[0][c], fitting->basis.own_sd[1][c])};
        if (sides[ALB_REFLECTION].readings && sides[ALB_TRANSMISSION].readings)
            alb_image_properties_find(&fitting->properties[c].images, sides, &known);
    }
}

// What is not a round spot is not decided, whatever the noise makes of a curve through it: more than a third of the
// pixels left out, three quarters of the light beyond the border of the image, or the best form a factor of two off.
static void doubt(alb_outcome *outcome, const alb_readings *readings)
{
    if (!outcome->fitted.identifiable)
        return;
    const double beyond =
        readings->complete_mm > 0
            ? 1 - 2 * M_PI * alb_profile_disc(&outcome->fitted.profile, readings->complete_mm) / outcome->fitted.total
            : 0;
    if (2 * readings->glints > readings->pixels)
        snprintf(outcome->undecided, sizeof outcome->undecided,
                 "%ld of %ld pixels had to be left out as glints, dust or veins: the light is not that of a round spot",
                 readings->glints, readings->pixels + readings->glints);
    else if (beyond > 0.75)
        snprintf(
            outcome->undecided, sizeof outcome->undecided,
            "the border of the image is %.4g mm from the spot, %.2g %% of its light lies beyond: bring the spot to "
            "the middle of the picture, or more of the face into it",
            readings->complete_mm, 100 * beyond);
    else if (outcome->discrepancy_relative > 1)
        snprintf(outcome->undecided, sizeof outcome->undecided,
                 "no form comes nearer to the readings than %.2g %%: this is not the light of a spot",
                 100 * outcome->discrepancy_relative);
    outcome->fitted.identifiable = !*outcome->undecided;
}

bool alb_fitting_run(alb_fitting *fitting, alb_error *error)
{
    alb_error reasons[ALB_SIDES * 3] = {{0}};
#pragma omp parallel for schedule(dynamic)
    for (int i = 0; i < ALB_SIDES * 3; i++) {
        alb_measurement *measurement = &fitting->sides[i / 3][i % 3];
        if (!measurement->forward.grid_mm)
            continue;
        measurement->measured =
            alb_offset_choose(measurement, &reasons[i]) &&
            (i / 3 != ALB_TRANSMISSION || alb_ballistic_find(&measurement->outcome, &measurement->readings,
                                                             &measurement->forward, measurement->common, &reasons[i]));
        if (measurement->measured)
            doubt(&measurement->outcome, &measurement->readings);
    }
    for (int i = 0; i < ALB_SIDES * 3; i++)
        if (reasons[i].status != ALB_OK)
            return alb_fail(error, reasons[i].status, "%s %s: %s", alb_side_names[i / 3],
                            fitting->material.channel_names[i % 3], reasons[i].text);
    for (int c = 0; c < fitting->material.channels; c++)
        if (!alb_energy_hold(fitting, c, error))
            return false;
    for (int i = 0; i < ALB_SIDES * 3; i++)
        if (fitting->sides[i / 3][i % 3].measured)
            fitting->material.fitted[i / 3][i % 3] = fitting->sides[i / 3][i % 3].outcome.fitted;
    alb_fitting_find_properties(fitting);
    find_images(fitting);
    return true;
}

void alb_fitting_free(alb_fitting *fitting)
{
    for (int side = 0; side < ALB_SIDES; side++)
        for (int channel = 0; channel < 3; channel++) {
            alb_readings_free(&fitting->sides[side][channel].readings);
            alb_operator_free(&fitting->sides[side][channel].forward);
        }
    *fitting = (alb_fitting){0};
}

static void put_attempts(alb_json *json, const alb_outcome *outcome)
{
    alb_json_list(json, "tried");
    for (int i = 0; i < outcome->attempt_count; i++) {
        const alb_attempt *attempt = &outcome->attempts[i];
        alb_json_object(json, NULL);
        alb_json_string(json, "form", alb_form_name(attempt->form));
        if (attempt->tied)
            alb_json_number(json, "decay_ratio_held", ALB_TIED_RATIO);
        alb_json_number(json, "chi_square", attempt->chi_square);
        alb_json_integer(json, "degrees_of_freedom", attempt->degrees_of_freedom);
        alb_json_number(json, "p_value", attempt->p_value);
        alb_json_number(json, "bic", attempt->bic);
        alb_json_number(json, "bic_excess", attempt->bic_excess);
        alb_json_number(json, "residual_lag_1", attempt->lag_1);
        alb_json_number(json, "residual_lag_1_p_value", attempt->lag_1_p);
        if (attempt->at_bound >= 0)
            alb_json_string(json, "at_bound", alb_form_parameter_name(attempt->form, attempt->at_bound));
        alb_json_string(json, "rejected", attempt->rejected);
        alb_json_end_object(json);
    }
    alb_json_end_list(json);
}

// An estimate with its 95 % interval (null: an open end), the Cramer-Rao bound, and whether the data identify it.
static void put_known(alb_json *json, const char *key, double value, double sd, const alb_certainty *certainty,
                      bool with_reason)
{
    const double interval[2] = {certainty->lower, certainty->upper};
    alb_json_object(json, key);
    alb_json_number(json, "value", value);
    alb_json_number(json, "sd", sd);
    alb_json_numbers(json, "interval_95", interval, 2);
    alb_json_number(json, "cramer_rao_sd", certainty->cramer_rao_sd);
    if (with_reason)
        alb_json_boolean(json, "identifiable", !*certainty->because);
    if (*certainty->because)
        alb_json_string(json, "because", certainty->because);
    alb_json_end_object(json);
}

static void put_outcome(alb_json *json, const char *side, const alb_outcome *outcome)
{
    const alb_fitted *fitted = &outcome->fitted;
    const int n = alb_form_parameter_count(fitted->profile.form);
    alb_json_object(json, side);
    alb_json_string(json, "form", alb_form_name(fitted->profile.form));
    if (outcome->tied)
        alb_json_number(json, "decay_ratio_held", ALB_TIED_RATIO);
    alb_json_boolean(json, "identifiable", fitted->identifiable);
    if (!fitted->identifiable) {
        alb_json_boolean(json, "best_guess", true);
        alb_json_string(json, "undecided", outcome->undecided);
    }
    alb_json_object(json, "parameters");
    for (int p = 0; p < n; p++)
        put_known(json, alb_form_parameter_name(fitted->profile.form, p), fitted->profile.parameters[p], fitted->sd[p],
                  &outcome->knowledge.parameters[p], true);
    alb_json_end_object(json);
    alb_json_list(json, "covariance");
    for (int p = 0; p < n; p++)
        alb_json_numbers(json, NULL, fitted->covariance[p], (size_t)n);
    alb_json_end_list(json);
    alb_json_number(json, "condition", outcome->knowledge.condition);
    alb_certainty known = outcome->knowledge.total;
    const bool undecided = !isfinite(fitted->total_sd);
    if (undecided)
        snprintf(known.because, sizeof known.because, "%.*s", ALB_BECAUSE_SIZE - 1, outcome->undecided);
    put_known(json, "total", fitted->total, fitted->total_sd, &known, undecided);
    alb_json_number(json, "total_without_inner_fifth", outcome->sensitivity.without_inner);
    alb_json_number(json, "total_without_outer_fifth", outcome->sensitivity.without_outer);
    if (outcome->offset_sd > 0)
        alb_json_estimate(json, "offset_per_mm2", outcome->offset, outcome->offset_sd);
    if (*outcome->offset_instead)
        alb_json_string(json, "offset_instead", outcome->offset_instead);
    if (fitted->total < outcome->free_total) {
        alb_json_object(json, "energy_held");
        alb_json_number(json, "free_total", outcome->free_total);
        alb_json_number(json, "chi_square_rise", outcome->energy_rise);
        alb_json_end_object(json);
    }
    alb_json_number(json, "chi_square", fitted->chi_square);
    alb_json_integer(json, "degrees_of_freedom", fitted->degrees_of_freedom);
    alb_json_string(json, "errors_from",
                    outcome->discrepancy_relative > 0
                        ? "no decided form fits within the noise: relative discrepancy in quadrature with "
                          "the noise, measured energy kept as a reading of its own"
                        : "the noise alone");
    alb_json_number(json, "discrepancy_relative", outcome->discrepancy_relative);
    alb_json_number(json, "rms_relative", outcome->rms_relative);
    if (outcome->ballistic_share > 0) {
        alb_json_estimate(json, "ballistic_share", outcome->ballistic_share, outcome->ballistic_sd);
        alb_json_number(json, "left_out_to_mm", outcome->ballistic_to_mm);
    }
    alb_json_number(json, "measured_share_of_total", outcome->measured_share);
    alb_json_object(json, "tail_slope_per_mm");
    alb_json_number(json, "value", outcome->slope_per_mm);
    alb_json_number(json, "sd", outcome->slope_sd);
    alb_json_number(json, "from_mm", outcome->slope_from_mm);
    alb_json_number(json, "to_mm", outcome->slope_to_mm);
    alb_json_end_object(json);
    put_attempts(json, outcome);
    alb_json_end_object(json);
}

void alb_material_put(alb_json *json, const alb_fitting *fitting)
{
    const alb_material *material = &fitting->material;
    alb_json_string(json, "name", material->name);
    if (material->thickness_mm > 0)
        alb_json_number(json, "thickness_mm", material->thickness_mm);
    if (material->refractive_index > 0)
        alb_json_number(json, "refractive_index", material->refractive_index);
    if (material->finish_known)
        alb_json_string(json, "finish", alb_finish_names[material->finish]);
    alb_json_object(json, "channels");
    for (int c = 0; c < material->channels; c++) {
        alb_json_object(json, material->channel_names[c]);
        for (int side = 0; side < ALB_SIDES; side++)
            if (fitting->sides[side][c].measured)
                put_outcome(json, alb_side_names[side], &fitting->sides[side][c].outcome);
        alb_properties_put(json, &fitting->properties[c]);
        alb_json_end_object(json);
    }
    alb_json_end_object(json);
}

bool alb_material_write(const alb_fitting *fitting, const alb_provenance *provenance, const char *folder,
                        alb_error *error)
{
    char path[ALB_PATH_SIZE];
    if (!alb_path_join(path, folder, "material.json", error))
        return false;
    alb_json json;
    alb_json_begin(&json, provenance);
    alb_material_put(&json, fitting);
    return alb_json_write(&json, path, error);
}

alb_exit alb_material_exit(const alb_material *material, alb_side side)
{
    return material->finish_known && material->refractive_index >= 1
               ? alb_exit_of(side, material->finish, material->refractive_index)
               : (alb_exit){0};
}

static bool check_profile(const alb_profile *profile, alb_node node, alb_error *error)
{
    const double *p = profile->parameters;
    return alb_profile_sound(profile) ||
           alb_node_fail(error, node, "parameters",
                         "not a positive profile that falls off: %s (%g, %g, %g, %g, %g, %g)",
                         alb_form_name(profile->form), p[0], p[1], p[2], p[3], p[4], p[5]);
}

// No variance below zero, and no two parameters correlated by more than 1.
static bool check_covariance(const alb_fitted *fitted, int n, alb_node node, alb_error *error)
{
    for (int p = 0; p < n; p++)
        for (int q = 0; q <= p; q++) {
            const double here = fitted->covariance[p][q], there = fitted->covariance[q][p],
                         most = sqrt(fitted->covariance[p][p]) * sqrt(fitted->covariance[q][q]);
            if (!(fabs(here) <= most * (1 + 1e-6)) || !(fabs(here - there) <= most * 1e-6))
                return alb_node_fail(error, node, "covariance", "rows %d and %d do not make a covariance (%g and %g)",
                                     q + 1, p + 1, here, there);
        }
    return true;
}

static bool read_parameters(alb_fitted *fitted, alb_node node, alb_error *error)
{
    alb_profile *profile = &fitted->profile;
    const int n = alb_form_parameter_count(profile->form);
    alb_node parameters, one, rows;
    size_t row_count;
    char names[256] = "";
    if (!alb_node_object(&parameters, node, "parameters", error))
        return false;
    for (int p = 0; p < n; p++) {
        const char *name = alb_form_parameter_name(profile->form, p);
        strncat(strncat(names, name, 60), " ", 2);
        if (!alb_estimate_check(parameters, name, error) || !alb_node_object(&one, parameters, name, error) ||
            !alb_node_number(&profile->parameters[p], one, "value", -1e300, 1e300, error) ||
            (fitted->identifiable && !alb_node_number(&fitted->sd[p], one, "sd", 0, 1e300, error)))
            return false;
    }
    if (!alb_node_allow(parameters, names, error) || !check_profile(profile, node, error))
        return false;
    if (!fitted->identifiable)
        return true;
    if (!alb_node_list(&rows, &row_count, node, "covariance", error))
        return false;
    if (row_count != (size_t)n)
        return alb_node_fail(error, node, "covariance", "%zu rows for %d parameters", row_count, n);
    for (size_t p = 0; p < row_count; p++)
        if (!alb_node_item_numbers(fitted->covariance[p], row_count, rows, p, -1e300, 1e300, error))
            return false;
    return check_covariance(fitted, n, node, error);
}

static bool read_fitted(alb_fitted *fitted, alb_node node, alb_error *error)
{
    const char *form;
    long freedom;
    alb_node total;
    if (!alb_node_allow(node,
                        "form decay_ratio_held identifiable best_guess undecided parameters covariance condition total "
                        "total_without_inner_fifth total_without_outer_fifth offset_per_mm2 offset_instead energy_held "
                        "chi_square degrees_of_freedom errors_from discrepancy_relative rms_relative "
                        "ballistic_share left_out_to_mm measured_share_of_total tail_slope_per_mm tried",
                        error) ||
        !alb_node_text(&form, node, "form", error))
        return false;
    if (!alb_form_from_name(&fitted->profile.form, form))
        return alb_node_fail(error, node, "form", "unknown form '%s'", form);
    if (!alb_node_boolean(&fitted->identifiable, node, "identifiable", error) ||
        !read_parameters(fitted, node, error) || !alb_estimate_check(node, "total", error) ||
        !alb_outcome_check(node, error) || !alb_node_object(&total, node, "total", error) ||
        !alb_node_number(&fitted->total, total, "value", 0, 1e300, error) ||
        (fitted->identifiable && !alb_node_number(&fitted->total_sd, total, "sd", 0, 1e300, error)) ||
        !alb_node_number(&fitted->chi_square, node, "chi_square", 0, 1e300, error) ||
        !alb_node_integer(&freedom, node, "degrees_of_freedom", 0, 1000000000, error))
        return false;
    fitted->degrees_of_freedom = (int)freedom;
    const double expected = alb_profile_total(&fitted->profile);
    if (!isfinite(expected) || fabs(fitted->total - expected) > 1e-6 * expected)
        return alb_node_fail(error, node, "total", "%g does not belong to the parameters, whose total is %g",
                             fitted->total, expected);
    return true;
}

// Names go into other programs' files as they are.
static const char name_characters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_.";

static bool read_material(alb_material *material, const alb_record *record, alb_error *error)
{
    alb_node root, channels, channel, side_node;
    const char *name;
    if (!alb_record_root(&root, record, error) ||
        !alb_node_allow(root, "format provenance name thickness_mm refractive_index finish channels", error) ||
        !alb_node_text(&name, root, "name", error) || !alb_node_object(&channels, root, "channels", error))
        return false;
    if (strlen(name) >= ALB_NAME_SIZE)
        return alb_node_fail(error, root, "name", "longer than %d characters", ALB_NAME_SIZE - 1);
    snprintf(material->name, sizeof material->name, "%s", name);
    if ((alb_node_has(root, "thickness_mm") &&
         !alb_node_number(&material->thickness_mm, root, "thickness_mm", 0, 1e6, error)) ||
        (alb_node_has(root, "refractive_index") &&
         !alb_node_number(&material->refractive_index, root, "refractive_index", 1, 4, error)) ||
        !alb_finish_read(&material->finish, root, error))
        return false;
    material->finish_known = alb_node_has(root, "finish");
    const size_t count = alb_node_key_count(channels);
    if (count < 1 || count > 3)
        return alb_node_fail(error, root, "channels", "%zu channels; 1 to 3 are possible", count);
    material->channels = (int)count;
    bool measured = false;
    for (size_t c = 0; c < count; c++) {
        const char *key = alb_node_key(channels, c);
        if (!*key || strlen(key) >= sizeof material->channel_names[0] || strspn(key, name_characters) < strlen(key))
            return alb_node_fail(error, channels, key, "a channel's name is 1 to 7 letters, digits, '_' and '.'");
        snprintf(material->channel_names[c], sizeof material->channel_names[0], "%s", key);
        if (!alb_node_object(&channel, channels, key, error) ||
            !alb_node_allow(channel, "reflection transmission optical_properties", error) ||
            !alb_properties_read(&material->optical[c], channel, error))
            return false;
        for (int side = 0; side < ALB_SIDES; side++)
            if (alb_node_has(channel, alb_side_names[side]) &&
                (!alb_node_object(&side_node, channel, alb_side_names[side], error) ||
                 !read_fitted(&material->fitted[side][c], side_node, error)))
                return false;
        measured |= alb_node_key_count(channel) > alb_node_has(channel, "optical_properties");
    }
    return measured || alb_node_fail(error, root, "channels", "no profile of either side in any of them");
}

bool alb_material_read(alb_material *material, const char *path, alb_error *error)
{
    *material = (alb_material){0};
    alb_record *record = alb_record_read(path, error);
    const bool ok = record && read_material(material, record, error);
    alb_record_free(record);
    if (!ok)
        *material = (alb_material){0};
    return ok;
}
