// Renderers that are told a medium behind a smooth face. Scattering is isotropic with the reduced coefficient: by
// similarity it spreads light as the real one does, but not within a mean free path of where light enters.
//
// pbrt-v4: sigma_a and sigma_s times scale are per unit of the scene; scale = millimetres per unit.
// Mitsuba 3: sigma_t times scale is per unit of the scene, and the albedo is sigma_s' / sigma_t.
// OpenPBR 1.1: the mean free path is subsurface_radius times its scale (at most 1), in units of the scene; the medium's
// albedo follows from the colour (appearance.c), so that the colour is that which gives the albedo, not what one sees.
#include "fit/export.h"
#include <math.h>

static double absorption(const alb_export *exported, int c)
{
    return exported->appearance.channel[c].absorption_per_mm;
}

static double scattering(const alb_export *exported, int c)
{
    return exported->appearance.channel[c].reduced_scattering_per_mm;
}

static double extinction(const alb_export *exported, int c)
{
    return absorption(exported, c) + scattering(exported, c);
}
static double albedo(const alb_export *exported, int c) { return scattering(exported, c) / extinction(exported, c); }
static double openpbr_colour(const alb_export *exported, int c) { return alb_openpbr_colour(albedo(exported, c)); }

static double longest_path_mm(const alb_export *exported)
{
    return 1 / fmin(extinction(exported, 0), fmin(extinction(exported, 1), extinction(exported, 2)));
}

static double path_of_longest(const alb_export *exported, int c)
{
    return 1 / (extinction(exported, c) * longest_path_mm(exported));
}

void alb_export_put_pbrt(alb_text *text, const alb_export *exported)
{
    alb_export_put_origin(text, exported, "# ");
    alb_text_add(text,
                 "# sigma_a and sigma_s are in 1/mm; scale makes them per unit of the scene.\n"
                 "MakeNamedMaterial \"%s\" \"string type\" \"subsurface\"\n    \"rgb sigma_a\" [ ",
                 exported->identifier);
    alb_export_put_rgb(text, exported, absorption, " ");
    alb_text_add(text, " ]\n    \"rgb sigma_s\" [ ");
    alb_export_put_rgb(text, exported, scattering, " ");
    alb_text_add(text,
                 " ]\n    \"float scale\" %.9g\n    \"float g\" 0\n    \"float eta\" %.9g\n    \"float roughness\" 0\n",
                 exported->unit_mm, exported->appearance.refractive_index);
}

void alb_export_put_mitsuba(alb_text *text, const alb_export *exported)
{
    alb_text_add(text, "<?xml version=\"1.0\"?>\n<!--\n");
    alb_export_put_origin(text, exported, "  ");
    alb_text_add(text,
                 "  sigma_t is in 1/mm; scale makes it per unit of the scene. Include this file and refer to it:\n"
                 "  [shape] [ref id=\"%s\"/] [ref name=\"interior\" id=\"%s_medium\"/] [/shape]\n-->\n"
                 "<scene version=\"3.0.0\">\n"
                 "    <bsdf type=\"dielectric\" id=\"%s\">\n"
                 "        <float name=\"int_ior\" value=\"%.9g\"/>\n"
                 "    </bsdf>\n"
                 "    <medium type=\"homogeneous\" id=\"%s_medium\">\n"
                 "        <rgb name=\"sigma_t\" value=\"",
                 exported->identifier, exported->identifier, exported->identifier,
                 exported->appearance.refractive_index, exported->identifier);
    alb_export_put_rgb(text, exported, extinction, " ");
    alb_text_add(text, "\"/>\n        <rgb name=\"albedo\" value=\"");
    alb_export_put_rgb(text, exported, albedo, " ");
    alb_text_add(text,
                 "\"/>\n        <float name=\"scale\" value=\"%.9g\"/>\n        <phase type=\"isotropic\"/>\n"
                 "    </medium>\n</scene>\n",
                 exported->unit_mm);
}

void alb_export_put_openpbr(alb_text *text, const alb_export *exported)
{
    alb_text_add(text, "<?xml version=\"1.0\"?>\n<!--\n");
    alb_export_put_origin(text, exported, "  ");
    alb_text_add(text,
                 "  subsurface_radius times its scale is the mean free path in units of the scene; the colour is that "
                 "which OpenPBR turns\n  into the medium's albedo.\n-->\n"
                 "<materialx version=\"1.39\">\n"
                 "    <open_pbr_surface name=\"%s_surface\" type=\"surfaceshader\">\n"
                 "        <input name=\"specular_ior\" type=\"float\" value=\"%.9g\"/>\n"
                 "        <input name=\"specular_roughness\" type=\"float\" value=\"0\"/>\n"
                 "        <input name=\"subsurface_weight\" type=\"float\" value=\"1\"/>\n"
                 "        <input name=\"subsurface_color\" type=\"color3\" value=\"",
                 exported->identifier, exported->appearance.refractive_index);
    alb_export_put_rgb(text, exported, openpbr_colour, ", ");
    alb_text_add(text,
                 "\"/>\n        <input name=\"subsurface_radius\" type=\"float\" value=\"%.9g\"/>\n"
                 "        <input name=\"subsurface_radius_scale\" type=\"color3\" value=\"",
                 longest_path_mm(exported) / exported->unit_mm);
    alb_export_put_rgb(text, exported, path_of_longest, ", ");
    alb_text_add(text,
                 "\"/>\n        <input name=\"subsurface_scatter_anisotropy\" type=\"float\" value=\"0\"/>\n"
                 "    </open_pbr_surface>\n"
                 "    <surfacematerial name=\"%s\" type=\"material\">\n"
                 "        <input name=\"surfaceshader\" type=\"surfaceshader\" nodename=\"%s_surface\"/>\n"
                 "    </surfacematerial>\n</materialx>\n",
                 exported->identifier, exported->identifier);
}
