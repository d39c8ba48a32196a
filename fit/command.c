// alabaster fit: readings of a lit spot -> material.
#include "base/command.h"
#include "base/memory.h"
#include "fit/report_tables.h"
#include "fit/source.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char usage[] =
    "usage: alabaster fit SESSION [--anisotropy G] [-o DIR] [--json]\n"
    "       alabaster fit --image R.exr [--transmission T.exr] --mm-per-pixel S [SPOT] [CURVED] -o DIR [--json]\n"
    "       alabaster fit --table PROFILE.csv --side reflection|transmission -o DIR [--json]\n"
    "\n"
    "Fits per channel and side the profile S(r), radiant exitance per incident flux, 1/mm^2, with the simplest\n"
    "form that the noise does not reject. Writes DIR/material.json and DIR/report/fit.html, fit.json, fit.svg,\n"
    "fit.csv. DIR is SESSION where it is not given.\n"
    "\n"
    "Where the session holds a grid of spots on the slab and no single one, every spot is fitted: DIR/map/*.exr,\n"
    "map.json, report/map.html, and the mean as material.json. It says whether the sample is alike everywhere.\n"
    "\n"
    "Images are looked at square on and hold radiant exitance per incident flux in 1/mm^2; in another unit the\n"
    "amplitudes and totals are in that unit. Pixels average S, lit by SPOT, over squares. SPOT is --spot-radius-mm P\n"
    "(a flat disc; 0, the default: a pencil beam), --spot-gaussian-mm W (irradiance falls to 1/e^2 at W) or\n"
    "--spot-image WHITE.exr (its photograph on an opaque white face). CURVED is --curvature-radius-mm R (a sphere "
    "that\n"
    "bulges towards the camera) and --distance chord|arc: through the sample (default) or along its surface.\n"
    "A table has the columns r_mm,value_per_mm2 and optionally sd_per_mm2.\n"
    "\n"
    "Of a slab of known thickness and index seen from both sides it gives absorption and reduced scattering by\n"
    "radiative transfer, with the scattering anisotropy G (Henyey-Greenstein's g, 0 where it is not given) assumed.\n"
    "\n"
    "Exit code 5: the data do not decide; the files hold the best guess, marked so, and say why.";

typedef struct request {
    const char *session, *reflection, *transmission, *table, *side, *out;
    alb_image_setting setting;
    double anisotropy;
    bool as_json;
} request;

// What goes with images alone, as it was typed.
typedef struct image_texts {
    const char *pixel, *radius, *gaussian, *curvature, *distance;
} image_texts;

static bool check_images(request *r, const image_texts *t, alb_error *error)
{
    alb_image_setting *setting = &r->setting;
    const char *extra = t->radius             ? "--spot-radius-mm"
                        : t->gaussian         ? "--spot-gaussian-mm"
                        : setting->spot_image ? "--spot-image"
                        : t->curvature        ? "--curvature-radius-mm"
                                              : NULL;
    if (extra && !r->reflection && !r->transmission)
        return alb_fail(error, ALB_USAGE, "%s goes with --image", extra);
    if ((t->radius != NULL) + (t->gaussian != NULL) + (setting->spot_image != NULL) > 1)
        return alb_fail(error, ALB_USAGE,
                        "one of --spot-radius-mm, --spot-gaussian-mm and --spot-image says what lights");
    if (t->distance && !t->curvature)
        return alb_fail(error, ALB_USAGE, "--distance goes with --curvature-radius-mm");
    if (t->distance && strcmp(t->distance, alb_distance_names[0]) != 0 &&
        strcmp(t->distance, alb_distance_names[1]) != 0)
        return alb_fail(error, ALB_USAGE, "--distance %.40s: chord or arc is wanted", t->distance);
    setting->distance = t->distance && strcmp(t->distance, alb_distance_names[ALB_DISTANCE_ARC]) == 0
                            ? ALB_DISTANCE_ARC
                            : ALB_DISTANCE_CHORD;
    return (!t->pixel || alb_option_number(&setting->mm_per_pixel, "--mm-per-pixel", t->pixel, 1e-9, 1e9, error)) &&
           (!t->radius || alb_option_number(&setting->spot_radius_mm, "--spot-radius-mm", t->radius, 0, 1e9, error)) &&
           (!t->gaussian ||
            alb_option_number(&setting->spot_gaussian_mm, "--spot-gaussian-mm", t->gaussian, 1e-9, 1e9, error)) &&
           (!t->curvature ||
            alb_option_number(&setting->curvature_radius_mm, "--curvature-radius-mm", t->curvature, 1e-9, 1e9, error));
}

