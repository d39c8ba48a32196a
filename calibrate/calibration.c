// calibration.json, read and written.
#include "calibrate/calibration_file.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

static const char *const lens_keys[9] = {"fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2", "k3"};

void alb_lens_write(alb_json *json, const alb_lens *lens, const double sd[9], double rms_px)
{
    const double values[9] = {lens->fx, lens->fy, lens->cx, lens->cy, lens->k1, lens->k2, lens->p1, lens->p2, lens->k3};
    alb_json_object(json, "lens");
    alb_json_integer(json, "width", lens->width);
    alb_json_integer(json, "height", lens->height);
    for (int i = 0; i < 9; i++)
        alb_json_estimate(json, lens_keys[i], values[i], sd[i]);
    alb_json_number(json, "rms_px", rms_px);
    alb_json_end_object(json);
}

static void write_estimates(alb_json *json, const char *key, const alb_calibration *c, const alb_estimate *estimates)
{
    alb_json_object(json, key);
    for (int i = 0; i < c->channels; i++)
        alb_json_estimate(json, c->channel_names[i], estimates[i].value, estimates[i].sd);
    alb_json_end_object(json);
}

static void write_view(alb_json *json, const alb_view *view, const char *side)
{
    if (!view->known)
        return;
    const alb_transform *t = &view->camera.camera_from_world;
    alb_json_object(json, side);
    alb_json_list(json, "rotation");
    for (int i = 0; i < 3; i++)
        alb_json_numbers(json, NULL, t->rotation[i], 3);
    alb_json_end_list(json);
    alb_json_numbers(json, "translation_mm", &t->translation.x, 3);
    alb_json_number(json, "rms_px", view->rms_px);
    alb_json_number(json, "relative_length_sd", view->relative_length_sd);
    alb_json_end_object(json);
}

static void write_product(alb_json *json, const alb_product *p, int channels)
{
    alb_json_object(json, NULL);
    alb_json_string(json, "shot", p->shot);
    alb_json_string(json, "side", alb_side_names[p->side]);
    alb_json_string(json, "target", alb_target_names[p->target]);
    alb_json_object(json, "pattern");
    alb_json_string(json, "kind", alb_pattern_names[p->pattern.kind]);
    alb_json_number(json, "diameter_px", p->pattern.diameter_px);
    alb_json_integer(json, "columns", p->pattern.columns);
    alb_json_integer(json, "rows", p->pattern.rows);
    alb_json_number(json, "pitch_px", p->pattern.pitch_px);
    alb_json_end_object(json);
    alb_json_numbers(json, "relative_scale_sd", p->relative_scale_sd, (size_t)channels);
    alb_json_end_object(json);
}

bool alb_calibration_write(const alb_calibration *c, const alb_provenance *provenance, alb_error *error)
{
    char path[ALB_PATH_SIZE];
    if (!alb_path_join(path, c->folder, "calibration.json", error))
        return false;
    alb_json json;
    alb_json_begin(&json, provenance);
    alb_json_string(&json, "sample", c->sample);
    alb_json_number(&json, "thickness_mm", c->thickness_mm);
    alb_json_number(&json, "refractive_index", c->refractive_index);
    alb_json_string(&json, "finish", alb_finish_names[c->finish]);
    alb_json_list(&json, "channels");
    for (int i = 0; i < c->channels; i++)
        alb_json_string(&json, NULL, c->channel_names[i]);
    alb_json_end_list(&json);
    alb_json_number(&json, "white_level_dn", c->white_level_dn);
    write_estimates(&json, "black_dn", c, c->black_dn);
    write_estimates(&json, "read_noise_dn", c, c->read_noise_dn);
    write_estimates(&json, "gain_dn_per_electron", c, c->gain_dn_per_electron);
    alb_json_list(&json, "flat");
    for (int i = 0; i < c->channels; i++)
        alb_json_numbers(&json, NULL, c->flat[i], ALB_FLAT_TERMS);
    alb_json_end_list(&json);
    alb_lens_write(&json, &c->views[ALB_REFLECTION].camera.lens, c->lens_sd, c->lens_rms_px);
    alb_json_object(&json, "views");
    for (int s = 0; s < ALB_SIDES; s++)
        write_view(&json, &c->views[s], alb_side_names[s]);
    alb_json_end_object(&json);
    alb_json_list(&json, "products");
    for (int i = 0; i < c->product_count; i++)
        write_product(&json, &c->products[i], c->channels);
    alb_json_end_list(&json);
    return alb_json_write(&json, path, error);
}

