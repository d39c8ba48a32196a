// Renderers that are told a colour and a length.
//
// Cycles, Burley: the mean free path is radius / (4 pi) and d = that / s(A), s(A) = 1.9 - A + 3.5 (A - 0.8)^2; the
// profile is cut at 16 d, which leaves 0.99638 of it (Blender, intern/cycles/kernel/closure/bssrdf.h). So that its d is
// the fitted one, radius = 4 pi s(A) d. Cycles draws the profile under the specular lobe, which takes its share first:
// the measured one counts all light that falls on the face, hence no specular lobe.
//
// Arnold, random walk: radius is the mean free path, and the albedo of the walk that which reflects the colour (Chiang,
// Kutz, Burley 2016); the walk meets no face from inside, so that colour and radius are those of the profile and not of
// the medium behind a face. radius = s(A) d, s of a beam.
#include "fit/export.h"
#include <math.h>

static double colour(const alb_export *exported, int c) { return exported->appearance.channel[c].burley.albedo; }

static double cycles_radius(const alb_export *exported, int c)
{
    const alb_burley burley = exported->appearance.channel[c].burley;
    return 4 * M_PI * alb_burley_diffuse_ratio(burley.albedo) * burley.length_mm / exported->unit_mm;
}

static double mean_free_path(const alb_export *exported, int c)
{
    const alb_burley burley = exported->appearance.channel[c].burley;
    return alb_burley_beam_ratio(burley.albedo) * burley.length_mm / exported->unit_mm;
}

void alb_export_put_cycles(alb_text *text, const alb_export *exported)
{
    alb_export_put_origin(text, exported, "# ");
    alb_text_add(text, "# Run it in Blender (Scripting, Run Script). Cycles divides the radius by 4 pi s(A) to get d, "
                       "in units of the scene.\n"
                       "import bpy\n\nbase_color = (");
    alb_export_put_rgb(text, exported, colour, ", ");
    alb_text_add(text, ")\nsubsurface_radius = (");
    alb_export_put_rgb(text, exported, cycles_radius, ", ");
    alb_text_add(text,
                 ")\nindex = %.9g\nspecular = 0.0  # the measured share counts all light that falls on the face\n\n"
                 "material = bpy.data.materials.new(\"%s\")\n"
                 "material.use_nodes = True\n"
                 "node = next(n for n in material.node_tree.nodes if n.type == \"BSDF_PRINCIPLED\")\n"
                 "node.subsurface_method = \"BURLEY\"\n"
                 "values = {\n"
                 "    \"Base Color\": (*base_color, 1.0),\n"
                 "    \"Subsurface Color\": (*base_color, 1.0),  # up to Blender 3.6\n"
                 "    \"Subsurface\": 1.0,\n"
                 "    \"Specular\": specular,\n"
                 "    \"Subsurface Weight\": 1.0,  # from Blender 4.0\n"
                 "    \"Specular IOR Level\": specular,\n"
                 "    \"Subsurface Scale\": 1.0,\n"
                 "    \"Subsurface Radius\": subsurface_radius,\n"
                 "    \"IOR\": index,\n"
                 "}\n"
                 "for name, value in values.items():\n"
                 "    if name in node.inputs:\n"
                 "        node.inputs[name].default_value = value\n",
                 exported->appearance.refractive_index, exported->identifier);
}

void alb_export_put_arnold(alb_text *text, const alb_export *exported)
{
    alb_export_put_origin(text, exported, "# ");
    alb_text_add(text, "# Arnold's walk has the albedo");
    for (int c = 0; c < 3; c++)
        alb_text_add(text, " %.6g", alb_chiang_albedo(colour(exported, c)));
    alb_text_add(text,
                 " (Chiang, Kutz, Burley 2016); radius is its mean free path, in units of the scene.\n"
                 "standard_surface\n{\n name %s\n base 0\n specular 0\n specular_IOR %.9g\n subsurface 1\n"
                 " subsurface_type \"randomwalk\"\n subsurface_anisotropy 0\n subsurface_scale 1\n subsurface_color ",
                 exported->identifier, exported->appearance.refractive_index);
    alb_export_put_rgb(text, exported, colour, " ");
    alb_text_add(text, "\n subsurface_radius ");
    alb_export_put_rgb(text, exported, mean_free_path, " ");
    alb_text_add(text, "\n}\n");
}
