// "materials" of SCENE.json: measured, a dipole, a multipole, tabulated, or opaque.
#include "base/memory.h"
#include "render/scene_reader.h"
#include <stdio.h>
#include <string.h>

static bool read_slab_path(bool *slab, alb_node node, alb_error *error)
{
    static const char *const paths[] = {"solid", "slab"};
    int path = 0;
    if (alb_node_has(node, "path") && !alb_node_choice(&path, node, "path", paths, 2, error))
        return false;
    *slab = path == 1;
    return true;
}

// The profile of a colour channel: by name, or the only one there is.
static const alb_profile *profile_of(const alb_material *material, alb_side side, int c)
{
    static const char *const names[3] = {"R", "G", "B"};
    for (int k = 0; k < material->channels; k++)
        if (material->channels == 1 || !strcmp(material->channel_names[k], names[c]))
            return &material->fitted[side][k].profile;
    return NULL;
}

static bool read_measured(alb_surface *surface, alb_scene_reader *in, alb_node node)
{
    char path[ALB_PATH_SIZE];
    alb_material material;
    if (!alb_node_allow(node, "measured path", in->error) || !alb_scene_input(path, in, node, "measured") ||
        !alb_material_read(&material, path, in->error) || !read_slab_path(&surface->slab, node, in->error))
        return false;
    surface->scatters = true;
    surface->thickness_mm = material.thickness_mm;
    for (int side = 0; side < ALB_SIDES; side++)
        surface->exits[side] = alb_material_exit(&material, (alb_side)side);
    for (int side = 0; side <= (surface->slab ? ALB_TRANSMISSION : ALB_REFLECTION); side++)
        for (int c = 0; c < 3; c++) {
            const alb_profile *profile = profile_of(&material, (alb_side)side, c);
            if (!profile || profile->form == ALB_FORM_NONE)
                return alb_node_fail(in->error, node, "measured", "%s has no %s profile for channel %c%s", path,
                                     alb_side_names[side], "RGB"[c],
                                     side == ALB_TRANSMISSION ? "; \"path\": \"solid\" needs reflection alone" : "");
            surface->profiles[side][c] = *profile;
        }
    return true;
}

typedef struct medium {
    double absorption[3], scattering[3], index;
    alb_finish finish;
} medium;

#define MEDIUM_KEYS "absorption_per_mm reduced_scattering_per_mm refractive_index finish"

static bool read_medium(medium *of, alb_node node, alb_error *error)
{
    return alb_node_numbers(of->absorption, 3, node, "absorption_per_mm", 1e-9, 1e4, error) &&
           alb_node_numbers(of->scattering, 3, node, "reduced_scattering_per_mm", 1e-9, 1e4, error) &&
           alb_node_number(&of->index, node, "refractive_index", 1, 3, error) &&
           alb_finish_read(&of->finish, node, error);
}

static bool read_dipole(alb_surface *surface, alb_node node, alb_error *error)
{
    alb_node dipole;
    medium of;
    if (!alb_node_allow(node, "dipole", error) || !alb_node_object(&dipole, node, "dipole", error) ||
        !alb_node_allow(dipole, MEDIUM_KEYS, error) || !read_medium(&of, dipole, error))
        return false;
    surface->scatters = true;
    surface->exits[ALB_REFLECTION] = alb_exit_of(ALB_REFLECTION, of.finish, of.index);
    for (int c = 0; c < 3; c++)
        surface->profiles[ALB_REFLECTION][c] =
            (alb_profile){.form = ALB_FORM_DIPOLE, .parameters = {of.absorption[c], of.scattering[c], of.index}};
    return true;
}