static bool check_request(request *r, const image_texts *texts, const char *anisotropy, alb_error *error)
{
    const bool images = r->reflection || r->transmission;
    if ((r->session != NULL) + images + (r->table != NULL) != 1)
        return alb_fail(error, ALB_USAGE,
                        "one of SESSION, --image and --table is wanted; 'alabaster help fit' tells more");
    if (images != (texts->pixel != NULL))
        return alb_fail(error, ALB_USAGE,
                        images ? "--image wants --mm-per-pixel: millimetres on the face between pixels"
                               : "--mm-per-pixel goes with --image");
    if (anisotropy && !r->session)
        return alb_fail(error, ALB_USAGE, "--anisotropy goes with SESSION");
    if ((r->table != NULL) != (r->side != NULL))
        return alb_fail(error, ALB_USAGE, "--table wants --side reflection or --side transmission, and only it does");
    if (r->side && strcmp(r->side, alb_side_names[0]) != 0 && strcmp(r->side, alb_side_names[1]) != 0)
        return alb_fail(error, ALB_USAGE, "--side %.40s: reflection or transmission is wanted", r->side);
    if (!r->session && !r->out)
        return alb_fail(error, ALB_USAGE, "-o DIR is wanted: where material.json goes");
    if (!r->out)
        r->out = r->session;
    return check_images(r, texts, error) &&
           (!anisotropy || alb_option_number(&r->anisotropy, "--anisotropy", anisotropy, -0.95, 0.95, error));
}

static void print_outcome(const alb_fitting *fitting, alb_side side, int c)
{
    const alb_outcome *outcome = &fitting->sides[side][c].outcome;
    const alb_fitted *fitted = &outcome->fitted;
    char sd[ALB_SD_TEXT_SIZE];
    printf("%-12s %-2s %-19s total %.5g %s  chi-square %.4g / %d  rms %.2f %%%s\n", alb_side_names[side],
           fitting->material.channel_names[c], alb_form_name(fitted->profile.form), fitted->total,
           alb_sd_text(sd, "+-", fitted->total_sd), fitted->chi_square, fitted->degrees_of_freedom,
           100 * outcome->rms_relative, fitted->identifiable ? "" : "  NOT DECIDED");
    for (int p = 0; p < alb_form_parameter_count(fitted->profile.form); p++)
        printf("%16s%-22s %.5g %s\n", "", alb_form_parameter_name(fitted->profile.form, p),
               fitted->profile.parameters[p], alb_sd_text(sd, "+-", fitted->sd[p]));
    printf("%16sd ln S / dr %.5g %s per mm from %.4g to %.4g mm\n", "", outcome->slope_per_mm,
           alb_sd_text(sd, "+-", outcome->slope_sd), outcome->slope_from_mm, outcome->slope_to_mm);
}

static void print_spread(const char *name, const alb_spread *spread, double wanted)
{
    printf("%16s%-10s %.5g +- %.2g  between spots %.2g  chi-square %.4g / %d  %s\n", "", name, spread->mean,
           spread->mean_sd, spread->between, spread->chi_square, spread->count - 1,
           spread->tail < wanted ? "DIFFERS" : "alike");
}

static void print_map(const alb_map *map, const alb_material *material)
{
    for (int side = 0; side < ALB_SIDES; side++)
        for (int c = 0; c < material->channels && map->layers[side][c].spots; c++) {
            const alb_map_layer *layer = &map->layers[side][c];
            printf("%-12s %-2s %-19s %d of %d x %d spots\n", alb_side_names[side], material->channel_names[c],
                   alb_form_name(layer->candidate.form), layer->total.count, map->columns, map->rows);
            print_spread("total", &layer->total, map->tail_wanted);
            print_spread("half in mm", &layer->half, map->tail_wanted);
        }
    printf("the sample is %s everywhere\n", map->heterogeneous ? "NOT ALIKE" : "alike");
}

