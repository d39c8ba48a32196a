// The files of a map: pictures of one pixel a spot, and the numbers.
#include "base/exr.h"
#include "base/json.h"
#include "fit/map.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

static void put(alb_image *image, int spot, int channel, double value)
{
    image->pixels[(size_t)spot * (size_t)image->channels + (size_t)channel] = (float)value;
}

// Total and half-light distance of every channel of the side.
static bool write_side(const alb_map *map, const alb_material *material, alb_side side, const char *folder,
                       alb_error *error)
{
    char names[512] = "", path[ALB_PATH_SIZE], file[64];
    alb_image image = {0};
    for (int c = 0; c < material->channels; c++) {
        const char *name = material->channel_names[c];
        const size_t used = strlen(names);
        snprintf(names + used, sizeof names - used, "%stotal.%s,total_sd.%s,half_light_mm.%s,half_light_sd_mm.%s",
                 c ? "," : "", name, name, name, name);
    }
    snprintf(file, sizeof file, "%s.exr", alb_side_names[side]);
    if (!alb_path_join(path, folder, file, error) || !alb_image_create(&image, map->columns, map->rows, names, error))
        return false;
    for (int c = 0; c < material->channels; c++) {
        const alb_map_layer *layer = &map->layers[side][c];
        for (int i = 0; i < layer->count; i++) {
            const bool known = layer->spots[i].profile.form != ALB_FORM_NONE;
            put(&image, i, 4 * c, known ? layer->spots[i].total : (double)NAN);
            put(&image, i, 4 * c + 1, known ? layer->spots[i].total_sd : (double)NAN);
            put(&image, i, 4 * c + 2, layer->half_mm[i]);
            put(&image, i, 4 * c + 3, layer->half_sd_mm[i]);
        }
    }
    const bool ok = alb_exr_write(&image, NULL, path, error);
    alb_image_free(&image);
    return ok;
}

// Parameters of one channel.
static bool write_layer(const alb_map *map, const alb_material *material, alb_side side, int c, const char *folder,
                        alb_error *error)
{
    const alb_map_layer *layer = &map->layers[side][c];
    const int n = alb_form_parameter_count(layer->candidate.form);
    char names[512] = "", path[ALB_PATH_SIZE], file[64];
    alb_image image = {0};
    for (int p = 0; p < n; p++) {
        const char *name = alb_form_parameter_name(layer->candidate.form, p);
        const size_t used = strlen(names);
        snprintf(names + used, sizeof names - used, "%s%s,%s.sd", p ? "," : "", name, name);
    }
    snprintf(file, sizeof file, "%s_%s.exr", alb_side_names[side], material->channel_names[c]);
    if (!alb_path_join(path, folder, file, error) || !alb_image_create(&image, map->columns, map->rows, names, error))
        return false;
    for (int i = 0; i < layer->count; i++)
        for (int p = 0; p < n; p++) {
            const alb_fitted *spot = &layer->spots[i];
            const bool known = spot->profile.form != ALB_FORM_NONE;
            put(&image, i, 2 * p, known ? spot->profile.parameters[p] : (double)NAN);
            put(&image, i, 2 * p + 1, known ? spot->sd[p] : (double)NAN);
        }
    const bool ok = alb_exr_write(&image, NULL, path, error);
    alb_image_free(&image);
    return ok;
}

static void put_spread(alb_json *json, const char *key, const alb_spread *spread)
{
    alb_json_object(json, key);
    alb_json_number(json, "mean", spread->mean);
    alb_json_number(json, "mean_sd", spread->mean_sd);
    alb_json_number(json, "sd_between_spots", spread->between);
    alb_json_number(json, "chi_square", spread->chi_square);
    alb_json_integer(json, "degrees_of_freedom", spread->count > 0 ? spread->count - 1 : 0);
    alb_json_number(json, "probability_if_alike", spread->tail);
    alb_json_end_object(json);
}

static void put_side(alb_json *json, const alb_map *map, const alb_material *material, alb_side side)
{
    alb_json_object(json, alb_side_names[side]);
    alb_json_list(json, "spots_mm");
    for (int i = 0; i < map->columns * map->rows; i++)
        alb_json_numbers(json, NULL, (double[2]){map->sites[side][i].x_mm, map->sites[side][i].y_mm}, 2);
    alb_json_end_list(json);
    for (int c = 0; c < material->channels; c++) {
        const alb_map_layer *layer = &map->layers[side][c];
        alb_json_object(json, material->channel_names[c]);
        alb_json_string(json, "form", alb_form_name(layer->candidate.form));
        if (layer->candidate.tied)
            alb_json_number(json, "decay_ratio_held", ALB_TIED_RATIO);
        alb_json_integer(json, "spots_decided", layer->total.count);
        put_spread(json, "total", &layer->total);
        put_spread(json, "half_light_mm", &layer->half);
        alb_json_end_object(json);
    }
    alb_json_end_object(json);
}

static bool write_json(const alb_map *map, const alb_material *material, const alb_provenance *provenance,
                       const char *folder, alb_error *error)
{
    char path[ALB_PATH_SIZE];
    alb_json json;
    if (!alb_path_join(path, folder, "map.json", error))
        return false;
    alb_json_begin(&json, provenance);
    alb_json_string(&json, "name", material->name);
    alb_json_integer(&json, "columns", map->columns);
    alb_json_integer(&json, "rows", map->rows);
    alb_json_boolean(&json, "heterogeneous", map->heterogeneous);
    alb_json_number(&json, "heterogeneous_below", map->tail_wanted);
    for (int side = 0; side < ALB_SIDES; side++)
        if (map->layers[side][0].spots)
            put_side(&json, map, material, (alb_side)side);
    return alb_json_write(&json, path, error);
}

bool alb_map_write(const alb_map *map, const alb_fitting *fitting, const alb_provenance *provenance, const char *notes,
                   const char *folder, alb_error *error)
{
    char pictures[ALB_PATH_SIZE];
    const alb_material *material = &fitting->material;
    if (!alb_path_join(pictures, folder, "map", error) || !alb_file_make_directory(pictures, error))
        return false;
    for (int side = 0; side < ALB_SIDES; side++) {
        if (!map->layers[side][0].spots)
            continue;
        if (!write_side(map, material, (alb_side)side, pictures, error))
            return false;
        for (int c = 0; c < material->channels; c++)
            if (!write_layer(map, material, (alb_side)side, c, pictures, error))
                return false;
    }
    return write_json(map, material, provenance, folder, error) && alb_map_report(map, material, notes, folder, error);
}