static bool read_estimate(alb_estimate *out, alb_node object, const char *key, double minimum, alb_error *error)
{
    alb_node node;
    return alb_node_object(&node, object, key, error) && alb_node_allow(node, "value sd", error) &&
           alb_node_number(&out->value, node, "value", minimum, 1e30, error) &&
           alb_node_number(&out->sd, node, "sd", 0, 1e30, error);
}

static bool read_estimates(alb_estimate *out, const alb_calibration *c, alb_node root, const char *key, double minimum,
                           alb_error *error)
{
    alb_node node;
    if (!alb_node_object(&node, root, key, error))
        return false;
    for (int i = 0; i < c->channels; i++)
        if (!read_estimate(&out[i], node, c->channel_names[i], minimum, error))
            return false;
    return true;
}

static bool read_lens(alb_calibration *c, alb_node root, alb_error *error)
{
    alb_node node;
    long width, height;
    alb_estimate values[9];
    if (!alb_node_object(&node, root, "lens", error) ||
        !alb_node_allow(node, "width height fx_px fy_px cx_px cy_px k1 k2 p1 p2 k3 rms_px", error) ||
        !alb_node_integer(&width, node, "width", 1, 1 << 16, error) ||
        !alb_node_integer(&height, node, "height", 1, 1 << 16, error) ||
        !alb_node_number(&c->lens_rms_px, node, "rms_px", 0, 1e9, error))
        return false;
    for (int i = 0; i < 9; i++) {
        if (!read_estimate(&values[i], node, lens_keys[i], i < 2 ? 1e-3 : -1e9, error))
            return false;
        c->lens_sd[i] = values[i].sd;
    }
    const alb_lens lens = {(int)width,      (int)height,     values[0].value, values[1].value,
                           values[2].value, values[3].value, values[4].value, values[5].value,
                           values[6].value, values[7].value, values[8].value};
    for (int s = 0; s < ALB_SIDES; s++)
        c->views[s].camera.lens = lens;
    return true;
}

static bool is_rotation(double r[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const double dot = r[i][0] * r[j][0] + r[i][1] * r[j][1] + r[i][2] * r[j][2];
            if (fabs(dot - (i == j)) > 1e-6)
                return false;
        }
    return true;
}

static bool read_views(alb_calibration *c, alb_node root, alb_error *error)
{
    alb_node views, node, rows;
    if (!alb_node_object(&views, root, "views", error) || !alb_node_allow(views, "reflection transmission", error))
        return false;
    for (int s = 0; s < ALB_SIDES; s++) {
        alb_view *view = &c->views[s];
        alb_transform *t = &view->camera.camera_from_world;
        size_t count;
        if (!(view->known = alb_node_has(views, alb_side_names[s])))
            continue;
        if (!alb_node_object(&node, views, alb_side_names[s], error) ||
            !alb_node_allow(node, "rotation translation_mm rms_px relative_length_sd", error) ||
            !alb_node_list(&rows, &count, node, "rotation", error) ||
            !alb_node_numbers(&t->translation.x, 3, node, "translation_mm", -1e9, 1e9, error) ||
            !alb_node_number(&view->rms_px, node, "rms_px", 0, 1e9, error) ||
            !alb_node_number(&view->relative_length_sd, node, "relative_length_sd", 0, 1e3, error))
            return false;
        if (count != 3)
            return alb_node_fail(error, node, "rotation", "expected 3 rows, found %zu", count);
        for (size_t i = 0; i < 3; i++)
            if (!alb_node_item_numbers(t->rotation[i], 3, rows, i, -1.0001, 1.0001, error))
                return false;
        if (!is_rotation(t->rotation))
            return alb_node_fail(error, node, "rotation", "its rows are not three unit vectors at right angles");
    }
    return true;
}

static bool read_product(alb_product *p, alb_node node, int channels, alb_error *error)
{
    alb_node pattern;
    const char *shot;
    int side, target, kind;
    long columns, rows;
    if (!alb_node_allow(node, "shot side target pattern relative_scale_sd", error) ||
        !alb_node_text(&shot, node, "shot", error) ||
        !alb_node_choice(&side, node, "side", alb_side_names, ALB_SIDES, error) ||
        !alb_node_choice(&target, node, "target", alb_target_names, ALB_TARGETS, error) ||
        !alb_node_object(&pattern, node, "pattern", error) ||
        !alb_node_allow(pattern, "kind diameter_px columns rows pitch_px", error) ||
        !alb_node_choice(&kind, pattern, "kind", alb_pattern_names, ALB_PATTERNS, error) ||
        !alb_node_number(&p->pattern.diameter_px, pattern, "diameter_px", 0, 1e6, error) ||
        !alb_node_integer(&columns, pattern, "columns", 0, 1000, error) ||
        !alb_node_integer(&rows, pattern, "rows", 0, 1000, error) ||
        !alb_node_number(&p->pattern.pitch_px, pattern, "pitch_px", 0, 1e6, error) ||
        !alb_node_numbers(p->relative_scale_sd, (size_t)channels, node, "relative_scale_sd", 0, 1e3, error))
        return false;
    if (!*shot || strlen(shot) >= ALB_NAME_SIZE || strchr(shot, '/'))
        return alb_node_fail(error, node, "shot", "not the name of a shot");
    snprintf(p->shot, sizeof p->shot, "%s", shot);
    p->side = (alb_side)side, p->target = (alb_target)target, p->pattern.kind = (alb_pattern_kind)kind;
    p->pattern.columns = (int)columns, p->pattern.rows = (int)rows;
    return true;
}