static void note_border(const alb_fitting *fitting, alb_side side, alb_text *notes)
{
    double complete_mm = INFINITY;
    for (int c = 0; c < fitting->material.channels; c++) {
        const alb_readings *readings = &fitting->sides[side][c].readings;
        if (fitting->sides[side][c].measured && readings->outer_mm > readings->complete_mm)
            complete_mm = fmin(complete_mm, readings->complete_mm);
    }
    if (isfinite(complete_mm))
        alb_text_add(notes, "%s: rings beyond %.4g mm are cut by the border of the image.\n", alb_side_names[side],
                     complete_mm);
}

// What a reader should know; *failure is filled with the first reason not to trust the result.
static void examine(alb_fitting *fitting, bool absolute, alb_text *notes, alb_error *failure)
{
    const alb_material *material = &fitting->material;
    for (int side = 0; side < ALB_SIDES; side++)
        note_border(fitting, (alb_side)side, notes);
    for (int c = 0; c < material->channels; c++) {
        alb_properties_note(notes, material->channel_names[c], &fitting->properties[c]);
        double total = 0;
        bool held = false;
        for (int side = 0; side < ALB_SIDES; side++) {
            const alb_measurement *measurement = &fitting->sides[side][c];
            if (!measurement->measured)
                continue;
            const alb_outcome *outcome = &measurement->outcome;
            total += outcome->free_total;
            if (outcome->discrepancy_relative > 0)
                alb_text_add(notes,
                             "%s %s: no decided form fits within the noise. %s misses by %.2g %% relative, which is in "
                             "the sd; the "
                             "measured energy is kept.\n",
                             alb_side_names[side], material->channel_names[c],
                             alb_form_name(outcome->fitted.profile.form), 100 * outcome->discrepancy_relative);
            if (outcome->offset_sd > 0)
                alb_text_add(notes,
                             "%s %s: a constant of %.4g +- %.2g was in all readings (stray light, or the "
                             "background) and is taken off.\n",
                             alb_side_names[side], material->channel_names[c], outcome->offset, outcome->offset_sd);
            if (*outcome->offset_instead)
                alb_text_add(notes, "%s %s: %s.\n", alb_side_names[side], material->channel_names[c],
                             outcome->offset_instead);
            held |= outcome->fitted.total < outcome->free_total;
            if (outcome->fitted.total < outcome->free_total)
                alb_text_add(notes,
                             "%s %s: the total of the best fit is %.4g; held at %.4g, so that no more leaves than came "
                             "in, chi-square rises by %.3g.\n",
                             alb_side_names[side], material->channel_names[c], outcome->free_total,
                             outcome->fitted.total, outcome->energy_rise);
            if (!outcome->fitted.identifiable)
                alb_fail(failure, ALB_UNDECIDED, "%s %s: the data do not decide: %s; the best guess is written",
                         alb_side_names[side], material->channel_names[c], outcome->undecided);
        }
        if (!absolute && !held && total > 1)
            alb_text_add(
                notes, "%s: the total of the sides is %.4g, more than 1: in units of the incident flux it cannot be.\n",
                material->channel_names[c], total);
    }
}

static bool fit_request(alb_fitting *fitting, alb_map *map, alb_provenance *provenance, alb_text *notes,
                        const request *r, alb_error *error)
{
    if (r->session) {
        snprintf(provenance->options, sizeof provenance->options, "--anisotropy %.9g", r->anisotropy);
        return alb_fitting_from_session(fitting, map, provenance, notes, r->session, error);
    }
    if (r->table) {
        snprintf(provenance->options, sizeof provenance->options, "--table %s --side %s", alb_path_name(r->table),
                 r->side);
        return alb_fitting_from_table(
            fitting, provenance, r->table,
            strcmp(r->side, alb_side_names[ALB_REFLECTION]) == 0 ? ALB_REFLECTION : ALB_TRANSMISSION, error);
    }
    const char *const paths[ALB_SIDES] = {r->reflection, r->transmission};
    const alb_image_setting *setting = &r->setting;
    alb_text options = {0};
    alb_text_add(&options, "--mm-per-pixel %.9g", setting->mm_per_pixel);
    if (setting->spot_image)
        alb_text_add(&options, " --spot-image %s", alb_path_name(setting->spot_image));
    else if (setting->spot_gaussian_mm > 0)
        alb_text_add(&options, " --spot-gaussian-mm %.9g", setting->spot_gaussian_mm);
    else
        alb_text_add(&options, " --spot-radius-mm %.9g", setting->spot_radius_mm);
    if (setting->curvature_radius_mm > 0)
        alb_text_add(&options, " --curvature-radius-mm %.9g --distance %s", setting->curvature_radius_mm,
                     alb_distance_names[setting->distance]);
    for (int side = 0; side < ALB_SIDES; side++)
        if (paths[side])
            alb_text_add(&options, "%s%s", side == ALB_REFLECTION ? " --image " : " --transmission ",
                         alb_path_name(paths[side]));
    snprintf(provenance->options, sizeof provenance->options, "%s", options.bytes ? options.bytes : "");
    alb_text_free(&options);
    return alb_fitting_from_images(fitting, provenance, notes, paths, setting, error);
}