static bool read_multipole(alb_surface *surface, alb_node node, alb_error *error)
{
    static const alb_form forms[ALB_SIDES] = {ALB_FORM_MULTIPOLE_REFLECTION, ALB_FORM_MULTIPOLE_TRANSMISSION};
    alb_node multipole;
    medium of;
    if (!alb_node_allow(node, "multipole", error) || !alb_node_object(&multipole, node, "multipole", error) ||
        !alb_node_allow(multipole, MEDIUM_KEYS " thickness_mm", error) || !read_medium(&of, multipole, error) ||
        !alb_node_number(&surface->thickness_mm, multipole, "thickness_mm", 1e-6, 1e6, error))
        return false;
    surface->scatters = surface->slab = true;
    for (int side = 0; side < ALB_SIDES; side++) {
        surface->exits[side] = alb_exit_of((alb_side)side, of.finish, of.index);
        for (int c = 0; c < 3; c++)
            surface->profiles[side][c] =
                (alb_profile){.form = forms[side],
                              .parameters = {of.absorption[c], of.scattering[c], of.index, surface->thickness_mm}};
    }
    for (int c = 0; c < 3; c++)
        if (surface->thickness_mm * (of.absorption[c] + of.scattering[c]) <= 1)
            return alb_node_fail(error, multipole, "thickness_mm",
                                 "%g mm is thinner than a transport mean free path, %.3g mm in channel %c: light does "
                                 "not diffuse there",
                                 surface->thickness_mm, 1 / (of.absorption[c] + of.scattering[c]), "RGB"[c]);
    return true;
}

// A file for each channel, R, G and B.
static bool read_tables(alb_profile profiles[3], alb_scene_reader *in, alb_node node, const char *key)
{
    alb_node list;
    size_t count;
    if (!alb_node_list(&list, &count, node, key, in->error))
        return false;
    if (count != 3)
        return alb_node_fail(in->error, node, key, "%zu files; one for each of R, G and B is wanted", count);
    for (size_t c = 0; c < 3; c++) {
        const char *name;
        char path[ALB_PATH_SIZE];
        if (!alb_node_item_text(&name, list, c, in->error) || !alb_path_join(path, in->folder, name, in->error) ||
            !alb_provenance_add(in->provenance, path, in->error) ||
            !alb_profile_read_table(&profiles[c], path, in->error))
            return false;
    }
    return true;
}

static bool read_tabulated(alb_surface *surface, alb_scene_reader *in, alb_node node)
{
    alb_node tabulated;
    if (!alb_node_allow(node, "tabulated", in->error) || !alb_node_object(&tabulated, node, "tabulated", in->error) ||
        !alb_node_allow(tabulated, "reflection transmission thickness_mm", in->error) ||
        !read_tables(surface->profiles[ALB_REFLECTION], in, tabulated, "reflection"))
        return false;
    surface->scatters = true;
    surface->slab = alb_node_has(tabulated, "transmission");
    return !surface->slab || (read_tables(surface->profiles[ALB_TRANSMISSION], in, tabulated, "transmission") &&
                              alb_node_number(&surface->thickness_mm, tabulated, "thickness_mm", 1e-6, 1e6, in->error));
}

static bool read_surface(alb_surface *surface, alb_scene_reader *in, alb_node node)
{
    if (alb_node_has(node, "measured"))
        return read_measured(surface, in, node);
    if (alb_node_has(node, "dipole"))
        return read_dipole(surface, node, in->error);
    if (alb_node_has(node, "multipole"))
        return read_multipole(surface, node, in->error);
    if (alb_node_has(node, "tabulated"))
        return read_tabulated(surface, in, node);
    return alb_node_allow(node, "reflectance exitance", in->error) &&
           alb_node_numbers(surface->reflectance, 3, node, "reflectance", 0, 1, in->error) &&
           (!alb_node_has(node, "exitance") ||
            alb_node_numbers(surface->exitance, 3, node, "exitance", 0, 1e12, in->error));
}

bool alb_scene_read_surfaces(alb_scene_reader *in, alb_node root)
{
    alb_node list;
    if (!alb_node_object(&list, root, "materials", in->error))
        return false;
    const size_t count = alb_node_key_count(list);
    if (count > ALB_SURFACES_MAX)
        return alb_node_fail(in->error, list, NULL, "%zu materials; at most %d", count, ALB_SURFACES_MAX);
    if (!(in->scene->surfaces = alb_allocate(count, sizeof *in->scene->surfaces, in->error)))
        return false;
    in->scene->surface_count = count;
    for (size_t i = 0; i < count; i++) {
        const char *name = alb_node_key(list, i);
        alb_node node;
        if (strlen(name) >= ALB_GROUP_NAME)
            return alb_node_fail(in->error, list, NULL, "material name '%.80s' is too long", name);
        snprintf(in->scene->surfaces[i].name, ALB_GROUP_NAME, "%s", name);
        if (!alb_node_object(&node, list, name, in->error) || !read_surface(&in->scene->surfaces[i], in, node))
            return false;
    }
    return true;
}