static bool read_all(alb_calibration *c, alb_node root, alb_error *error)
{
    const char *sample;
    alb_node list;
    size_t count;
    if (!alb_node_allow(root,
                        "format provenance sample thickness_mm refractive_index finish channels white_level_dn "
                        "black_dn read_noise_dn "
                        "gain_dn_per_electron flat lens views products",
                        error) ||
        !alb_node_text(&sample, root, "sample", error) ||
        !alb_node_number(&c->thickness_mm, root, "thickness_mm", 0, 1e6, error) ||
        !alb_node_number(&c->refractive_index, root, "refractive_index", 1, 10, error) ||
        !alb_finish_read(&c->finish, root, error) ||
        !alb_node_number(&c->white_level_dn, root, "white_level_dn", 0, 1e12, error) ||
        !alb_node_list(&list, &count, root, "channels", error))
        return false;
    snprintf(c->sample, sizeof c->sample, "%.*s", ALB_NAME_SIZE - 1, sample);
    if (count != 1 && count != 3)
        return alb_node_fail(error, root, "channels", "expected 1 or 3 channels, found %zu", count);
    c->channels = (int)count;
    for (size_t i = 0; i < count; i++) {
        const char *name;
        if (!alb_node_item_text(&name, list, i, error))
            return false;
        snprintf(c->channel_names[i], sizeof c->channel_names[i], "%.7s", name);
    }
    if (!read_estimates(c->black_dn, c, root, "black_dn", -1e9, error) ||
        !read_estimates(c->read_noise_dn, c, root, "read_noise_dn", 0, error) ||
        !read_estimates(c->gain_dn_per_electron, c, root, "gain_dn_per_electron", 0, error) ||
        !read_lens(c, root, error) || !read_views(c, root, error) || !alb_node_list(&list, &count, root, "flat", error))
        return false;
    if (count != (size_t)c->channels)
        return alb_node_fail(error, root, "flat", "expected a row for each channel, found %zu", count);
    for (size_t i = 0; i < count; i++)
        if (!alb_node_item_numbers(c->flat[i], ALB_FLAT_TERMS, list, i, -1e3, 1e3, error))
            return false;
    if (!alb_node_list(&list, &count, root, "products", error))
        return false;
    if (count > ALB_SHOTS_MAX)
        return alb_node_fail(error, root, "products", "found %zu, at most %d", count, ALB_SHOTS_MAX);
    for (size_t i = 0; i < count; i++, c->product_count++) {
        alb_node item;
        if (!alb_node_item_object(&item, list, i, error) || !read_product(&c->products[i], item, c->channels, error))
            return false;
    }
    return true;
}

bool alb_calibration_read(alb_calibration *calibration, const char *session_folder, alb_error *error)
{
    char path[ALB_PATH_SIZE];
    *calibration = (alb_calibration){0};
    if (!alb_path_join(path, session_folder, "calibration.json", error))
        return false;
    if (!alb_file_exists(path))
        return alb_fail(error, ALB_ACCESS, "%s: no such file; run alabaster calibrate %s first", path, session_folder);
    alb_record *record = alb_record_read(path, error);
    if (!record)
        return false;
    alb_node root;
    const bool ok = alb_record_root(&root, record, error) && read_all(calibration, root, error);
    alb_record_free(record);
    snprintf(calibration->folder, sizeof calibration->folder, "%s", session_folder);
    return ok;
}

bool alb_calibration_image(char path[ALB_PATH_SIZE], const alb_calibration *calibration, const alb_product *product,
                           alb_error *error)
{
    char name[ALB_NAME_SIZE + 32];
    snprintf(name, sizeof name, "calibration/%s.exr", product->shot);
    return alb_path_join(path, calibration->folder, name, error);
}