static bool write_results(const alb_fitting *fitting, const alb_map *map, const alb_provenance *provenance,
                          const alb_text *notes, const request *r, alb_error *error)
{
    const char *said = notes->bytes ? notes->bytes : "";
    if (!alb_file_make_directory(r->out, error))
        return false;
    alb_files_gather();
    const bool written = (map->columns ? alb_map_write(map, fitting, provenance, said, r->out, error)
                                       : alb_fitting_report(fitting, provenance, said, r->out, error)) &&
                         alb_material_write(fitting, provenance, r->out, error);
    if (!alb_files_settle(written, error) || !written)
        return false;
    if (r->as_json) {
        alb_json json;
        alb_json_begin(&json, provenance);
        alb_material_put(&json, fitting);
        return alb_json_print(&json, error);
    }
    if (map->columns) {
        print_map(map, &fitting->material);
        return true;
    }
    for (int side = 0; side < ALB_SIDES; side++)
        for (int c = 0; c < fitting->material.channels; c++)
            if (fitting->sides[side][c].measured)
                print_outcome(fitting, (alb_side)side, c);
    return true;
}

static bool run(int argc, char **argv, alb_error *error)
{
    request r = {0};
    image_texts texts = {0};
    const char *anisotropy = NULL;
    const alb_option options[] = {{NULL, "SESSION", false, &r.session, NULL},
                                  {"--image", NULL, false, &r.reflection, NULL},
                                  {"--transmission", NULL, false, &r.transmission, NULL},
                                  {"--mm-per-pixel", NULL, false, &texts.pixel, NULL},
                                  {"--spot-radius-mm", NULL, false, &texts.radius, NULL},
                                  {"--spot-gaussian-mm", NULL, false, &texts.gaussian, NULL},
                                  {"--spot-image", NULL, false, &r.setting.spot_image, NULL},
                                  {"--curvature-radius-mm", NULL, false, &texts.curvature, NULL},
                                  {"--distance", NULL, false, &texts.distance, NULL},
                                  {"--table", NULL, false, &r.table, NULL},
                                  {"--side", NULL, false, &r.side, NULL},
                                  {"--anisotropy", NULL, false, &anisotropy, NULL},
                                  {"-o", NULL, false, &r.out, NULL},
                                  {"--json", NULL, false, NULL, &r.as_json}};
    if (!alb_options_read(options, sizeof options / sizeof options[0], argc, argv, error) ||
        !check_request(&r, &texts, anisotropy, error))
        return false;
    alb_provenance provenance = {.command = "fit"};
    alb_text notes = {0};
    alb_error failure = {0};
    alb_map map = {0};
    alb_fitting *fitting = alb_allocate(1, sizeof *fitting, error);
    if (fitting)
        fitting->basis.anisotropy = r.anisotropy;
    bool ok = fitting && fit_request(fitting, &map, &provenance, &notes, &r, error);
    if (ok) {
        examine(fitting, r.session != NULL, &notes, &failure);
        if (notes.bytes)
            fputs(notes.bytes, stderr);
        ok = write_results(fitting, &map, &provenance, &notes, &r, error);
    }
    if (ok && failure.status != ALB_OK)
        ok = alb_fail(error, failure.status, "%s", failure.text);
    if (fitting)
        alb_fitting_free(fitting);
    free(fitting);
    alb_map_free(&map);
    alb_text_free(&notes);
    return ok;
}

const alb_command alb_fit_command = {"fit", "readings of a lit spot -> material (material.json)", usage, run};
