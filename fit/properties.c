// Optical properties from the totals of a fitted slab (optical.c). What is uncertain: the fit of each total, what is
// each side's own (which way light leaves its face, exit_angle.h), and the scale that both share (white reference).
// Stops being true: ground faces, whose inner reflection is not Fresnel's; and as good as the tails of the two forms,
// which carry the energy beyond the readings.
#include "fit/properties.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

static const char *method_of(const alb_properties *p)
{
    return p->half_space ? "adding-doubling of the reflection, as of a half-space"
                         : "adding-doubling of the totals of both sides";
}

static bool measured(const alb_material *material, alb_side side, int c)
{
    return material->fitted[side][c].profile.form != ALB_FORM_NONE;
}

static bool decided(const alb_material *material, int c)
{
    return material->fitted[ALB_REFLECTION][c].identifiable &&
           (!measured(material, ALB_TRANSMISSION, c) || material->fitted[ALB_TRANSMISSION][c].identifiable);
}

static alb_measured_totals totals_of(const alb_material *material, const alb_properties_basis *basis, int c)
{
    const bool slab = measured(material, ALB_TRANSMISSION, c);
    alb_measured_totals out = {.thickness_mm = slab ? material->thickness_mm : 0};
    for (int side = 0; side < (slab ? 2 : 1); side++) {
        const alb_fitted *fitted = &material->fitted[side][c];
        const double common = basis->common_sd[side][c], own = fmin(common, basis->own_sd[side][c]);
        const double shared = common * common - own * own, all = fitted->total_sd / fitted->total;
        const double sd = fitted->total * sqrt(fmax(0, all * all - shared));
        out.scale_sd = fmax(out.scale_sd, sqrt(shared));
        *(side ? &out.transmission : &out.reflection) = fitted->total;
        *(side ? &out.transmission_sd : &out.reflection_sd) = sd;
    }
    return out;
}

double alb_other_anisotropy(double assumed) { return assumed < 0.5 ? 0.9 : 0; }

void alb_properties_find(alb_properties properties[3], const alb_material *material, const alb_properties_basis *basis)
{
    const double n = material->refractive_index, assumed_g = basis->anisotropy,
                 other_g = alb_other_anisotropy(assumed_g);
    for (int c = 0; c < 3; c++)
        properties[c] = (alb_properties){.anisotropy = assumed_g, .other_anisotropy = other_g, .other = {NAN, NAN}};
    if (!(n >= 1))
        return;
    alb_optical_model assumed, instead;
    alb_optical_model_create(&assumed, ALB_OPTICAL_STREAMS, n, assumed_g);
    alb_optical_model_create(&instead, ALB_OPTICAL_STREAMS, n, other_g);
    for (int c = 0; c < material->channels; c++) {
        alb_properties *out = &properties[c];
        out->half_space = !measured(material, ALB_TRANSMISSION, c);
        if (!measured(material, ALB_REFLECTION, c) || !(out->half_space || material->thickness_mm > 0))
            continue;
        const alb_measured_totals totals = totals_of(material, basis, c);
        alb_error error = {0};
        if (basis->finish != ALB_FINISH_SMOOTH)
            alb_fail(&error, ALB_UNDECIDED, "the faces are ground: what they reflect inside is not known");
        else if (!decided(material, c))
            alb_fail(&error, ALB_UNDECIDED, "the fits do not decide the totals");
        out->known = error.status == ALB_OK && alb_optical_from_totals(&out->optical, &assumed, &totals, &error);
        snprintf(out->refused, sizeof out->refused, "%.319s", error.text);
        alb_optical with_other;
        if (out->known && alb_optical_from_totals(&with_other, &instead, &totals, NULL)) {
            out->other[0] = with_other.absorption_per_mm;
            out->other[1] = with_other.reduced_scattering_per_mm;
        }
    }
}

static void put_pair(alb_json *json, const char *key, const double anisotropy, const double pair[2])
{
    if (!isfinite(pair[0]))
        return;
    alb_json_object(json, key);
    if (isfinite(anisotropy))
        alb_json_number(json, "anisotropy", anisotropy);
    alb_json_number(json, "absorption_per_mm", pair[0]);
    alb_json_number(json, "reduced_scattering_per_mm", pair[1]);
    alb_json_end_object(json);
}

static void put_slab(alb_json *json, const alb_properties *p)
{
    const alb_optical *o = &p->optical;
    alb_json_estimate(json, "absorption_per_mm", o->absorption_per_mm, o->absorption_sd);
    alb_json_estimate(json, "reduced_scattering_per_mm", o->reduced_scattering_per_mm, o->reduced_scattering_sd);
    alb_json_number(json, "correlation", o->correlation);
    alb_json_numbers(json, "relative_change_by_scale", o->by_scale, 2);
    alb_json_numbers(json, "relative_change_by_thickness", o->by_thickness, 2);
    put_pair(json, "with_other_anisotropy", p->other_anisotropy, p->other);
    put_pair(json, "by_diffusion", NAN, o->diffusion);
}

