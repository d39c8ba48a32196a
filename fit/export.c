// The table of formats, and what all of them say.
#include "fit/export.h"
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

const alb_exporter alb_exporters[] = {
    {"cycles", "Blender: a Python text block that makes the material (Principled BSDF, Burley)", true,
     alb_export_put_cycles},
    {"pbrt", "pbrt-v4: subsurface material", true, alb_export_put_pbrt},
    {"mitsuba", "Mitsuba 3: homogeneous medium behind a dielectric", true, alb_export_put_mitsuba},
    {"openpbr", "MaterialX: open_pbr_surface", true, alb_export_put_openpbr},
    {"arnold", "Arnold: standard_surface, random walk", true, alb_export_put_arnold},
    {"csv", "the profiles of both sides with their sd, in mm", false, alb_export_put_csv},
};
const int alb_exporter_count = sizeof alb_exporters / sizeof alb_exporters[0];

const alb_exporter *alb_exporter_find(const char *name)
{
    for (int i = 0; i < alb_exporter_count; i++)
        if (strcmp(alb_exporters[i].name, name) == 0)
            return &alb_exporters[i];
    return NULL;
}

static void make_identifier(char identifier[ALB_NAME_SIZE], const char *name)
{
    snprintf(identifier, ALB_NAME_SIZE, "%s", *name ? name : "material");
    for (char *at = identifier; *at; at++)
        if ((unsigned char)*at > 127 || !isalnum((unsigned char)*at))
            *at = '_';
    if (isdigit((unsigned char)*identifier))
        *identifier = '_';
}

// A file's name may hold anything but '/': no line of it ends a comment, nor does "--", which XML's do not hold.
static void keep_in_comment(char *text)
{
    for (char *at = text; *at; at++)
        if ((unsigned char)*at < ' ' || *at == 127 || (at > text && *at == '-' && at[-1] == '-'))
            *at = '_';
}

bool alb_export_prepare(alb_export *exported, const alb_exporter *exporter, const alb_material *material,
                        const char *path, double unit_mm, alb_error *error)
{
    *exported = (alb_export){.material = material, .unit_mm = unit_mm};
    snprintf(exported->source, sizeof exported->source, "%.255s", alb_path_name(path));
    keep_in_comment(exported->source);
    make_identifier(exported->identifier, material->name);
    if (!alb_hash_file(exported->sha256, path, error))
        return false;
    if (!exporter->wants_appearance)
        return true;
    if (material->channels == 2)
        return alb_fail(error, ALB_BAD_DATA, "%s: channels %s and %s; a renderer wants three, or one for all", path,
                        material->channel_names[0], material->channel_names[1]);
    if (!alb_appearance_derive(&exported->appearance, material, error))
        return false;
    for (int c = material->channels; c < 3; c++)
        exported->appearance.channel[c] = exported->appearance.channel[0];
    return true;
}

static void put_channel(alb_text *text, const alb_export *exported, int c, const char *prefix)
{
    const alb_appearance_channel *channel = &exported->appearance.channel[c];
    const alb_fitted *reflection = &exported->material->fitted[ALB_REFLECTION][c];
    const char *name = exported->material->channel_names[c];
    const double albedo =
        channel->reduced_scattering_per_mm / (channel->absorption_per_mm + channel->reduced_scattering_per_mm);
    alb_text_add(text, "%s%s: reflects %.6g", prefix, name, channel->burley.albedo);
    if (reflection->identifiable)
        alb_text_add(text, " +- %.2g", channel->albedo_sd);
    alb_text_add(text, " of the light, fitted by %s%s.\n", alb_form_name(reflection->profile.form),
                 reflection->identifiable ? "" : ": a best guess, the data do not decide");
    alb_text_add(text,
                 "%s%s: Burley's profile of length d = %.6g mm misses that by %.2g %% rms, %.2g %% at most, where "
                 "the middle 90 %% of the light leaves.\n",
                 prefix, name, channel->burley.length_mm, 100 * expm1(channel->deviation_rms),
                 100 * expm1(channel->deviation_maximum));
    alb_text_add(text, "%s%s: absorption %.6g 1/mm, reduced scattering %.6g 1/mm, %s.\n", prefix, name,
                 channel->absorption_per_mm, channel->reduced_scattering_per_mm,
                 channel->medium_source == ALB_MEDIUM_MEASURED
                     ? "as the material has them"
                     : "of the half-space with that reflection and mean free path s(A) d");
    if (albedo < 0.8)
        alb_text_add(text,
                     "%s%s: the medium's albedo %.3g is below 0.8, where diffusion does not hold: expect a "
                     "renderer to differ.\n",
                     prefix, name, albedo);
}

void alb_export_put_origin(alb_text *text, const alb_export *exported, const char *prefix)
{
    const alb_material *material = exported->material;
    alb_text_add(text, "%s%s, by alabaster " ALB_VERSION " from %s (SHA-256 %s).\n", prefix, exported->identifier,
                 exported->source, exported->sha256);
    alb_text_add(text, "%s1 unit of the scene = %.9g mm.\n", prefix, exported->unit_mm);
    if (material->channels == 3)
        alb_text_add(text, "%s%s, %s, %s of the measurement are taken as linear red, green, blue.\n", prefix,
                     material->channel_names[0], material->channel_names[1], material->channel_names[2]);
    else
        alb_text_add(text, "%s%s of the measurement stands for red, green and blue.\n", prefix,
                     material->channel_names[0]);
    for (int c = 0; c < material->channels; c++)
        put_channel(text, exported, c, prefix);
    if (exported->appearance.index_assumed)
        alb_text_add(text, "%sThe refractive index %.4g is assumed: the material does not say.\n", prefix,
                     exported->appearance.refractive_index);
    const double through = material->fitted[ALB_TRANSMISSION][0].total;
    if (through > 0 && exported->appearance.channel[0].medium_source == ALB_MEDIUM_INVERTED)
        alb_text_add(text,
                     "%sThe slab let %.3g %% of %s through, which a half-space keeps: thinner in the renderer it lets "
                     "another share through, and the medium is not the slab's own.\n",
                     prefix, 100 * through, material->channel_names[0]);
}

void alb_export_put_rgb(alb_text *text, const alb_export *exported, alb_export_number number, const char *separator)
{
    for (int c = 0; c < 3; c++)
        alb_text_add(text, "%s%.9g", c ? separator : "", number(exported, c));
}
