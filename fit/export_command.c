// alabaster export: a material as other programs read it.
#include "base/command.h"
#include "fit/export.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const char usage[] =
    "usage: alabaster export MATERIAL.json --to FORMAT -o FILE [--unit-mm U] [--json]\n"
    "\n"
    "Writes the material for another program. FORMAT is\n"
    "  cycles   Blender: a Python text block that makes the material (Principled BSDF, Burley)\n"
    "  pbrt     pbrt-v4: subsurface material\n"
    "  mitsuba  Mitsuba 3: homogeneous medium behind a dielectric\n"
    "  openpbr  MaterialX: open_pbr_surface\n"
    "  arnold   Arnold: standard_surface, random walk\n"
    "  csv      the profiles of both sides with their sd, in mm\n"
    "One unit of the scene is U millimetres (1 where not given; Blender's metre is 1000). The file says so, and where\n"
    "its numbers come from: Burley's profile with the measured total, and by how much it misses the measured curve;\n"
    "absorption and scattering of the material where it holds them, else those of a half-space with that total.";

static void print_appearance(const alb_appearance *appearance)
{
    for (int c = 0; c < appearance->channels; c++) {
        const alb_appearance_channel *channel = &appearance->channel[c];
        printf("%-2s albedo %.5g  Burley d %.5g mm, misses R by %.2g %% rms, %.2g %% at most  absorption %.5g /mm  "
               "reduced scattering %.5g /mm%s\n",
               appearance->material->channel_names[c], channel->burley.albedo, channel->burley.length_mm,
               100 * expm1(channel->deviation_rms), 100 * expm1(channel->deviation_maximum), channel->absorption_per_mm,
               channel->reduced_scattering_per_mm, channel->medium_source == ALB_MEDIUM_MEASURED ? "" : " (inverted)");
    }
}

static bool print_json(const alb_export *exported, const alb_provenance *provenance, alb_error *error)
{
    alb_json json;
    alb_json_begin(&json, provenance);
    alb_json_string(&json, "name", exported->material->name);
    alb_json_number(&json, "unit_mm", exported->unit_mm);
    alb_json_object(&json, "channels");
    for (int c = 0; c < exported->appearance.channels; c++) {
        const alb_appearance_channel *channel = &exported->appearance.channel[c];
        alb_json_object(&json, exported->material->channel_names[c]);
        alb_json_estimate(&json, "albedo", channel->burley.albedo, channel->albedo_sd);
        alb_json_number(&json, "burley_length_mm", channel->burley.length_mm);
        alb_json_number(&json, "burley_deviation_rms", expm1(channel->deviation_rms));
        alb_json_number(&json, "burley_deviation_maximum", expm1(channel->deviation_maximum));
        alb_json_number(&json, "absorption_per_mm", channel->absorption_per_mm);
        alb_json_number(&json, "reduced_scattering_per_mm", channel->reduced_scattering_per_mm);
        alb_json_boolean(&json, "medium_inverted", channel->medium_source == ALB_MEDIUM_INVERTED);
        alb_json_end_object(&json);
    }
    alb_json_end_object(&json);
    return alb_json_print(&json, error);
}

static bool run(int argc, char **argv, alb_error *error)
{
    const char *path = NULL, *format = NULL, *out = NULL, *unit = NULL;
    bool as_json = false;
    double unit_mm = 1;
    const alb_option options[] = {{NULL, "MATERIAL.json", true, &path, NULL},
                                  {"--to", NULL, true, &format, NULL},
                                  {"-o", NULL, true, &out, NULL},
                                  {"--unit-mm", NULL, false, &unit, NULL},
                                  {"--json", NULL, false, NULL, &as_json}};
    if (!alb_options_read(options, sizeof options / sizeof options[0], argc, argv, error) ||
        (unit && !alb_option_number(&unit_mm, "--unit-mm", unit, 1e-6, 1e9, error)))
        return false;
    const alb_exporter *exporter = alb_exporter_find(format);
    if (!exporter)
        return alb_fail(error, ALB_USAGE, "--to %.40s: 'alabaster help export' lists the formats", format);
    if (unit && !exporter->wants_appearance)
        return alb_fail(error, ALB_USAGE, "--unit-mm does not go with --to %s, which is in millimetres", format);
    if (alb_file_same(path, out))
        return alb_fail(error, ALB_USAGE, "-o %s is the material itself; give the export a name of its own", out);
    alb_provenance provenance = {.command = "export"};
    snprintf(provenance.options, sizeof provenance.options, "--to %s --unit-mm %.9g", format, unit_mm);
    alb_material material;
    alb_export exported;
    alb_text text = {0};
    bool ok = alb_file_check_target(out, error) && alb_material_read(&material, path, error) &&
              alb_export_prepare(&exported, exporter, &material, path, unit_mm, error) &&
              alb_provenance_add(&provenance, path, error);
    if (ok) {
        exporter->put(&text, &exported);
        ok = alb_file_write_text(out, &text, error);
    }
    alb_text_free(&text);
    if (ok && as_json)
        return print_json(&exported, &provenance, error);
    if (ok)
        print_appearance(&exported.appearance);
    return ok;
}

const alb_command alb_export_command = {"export", "material -> what Blender, pbrt, Mitsuba, ... read", usage, run};