void alb_properties_put(alb_json *json, const alb_properties *p)
{
    const alb_optical *o = &p->optical;
    if (!p->known && !*p->refused)
        return;
    alb_json_object(json, "optical_properties");
    alb_json_string(json, "method", method_of(p));
    if (p->known) {
        alb_json_number(json, "anisotropy_assumed", p->anisotropy);
        alb_json_estimate(json, "reduced_albedo", o->reduced_albedo, o->reduced_albedo_sd);
        if (!p->half_space)
            put_slab(json, p);
        alb_json_list(json, "flags");
        for (int i = 0; i < ALB_OPTICAL_FLAGS; i++)
            if (o->flags >> i & 1)
                alb_json_string(json, NULL, alb_optical_flag_text(i));
        alb_json_end_list(json);
    } else {
        alb_json_string(json, "refused", p->refused);
    }
    alb_image_properties_put(json, &p->images);
    alb_json_end_object(json);
}

void alb_properties_note(alb_text *notes, const char *channel, const alb_properties *p)
{
    const alb_optical *o = &p->optical;
    if (*p->refused)
        alb_text_add(notes, "%s: no optical properties: %s.\n", channel, p->refused);
    alb_image_properties_note(notes, channel, &p->images);
    if (!p->known)
        return;
    if (p->half_space) {
        alb_text_add(notes,
                     "%s: reduced albedo %.5g +- %.2g by radiative transfer from reflection alone, as if no light came "
                     "through, anisotropy %g assumed; absorption and scattering themselves want both sides.\n",
                     channel, o->reduced_albedo, o->reduced_albedo_sd, p->anisotropy);
        return;
    }
    alb_text_add(notes,
                 "%s: absorption %.4g +- %.2g, reduced scattering %.4g +- %.2g per mm by radiative transfer from the "
                 "totals, anisotropy %g assumed",
                 channel, o->absorption_per_mm, o->absorption_sd, o->reduced_scattering_per_mm,
                 o->reduced_scattering_sd, p->anisotropy);
    if (isfinite(p->other[0]))
        alb_text_add(notes, " (with %g: %.4g and %.4g)", p->other_anisotropy, p->other[0], p->other[1]);
    if (isfinite(o->diffusion[0]))
        alb_text_add(notes, "; by diffusion %.4g and %.4g", o->diffusion[0], o->diffusion[1]);
    if (isfinite(o->by_scale[0]))
        alb_text_add(notes, "; 1 %% of scale moves them by %+.2g and %+.2g %%", o->by_scale[0], o->by_scale[1]);
    alb_text_add(notes, ", 1 %% of thickness by -1 and -1 %%");
    for (int i = 0; i < ALB_OPTICAL_FLAGS; i++)
        if (o->flags >> i & 1)
            alb_text_add(notes, "; %s", alb_optical_flag_text(i));
    alb_text_add(notes, ".\n");
}

static bool read_estimate(double *value, alb_node node, const char *key, alb_error *error)
{
    alb_node estimate;
    double sd;
    return alb_node_object(&estimate, node, key, error) && alb_node_allow(estimate, "value sd", error) &&
           alb_node_number(value, estimate, "value", 0, 1e300, error) &&
           alb_node_number(&sd, estimate, "sd", 0, 1e300, error);
}

bool alb_properties_read(alb_optical_estimate *out, alb_node channel, alb_error *error)
{
    *out = (alb_optical_estimate){0};
    alb_node properties, flags;
    const char *text;
    double value, absorption, scattering;
    size_t count;
    if (!alb_node_has(channel, "optical_properties"))
        return true;
    if (!alb_node_object(&properties, channel, "optical_properties", error) ||
        !alb_node_text(&text, properties, "method", error) || !alb_image_properties_check(properties, error))
        return false;
    if (alb_node_has(properties, "refused"))
        return alb_node_allow(properties, "method refused images", error) &&
               alb_node_text(&text, properties, "refused", error);
    const bool slab = alb_node_has(properties, "absorption_per_mm");
    if (!alb_node_allow(properties,
                        slab ? "method anisotropy_assumed reduced_albedo absorption_per_mm reduced_scattering_per_mm "
                               "correlation relative_change_by_scale relative_change_by_thickness "
                               "with_other_anisotropy by_diffusion flags images"
                             : "method anisotropy_assumed reduced_albedo flags",
                        error) ||
        !alb_node_number(&value, properties, "anisotropy_assumed", -1, 1, error) ||
        !read_estimate(&value, properties, "reduced_albedo", error) ||
        !alb_node_list(&flags, &count, properties, "flags", error))
        return false;
    if (!slab)
        return true;
    if (!read_estimate(&absorption, properties, "absorption_per_mm", error) ||
        !read_estimate(&scattering, properties, "reduced_scattering_per_mm", error) ||
        !alb_node_number(&value, properties, "correlation", -1.001, 1.001, error))
        return false;
    *out = (alb_optical_estimate){true, absorption, scattering};
    return true;
}
